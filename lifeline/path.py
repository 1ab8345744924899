"""`lifeline path`: drive the robot along a square, a circle, or a recorded path."""

import asyncio
import json
import math
import os
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict
from pathlib import Path as FilePath
from typing import Any, NoReturn

import numpy as np

from deploy.stack.console import StatusLine, note, say
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import reach, run_command
from recordings.recording import RecordingReader
from teleop.holder import HeldError, about_this_process
from teleop.path.course import Path, PathError, Pose, Poses, TrackError, placed, seen_from, to_path, to_poses
from teleop.path.service import SOURCE, Drive, Ending, PathService, Plan
from teleop.pilots.config import TeleopSection
from wire import topics
from wire.messages import Odometry, UndecodableError, decode
from wire.zenoh.hub_proof import HubProof

EXIT_CODES = {Ending.DONE: 0, Ending.STOPPED: 1, Ending.INTERRUPTED: 130}
START_LIMIT_M = 0.5
"""With --absolute: maximum distance of the robot from the start of the path."""


# --- plans


def relative(poses: Poses) -> Plan:
    """Return a plan that moves the path so that its first pose is the robot's present pose."""
    own = seen_from(poses, Pose(*poses[0].tolist()))
    return lambda pose: to_path(placed(own, pose))


def absolute(poses: Poses) -> Plan:
    """Return a plan that keeps the path where it is in the odometry frame."""
    path = to_path(poses)

    def plan(pose: Pose) -> Path:
        away_m = math.dist(pose[:2], path.start[:2])
        if away_m > START_LIMIT_M:
            raise PathError(
                f"the path begins {away_m:.2f} m from the robot, at x {path.start.x_m:.2f} m, "
                f"y {path.start.y_m:.2f} m in the odometry frame: drive it there first, or leave out --absolute"
            )
        return path

    return plan


def read_poses(file: FilePath) -> Poses:
    """Read the path of a recording, in its odometry frame.

    Raises:
        DeployError: the recording does not have exactly one odometry topic, or its path cannot be driven.
    """
    samples: dict[str, list[tuple[float, Pose]]] = {}
    for message in RecordingReader(file).messages():
        if message.msgtype == Odometry.__msgtype__ and message.topic.split("/")[-1] == topics.ODOM.key:
            with suppress(UndecodableError):
                pose = Pose.of(decode(message.payload, Odometry))
                samples.setdefault(message.topic, []).append((message.log_time_ns * 1e-9, pose))
    if len(samples) != 1:
        found = f"it has {', '.join(sorted(samples))}" if samples else "it has none"
        raise DeployError(f"{file}: one odometry topic is needed to follow a recording, and {found}")
    (rows,) = samples.values()
    try:
        return to_poses(np.array([time_s for time_s, _ in rows]), np.array([pose for _, pose in rows]))
    except PathError as error:
        raise DeployError(f"{file}: {error}") from error


# --- the operator at the terminal


@contextmanager
def _attended(service: PathService) -> Generator[None]:
    """Let Enter at the terminal continue the drive after a pause, until the input ends."""
    loop = asyncio.get_running_loop()

    def on_input() -> None:
        data = b""
        with suppress(OSError):
            data = os.read(0, 1024)
        if not data:
            leave()
        elif b"\n" in data:
            service.go_on()

    def leave() -> None:
        service.is_attended = False
        loop.remove_reader(0)

    # In the background, a read then fails instead of stopping this process and its heartbeat.
    signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    service.is_attended = True
    loop.add_reader(0, on_input)
    try:
        yield
    finally:
        leave()


# --- the command


def drive(plan: Plan, launch: Launch, speed_m_s: float, *, as_json: bool = False) -> NoReturn:
    """Drive along a path, and exit: 0 at the end of the path, 1 if stopped, 130 if interrupted.

    Raises:
        DeployError: the configuration is refused.
    """
    teleop = launch.section("teleop", TeleopSection)

    async def run(stop: asyncio.Event) -> int:
        bus = await reach(launch.bus, stop, HubProof(launch.bus, note))
        if bus is None:
            return EXIT_CODES[Ending.INTERRUPTED]
        stream = sys.stderr if as_json else sys.stdout
        status = StatusLine(stream)
        try:
            service = PathService(
                bus,
                plan,
                speed_m_s=speed_m_s,
                say=lambda sentence: status.say(f"lifeline: {sentence}"),
                show=status.show,
                operator=teleop.source,
                operator_rate_hz=teleop.rate_hz,
                about=about_this_process(SOURCE),
            )
            with _attended(service) if sys.stdin.isatty() and stream.isatty() else nullcontext():
                done = await service.run(stop)
        except (HeldError, PathError) as error:
            raise DeployError(str(error)) from error
        finally:
            status.clear()
            await bus.close()
        if as_json:
            print(json.dumps(to_json(done), indent=2))
        else:
            for line in report(done):
                say(line)
        return EXIT_CODES[done.ending]

    run_command(run)


def report(done: Drive) -> list[str]:
    """Return the lines of the report on a drive."""
    how = {
        Ending.DONE: "the path is complete",
        Ending.STOPPED: f"ended early, {done.reason}",
        Ending.INTERRUPTED: "interrupted",
    }[done.ending]
    if done.path is None:
        return [f"{how}; the robot did not move"]
    lines = [f"{how}: {done.done_m:.2f} of {done.path.length_m:.2f} m in {done.driving_s:.1f} s of driving"]
    error = TrackError.of(done.off_path_m)
    if error is not None:
        lines.append(
            f"distance from the path, by odometry: {_mm(error.rms_m)} rms, {_mm(error.max_m)} at most, "
            f"over {error.count:,} samples"
        )
    return lines


def to_json(done: Drive) -> dict[str, Any]:
    """Return the report on a drive as JSON values; `path` is null if the robot did not move."""
    document: dict[str, Any] = {"ending": done.ending.name, "reason": done.reason or None, "path": None}
    if done.path is None:
        return document
    error = TrackError.of(done.off_path_m)
    return document | {
        "path": {"length_m": done.path.length_m, "done_m": done.done_m, "driving_s": done.driving_s},
        "off_path_by_odometry": None if error is None else asdict(error),
    }


def _mm(distance_m: float) -> str:
    return f"{distance_m * 1000:.0f} mm" if distance_m < 1.0 else f"{distance_m:.2f} m"
