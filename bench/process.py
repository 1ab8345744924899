"""Measures the real supervisor process over real Zenoh at the robot's rates.

A bare relay in its place is the reference of the same run.
"""

import asyncio
import itertools
import subprocess
import sys
from collections.abc import Coroutine, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np

from bench.rig import load, scenery
from bench.rig.feed import (
    BEAMS,
    SCANS,
    Robot,
    Stream,
    Supervisor,
    at_rate,
    client,
    feeding,
    mode_of,
    supervisor,
)
from bench.rig.program import running
from bench.rig.sheet import Column, Sheet, Times, Verdict
from wire import topics
from wire.messages import planar_twist
from wire.zenoh.bus import ZenohBus

COMMAND_HZ = 20.0
WARM_UP_S, MEASURED_S = 3.0, 15.0
SLEEPS = "voluntary_ctxt_switches"
"""In /proc: how often the main thread, which has the event loop, has gone to sleep."""
CRUISE_M_S = 0.3
CLEAR_M = scenery.ROOM_M

Phase = tuple[str, float, float]
"""Its name, the distance of the wall [m], and the commanded speed [m/s]."""
ECHO = "free path, topic echo of everything"
"""In this phase, `lifeline topic echo` prints every message of the robot."""
PHASES: dict[str, Sequence[Phase]] = {
    "bench.relay": [("a bare relay instead", CLEAR_M, CRUISE_M_S)],
    "supervisor": [
        ("free path", CLEAR_M, CRUISE_M_S),
        ("limited by the barrier", scenery.WALL_M, scenery.FORWARD_M_S),
        (ECHO, CLEAR_M, CRUISE_M_S),
    ],
}
"""By the module that runs; the relay is the reference."""

TARGET_CPU_PERCENT = 6.0
TARGET_TO_RELAY = 1.35
TARGET_RSS_MB = 100.0


@dataclass(frozen=True)
class Load:
    """The load and the output of the supervisor process in one phase."""

    phase: str
    seconds: float
    mode: str
    """The mode of the last status."""
    cpu_percent: float
    """Of one core."""
    loop_percent: float
    """CPU of the thread with the event loop, the law, and all encoding and decoding."""
    zenoh_percent: float
    """CPU of the other threads."""
    wakes_hz: float
    """How often the thread with the event loop goes to sleep."""
    rss_mb: float
    cmd_vel_hz: float
    gaps: Times


def measure_process() -> list[Load]:
    """Measure a relay, and a supervisor on a free path, limited by the barrier, and while everything is printed.

    Raises:
        RuntimeError: a process does not start or sends nothing.
    """
    loads: list[Load] = []
    for module, phases in PHASES.items():
        with supervisor(module) as process:
            loads += asyncio.run(_measure(process, phases))
    return loads


async def _measure(process: Supervisor, phases: Sequence[Phase]) -> list[Load]:
    async with client(process.endpoint) as bus:
        driver = _Driver(bus)
        async with feeding(driver.feeds()):
            loads: list[Load] = []
            for phase, wall_m, speed_m_s in phases:
                with echo(process.endpoint) if phase == ECHO else nullcontext():
                    loads.append(await driver.measure(phase, process.pid, wall_m, speed_m_s))
            return loads


def echo(endpoint: str) -> AbstractContextManager["subprocess.Popen[str]"]:
    """Print every message of the robot in another process, as YAML."""
    keys = [topic.key for topic in (topics.CMD_VEL, topics.SCAN, topics.ODOM, topics.STATUS)]
    keys.append(topics.source_cmd_vel(topics.TELEOP).key)
    return running([sys.executable, "-m", "lifeline.cli.app", "topic", "echo", *keys, "--endpoint", endpoint])


