"""Measures `lifeline up`, and the time from SIGKILL of the supervisor until the robot is drivable again.

The reference of the same round is an interpreter that imports only numpy and zenoh, the largest part of a start that is not ours.
"""

import asyncio
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.rig import feed
from bench.rig.nodes import SimulatedRobot, simulated_robot
from bench.rig.sheet import Column, Sheet, Verdict
from deploy.stack import processes
from wire import topics
from wire.bus_config import BusConfig
from wire.messages import SafetyStatus, decode, encode, zero_twist
from wire.stamp import parse_stamp
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

ROUNDS = 5
SETTLED_S = 3.2
"""More than the `startsecs` of supervisord.conf: a process that dies earlier is restarted after a pause."""
IMPORT_LIMIT_S, READY_LIMIT_S = 60.0, 20.0
TARGET_ABOVE_S = 0.7
"""Limit of the time until drivable, above the reference; it contains the timeouts for which the supervisor observes its inputs."""


@dataclass(frozen=True)
class Start:
    """One start of the simulated robot, and one restart of its supervisor after SIGKILL."""

    libraries_s: float
    """The reference: a process that imports numpy and zenoh, and ends."""
    up_s: float
    """Duration of `lifeline up --detach`, which ends when every node is alive."""
    drivable_s: float
    """From SIGKILL to the first status READY: the next command moves the robot."""


def measure_starts() -> list[Start]:
    """Time the reference, start the simulated robot, kill its supervisor, and stop everything, `ROUNDS` times.

    Raises:
        RuntimeError: the robot does not start, or does not become drivable.
    """
    starts: list[Start] = []
    _import()  # fills the caches
    for _ in range(ROUNDS):
        libraries_s = _import()
        with simulated_robot() as robot:
            starts.append(Start(libraries_s, robot.up_s, asyncio.run(_restart(robot))))
    return starts


def _import() -> float:
    """Return the duration of a process that imports the reference's libraries [s]."""
    began_s = time.perf_counter()
    # With pipes, the end of the process is noticed at once; without, a time limit polls every 50 ms.
    command = [sys.executable, "-c", "import numpy, zenoh"]
    subprocess.run(command, check=True, capture_output=True, timeout=IMPORT_LIMIT_S)
    return time.perf_counter() - began_s


async def _restart(robot: SimulatedRobot) -> float:
    """Kill the supervisor while a neutral source is live; return the time until the robot is drivable [s]."""
    config = BusConfig(robot.endpoint)
    session = ZenohSession(await open_session(config, "client"), config.namespace)
    try:
        return await asyncio.to_thread(_kill, robot, session)
    finally:
        await session.close()


def _kill(robot: SimulatedRobot, session: ZenohSession) -> float:
    ready: queue.Queue[tuple[bytes, float]] = queue.Queue()
    """Epoch of the supervisor and arrival time of each status READY."""

    def hear(payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        stamp = parse_stamp(attachment)
        if stamp is not None and decode(payload, SafetyStatus).mode == SafetyStatus.READY:
            ready.put((stamp.gid, arrival_s))

    session.subscribe_raw(topics.STATUS.key, hear)
    commands, neutral = session.publisher_raw(topics.source_cmd_vel(topics.TELEOP)), encode(zero_twist())
    ended = threading.Event()
    acts = [(lambda: commands.put_bytes(neutral), feed.COMMAND_HZ)]
    sender = threading.Thread(target=feed.send, args=(acts, ended))
    sender.start()
    try:
        killed_epoch, _ = ready.get(timeout=READY_LIMIT_S)
        time.sleep(SETTLED_S)
        [pid] = [one.pid for one in processes.of(robot.state.path) if one.name == topics.SUPERVISOR]
        killed_s = time.monotonic()
        os.kill(pid, signal.SIGKILL)
        while True:
            epoch, arrival_s = ready.get(timeout=READY_LIMIT_S)
            if epoch != killed_epoch:
                return arrival_s - killed_s
    except queue.Empty as error:
        raise RuntimeError("the robot does not become drivable") from error
    finally:
        ended.set()
        sender.join()


Row = tuple[str, list[float]]
"""What was measured, and the times [s]."""
COLUMNS: tuple[Column[Row], ...] = (
    ("what", lambda one: one[0]),
    ("p50", lambda one: f"{np.median(one[1]):.2f}"),
    ("min", lambda one: f"{min(one[1]):.2f}"),
    ("max", lambda one: f"{max(one[1]):.2f}"),
    ("runs", lambda one: f"{len(one[1])}"),
)


def starts_sheet(starts: Sequence[Start]) -> Sheet:
    rows = (
        ("a new interpreter that imports numpy and zenoh, and ends", [one.libraries_s for one in starts]),
        ("lifeline up --detach, until every node is alive", [one.up_s for one in starts]),
        ("SIGKILL of the supervisor until drivable", [one.drivable_s for one in starts]),
    )
    return Sheet.of(
        "Start and restart under supervisord, in s",
        COLUMNS,
        rows,
        (
            "drivable: the first status READY, while a source sends zero velocity at 20 Hz. It includes the timeouts of "
            "0.2 s and 0.24 s for which the supervisor observes a command source and a lidar before it trusts them."
        ),
    )


def verdicts(starts: Sequence[Start]) -> list[Verdict]:
    above_s = float(np.median([one.drivable_s - one.libraries_s for one in starts]))
    what = "from SIGKILL of the supervisor to drivable, median, above the import of numpy and zenoh,"
    return [Verdict(what, above_s, TARGET_ABOVE_S, "s")]
