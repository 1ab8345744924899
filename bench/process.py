"""Measures the real supervisor process over real Zenoh at the robot's rates, beside a bare relay of the same round."""

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bench.rig import load, scenery
from bench.rig.feed import CRUISE_M_S, Plan
from bench.rig.nodes import Supervisor, supervisor
from bench.rig.program import program
from bench.rig.sheet import Column, Sheet, Times, Verdict
from wire.bus_config import BusConfig

ROUNDS = 3
START_LIMIT_S, WARM_UP_S, MEASURED_S, END_LIMIT_S = 60.0, 3.0, 8.0, 60.0
SLEEPS = "voluntary_ctxt_switches"
"""In /proc: how often the main thread, which has the event loop, has gone to sleep."""


class Phase(NamedTuple):
    """What runs, and what it must do."""

    name: str
    module: str
    wall_m: float
    speed_m_s: float
    target_to_relay: float
    """Limit of the processor time, relative to the relay's."""


PHASES = (
    Phase("a bare relay instead", "bench.relay", scenery.ROOM_M, CRUISE_M_S, 1.0),
    Phase("free path", "supervisor", scenery.ROOM_M, CRUISE_M_S, 1.45),
    Phase("limited by the barrier", "supervisor", scenery.WALL_M, scenery.FORWARD_M_S, 2.1),
)
"""The first one is the reference."""


@dataclass(frozen=True)
class Load:
    """The load and the output of a process in one phase of one round."""

    phase: str
    round: int
    seconds: float
    mode: str
    """The mode of most statuses."""
    cpu_percent: float
    """Of one core."""
    loop_percent: float
    """CPU of the thread with the event loop, the law, and all encoding and decoding."""
    wakes_hz: float
    """How often the thread with the event loop goes to sleep."""
    rss_mb: float
    cmd_vel_hz: float
    gaps: Times

    @property
    def zenoh_percent(self) -> float:
        """CPU of the other threads."""
        return self.cpu_percent - self.loop_percent


def measure_process() -> list[Load]:
    """Measure each phase in each round, so that load on the machine affects all of them.

    Raises:
        RuntimeError: a process does not start, or ends.
    """
    loads: list[Load] = []
    for number in range(ROUNDS):
        for phase in PHASES:
            with supervisor(phase.module) as process:
                loads.append(_measure(process, phase, number))
    return loads


def _measure(process: Supervisor, phase: Phase, number: int) -> Load:
    plan = Plan([(process.endpoint, BusConfig().namespace)], [None], phase.wall_m, phase.speed_m_s)
    pid = process.pid
    with program("bench.rig.feed", arguments=plan.words()) as feeder:
        feeder.expect("driving", START_LIMIT_S)
        time.sleep(WARM_UP_S)
        began, loop_began, slept = load.usage(pid), load.usage(pid, pid), load.status(pid, SLEEPS)
        began_s = time.monotonic()
        time.sleep(MEASURED_S)
        used, loop_used = load.usage(pid) - began, load.usage(pid, pid) - loop_began
        window = began_s, time.monotonic()
        sleeps, rss_kb = load.status(pid, SLEEPS) - slept, load.status(pid, "VmRSS")
        feeder.tell("end")
        [robot] = json.loads(feeder.line(END_LIMIT_S))["robots"]
    arrivals_s = [at_s for at_s, *_ in robot["heard"] if window[0] <= at_s < window[1]]
    modes = Counter(mode for at_s, mode, _ in robot["statuses"] if window[0] <= at_s < window[1])
    if len(arrivals_s) < 2 or not modes:
        raise RuntimeError("it stopped sending commands or its status")
    return Load(
        phase=phase.name,
        round=number,
        seconds=used.at_s,
        mode=modes.most_common(1)[0][0],
        cpu_percent=used.cpu_percent,
        loop_percent=loop_used.cpu_percent,
        wakes_hz=sleeps / used.at_s,
        rss_mb=rss_kb / 1024,
        cmd_vel_hz=len(arrivals_s) / used.at_s,
        gaps=Times.of(1000.0 * np.diff(arrivals_s)),
    )


def to_relay(loads: Sequence[Load], phase: str) -> list[float]:
    """Return the processor time of a phase relative to the relay's in the same round, for each round."""
    percent = {(one.round, one.phase): one.cpu_percent for one in loads}
    relay = PHASES[0].name
    return [
        percent[number, phase] / percent[number, relay] for number in sorted({one.round for one in loads})
    ]


def load_sheet(loads: Sequence[Load]) -> Sheet:
    """Return a row for each phase: the medians of its rounds, and the longest gap."""
    rows = [[one for one in loads if one.phase == phase.name] for phase in PHASES]

    def median(of: Callable[[Load], float], digits: int) -> Callable[[Sequence[Load]], str]:
        return lambda row: f"{np.median([of(one) for one in row]):.{digits}f}"

    def ratio(row: Sequence[Load]) -> str:
        found = to_relay(loads, row[0].phase)
        return f"{np.median(found):.2f} ({min(found):.2f} to {max(found):.2f})"

    columns: list[Column[Sequence[Load]]] = [
        ("phase", lambda row: row[0].phase),
        ("mode", lambda row: Counter(one.mode for one in row).most_common(1)[0][0]),
        ("s", lambda row: f"{sum(one.seconds for one in row):.0f}"),
        ("CPU %", median(lambda one: one.cpu_percent, 1)),
        ("/ relay", ratio),
        ("loop %", median(lambda one: one.loop_percent, 1)),
        ("Zenoh %", median(lambda one: one.zenoh_percent, 1)),
        ("wakes /s", median(lambda one: one.wakes_hz, 0)),
        ("RSS MB", median(lambda one: one.rss_mb, 0)),
        ("cmd_vel Hz", median(lambda one: one.cmd_vel_hz, 1)),
        ("gap ms p50", median(lambda one: one.gaps.p50_ms, 1)),
        ("p99", median(lambda one: one.gaps.p99_ms, 1)),
        ("max", lambda row: f"{max(one.gaps.max_ms for one in row):.1f}"),
    ]
    return Sheet.of(
        "The supervisor process over Zenoh: 20 Hz scans of 360 beams, 20 Hz commands, 50 Hz odometry",
        columns,
        rows,
        f"Medians of {len({one.round for one in loads})} rounds; each round measures every phase in a new process.",
        (
            "CPU: of one core, user and system, from the scheduler's statistics of each thread. loop: the thread with the event loop, the "
            "law, encoding and decoding. Zenoh: all other threads."
        ),
        (
            "relay: the same traffic through a process without a law, bench/relay.py. If a core sleeps between "
            "ticks its caches grow cold, and on some machines the same code takes several times as long as in a "
            "loop; / relay compares both under the same conditions of one round: median (least to greatest)."
        ),
        "wakes: of the event loop.",
        (
            "cmd_vel and its gaps are measured by the process that plays the robot; under the barrier the output also changes between "
            "ticks, and each change is sent immediately."
        ),
    )


def verdicts(loads: Sequence[Load]) -> list[Verdict]:
    return [
        Verdict(
            f"CPU, {phase.name},",
            float(np.median(to_relay(loads, phase.name))),
            phase.target_to_relay,
            "× the relay's",
        )
        for phase in PHASES[1:]
    ]
