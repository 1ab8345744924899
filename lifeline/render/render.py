"""`lifeline render`: render the simulated robot, under the real safety law, to an image or animation."""

import re
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError, interrupts
from sim.gl import NoGlError, choose

MIN_S, MAX_S = 0.1, 120.0
MIN_FPS, MAX_FPS = 1.0, 60.0


class Wanted(NamedTuple):
    """The options of `lifeline render`, as its help describes them."""

    out: Path
    scene: str = "warehouse"
    hull: str = "round"
    camera: str = "follow"
    size: str = "1280x720"
    seconds: float = 8.0
    fps: float = 15.0
    drive: bool = False
    caption: bool = True

    @property
    def frames(self) -> int:
        return 1 if self.out.suffix.lower() == ".png" else max(1, round(self.seconds * self.fps))


def parse_size(text: str) -> tuple[int, int]:
    """Parse width and height in pixels.

    Raises:
        DeployError: The text is not WxH.
    """
    match = re.fullmatch(r"([0-9]{1,5})[xX×]([0-9]{1,5})", text.strip())
    if match is None:
        raise DeployError(f"--size must be like 1280x720, not {text!r}")
    return int(match[1]), int(match[2])


class Rendered(NamedTuple):
    """A file that was written."""

    file: str
    frames: int
    width: int
    height: int
    bytes: int

    @property
    def sentence(self) -> str:
        frames = "a picture" if self.frames == 1 else f"{self.frames} frames"
        return f"wrote {self.file}: {frames} of {self.width}x{self.height}, {self.bytes / 1e6:.2f} MB"


def render(wanted: Wanted) -> Rendered:
    """Write the file, and show the progress on a terminal.

    Raises:
        DeployError: An option is invalid or rendering is impossible; nothing has been written.
    """
    width, height = parse_size(wanted.size)
    for name, value, least, most in (
        ("seconds", wanted.seconds, MIN_S, MAX_S),
        ("fps", wanted.fps, MIN_FPS, MAX_FPS),
    ):
        if not least <= value <= most:
            raise DeployError(f"--{name} must be from {least:g} to {most:g}, not {value:g}")
    try:
        choose()
        # Imported only now: bad options are refused before MuJoCo is loaded.
        from lifeline.render.film import film  # noqa: PLC0415

        with interrupts():
            film(wanted, width, height)
    except NoGlError as error:
        raise DeployError(f"cannot render on this machine: {error}") from error
    return Rendered(str(wanted.out), wanted.frames, width, height, wanted.out.stat().st_size)
