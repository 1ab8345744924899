"""`lifeline render`: a picture or an animation of the robot in a hall, under the real safety law, without a screen."""

import re
from pathlib import Path
from typing import NamedTuple

from deploy.errors import DeployError
from deploy.interrupts import interrupts
from sim.gl import NoGlError, choose

MIN_S, MAX_S = 0.1, 120.0
MIN_FPS, MAX_FPS = 1.0, 60.0


class Wanted(NamedTuple):
    """What to render.

    Attributes:
        out: The file; its ending says what is written.
        scene: A layout's name, or a layout (.toml) or MJCF file (.xml).
        hull: round or rectangular.
        camera: A view's name, or that of one of the scene's own cameras.
        size: WxH, in pixels.
        seconds: How long; a picture shows the end of it.
        fps: Frames of each second.
        drive: Whether the robot is driven.
        caption: Whether mode, speed and what is nearest are written on it.
    """

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


def render(wanted: Wanted) -> str:
    """Writes the file, and says on a terminal how far it is.

    Returns:
        A sentence about the file.

    Raises:
        DeployError: Something that is wanted cannot be; nothing has been written.
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
        # Only now: with a way to draw that is not here, MuJoCo's import fails.
        from deploy.film import FilmError, film  # noqa: PLC0415

        try:
            with interrupts():
                film(wanted, width, height)
        except FilmError as error:
            raise DeployError(str(error)) from error
    except NoGlError as error:
        raise DeployError(f"nothing can be drawn on this machine: {error}") from error
    frames = "a picture" if wanted.frames == 1 else f"{wanted.frames} frames"
    return f"wrote {wanted.out}: {frames} of {width}x{height}, {wanted.out.stat().st_size / 1e6:.2f} MB"


def parse_size(text: str) -> tuple[int, int]:
    """Width and height in pixels.

    Raises:
        DeployError: It is not WxH.
    """
    match = re.fullmatch(r"([0-9]{1,5})[xX×]([0-9]{1,5})", text.strip())
    if match is None:
        raise DeployError(f"--size must be like 1280x720, not {text!r}")
    return int(match[1]), int(match[2])
