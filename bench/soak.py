"""Soak test: drive for hours, and report growth of memory, descriptors, threads and latency: `python -m bench.soak`.

A simulated operator drives the simulated robot by teleop's keys, also at racks and pillars. docs/campaign/soak.jsonl.gz is the
compressed file of a run of one hour, from which docs/crash-safety.md is generated.
"""

import asyncio
import itertools
import math
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter
from pydantic.dataclasses import dataclass

from bench.rig import load
from bench.rig.feed import client, simulated_robot
from bench.rig.options import CommandLine, failing_in_a_sentence, positive, seed
from bench.rig.sheet import Times
from bench.rig.stored import provenance
from deploy.stack import processes
from deploy.stack.errors import Interrupted
from deploy.stack.keyboard import TypedTeleop, typing
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from faults.trial import PROVENANCE_BEGINS, Provenance, parse
from faults.trial_file import appending, whole_lines
from wire import topics
from wire.bus import Bus, NoReplyError, Subscription
from wire.messages import Odometry, SafetyStatus, header
from wire.stamp import Stamp

SAMPLE_S, LOOK_S, READY_LIMIT_S = 10.0, 0.1, 15.0
DEPTH = 512
"""Messages kept between two looks; more than the fastest topic sends."""
HEARTBEAT = topics.source_cmd_vel(topics.TELEOP)
HEARTBEAT_S = 0.05
TOPICS = (topics.CMD_VEL, HEARTBEAT, topics.SCAN, topics.ODOM, topics.STATUS)
JUMP_M = 0.5
"""A larger step of the odometry is a reset."""
PROVOKED = "OBSTACLE"
"""The operator drives at obstacles on purpose; no other stop is expected."""
GROWTH_LIMIT_PERCENT = 1.0
WARM_UP_LEAST_S, WARM_UP_S, WARM_UP_SHARE = 90.0, 600.0, 1.0 / 6.0
"""The black box fills within a minute, during which memory grows as expected. Heap fragmentation is stable after about ten
minutes (measured over 25 minutes: 80 MB after three, 83 to 84 MB from the thirteenth on)."""
FEWEST_SAMPLES = 6
JUDGED_S = 600.0
"""Minimum time for a verdict: over a shorter time, a single block of an allocator is one percent."""
MOST_POINTS = 600
"""Maximum number of samples for a slope over all pairs; of more samples, evenly spaced ones are used."""
WEDGED_STOPS = 6
"""After this many consecutive stops without a completed plan, the robot is reset to its start."""
LET_GO_S = 0.6

Floats = npt.NDArray[np.float64]
Heard = tuple[float, Stamp | None]
"""Arrival time [s] and stamp of a message."""


@dataclass(frozen=True)
class Gaps(Times):
    """Times between the messages of a topic."""

    lost: int
    """Number of messages that were lost, by their stamps."""


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
    ticks: Gaps
    """Gaps of cmd_vel at an independent subscriber."""
    heartbeat: Gaps
    """Lateness of teleop's commands beyond their period of 50 ms."""
    lost: dict[str, int]
    """Lost messages of each topic."""
    false_stops: tuple[str, ...]
    obstacle_stops: int
    """Since the soak began; the next two fields as well."""
    black_boxes: int
    driven_m: float


SAMPLE = TypeAdapter(Sample)


def read_samples(path: Path) -> tuple[list[Sample], Provenance]:
    """Return the samples of a soak's file, compressed or not, and their provenance; an empty one if there is none.

    Raises:
        DeployError: the file cannot be read, or its provenance is damaged.
        ValueError: a line is not a sample of a soak.
    """
    samples, origin = list[Sample](), Provenance()
    for line in whole_lines(path, "a soak"):
        if line.startswith(PROVENANCE_BEGINS):
            origin = parse(Provenance, line)
        else:
            samples.append(SAMPLE.validate_json(line))
    return samples, origin


class Growth(NamedTuple):
    """Growth of one measure of one process after the warm-up."""

    process: str
    measure: str
    level: float
    """Its median."""
    percent: float
    """Slope times the observed time; NaN with too few samples."""
    is_judged: bool
    """Enough time was observed for a verdict."""


def warm_up_s(duration_s: float) -> float:
    """Return the duration of the warm-up: a sixth of the soak, at most ten minutes; up to half of a short soak."""
    wanted_s = max(min(WARM_UP_SHARE * duration_s, WARM_UP_S), WARM_UP_LEAST_S)
    return min(wanted_s, duration_s / 2.0)


