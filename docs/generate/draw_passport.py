"""Makes the stored passports again from their signed records, and draws docs/images/passport.png: `python -m docs.generate.draw_passport`.

The picture is what is on the first sheet of paper of the simulated robot's page, as Debian's Chromium shows it.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageOps

from docs.generate import sections
from docs.generate.passports import DEMO, FOLDER, page_of, read

IMAGE = sections.ROOT / "docs/images/passport.png"
SECOND_SHEET = '<h2 class="new">'
"""Begins it, in the page."""
WIDTH_PX, HEIGHT_PX = 930, 2000
"""Of the window."""
SCALE, MARGIN_PX = 2, 32
"""Of the picture."""
COLOURS = 64
"""Are enough for text and lines."""
LIMIT_S = 60.0


def draw(chromium: str) -> None:
    """Write the picture.

    Raises:
        SubprocessError: the browser failed.
    """
    first_sheet = page_of(DEMO).read_text().partition(SECOND_SHEET)[0]
    with tempfile.TemporaryDirectory() as folder:
        page, screen = Path(folder) / "page.html", Path(folder) / "screen.png"
        page.write_text(first_sheet)
        command = [
            chromium,
            "--headless=new",
            "--no-sandbox",  # Chromium refuses its sandbox to root
            "--disable-gpu",
            f"--force-device-scale-factor={SCALE}",
            f"--window-size={WIDTH_PX},{HEIGHT_PX}",
            f"--user-data-dir={folder}/profile",
            f"--screenshot={screen}",
            page.as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=LIMIT_S)
        with Image.open(screen) as picture:
            grey = picture.convert("L")
            _, _, _, bottom = ImageOps.invert(grey).getbbox() or (0, 0, *grey.size)
            few = picture.convert("RGB").quantize(COLOURS)
            few.crop((0, 0, grey.width, bottom + MARGIN_PX)).save(IMAGE, optimize=True)


def main() -> int:
    """Write pages and picture; return 1 with one sentence on stderr if there is no picture."""
    for file in FOLDER.glob("*.html"):
        file.write_text(read(file.stem)[1])
    chromium = shutil.which("chromium")
    if chromium is None:
        print("The passport cannot be drawn: it needs Debian's package chromium.", file=sys.stderr)
        return 1
    try:
        draw(chromium)
    except (OSError, subprocess.SubprocessError) as error:
        print(f"The passport cannot be drawn: {error}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
