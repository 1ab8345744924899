"""Draws docs/images/crash.webp, the first picture of the README: `python -m docs.generate.draw_crash_animation`; a minute.

It shows two measured drives of the same robot at the same rack, side by side. In both, a keyboard node of ROS 2 drives
at 0.8 m/s, and SIGKILL ends it at the same place. On the left, the node publishes /cmd_vel directly to a base that keeps
its last command; on the right, the processes ros2 and supervisor are between them. All processes are real; the base and
the hall are simulated. docs/campaign/crash_film.jsonl has the robot's true poses, from which each frame is rendered.

`--drive` first measures both drives again: it needs `make ros2` and an idle machine.
"""

import argparse
import asyncio
import itertools
import math
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bench.rig.stored import FOLDER, read_rows, rows_of, this_run, write_rows
from deploy.stack.errors import DeployError
from docs.generate.palette import DANGER, GOOD
from faults.grade import rubric
from faults.grade.exam import Exam, NotGradedError, driving, in_directory
from faults.grade.robot import Robot, Setup, running
from recordings.incidents.braking import Motion
from sim import mj
from sim.config import Build
from sim.gl import NoGlError, choose
from sim.plant import Plant
from sim.render import Studio, View
from sim.video import OutputError, Pixels, write

SCENE = Path(__file__).with_name("crash.toml")
DRIVES = FOLDER / "crash_film.jsonl"
IMAGE = Path(__file__).parents[1] / "images" / "crash.webp"
ALONE, LIFELINE = "alone", "lifeline"
LABELS = {ALONE: "a robot that keeps its last command", LIFELINE: "with Lifeline"}

SPEED_M_S, AT_REST_M_S = 0.8, 0.005
NODE = ("python", "-m", "tests.ros2.peers.lab_teleop")
KILL_X_M = 0.8
"""2.25 m before the hull would touch the rack: there, Lifeline does not yet limit the speed."""
BEFORE_S, AFTER_S = 1.0, 4.0
"""The recorded time before and after SIGKILL."""
TRIES, REACH_LIMIT_S = 10, 12.0
LOOK_S, EVERY = 0.02, 2
"""The poses of the film are every second one of the robot's."""
GAP_LIMIT_S = 0.06
"""Three periods of these poses; a drive with a longer gap is repeated."""

FPS, HOLD_S, AFTER_HIT_S, FLASH_S = 15.0, 1.5, 0.7, 0.3
WIDTH, HEIGHT, GAP = 478, 360, 4
LABEL_PX, LINE_PX = 36, 44
VIEW = View((1.6, -0.1, 0.15), 3.35, 70.0, -28.0)
PANEL, INK, GAP_COLOUR = "#12181f", "#ffffff", "#aeb8c2"
BAR_M, BAR_TOP_M, AWAY_M = (0.03, 0.9), 0.006, -10.0
"""Half size along x and y of the bar that marks the place of SIGKILL on the floor, its height, and where it is before."""
TOUCH_M = 0.005


