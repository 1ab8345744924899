"""Renders the frames of `lifeline render` from a simulated drive."""

import math
from collections.abc import Iterator

from rich.console import Console
from rich.progress import track

from deploy.stack.errors import DeployError
from lifeline.render.rehearsal import Operator, Rehearsal
from lifeline.render.render import Wanted
from sim.config import Build, Hull, SceneError
from sim.floorplan import Circle, Rectangle
from sim.lidar_config import LidarConfig
from sim.plant import Plant
from sim.render import Studio, View, ViewError, captioned, view_of
from sim.video import OutputError, Pixels, refuse_bad_output, write
from supervisor.config import FootprintSection, SupervisorSection

PILLARS_AHEAD_M = (3.0, 2.4, 1.8, 1.4)
"""Candidate distances of the pillar ahead of a driven robot; the first one with room is used."""
LIDAR_NOISE_M = 0.002

_PICTURE_SAMPLES, _ANIMATION_SAMPLES = 8, 4
"""Multisampling; an animation needs less antialiasing than a picture."""


def film(wanted: Wanted, width: int, height: int, view: View | None = None, *, pillar: bool = True) -> None:
    """Simulate the drive, render its frames, and write the file.

    Args:
        wanted: The options; their numbers are within bounds.
        width: In pixels.
        height: In pixels.
        view: Replaces `wanted.camera` if given.
        pillar: Whether to place the pillar ahead of a driven robot.

    Raises:
        DeployError: An option is invalid; nothing has been written.
        NoGlError: This machine cannot render offscreen.
    """
    try:
        refuse_bad_output(wanted.out, width, height, wanted.frames)
        plant = _plant(wanted)
        seen_from = view or view_of(plant, wanted.camera, width / height)
        if wanted.drive and pillar:
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
