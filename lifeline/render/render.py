"""`lifeline render`: render the simulated robot, under the real safety law, to an image or animation."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.progress import track

from deploy.stack.errors import DeployError, interrupts
from lifeline.render.rehearsal import Operator, Rehearsal
from sim.config import Build, Hull, SceneError
from sim.floorplan import Circle, Rectangle
from sim.gl import NoGlError, choose
from sim.lidar_config import LidarConfig
from sim.plant import Plant
from sim.render import Studio, View, ViewError, captioned, view_of
from sim.video import OutputError, Pixels, refuse_bad_output, write
from supervisor.config import FootprintSection, SupervisorSection

MIN_S, MAX_S = 0.1, 120.0
MIN_FPS, MAX_FPS = 1.0, 60.0
PILLARS_AHEAD_M = (3.0, 2.4, 1.8, 1.4)
"""Candidate distances of the pillar ahead of a driven robot; the first one with room is used."""
LIDAR_NOISE_M = 0.002

_PICTURE_SAMPLES, _ANIMATION_SAMPLES = 8, 4
"""Multisampling; an animation needs less antialiasing than a picture."""


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
        with interrupts():
            film(wanted, width, height)
    except NoGlError as error:
        raise DeployError(f"cannot render on this machine: {error}") from error
    return Rendered(str(wanted.out), wanted.frames, width, height, wanted.out.stat().st_size)


def film(wanted: Wanted, width: int, height: int) -> None:
    """Simulate the drive, render its frames, and write the file.

    Args:
        wanted: The options; their numbers are within bounds.
        width: In pixels.
        height: In pixels.

    Raises:
        DeployError: An option is invalid; nothing has been written.
        NoGlError: This machine cannot render offscreen.
    """
    try:
        refuse_bad_output(wanted.out, width, height, wanted.frames)
        plant = _plant(wanted)
        seen_from = view_of(plant, wanted.camera, width / height)
        if wanted.drive:
            _put_pillar(plant)
        samples = _PICTURE_SAMPLES if wanted.frames == 1 else _ANIMATION_SAMPLES
        with Studio(plant, width, height, samples) as studio:
            console = Console(stderr=True)
            pictures = track(
                _pictures(wanted, plant, studio, seen_from),
                f"lifeline: {wanted.out.name}",
                wanted.frames,
                console=console,
                transient=True,
                disable=not console.is_terminal,
            )
            write(wanted.out, iter(pictures), wanted.fps)
    except (OutputError, SceneError, ViewError) as error:
        raise DeployError(str(error).rstrip(".")) from error


def _plant(wanted: Wanted) -> Plant:
    if wanted.hull not in tuple(Hull):
        raise DeployError(f"There is no hull named {wanted.hull!r}; there are {', '.join(Hull)}")
    options = Build(Hull(wanted.hull), moving=True, scenery=True)
    return Plant(wanted.scene, lidars=(LidarConfig(noise_m=LIDAR_NOISE_M),), options=options)


def _put_pillar(plant: Plant) -> None:
    x_m, y_m, yaw_rad = plant.true_pose
    for ahead_m in PILLARS_AHEAD_M:
        try:
            plant.place_pillar(x_m + ahead_m * math.cos(yaw_rad), y_m + ahead_m * math.sin(yaw_rad))
        except ValueError:
            continue
        return


def _pictures(wanted: Wanted, plant: Plant, studio: Studio, view: View | str) -> Iterator[Pixels]:
    rehearsal = Rehearsal(plant, Operator(drives=wanted.drive), supervisor_for(plant))
    if wanted.frames == 1:
        rehearsal.run_until(wanted.seconds)
        moments = iter([rehearsal.shown()])
    else:
        moments = rehearsal.play(wanted.seconds, wanted.fps)
    for shown in moments:
        picture = studio.picture(view, shown)
        yield captioned(picture, shown) if wanted.caption else picture


def supervisor_for(plant: Plant) -> SupervisorSection:
    """Return the defaults of `[supervisor]` with the footprint of this hull."""
    match plant.outline:
        case Circle(_, _, radius_m):
            footprint = FootprintSection(radius_m=radius_m)
        case Rectangle() as outline:
            corners_m = outline._replace(x_m=0.0, y_m=0.0, yaw_rad=0.0).corners_m()
            footprint = FootprintSection(corners_m=corners_m)
    return SupervisorSection(footprint=footprint)