@dataclass(frozen=True)
class Pose:
    """The robot's true pose and speed at a time from SIGKILL."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_m_s: float


class Drive(NamedTuple):
    """The poses of one drive, by time."""

    poses: Sequence[Pose]

    def at(self, time_s: float) -> Pose:
        """Return the pose at a time, interpolated."""
        times_s = [pose.time_s for pose in self.poses]
        names = ("x_m", "y_m", "yaw_rad", "speed_m_s")
        values = ([getattr(pose, name) for pose in self.poses] for name in names)
        return Pose(time_s, *(float(np.interp(time_s, times_s, one)) for one in values))

    def distance_m(self, time_s: float) -> float:
        """Return the distance from the place of SIGKILL."""
        begin, now = self.at(0.0), self.at(time_s)
        return math.dist((begin.x_m, begin.y_m), (now.x_m, now.y_m))


class End(NamedTuple):
    """When a drive ends, and what is written then."""

    time_s: float
    words: str
    colour: str


class UnfitDriveError(Exception):
    """A drive that is not filmed."""


def measure() -> None:
    """Drive without and with Lifeline, and store the poses.

    Raises:
        DeployError: a process does not start, or the robot does not drive.
    """
    rows = [row for half in LABELS for row in rows_of(half, drive(lifeline=half == LIFELINE), digits=4)]
    write_rows(DRIVES, this_run("python -m docs.generate.draw_crash_animation --drive"), rows)


def drive(*, lifeline: bool) -> list[Pose]:
    """Drive until the robot reaches the place of SIGKILL at its speed, kill the node there, and return the poses."""
    points = rubric.read(None)
    fast = points.model_copy(update={"exam": points.exam.model_copy(update={"drive_m_s": SPEED_M_S})})
    exam = Exam(NODE, Setup(lifeline=lifeline, ros2=True, scene=str(SCENE)), fast, keys="w", stop_key="s")

    async def play(directory: Path) -> list[Pose]:
        async with running(exam.setup, directory) as robot:
            for number in range(1, TRIES + 1):
                try:
                    return await _drive(exam, robot)
                except (NotGradedError, UnfitDriveError) as error:
                    # On a busy machine, poses are late, and Lifeline stops the robot when a process is.
                    print(f"drive {number}: {error}", file=sys.stderr)
        raise DeployError(f"no drive of {TRIES} reached the place of SIGKILL at its speed")

    return in_directory(play)


async def _drive(exam: Exam, robot: Robot) -> list[Pose]:
    """Drive once; afterwards, the robot is back at its start.

    Raises:
        UnfitDriveError: it is not filmed.
    """
    async with driving(exam, robot) as node:
        late_s = time.monotonic() + REACH_LIMIT_S
        while robot.look()[-1].x_m < KILL_X_M:
            if time.monotonic() > late_s:
                raise UnfitDriveError("the place of SIGKILL was not reached")
            await asyncio.sleep(LOOK_S)
        killed_s = node.send(signal.SIGKILL)
        await asyncio.sleep(AFTER_S)
        poses = [pose for pose in _poses(robot.look(), killed_s) if -BEFORE_S <= pose.time_s <= AFTER_S][
            ::EVERY
        ]
    if min(pose.speed_m_s for pose in poses if pose.time_s < 0.0) < 0.95 * SPEED_M_S:
        raise UnfitDriveError("not at its speed before SIGKILL")
    longest_s = max(after.time_s - before.time_s for before, after in itertools.pairwise(poses))
    if longest_s > GAP_LIMIT_S:
        raise UnfitDriveError(f"no pose for {longest_s:.3f} s")
    return poses


def _poses(motions: Sequence[Motion], killed_s: float) -> Iterator[Pose]:
    """Yield the poses of a robot that faced along x at first; its heading is the integral of its turn rate."""
    yaw_rad, before = 0.0, motions[0]
    for one in motions:
        yaw_rad += one.angular_rad_s * (one.time_s - before.time_s)
        before = one
        yield Pose(one.time_s - killed_s, one.x_m, one.y_m, yaw_rad, one.linear_m_s)


def read() -> dict[str, Drive]:
    """Return the stored drives by half."""
    stored = read_rows(DRIVES)
    return {half: Drive(stored.of(half, Pose)) for half in LABELS}


def put(plant: Plant, pose: Pose) -> None:
    """Put the robot at a pose."""
    model: Any = plant.model
    qpos = int(model.jnt_qposadr[mj.id_of(plant.model, "joint", "robot")])
    half_rad = 0.5 * pose.yaw_rad
    plant.data.qpos[qpos : qpos + 2] = pose.x_m, pose.y_m
    plant.data.qpos[qpos + 3 : qpos + 7] = math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)


def hit(plant: Plant, one: Drive) -> End:
    """Return the first contact of the hull after SIGKILL, with the speed just before it."""
    for before, pose in itertools.pairwise(one.poses):
        put(plant, pose)
        if pose.time_s > 0.0 and plant.clearance_m() < TOUCH_M:
            return End(pose.time_s, f"hit the rack at {before.speed_m_s:.1f} m/s", DANGER)
    raise ValueError("the robot hit nothing")


def standstill(one: Drive) -> End:
    """Return when and where the robot stands still after SIGKILL."""
    rest_s = next(p.time_s for p in one.poses if p.time_s > 0.0 and abs(p.speed_m_s) < AT_REST_M_S)
    return End(rest_s, f"stands still after {rest_s:.2f} s, {100 * one.distance_m(rest_s):.0f} cm", GOOD)


class Bar:
    """A red bar on the floor at the robot's front: the pillar of the scene, sunk into the floor."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        model: Any = plant.model
        geom = mj.id_of(plant.model, "geom", "pillar")
        self._half_height_m = float(model.geom_size[geom, 1])
        model.geom_type[geom] = mj.Shape.BOX
        model.geom_size[geom] = (*BAR_M, self._half_height_m)
        self._number = int(model.body_mocapid[mj.id_of(plant.model, "body", "pillar")])

    def put(self, pose: Pose, *, shown: bool) -> None:
        """Put it before the robot at this pose, or away."""
        z_m = BAR_TOP_M - self._half_height_m if shown else AWAY_M
        self._plant.data.mocap_pos[self._number] = (pose.x_m + self._plant.hull_radius_m, pose.y_m, z_m)


