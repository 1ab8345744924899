"""Start a robot, drive it for hours, record the resources that it uses, and judge them."""

import asyncio
import json
import math
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, TextIO

from deploy.stack import bringup, interrupts, processes, takedown
from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.keyboard import TypedTeleop, typing
from deploy.stack.launch import Launch, free_loopback_endpoint
from deploy.stack.statedir import StateDir, locked
from deploy.stack.statusline import StatusLine
from deploy.stack.takedown import Say
from faults.provenance import signed
from faults.soak.hand import Hand
from faults.soak.heard import Stops, Stream
from faults.soak.judge import JUDGED_S, Judgement, judge
from faults.soak.plot import svg
from faults.soak.sample import Sample
from faults.soak.usage import Usage, usage
from wire import topics
from wire.bus import Bus, NoReplyError, Subscription
from wire.messages import Odometry, SafetyStatus
from wire.stamp import parse_stamp
from wire.zenoh.bus import open_bus

SAMPLE_S = 10.0
LOOK_S = 0.1
DEPTH = 512
"""Samples kept between two updates: ten seconds of the fastest stream."""
HEARTBEAT_S = 0.05
CONNECT_LIMIT_S = 10.0
READY_LIMIT_S = 15.0
LINE_S = 60.0
"""Period of the progress lines without a terminal."""
STEP_LIMIT_M = 0.5
"""A larger jump of the odometry is a reset."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What to run."""

    hours: float
    out: Path | None = None
    plot: Path | None = None
    seed: int = 0
    sample_s: float = SAMPLE_S


@dataclass(slots=True)
class _Log:
    """The results so far, which remain when the soak ends early."""

    file: TextIO | None
    samples: list[Sample] = field(default_factory=list[Sample])
    ended: str = ""
    """Why the soak ended early."""

    def add(self, sample: Sample) -> None:
        self.samples.append(sample)
        if self.file is not None:
            print(sample.to_json(), file=self.file, flush=True)


def soak(orders: Orders, say: Say, *, as_json: bool = False) -> int:
    """Run the soak; return 0 if nothing grew and nothing stopped without a cause, else 1.

    Raises:
        DeployError: the robot could not be started, or a file cannot be written.
    """
    with ExitStack() as files:
        log = _Log(_opened(files, orders.out))
        files.enter_context(signed(orders.out))
        if orders.plot is not None:
            _opened(files, orders.plot)  # fail now, not after hours
        _soak(orders, log, say, StatusLine(sys.stderr if as_json else None))
        if not log.samples:
            say(f"{log.ended or 'it was too short'}: there is nothing to judge")
            return 1
        judgement = judge(log.samples)
        if log.ended:
            say(f"warning: {log.ended} after {_span(log.samples[-1].time_s)} of {_span(orders.hours * 3600)}")
        if as_json:
            print(json.dumps(_to_json(log, judgement), indent=2))
        else:
            _tell(log.samples, judgement, say)
        if orders.plot is not None:
            orders.plot.write_text(svg(log.samples, f"lifeline soak, {_span(log.samples[-1].time_s)}"))
            say(f"drawn in {orders.plot}")
        return int(not judgement.passed)


def _opened(files: ExitStack, path: Path | None) -> TextIO | None:
    if path is None:
        return None
    try:
        return files.enter_context(path.open("w"))
    except OSError as error:
        raise DeployError(f"cannot write {path}: {error.strerror}; choose another file") from error


def _soak(orders: Orders, log: _Log, say: Say, line: StatusLine) -> None:
    with tempfile.TemporaryDirectory(prefix="lifeline-soak-", ignore_cleanup_errors=True) as directory:
        state = StateDir(Path(directory).resolve())
        state.create()
        launch = Launch.read(None, free_loopback_endpoint(), sim_options="--no-viewer")
        with interrupts.interrupts(), locked(state, "soak"):
            try:
                try:
                    say("starting sim and supervisor")
                    bringup.start(state, launch, say)
                    asyncio.run(_drive(orders, state, launch, log, line, say))
                except interrupts.Interrupted:
                    log.ended = "cut short"
                finally:
                    interrupts.ignore()
            finally:
                takedown.stop(state)


