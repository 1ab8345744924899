"""`lifeline render`: render a robot of a footage, or a new one under the real safety law, to an image or animation."""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.progress import track

from deploy.stack.errors import DeployError, interrupts
from lifeline.render.footage import Footage
from lifeline.render.rehearsal import Operator, Rehearsal
from sim.config import Hull, SceneError, SimSection
from sim.floorplan import Circle, Rectangle
from sim.gl import NoGlError, choose
from sim.overlay import Shown
from sim.plant import Plant
from sim.render import Studio, View, ViewError, captioned, view_of
from sim.video import OutputError, Pixels, refuse_bad_output, write
from supervisor.config import FootprintSection, SupervisorSection

MIN_S, MAX_S = 0.1, 120.0
MIN_FPS, MAX_FPS = 1.0, 60.0
PILLARS_AHEAD_M = (3.0, 2.4, 1.8, 1.4)
"""Candidate distances of the pillar ahead of a driven robot; the first one with room is used."""
FILM_S, PICTURE_S = 8.0, 1.2
"""Default durations: of a drive, and how long the rarest message of a running robot takes, the diagnostics."""

_PICTURE_SAMPLES, _ANIMATION_SAMPLES = 8, 4
"""Multisampling; an animation needs less antialiasing than a picture."""


class Wanted(NamedTuple):
    """The options of `lifeline render`, as its help describes them."""

    out: Path
    scene: str | None = None
    hull: str | None = None
    camera: str = "follow"
    size: str = "1280x720"
    seconds: float | None = None
    fps: float = 15.0
    drive: bool = False
    caption: bool = True

    @property
    def is_picture(self) -> bool:
        return self.out.suffix.lower() == ".png"

    @property
    def listening_s(self) -> float:
        """How long to listen to a running robot."""
        return PICTURE_S if self.is_picture else self.seconds or FILM_S

    def times_s(self, longest_s: float) -> list[float]:
        """Return the time of each frame; a picture shows the last moment."""
        seconds = min(self.seconds or math.inf, longest_s)
        frames = max(1, round(seconds * self.fps))
        return [seconds] if self.is_picture else [frame / self.fps for frame in range(frames)]


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
    robot: str
    x_m: float
    y_m: float
    yaw_rad: float
    """Which robot is drawn, and its pose in the last frame, in the world."""

    @property
    def sentence(self) -> str:
        frames = "a picture" if self.frames == 1 else f"{self.frames} frames"
        size = f"{self.width}x{self.height}, {self.bytes / 1e6:.2f} MB"
        place = f"x {self.x_m + 0.0:.2f} m, y {self.y_m + 0.0:.2f} m"
        return f"wrote {self.file}: {frames} of {size}: {self.robot}, at {place}"


def render(wanted: Wanted, find: Callable[[], Footage | None] | None = None) -> Rendered:
    """Write the file, and show the progress on a terminal.

    Args:
        wanted: The options.
        find: Returns what to show, once the options are known to be valid; None, as its result: a new robot.

    Raises:
        DeployError: An option is invalid or rendering is impossible; nothing has been written.
    """
    width, height = parse_size(wanted.size)
    for name, value, least, most in (
        ("seconds", wanted.seconds, MIN_S, MAX_S),
        ("fps", wanted.fps, MIN_FPS, MAX_FPS),
    ):
        if value is not None and not least <= value <= most:
            raise DeployError(f"--{name} must be from {least:g} to {most:g}, not {value:g}")
    try:
        choose()
        refuse_bad_output(wanted.out, width, height, frames=1)
        with interrupts():
            footage = find and find()
            times_s = wanted.times_s(footage.duration_s if footage else wanted.seconds or FILM_S)
            refuse_bad_output(wanted.out, width, height, len(times_s))
            plant = _plant(wanted, footage)
            seen_from = view_of(plant, wanted.camera, width / height)
            if wanted.drive:
                _put_pillar(plant)
            if footage is None:
                moments = Rehearsal(plant, Operator(drives=wanted.drive), supervisor_for(plant)).play(times_s)
            else:
                moments = footage.play(plant, times_s)
            samples = _PICTURE_SAMPLES if len(times_s) == 1 else _ANIMATION_SAMPLES
            with Studio(plant, width, height, samples) as studio:
                console = Console(stderr=True)
                pictures = track(
                    _pictures(wanted, moments, studio, seen_from),
                    f"lifeline: {wanted.out.name}",
                    len(times_s),
                    console=console,
                    transient=True,
                    disable=not console.is_terminal,
                )
                write(wanted.out, iter(pictures), wanted.fps)
    except NoGlError as error:
        raise DeployError(f"cannot render on this machine: {error}") from error
    except (OutputError, SceneError, ViewError) as error:
        raise DeployError(str(error).rstrip(".")) from error
    robot, size = footage.robot if footage else "a new robot", wanted.out.stat().st_size
    return Rendered(str(wanted.out), len(times_s), width, height, size, robot, *plant.true_pose)


def _plant(wanted: Wanted, footage: Footage | None) -> Plant:
    sim = SimSection() if footage is None else footage.sim
    hull, scene = wanted.hull or sim.hull, sim.scene if footage is None else footage.scene
    if hull not in tuple(Hull):
        raise DeployError(f"There is no hull named {hull!r}; there are {', '.join(Hull)}")
    options = replace(sim.build(scenery=True), hull=Hull(hull))
    return Plant(wanted.scene or scene, lidars=sim.lidar_configs(), options=options)


def _put_pillar(plant: Plant) -> None:
    x_m, y_m, yaw_rad = plant.true_pose
    for ahead_m in PILLARS_AHEAD_M:
        try:
            plant.place_pillar(x_m + ahead_m * math.cos(yaw_rad), y_m + ahead_m * math.sin(yaw_rad))
        except ValueError:
            continue
        return


def _pictures(wanted: Wanted, moments: Iterable[Shown], studio: Studio, view: View | str) -> Iterator[Pixels]:
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
