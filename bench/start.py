"""Measures how long the processes take to start: their imports, `lifeline up`, and the restart of a killed supervisor.

The references in the same run are a bare interpreter, and one that imports only numpy and zenoh.
"""

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rig.feed import SimulatedRobot, Stream, at_rate, client, feeding, simulated_robot
from bench.rig.load import started_s
from bench.rig.sheet import Column, Sheet, Verdict
from deploy.stack import processes
from deploy.stack.statedir import StateDir
from wire import topics
from wire.messages import SafetyStatus, zero_twist

BARE = "python -c pass"
LIBRARIES = "numpy and zenoh"
PROGRAMS = {
    BARE: ("-c", "pass"),
    LIBRARIES: ("-c", "import numpy, zenoh"),
    "supervisor": ("-m", "supervisor", "--help"),
    "sim": ("-m", "sim", "--help"),
    "teleop": ("-m", "teleop", "--help"),
    "lifeline up": ("-c", "import lifeline.cli.app, deploy.up"),
}
"""By name, the arguments of an interpreter that imports a program's modules and ends."""
IMPORT_ROUNDS, START_ROUNDS = 10, 5
COMMAND_HZ = 20.0
SETTLED_S = 3.2
"""More than the `startsecs` of supervisord.conf: a process that dies earlier is restarted after a pause."""
RUN_LIMIT_S = 60.0

TARGET_UP_S = 2.0
TARGET_DRIVABLE_S = 0.7


@dataclass(frozen=True)
class Imports:
    """The time of a process that imports the modules of one program and ends, with warm caches."""

    program: str
    median_ms: float
    p90_ms: float
    runs: int
    to_libraries: float
    """The median of the ratios to the import of numpy and zenoh in the same round."""


@dataclass(frozen=True)
class Start:
    """One start of the simulated robot, and one restart of its supervisor after SIGKILL."""

    up_s: float
    """Duration of `lifeline up --detach`, which ends when every node is alive."""
    respawned_s: float
    """From SIGKILL to the start of the new process."""
    drivable_s: float
    """From SIGKILL to the first status READY: the next command moves the robot."""


def measure_imports() -> list[Imports]:
    """Start one interpreter for each program in turn, `IMPORT_ROUNDS` times."""
    taken_ms: dict[str, list[float]] = {program: [] for program in PROGRAMS}
    for number in range(-1, IMPORT_ROUNDS):
        for program, arguments in PROGRAMS.items():
            began_s = time.perf_counter()
            # With pipes, the end of the process is noticed at once; without, a time limit polls every 50 ms.
            subprocess.run([sys.executable, *arguments], check=True, capture_output=True, timeout=RUN_LIMIT_S)
            if number >= 0:  # the first round fills the caches
                taken_ms[program].append(1000.0 * (time.perf_counter() - began_s))
    return [summary(program, times_ms, taken_ms[LIBRARIES]) for program, times_ms in taken_ms.items()]


def summary(program: str, times_ms: list[float], libraries_ms: list[float]) -> Imports:
    """Return the statistics of one program beside the times of the libraries in the same rounds."""
    times, reference = np.array(times_ms), np.array(libraries_ms)
    return Imports(
        program,
        median_ms=float(np.median(times)),
        p90_ms=float(np.percentile(times, 90)),
        runs=len(times_ms),
        to_libraries=float(np.median(times / reference)),
    )


def measure_starts() -> list[Start]:
    """Start the simulated robot, kill its supervisor, and stop everything, `START_ROUNDS` times.

    Raises:
        RuntimeError: the robot does not start, or does not become drivable.
    """
    starts: list[Start] = []
    for _ in range(START_ROUNDS):
        with simulated_robot() as robot:
            try:
                starts.append(Start(robot.up_s, *asyncio.run(_kill(robot))))
            except TimeoutError as error:
                raise RuntimeError("the robot does not become drivable") from error
    return starts


async def _kill(robot: SimulatedRobot) -> tuple[float, float]:
    """Kill the supervisor while a neutral source is live; return the times of its restart and of READY [s]."""
    async with client(robot.endpoint) as bus:
        commands = bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        statuses = Stream(bus, topics.STATUS)
        async with feeding([at_rate(COMMAND_HZ, lambda: commands.put(zero_twist()))]):
            await _ready(statuses)
            await asyncio.sleep(SETTLED_S)
            killed = _supervisor(robot.state)
            killed_s, killed_boot_s = time.monotonic(), time.clock_gettime(time.CLOCK_BOOTTIME)
            os.kill(killed, signal.SIGKILL)
            drivable_s = await _ready(statuses) - killed_s
            respawned_s = started_s(_supervisor(robot.state)) - killed_boot_s
    return respawned_s, drivable_s


async def _ready(statuses: Stream[SafetyStatus]) -> float:
    """Wait for the first status READY of a new run of the supervisor; return its arrival time [s]."""
    at_s, _ = await statuses.next(lambda status: status.mode == SafetyStatus.READY, of_new_run=True)
    return at_s


def _supervisor(state: StateDir) -> int:
    """Return the pid of the running supervisor."""
    (found,) = [process.pid for process in processes.of(state.path) if process.name == topics.SUPERVISOR]
    return found


IMPORTS: tuple[Column[Imports], ...] = (
    ("program", lambda one: one.program),
    ("p50", lambda one: f"{one.median_ms:.0f}"),
    ("p90", lambda one: f"{one.p90_ms:.0f}"),
    ("/ numpy and zenoh", lambda one: f"{one.to_libraries:.2f}"),
    ("runs", lambda one: f"{one.runs}"),
)
Times = tuple[str, list[float]]
"""What was measured, and the times [s]."""
STARTS: tuple[Column[Times], ...] = (
    ("what", lambda one: one[0]),
    ("p50", lambda one: f"{np.median(one[1]):.2f}"),
    ("min", lambda one: f"{min(one[1]):.2f}"),
    ("max", lambda one: f"{max(one[1]):.2f}"),
    ("runs", lambda one: f"{len(one[1])}"),
)


def imports_sheet(imports: Iterable[Imports]) -> Sheet:
    return Sheet.of(
        "Imports: a new interpreter that imports the modules of one program and ends, in ms",
        IMPORTS,
        imports,
        "With warm caches and compiled byte code. / numpy and zenoh: the median of the ratios of each round.",
        "lifeline up: the imports of the command itself, not of the processes that it starts.",
    )


def starts_sheet(starts: Sequence[Start]) -> Sheet:
    rows = (
        ("lifeline up --detach, until every node is alive", [one.up_s for one in starts]),
        ("SIGKILL of the supervisor until its restart", [one.respawned_s for one in starts]),
        ("SIGKILL of the supervisor until drivable", [one.drivable_s for one in starts]),
    )
    return Sheet.of(
        "Start and restart under supervisord, in s",
        STARTS,
        rows,
        (
            "drivable: the first status READY, while a source sends zero velocity at 20 Hz. It includes the timeouts of "
            "0.2 s and 0.24 s for which the supervisor observes a command source and a lidar before it trusts them."
        ),
        "The time of the restart is rounded down to 10 ms, and may therefore appear to be before the kill.",
    )


def verdicts(starts: Sequence[Start]) -> list[Verdict]:
    up_s = float(np.median([one.up_s for one in starts]))
    drivable_s = float(np.median([one.drivable_s for one in starts]))
    return [
        Verdict("`lifeline up --detach`, median,", up_s, TARGET_UP_S, "s"),
        Verdict("from SIGKILL of the supervisor to drivable, median,", drivable_s, TARGET_DRIVABLE_S, "s"),
    ]