async def _drive(
    orders: Orders, state: StateDir, launch: Launch, log: _Log, line: StatusLine, say: Say
) -> None:
    await bringup.wait_until_alive(state, launch, say)
    async with asyncio.timeout(CONNECT_LIMIT_S):
        bus = await open_bus(launch.bus, "client")
    try:
        async with typing(launch, {processes.MARK: str(state.path)}) as teleop:
            await _Soak(bus, state, teleop, Random(orders.seed)).run(orders, log, line, say)  # noqa: S311 - no secret
    finally:
        line.clear()
        await bus.close()


class _Soak:
    def __init__(self, bus: Bus, state: StateDir, teleop: TypedTeleop, random: Random) -> None:
        self._bus, self._state, self._teleop = bus, state, teleop
        self._hand = Hand(random)
        heartbeat = topics.source_cmd_vel(topics.TELEOP)
        self._raw: dict[str, Subscription[Any]] = {
            topic.key: bus.subscribe(topic, depth=DEPTH) for topic in (topics.CMD_VEL, heartbeat, topics.SCAN)
        }
        self._streams = {key: Stream(HEARTBEAT_S if key == heartbeat.key else None) for key in self._raw}
        self._heartbeat = heartbeat.key
        self._odometry: Subscription[Odometry] = bus.subscribe(topics.ODOM, depth=DEPTH)
        self._statuses: Subscription[SafetyStatus] = bus.subscribe(topics.STATUS, depth=DEPTH)
        self._odom_stream, self._status_stream = Stream(), Stream()
        self._status: SafetyStatus | None = None
        self._stops = Stops()
        self._false: list[str] = []
        self._boxes: set[str] = set()
        self._at_m: tuple[float, float] | None = None
        self._driven_m = 0.0
        self._overflowed = 0

    async def run(self, orders: Orders, log: _Log, line: StatusLine, say: Say) -> None:
        await self._until_ready()
        duration_s = orders.hours * 3600.0
        say(f"driving for {_span(duration_s)}; Ctrl-C ends early and judges the results so far")
        began_s = time.monotonic()
        next_s, next_line_s = began_s + orders.sample_s, began_s + LINE_S
        while (now_s := time.monotonic()) < began_s + duration_s + LOOK_S:
            self._look()
            await self._act(now_s)
            if now_s >= next_s:
                next_s += orders.sample_s
                log.add(self._sample(now_s - began_s))
                text = _progress(log.samples[-1], duration_s)
                line.show(text)
                if not sys.stdout.isatty() and now_s >= next_line_s:
                    next_line_s += LINE_S
                    say(text)
            if not self._teleop.running:
                log.ended = f"teleop has ended ({self._teleop.last_lines})"
                return
            await asyncio.sleep(LOOK_S)

    async def _until_ready(self) -> None:
        deadline_s = time.monotonic() + READY_LIMIT_S
        while self._status is None or self._status.mode != SafetyStatus.READY:
            if time.monotonic() > deadline_s:
                raise DeployError(
                    f"the robot did not become ready within {READY_LIMIT_S:g} s; try again when the machine is less busy"
                )
            self._look()
            await asyncio.sleep(LOOK_S)
        for stream in (*self._streams.values(), self._odom_stream, self._status_stream):
            stream.take()

    def _look(self) -> None:
        """Add the new arrivals."""
        for key, subscription in self._raw.items():
            for raw in subscription.take_raw():
                self._streams[key].hear(raw.arrival_s, parse_stamp(raw.attachment))
        for moved in self._odometry.take():
            self._odom_stream.hear(moved.arrival_s, moved.stamp)
            if moved.message is not None:
                self._move(moved.message)
        for arrival in self._statuses.take():
            self._status_stream.hear(arrival.arrival_s, arrival.stamp)
            if arrival.message is not None:
                self._status = arrival.message
                self._false += self._stops.look(arrival.message)

    def _move(self, message: Odometry) -> None:
        point = message.pose.pose.position
        before, self._at_m = self._at_m, (point.x, point.y)
        step_m = 0.0 if before is None else math.dist(before, self._at_m)
        self._driven_m += step_m if step_m < STEP_LIMIT_M else 0.0

    async def _act(self, now_s: float) -> None:
        assert self._status is not None
        if self._hand.is_wedged and self._status.mode == SafetyStatus.READY:
            try:
                await self._bus.call(topics.SIM_RESET)
            except NoReplyError:
                return
            self._hand.put_back()
            return
        keys = self._hand.keys(now_s, self._status)
        if keys:
            self._teleop.press(keys)

    def _sample(self, time_s: float) -> Sample:
        self._boxes |= {path.name for path in (self._state.path / "blackbox").glob("*.jsonl.gz")}
        lost = {key: stream.take() for key, stream in self._streams.items()}
        odom, status = self._odom_stream.take(), self._status_stream.take()
        false, self._false = tuple(self._false), []
        return Sample(
            time_s=round(time_s, 3),
            processes=_usages(self._state),
            ticks=lost[topics.CMD_VEL.key],
            heartbeat=lost[self._heartbeat],
            lost={
                **{key: gaps.lost for key, gaps in lost.items()},
                topics.ODOM.key: odom.lost,
                topics.STATUS.key: status.lost,
            },
            false_stops=false,
            obstacle_stops=self._stops.provoked,
            black_boxes=len(self._boxes),
            driven_m=round(self._driven_m, 2),
            load=os.getloadavg()[0],
        )


