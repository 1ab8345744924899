"""The options of `lifeline render`; imports no MuJoCo."""

import re
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError


class Wanted(NamedTuple):
    """The options of `lifeline render`.

    Attributes:
        out: The file to write; its extension selects the format.
        scene: A layout's name, or a layout (.toml) or MJCF file (.xml).
        hull: round or rectangular.
        camera: Name of a view or of a camera of the scene.
        size: WxH in pixels.
        seconds: Simulated duration; a picture shows the last moment.
        fps: Frames per second.
        drive: Whether the operator drives the robot.
        caption: Whether to print mode, speed and nearest distance on each frame.
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
    """Parse width and height in pixels.

    Raises:
        DeployError: The text is not WxH.
    """
    match = re.fullmatch(r"([0-9]{1,5})[xX×]([0-9]{1,5})", text.strip())
    if match is None:
        raise DeployError(f"--size must be like 1280x720, not {text!r}")
    return int(match[1]), int(match[2])