def written(picture: Pixels, label: str, one: Drive, end: End, time_s: float) -> Image.Image:
    """Return a half of a frame: the picture, its label, time and distance since SIGKILL, and the end."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    centre, top, middle = WIDTH / 2, HEIGHT - LINE_PX, HEIGHT - LINE_PX / 2
    draw.rectangle((0, 0, WIDTH, LABEL_PX), fill=PANEL)
    draw.text((centre, LABEL_PX / 2), label, fill=INK, font=_font(20), anchor="mm")
    draw.rectangle((0, top, WIDTH, HEIGHT), fill=PANEL)
    if time_s < 0.0:
        text = f"driven at {one.at(time_s).speed_m_s:.1f} m/s"
        draw.text((centre, middle), text, fill=INK, font=_font(22), anchor="mm")
        return image
    draw.rounded_rectangle((12, top + 7, 134, HEIGHT - 7), 6, fill=DANGER)
    draw.text((73, middle), "SIGKILL", fill=INK, font=_font(22), anchor="mm")
    draw.text((284, middle), f"+ {time_s:.2f} s", fill=INK, font=_font(24), anchor="rm")
    draw.text((WIDTH - 24, middle), f"{one.distance_m(time_s):.2f} m", fill=INK, font=_font(24), anchor="rm")
    if time_s < FLASH_S:
        draw.rectangle((0, LABEL_PX, WIDTH - 1, top), outline=DANGER, width=8)
    if time_s >= end.time_s:
        draw.rectangle((0, top - LINE_PX, WIDTH, top), fill=end.colour)
        draw.text((centre, top - LINE_PX / 2), end.words, fill=INK, font=_font(24), anchor="mm")
    return image


def _font(size_px: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(Path(mpl.get_data_path()) / "fonts/ttf/DejaVuSans-Bold.ttf", size_px)


def frames(drives: dict[str, Drive]) -> Iterator[Pixels]:
    """Yield the frames; the last one several times."""
    plant = Plant(SCENE, options=Build(scenery=True))
    ends = {ALONE: hit(plant, drives[ALONE]), LIFELINE: standstill(drives[LIFELINE])}
    bar = Bar(plant)
    frame = Image.new("RGB", (2 * WIDTH + GAP, HEIGHT), GAP_COLOUR)
    with Studio(plant, WIDTH, HEIGHT, samples=4) as studio:
        for number in range(math.ceil((BEFORE_S + ends[ALONE].time_s + AFTER_HIT_S) * FPS)):
            time_s = number / FPS - BEFORE_S
            for place, (half, one) in enumerate(drives.items()):
                put(plant, one.at(time_s))
                bar.put(one.at(0.0), shown=time_s >= 0.0)
                picture = studio.picture(VIEW)
                half_frame = written(picture, LABELS[half], one, ends[half], time_s)
                frame.paste(half_frame, (place * (WIDTH + GAP), 0))
            yield np.array(frame)
    for _ in range(round(HOLD_S * FPS)):
        yield np.array(frame)


def main() -> int:
    """Write the picture; return 1 with one sentence on stderr if that is not possible."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.draw_crash_animation")
    parser.add_argument("--drive", action="store_true", help="measure both drives again; needs `make ros2`")
    options = parser.parse_args()
    try:
        if options.drive:
            measure()
        choose()
        write(IMAGE, frames(read()), FPS)
    except (DeployError, NoGlError, OutputError) as error:
        print(f"The animation cannot be drawn: {str(error).rstrip('.')}.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
