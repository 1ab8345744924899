"""Soak test: drive for hours, and report growth of memory, descriptors, threads and latency: `python -m bench.soak`.

A simulated operator drives the simulated robot by teleop's keys, also at racks and pillars. docs/campaign/soak.jsonl.gz is the
compressed file of a run of one hour, from which docs/crash-safety.md is generated.
"""

import asyncio
import itertools
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from bench.rig import load
from bench.rig.feed import ODOM_HZ
from bench.rig.nodes import SimulatedRobot, simulated_robot
from bench.rig.options import CommandLine, failing_in_a_sentence, positive
from bench.rig.sheet import Times, percentile
from deploy.stack import processes
from deploy.stack.errors import Interrupted
from deploy.stack.keyboard import TypedTeleop
from deploy.stack.launch import Launch
from deploy.stack.reach import Observer
from deploy.stack.statedir import StateDir
from faults.trial_file import appending, provenance
from wire import topics
from wire.bus import Arrival, Bus, NoReplyError, Subscription
from wire.messages import Odometry, SafetyStatus, header
from wire.zenoh.bus import BusConfig, open_bus

SAMPLE_S, LOOK_S = 10.0, 0.1
DEPTH = 512
"""Maximum number of messages kept between two readings; more than the fastest topic sends."""
HEARTBEAT = topics.source_cmd_vel(topics.TELEOP)
HEARTBEAT_S = 0.05
TOPICS = (topics.CMD_VEL, HEARTBEAT, topics.SCAN, topics.ODOM, topics.STATUS)
PROVOKED = "OBSTACLE"
"""The operator drives at obstacles on purpose; no other stop is expected."""
GROWTH_LIMIT_PERCENT = 1.0
WARM_UP_S, WARM_UP_SHARE = 600.0, 1.0 / 6.0
"""The black box fills within a minute, during which memory grows as expected. Heap fragmentation is stable after about ten
minutes (measured over 25 minutes: 80 MB after three, 83 to 84 MB from the thirteenth on)."""
JUDGED_S = 600.0
"""Minimum time after the warm-up for a verdict: over a shorter time, a single block of an allocator is one percent."""
MOST_POINTS = 600
"""Maximum number of samples for a slope over all pairs; of more samples, evenly spaced ones are used."""
WEDGED_STOPS = 6
"""After this many consecutive stops without a completed plan, the robot is reset to its start."""
LET_GO_S = 0.6
READY_LIMIT_S = 20.0


@dataclass(frozen=True)
class Usage:
    """The resources of one process at one moment."""

    pid: int
    rss_bytes: int
    """Resident memory, including shared pages."""
    descriptors: int
    threads: int


@dataclass(frozen=True)
class Sample:
    """The record of ten seconds: one line of the file."""

    time_s: float
    """Time since the soak began."""
    processes: dict[str, Usage]
    ticks: Times
    """Gaps of cmd_vel at an independent subscriber."""
    heartbeat: Times
    """Lateness of teleop's commands beyond their period of 50 ms."""
    lost: dict[str, int]
    """Lost messages of each topic."""
    false_stops: tuple[str, ...]
    obstacle_stops: int
    """Since the soak began; the next two fields as well."""
    black_boxes: int
    driven_m: float


SAMPLE = TypeAdapter(Sample)


class Growth(NamedTuple):
    """Growth of one measure of one process after the warm-up."""

    process: str
    measure: str
    level: float
    """Its median."""
    percent: float
    """Slope times the observed time; NaN if that is less than `JUDGED_S`."""


def warm_up_s(duration_s: float) -> float:
    """Return the duration of the warm-up: a sixth of the soak, at most ten minutes."""
    return min(WARM_UP_SHARE * duration_s, WARM_UP_S)


def judge(samples: Sequence[Sample]) -> tuple[list[Growth], list[str]]:
    """Return the growths, and the faults as sentences: none if the soak passed. There must be a sample."""
    kept = [sample for sample in samples if sample.time_s >= warm_up_s(samples[-1].time_s)]
    names = list(dict.fromkeys(name for sample in samples for name in sample.processes))
    measures = (("memory", "rss_bytes"), ("descriptors", "descriptors"), ("threads", "threads"))
    growths = [_growth(kept, name, measure, field) for name in names for measure, field in measures]
    faults = [
        f"{g.process}: {g.measure} grew by {g.percent:.2f} %, more than {GROWTH_LIMIT_PERCENT:g} %"
        for g in growths
        if g.percent > GROWTH_LIMIT_PERCENT
    ]
    false = [reason for sample in samples for reason in sample.false_stops]
    if false:
        counts = ", ".join(f"{reason} {false.count(reason)}×" for reason in dict.fromkeys(false))
        faults.append(f"false stops: {counts}")
    for name in names:
        pids = {sample.processes[name].pid if name in sample.processes else None for sample in samples}
        if len(pids) > 1:
            faults.append(f"{name} ended or was restarted")
    if samples[-1].driven_m <= 0.0:
        faults.append("the robot never moved")
    return growths, faults


