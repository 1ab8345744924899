"""What is wanted of a picture or an animation. Pure."""

import re
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError


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


def parse_size(text: str) -> tuple[int, int]:
    """Width and height in pixels.

    Raises:
        DeployError: It is not WxH.
    """
    match = re.fullmatch(r"([0-9]{1,5})[xX×]([0-9]{1,5})", text.strip())
    if match is None:
        raise DeployError(f"--size must be like 1280x720, not {text!r}")
    return int(match[1]), int(match[2])