def _usages(state: StateDir) -> dict[str, Usage]:
    found = ((process.name, usage(process.pid)) for process in processes.of(state.path))
    return {name: used for name, used in sorted(found, key=lambda pair: pair[0]) if used is not None}


def _progress(sample: Sample, duration_s: float) -> str:
    memory = ", ".join(f"{name} {used.rss_bytes / 1e6:.1f} MB" for name, used in sample.processes.items())
    return (
        f"{_span(sample.time_s)} of {_span(duration_s)}, {_span(max(0.0, duration_s - sample.time_s))} left; "
        f"{sample.driven_m:.0f} m, {sample.obstacle_stops} obstacles; {memory}"
    )


def _tell(samples: list[Sample], judgement: Judgement, say: Say) -> None:
    last = samples[-1]
    boxes = f"{last.black_boxes} black boxes"
    say(
        f"drove {last.driven_m:.0f} m in {_span(last.time_s)}, stopped {last.obstacle_stops} times at obstacles, {boxes}"
    )
    for growth in judgement.growths:
        level = f"{growth.level / 1e6:.1f} MB" if growth.measure == "memory" else f"{growth.level:g}"
        grew = f"{growth.percent:+.2f} %" if growth.is_measured else "too few samples to tell its growth"
        say(f"  {growth.process:<12} {growth.measure:<12} {level:>10}  {grew}")
    if not all(growth.is_judged for growth in judgement.growths):
        say(f"  growth is not judged: less than {_span(JUDGED_S)} were observed after the warm-up")
    for name, gaps in (
        ("gaps of cmd_vel", [s.ticks for s in samples]),
        ("lateness of the heartbeat", [s.heartbeat for s in samples]),
    ):
        p50, p99, most = (max(getattr(g, f) for g in gaps) for f in ("p50_ms", "p99_ms", "max_ms"))
        say(
            f"  {name}: p50 {p50:.1f} ms, p99 {p99:.1f} ms, longest {most:.1f} ms (each from the worst sample)"
        )
    lost = {key: sum(s.lost[key] for s in samples) for key in last.lost}
    say("  lost by sequence: " + ", ".join(f"{key} {count}" for key, count in lost.items()))
    loads = sorted(s.load for s in samples)
    say(f"  load of the machine: {loads[len(loads) // 2]:.1f} (median), {loads[-1]:.1f} (highest)")
    for fault in judgement.faults:
        say(f"FAILED: {fault}")
    if judgement.passed:
        is_short = not all(growth.is_judged for growth in judgement.growths)
        say(f"passed: {'' if is_short else 'nothing grew, and '}nothing stopped without a cause")


def _to_json(log: _Log, judgement: Judgement) -> dict[str, Any]:
    last = log.samples[-1]
    return {
        "passed": judgement.passed,
        "faults": list(judgement.faults),
        "ended": log.ended or None,
        "duration_s": last.time_s,
        "driven_m": last.driven_m,
        "obstacle_stops": last.obstacle_stops,
        "black_boxes": last.black_boxes,
        "growths": [
            {
                "process": growth.process,
                "measure": growth.measure,
                "level": growth.level,
                "percent": number(growth.percent),
                "is_judged": growth.is_judged,
            }
            for growth in judgement.growths
        ],
        "lost": {key: sum(sample.lost[key] for sample in log.samples) for key in last.lost},
    }


def _span(duration_s: float) -> str:
    if duration_s < 120.0:
        return f"{duration_s:.0f} s"
    if duration_s < 7200.0:
        return f"{duration_s / 60.0:.1f} min"
    return f"{duration_s / 3600.0:.2f} h"