def _growth(kept: Sequence[Sample], name: str, measure: str, field: str) -> Growth:
    points = [(s.time_s, getattr(s.processes[name], field)) for s in kept if name in s.processes]
    times_s, values = np.array(points, dtype=np.float64).reshape(-1, 2).T
    level, watched_s = percentile(values, 50), float(np.ptp(times_s)) if points else 0.0
    is_judged = watched_s >= JUDGED_S
    percent = 100.0 * theil_sen(times_s, values) * watched_s / level if is_judged else math.nan
    return Growth(name, measure, level, percent)


def theil_sen(times_s: npt.NDArray[np.float64], values: npt.NDArray[np.float64]) -> float:
    """Return the median slope of all pairs of points; spikes, and steps at either end, hardly affect it.

    Args:
        times_s: (n,) rising; at least two.
        values: (n,).
    """
    thinned = slice(None, None, math.ceil(len(times_s) / MOST_POINTS))
    times_s, values = times_s[thinned], values[thinned]
    first, second = np.triu_indices(len(times_s), 1)
    return float(np.median((values[second] - values[first]) / (times_s[second] - times_s[first])))


def gaps(heard: Sequence[Arrival[Any]], beyond_s: float = 0.0) -> Times:
    """Return the times between the messages of a topic, or their lateness beyond its period.

    Args:
        heard: the messages. The first one belongs to the previous sample; it only starts a gap.
        beyond_s: the period of the topic.
    """
    gaps_s = np.diff([arrival.arrival_s for arrival in heard])
    return Times.of(1000.0 * np.maximum(gaps_s - beyond_s, 0.0))


def lost(heard: Sequence[Arrival[Any]]) -> int:
    """Return the number of messages of a topic that were lost, by their stamps."""
    pairs = itertools.pairwise(arrival.stamp for arrival in heard if arrival.stamp is not None)
    return sum(max(0, b.sequence - a.sequence - 1) for a, b in pairs if a.gid == b.gid)


class Operator:
    """Drives at random by teleop's keys: forward, turns, up to obstacles, and back. Pure: the time is an argument."""

    def __init__(self, random: Random) -> None:
        self._random, self._until_s, self._is_back = random, 0.0, False
        self.stops = 0
        """Number of consecutive stops without a complete forward drive between them."""

    def keys(self, now_s: float, status: SafetyStatus) -> str:
        """Return the keys to press now; mostly none. "s" is neutral, which a stopped robot needs first."""
        if status.mode == SafetyStatus.STOPPED:
            self.stops += not self._is_back
            self._is_back, self._until_s = True, now_s + LET_GO_S
            return "s"
        if now_s < self._until_s:
            return ""
        chance = self._random
        self._until_s = now_s + chance.uniform(0.8, 2.6)
        turn = chance.choice("ad") * chance.randint(1, 6)
        if self._is_back or chance.random() < 0.25:  # turn on the spot, after a stop sometimes also back
            back = "x" * chance.choice((0, 2, 3)) if self._is_back else ""
            self._is_back = False
            return "s" + back + turn
        self.stops = 0
        return "s" + "w" * chance.randint(3, 10) + turn * chance.choice((0, 0, 1))


def usage(pid: int) -> Usage | None:
    """Return the resources of one of our processes; None if it has ended."""
    with suppress(OSError, RuntimeError):
        rss_bytes, threads = 1024 * load.status(pid, "VmRSS"), load.status(pid, "Threads")
        return Usage(pid, rss_bytes, sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir()), threads)
    return None


class Watch:
    """Records the robot's messages and the events since the last sample; starts when the robot is ready."""

    def __init__(self, bus: Bus, state: StateDir) -> None:
        self._state = state
        self.inboxes: dict[str, Subscription[Any]] = {
            topic.key: bus.subscribe(topic, depth=DEPTH) for topic in TOPICS
        }
        self._heard: dict[str, list[Arrival[Any]]] = {topic.key: [] for topic in TOPICS}
        self._status = SafetyStatus(header(""), mode=SafetyStatus.READY)
        self._stops: list[str] = []
        self._obstacle_stops = 0
        self._driven_m = 0.0
        self._boxes: set[str] = set()

    def look(self) -> SafetyStatus:
        """Read all arrived messages; return the newest status."""
        for key, inbox in self.inboxes.items():
            arrivals = inbox.take()
            self._heard[key] += arrivals
            for message in (arrival.message for arrival in arrivals):
                if isinstance(message, Odometry):
                    self._driven_m += abs(message.twist.twist.linear.x) / ODOM_HZ
                elif isinstance(message, SafetyStatus):
                    self._stops += [one for one in message.reasons if one not in self._status.reasons]
                    self._status = message
        return self._status

    def sample(self, time_s: float) -> Sample:
        """Return the measurements since the last sample."""
        found = {process.name: usage(process.pid) for process in processes.of(self._state.path)}
        heard, stops = self._heard, self._stops
        self._heard, self._stops = {key: arrivals[-1:] for key, arrivals in heard.items()}, []
        self._obstacle_stops += stops.count(PROVOKED)
        self._boxes |= {path.name for path in (self._state.path / "blackbox").glob("*.jsonl.gz")}
        return Sample(
            time_s=round(time_s, 3),
            processes={name: used for name, used in sorted(found.items()) if used is not None},
            ticks=gaps(heard[topics.CMD_VEL.key]),
            heartbeat=gaps(heard[HEARTBEAT.key], HEARTBEAT_S),
            lost={key: lost(arrivals) for key, arrivals in heard.items()},
            false_stops=tuple(reason for reason in stops if reason != PROVOKED),
            obstacle_stops=self._obstacle_stops,
            black_boxes=len(self._boxes),
            driven_m=round(self._driven_m, 2),
        )