class _Driver(Robot):
    """Teleop and sim in one client, at a constant distance to the wall."""

    def __init__(self, bus: ZenohBus) -> None:
        self._clear = scenery.scans(BEAMS, SCANS, wall_m=CLEAR_M)
        self._wall = scenery.scans(BEAMS, SCANS)
        super().__init__(bus, self._clear)
        self._speed_m_s = 0.0
        self._source = bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        self._token = bus.declare_alive(topics.TELEOP)
        self._statuses = Stream(bus, topics.STATUS)

    def feeds(self) -> list[Coroutine[None, None, None]]:
        commands = at_rate(COMMAND_HZ, lambda: self._source.put(planar_twist(self._speed_m_s, 0.0)))
        return [commands, *super().feeds()]

    async def measure(self, phase: str, pid: int, wall_m: float, speed_m_s: float) -> Load:
        """Command zero, then this motion, and measure the process from outside for `MEASURED_S`."""
        self._speed_m_s = 0.0
        self.ranges = itertools.cycle(self._clear if wall_m == CLEAR_M else self._wall)
        await asyncio.sleep(WARM_UP_S)
        self._speed_m_s = speed_m_s
        await asyncio.sleep(WARM_UP_S)
        self.arrivals_s.clear()
        began, loop_began, slept = load.usage(pid), load.usage(pid, pid), load.status(pid, SLEEPS)
        await asyncio.sleep(MEASURED_S)
        used, loop_used = load.usage(pid) - began, load.usage(pid, pid) - loop_began
        sleeps, arrivals_s = load.status(pid, SLEEPS) - slept, self.arrivals_s.copy()
        self._statuses.take()
        _, status = await self._statuses.next()
        return Load(
            phase=phase,
            seconds=used.at_s,
            mode=mode_of(status),
            cpu_percent=used.cpu_percent,
            loop_percent=loop_used.cpu_percent,
            zenoh_percent=used.cpu_percent - loop_used.cpu_percent,
            wakes_hz=sleeps / used.at_s,
            rss_mb=load.status(pid, "VmRSS") / 1024,
            cmd_vel_hz=len(arrivals_s) / used.at_s,
            gaps=Times.of(1000 * np.diff(arrivals_s)),
        )


def load_sheet(loads: Sequence[Load]) -> Sheet:
    columns: list[Column[Load]] = [
        ("phase", lambda one: one.phase),
        ("mode", lambda one: one.mode),
        ("s", lambda one: f"{one.seconds:.0f}"),
        ("CPU %", lambda one: f"{one.cpu_percent:.1f}"),
        ("/ relay", lambda one: f"{one.cpu_percent / loads[0].cpu_percent:.2f}"),
        ("loop %", lambda one: f"{one.loop_percent:.1f}"),
        ("Zenoh %", lambda one: f"{one.zenoh_percent:.1f}"),
        ("wakes /s", lambda one: f"{one.wakes_hz:.0f}"),
        ("RSS MB", lambda one: f"{one.rss_mb:.0f}"),
        ("cmd_vel Hz", lambda one: f"{one.cmd_vel_hz:.1f}"),
        *Times.columns("gap ms", lambda one: one.gaps),
    ]
    return Sheet.of(
        "The supervisor process over Zenoh: 20 Hz scans of 360 beams, 20 Hz commands, 50 Hz odometry",
        columns,
        loads,
        (
            "CPU: of one core, user and system, from the scheduler's statistics of each thread. loop: the thread with the event loop, the "
            "law, encoding and decoding. Zenoh: all other threads."
        ),
        (
            "relay: the same traffic through a process without a law, bench/relay.py. If a core sleeps between "
            "ticks its caches grow cold, and on some machines the same code takes several times as long as in a "
            "loop; / relay compares both under the same conditions."
        ),
        "wakes: of the event loop.",
        ("topic echo: another process prints every message as YAML, on the same two cores."),
        (
            "cmd_vel and its gaps are measured by the driver; under the barrier the output also changes between "
            "ticks, and each change is sent immediately."
        ),
    )


def verdicts(loads: Sequence[Load]) -> list[Verdict]:
    found: list[Verdict] = []
    for one in loads[1:]:
        found += [
            Verdict(f"CPU, {one.phase},", one.cpu_percent, TARGET_CPU_PERCENT, "% of one core"),
            Verdict(f"resident memory, {one.phase},", one.rss_mb, TARGET_RSS_MB, "MB"),
        ]
        if one.phase != ECHO:  # the relay was measured without the printing process
            to_relay = one.cpu_percent / loads[0].cpu_percent
            found.append(Verdict(f"CPU, {one.phase},", to_relay, TARGET_TO_RELAY, "× the relay's"))
    return found