def judge(samples: Sequence[Sample]) -> tuple[list[Growth], list[str]]:
    """Return the growths, and the faults as sentences: none if the soak passed. There must be a sample."""
    kept = [sample for sample in samples if sample.time_s >= warm_up_s(samples[-1].time_s)]
    names = list(dict.fromkeys(name for sample in samples for name in sample.processes))
    measures = (("memory", "rss_bytes"), ("descriptors", "descriptors"), ("threads", "threads"))
    growths = [_growth(kept, name, measure, field) for name in names for measure, field in measures]
    faults = [
        f"{g.process}: {g.measure} grew by {g.percent:.2f} %, more than {GROWTH_LIMIT_PERCENT:g} %"
        for g in growths
        if g.is_judged and g.percent > GROWTH_LIMIT_PERCENT
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
    level = float(np.median(values)) if points else math.nan
    if len(points) < FEWEST_SAMPLES:
        return Growth(name, measure, level, math.nan, is_judged=False)
    watched_s = float(times_s[-1] - times_s[0])
    percent = 100.0 * theil_sen(times_s, values) * watched_s / level
    return Growth(name, measure, level, percent, is_judged=watched_s >= JUDGED_S)


def theil_sen(times_s: Floats, values: Floats) -> float:
    """Return the median slope of all pairs of points; spikes, and steps at either end, hardly affect it.

    Args:
        times_s: (n,) rising; at least two.
        values: (n,).
    """
    thinned = slice(None, None, math.ceil(len(times_s) / MOST_POINTS))
    times_s, values = times_s[thinned], values[thinned]
    first, second = np.triu_indices(len(times_s), 1)
    return float(np.median((values[second] - values[first]) / (times_s[second] - times_s[first])))


def gaps(heard: Sequence[Heard], beyond_s: float | None = None) -> Gaps:
    """Return the gaps from the first arrival of a topic to each later one; with `beyond_s`, their lateness beyond this period.

    Args:
        heard: the messages. The first one ended the previous sample, and only begins a gap.
        beyond_s: the period of the topic.
    """
    gaps_ms = 1000.0 * np.diff([arrival_s for arrival_s, _ in heard])
    if beyond_s is not None:
        gaps_ms = np.maximum(gaps_ms - 1000.0 * beyond_s, 0.0)
    pairs = itertools.pairwise(stamp for _, stamp in heard if stamp is not None)
    lost = sum(max(0, b.sequence - a.sequence - 1) for a, b in pairs if a.gid == b.gid)
    times = Times.of(gaps_ms)
    return Gaps(times.samples, times.p50_ms, times.p99_ms, times.max_ms, lost)


class Stops:
    """Distinguishes stops that the operator provoked from all others; begins at the first status READY."""

    def __init__(self) -> None:
        self.is_watching = False
        self._reasons: frozenset[str] = frozenset()
        self.provoked = 0

    def look(self, status: SafetyStatus) -> list[str]:
        """Return the new reasons of this status, except provoked ones."""
        self.is_watching = self.is_watching or status.mode == SafetyStatus.READY
        if not self.is_watching:
            return []
        new = [reason for reason in status.reasons if reason not in self._reasons]
        self._reasons = frozenset(status.reasons)
        self.provoked += PROVOKED in new
        return [reason for reason in new if reason != PROVOKED]


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


class Drive:
    """Drives the robot, and takes a sample every ten seconds."""

    def __init__(self, bus: Bus, state: StateDir, teleop: TypedTeleop, operator: Operator) -> None:
        self._bus, self._state, self._teleop, self._operator = bus, state, teleop, operator
        self._inboxes: dict[str, Subscription[Any]] = {
            topic.key: bus.subscribe(topic, depth=DEPTH) for topic in TOPICS
        }
        self._heard: dict[str, list[Heard]] = {topic.key: [] for topic in TOPICS}
        self._status = SafetyStatus(header(""))
        self._stops = Stops()
        self._false: list[str] = []
        self._driven_m = 0.0
        self._at_m: tuple[float, float] | None = None
        self._boxes: set[str] = set()

    async def run(self, duration_s: float, add: Callable[[Sample], None]) -> None:
        """Drive; call `add` with each sample.

        Raises:
            RuntimeError: the robot does not become ready, or teleop ends.
        """
        async with asyncio.timeout(READY_LIMIT_S):
            while not self._stops.is_watching:
                self._look()
                await asyncio.sleep(LOOK_S)
        began_s = time.monotonic()
        self._sample(0.0)  # what came before does not count
        next_s = began_s + SAMPLE_S
        while (now_s := time.monotonic()) < began_s + duration_s + LOOK_S:
            self._look()
            if self._operator.stops >= WEDGED_STOPS and self._status.mode == SafetyStatus.READY:
                with suppress(NoReplyError):
                    await self._bus.call(topics.SIM_RESET)
                    self._operator.stops = 0
            self._teleop.press(self._operator.keys(now_s, self._status))
            if now_s >= next_s:
                next_s += SAMPLE_S
                add(self._sample(now_s - began_s))
            if not self._teleop.running:
                raise RuntimeError(f"teleop has ended ({self._teleop.last_lines})")
            await asyncio.sleep(LOOK_S)

    def _look(self) -> None:
        for key, inbox in self._inboxes.items():
            for arrival in inbox.take():
                self._heard[key].append((arrival.arrival_s, arrival.stamp))
                if isinstance(arrival.message, Odometry):
                    before, point = self._at_m, arrival.message.pose.pose.position
                    self._at_m = point.x, point.y
                    step_m = math.dist(before or self._at_m, self._at_m)
                    self._driven_m += step_m if step_m < JUMP_M else 0.0
                elif isinstance(arrival.message, SafetyStatus):
                    self._status = arrival.message
                    self._false += self._stops.look(arrival.message)

    def _sample(self, time_s: float) -> Sample:
        """Return what has happened since the last sample."""
        found = {process.name: usage(process.pid) for process in processes.of(self._state.path)}
        taken = {key: gaps(heard) for key, heard in self._heard.items()}
        late = gaps(self._heard[HEARTBEAT.key], HEARTBEAT_S)
        self._heard = {key: heard[-1:] for key, heard in self._heard.items()}
        false, self._false = tuple(self._false), []
        self._boxes |= {path.name for path in (self._state.path / "blackbox").glob("*.jsonl.gz")}
        return Sample(
            time_s=round(time_s, 3),
            processes={name: used for name, used in sorted(found.items()) if used is not None},
            ticks=taken[topics.CMD_VEL.key],
            heartbeat=late,
            lost={key: one.lost for key, one in taken.items()},
            false_stops=false,
            obstacle_stops=self._stops.provoked,
            black_boxes=len(self._boxes),
            driven_m=round(self._driven_m, 2),
        )


async def _drive(
    state: StateDir, endpoint: str, operator: Operator, duration_s: float, add: Callable[[Sample], None]
) -> None:
    marked = {processes.MARK: str(state.path)}
    async with client(endpoint) as bus, typing(Launch.read(None, endpoint), marked) as teleop:
        await Drive(bus, state, teleop, operator).run(duration_s, add)


def report(samples: Sequence[Sample]) -> bool:
    """Print the verdict; return whether the soak passed."""
    if not samples:
        print("it was too short: there is nothing to judge")
        return False
    last, (growths, faults) = samples[-1], judge(samples)
    print(f"{last.driven_m:.0f} m in {last.time_s:.0f} s, {last.obstacle_stops} stops at obstacles")
    print(f"  {last.black_boxes} black boxes, {sum(sum(one.lost.values()) for one in samples)} lost messages")
    for g in growths:
        judged = "" if g.is_judged else f" (not judged: less than {JUDGED_S:g} s after the warm-up)"
        print(f"  {g.process:<12} {g.measure:<12} {g.level:>12g}  {g.percent:+.2f} %{judged}")
    ticks, late = [one.ticks for one in samples], [one.heartbeat for one in samples]
    for name, found in (("gaps of cmd_vel", ticks), ("lateness of the heartbeat", late)):
        p99_ms, max_ms = max(one.p99_ms for one in found), max(one.max_ms for one in found)
        print(f"  {name}, worst p99 of ten seconds {p99_ms:.1f} ms, longest {max_ms:.1f} ms")
    for fault in faults:
        print(f"FAILED: {fault}")
    if not faults:
        print("passed: nothing stopped without a cause, and no measured growth is too much")
    return not faults


def main() -> None:
    line = CommandLine(
        "bench.soak",
        "Drive for hours and report growth of memory, descriptors, threads and latency. Ctrl-C ends early.",
        "exit code: 1 on growth, on a stop without a cause, or if a process fails",
    )
    line.option("hours", positive, 1.0, "duration; fractions are allowed")
    line.option("seed", seed, 0, "seed of the simulated operator")
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
            print(f"sample after {sample.time_s:.0f} s: {sample.driven_m:.0f} m", flush=True)

        try:
            with simulated_robot() as robot:
                operator = Operator(Random(options.seed))
                asyncio.run(_drive(robot.state, robot.endpoint, operator, 3600.0 * options.hours, add))
        except Interrupted:
            print("warning: cut short")
        finally:
            passed = report(samples)
    sys.exit(not passed)


if __name__ == "__main__":
    main()