def _is_ready(robot: Observer) -> bool:
    return robot.status is not None and robot.status.mode == SafetyStatus.READY


async def drive(robot: SimulatedRobot, duration_s: float, add: Callable[[Sample], None]) -> None:
    """Drive; call `add` with a sample every ten seconds.

    Raises:
        TimeoutError: the robot does not become ready.
        RuntimeError: teleop ends.
    """
    marked = {processes.MARK: str(robot.state.path)}
    async with AsyncExitStack() as ending:
        bus = await open_bus(BusConfig(robot.endpoint), "client")
        ending.push_async_callback(bus.close)
        command = Launch.read(None, robot.endpoint).command(topics.TELEOP)
        teleop = TypedTeleop(command, os.environ | marked)
        ending.push_async_callback(teleop.close)
        if not await Observer(bus).until(_is_ready, READY_LIMIT_S):
            raise TimeoutError("the robot does not become ready")
        watch, operator = Watch(bus, robot.state), Operator(Random(0))
        began_s = time.monotonic()
        next_s = began_s + SAMPLE_S
        while (now_s := time.monotonic()) < began_s + duration_s + LOOK_S:
            status = watch.look()
            if operator.stops >= WEDGED_STOPS and status.mode == SafetyStatus.READY:
                with suppress(NoReplyError):
                    await bus.call(topics.SIM_RESET)
                    operator.stops = 0
            teleop.press(operator.keys(now_s, status))
            if now_s >= next_s:
                next_s += SAMPLE_S
                add(watch.sample(now_s - began_s))
            if not teleop.running:
                raise RuntimeError(f"teleop has ended ({teleop.last_lines})")
            await asyncio.sleep(LOOK_S)


def report(samples: Sequence[Sample]) -> bool:
    """Print the verdict; return whether the soak passed."""
    if not samples:
        print("it was too short: there is nothing to judge")
        return False
    last, (growths, faults) = samples[-1], judge(samples)
    print(f"{last.driven_m:.0f} m in {last.time_s:.0f} s, {last.obstacle_stops} stops at obstacles")
    print(f"  {last.black_boxes} black boxes, {sum(sum(one.lost.values()) for one in samples)} lost messages")
    for g in growths:
        why = f" (not judged: less than {JUDGED_S:g} s after the warm-up)" if math.isnan(g.percent) else ""
        print(f"  {g.process:<12} {g.measure:<12} {g.level:>12g}  {g.percent:+.2f} %{why}")
    for fault in faults:
        print(f"FAILED: {fault}")
    if not faults:
        print("passed: no stop without a cause, and no growth above the limit")
    return not faults


def main() -> None:
    line = CommandLine(
        "bench.soak",
        "Drive for hours and report growth of memory, descriptors, threads and latency. Ctrl-C ends early.",
        "exit code: 1 on growth, on a stop without a cause, or if a process fails",
    )
    line.option("hours", positive, 1.0, "duration; fractions are allowed")
    line.file("out", "write one JSON line every ten seconds")
    options = line.parse()
    samples: list[Sample] = []
    if options.out is not None:
        options.out.unlink(missing_ok=True)
    origin = provenance(line.repeat(options))
    with failing_in_a_sentence("bench.soak"), appending(options.out, origin) as write:

        def add(sample: Sample) -> None:
            samples.append(sample)
            write(SAMPLE.dump_json(sample).decode())
            p99_ms = (
                f"gaps of cmd_vel {sample.ticks.p99_ms:.1f}, heartbeat late {sample.heartbeat.p99_ms:.1f}"
            )
            print(f"sample after {sample.time_s:.0f} s, p99 in ms: {p99_ms}", flush=True)

        try:
            with simulated_robot() as robot:
                asyncio.run(drive(robot, 3600.0 * options.hours, add))
        except Interrupted:
            print("warning: cut short")
        finally:
            passed = report(samples)
    sys.exit(not passed)


if __name__ == "__main__":
    main()
