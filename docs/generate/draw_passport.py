"""Makes the stored passports again from their signed records, and draws docs/images/passport.png: `python -m docs.generate.draw_passport`.

The picture is the beginning of the page of the simulated robot as Debian's Chromium shows it.
"""

import shutil
import subprocess
import sys
import tempfile

from docs.generate import sections
from docs.generate.passports import DEMO, FOLDER, page_of, read

IMAGE = sections.ROOT / "docs/images/passport.png"
WIDTH_PX, HEIGHT_PX = 1000, 990
"""Of the window; the picture has twice as many."""
LIMIT_S = 60.0


def draw(chromium: str) -> None:
    """Write the picture.

    Raises:
        SubprocessError: the browser failed.
    """
    with tempfile.TemporaryDirectory() as profile:
        command = [
            chromium,
            "--headless=new",
            "--no-sandbox",  # Chromium refuses its sandbox to root
            "--disable-gpu",
            "--hide-scrollbars",
            "--force-device-scale-factor=2",
            f"--window-size={WIDTH_PX},{HEIGHT_PX}",
            f"--user-data-dir={profile}",
            f"--screenshot={IMAGE}",
            page_of(DEMO).as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=LIMIT_S)


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
    except subprocess.SubprocessError as error:
        print(f"The passport cannot be drawn: {error}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
