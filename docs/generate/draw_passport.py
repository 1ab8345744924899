"""Updates what is made from the stored passports: `python -m docs.generate.draw_passport`.

The pages are made again from their signed records. README.md has the sentence of the simulated robot's page, and docs/images/passport.png shows
its first sheet of paper, as Debian's Chromium draws it.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageOps

from docs.generate import readme, sections
from docs.generate.passports import DEMO, FOLDER, page_of, read

IMAGE = sections.ROOT / "docs/images/passport.png"
README = sections.ROOT / "README.md"
SECOND_SHEET = '<h2 class="new">'
"""Begins it, in the page."""
WIDTH_PX, HEIGHT_PX = 1200, 2000
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
    """Write pages, README.md and picture; return 1 with one sentence on stderr if there is no picture."""
    for file in FOLDER.glob("*.html"):
        file.write_text(read(file.stem)[1])
    README.write_text(sections.regenerated(README.read_text(), readme.PARTS, README.name))
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
