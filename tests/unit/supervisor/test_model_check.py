"""Every reachable state of the interlock, times every class of event, breadth first.

The law is run itself, not a model of it; what is folded together are states whose future cannot differ:

* times count as ages in whole ticks, up to the first that is beyond every timeout;
* which reasons are latched on a source matters only as: none, only the barrier's (an escape clears them),
  or others (a neutral clears them);
* counters are left out: no rule reads them.

Beside the law runs an independent monitor of the promise "no motion without neutral first".
"""

import math
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from supervisor.clearance import Surroundings
from supervisor.config import SupervisorSection
from supervisor.model import (
    STANDSTILL,
    Command,
    Decision,
    Inputs,
    LaserScan,
    LawConfig,
    Liveliness,
    Mode,
    Odometry,
    Source,
    SourceConfig,
    State,
    StopReason,
    Velocity,
)
from supervisor.safety import BARRIER_REASONS, initial_state, step
from supervisor.scan import read_scan

TICK_S = 0.125
LATE_S = 0.75
OLD_TICKS = 2
"""An age of so many ticks is beyond every timeout."""

BRAKED_TICKS = 4
"""After so many ticks of zero, braking has taken its time."""

CONFIG: LawConfig = replace(
    SupervisorSection().law(),
    sources=(SourceConfig("teleop", 2), SourceConfig("path", 1)),
    command_timeout_s=1.5 * TICK_S,
    scan_timeout_s=1.5 * TICK_S,
    overrun_s=2 * TICK_S,
    max_linear_m_s=1.0,
    deceleration_m_s2=10.0,
)

FORWARD, BACK, NEUTRAL = Velocity(0.5, 0.0), Velocity(-0.5, 0.0), STANDSTILL
BEAMS = 180


def _ranges(ahead_m: float = 3.0, everywhere_m: float = 3.0) -> np.ndarray:
    ranges = np.full(BEAMS, everywhere_m, dtype=np.float32)
    ranges[BEAMS // 2 - 8 : BEAMS // 2 + 8] = ahead_m
    return ranges


def _pair(ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two scans that show the same: no real one repeats itself to the bit."""
    return ranges, ranges + np.float32(1e-4)


SCANS: dict[str, tuple[np.ndarray, np.ndarray]] = {
    "clear": _pair(_ranges()),
    "obstacle ahead": _pair(_ranges(ahead_m=0.5)),
    "blind ahead": _pair(_ranges(ahead_m=math.nan)),
    "all NaN": _pair(_ranges(math.nan, math.nan)),
}
KINDS = {id(ranges): kind for kind, pair in SCANS.items() for ranges in pair}


@dataclass(frozen=True)
class Event:
    """What happens within one tick."""

    name: str
    commands: tuple[tuple[str, Velocity | None], ...] = ()
    liveliness: tuple[Liveliness, ...] = ()
    odometry: Velocity | None = None
    estop: bool = False
    reset: bool = False
    late: bool = False
    scan: str | None = "clear"

    def inputs(self, now_s: float) -> Inputs:
        scan = None
        if self.scan is not None:
            increment = 2 * math.pi / BEAMS
            ranges = SCANS[self.scan][round(now_s / TICK_S) % 2]
            scan = LaserScan(ranges, -math.pi, increment, 0.05, 12.0, now_s)
        return Inputs(
            commands=tuple(Command(source, velocity, now_s) for source, velocity in self.commands),
            liveliness=self.liveliness,
            scans=(scan,),
            odometry=None if self.odometry is None else Odometry(self.odometry, now_s),
            estop=self.estop,
            reset=self.reset,
        )


def _commands(source: str, **velocities: Velocity | None) -> list[Event]:
    return [Event(f"{source} {name}", ((source, velocity),)) for name, velocity in velocities.items()]


def _tokens(source: str) -> list[Event]:
    lost, back = Liveliness(source, alive=False), Liveliness(source, alive=True)
    return [
        Event(f"{source} lost", liveliness=(lost,)),
        Event(f"{source} back", liveliness=(back,)),
        Event(f"{source} flaps", liveliness=(lost, back)),
    ]


_TELEOP = _commands("teleop", neutral=NEUTRAL, forward=FORWARD, back=BACK, invalid=None)
_TIME = [Event("a tick"), Event("a late tick", late=True)]
_STOPS = [
    Event("estop", estop=True),
    Event("reset", reset=True),
    Event("estop and reset", estop=True, reset=True),
]


def _with_scans(events: list[Event]) -> list[Event]:
    kinds: list[str | None] = [None, *SCANS]
    return [replace(e, name=f"{e.name}, scan: {kind}", scan=kind) for e in events for kind in kinds]


ONE_OPERATOR = [*_with_scans([_TIME[0], *_TELEOP]), _TIME[1], *_tokens("teleop"), *_STOPS]
TWO_SOURCES = [
    *_TIME,
    *_TELEOP,
    *_commands("path", neutral=NEUTRAL, forward=FORWARD, invalid=None),
    *_tokens("teleop"),
    *_tokens("path"),
    Event("both forward", (("teleop", FORWARD), ("path", FORWARD))),
    Event("both neutral", (("teleop", NEUTRAL), ("path", NEUTRAL))),
    Event("teleop back, path forward", (("teleop", BACK), ("path", FORWARD))),
    Event("estop", estop=True),
    Event("reset", reset=True),
    Event("no scan", scan=None),
    Event("both forward at an obstacle", (("teleop", FORWARD), ("path", FORWARD)), scan="obstacle ahead"),
    Event("path forward at an obstacle", (("path", FORWARD),), scan="obstacle ahead"),
]
RUNAWAY_BASE = [
    *_TIME,
    *_TELEOP,
    *(
        replace(event, name=f"{event.name}, base {name}", odometry=velocity)
        for event in [Event("a tick"), *_TELEOP[:2]]
        for name, velocity in (("stands", STANDSTILL), ("moves", Velocity(0.4, 0.0)))
    ),
]


@dataclass(frozen=True)
class Monitor:
    """Who has been neutral since the last stop, told apart from the law's own latches."""

    neutral: frozenset[str] = frozenset()
    moving: bool = False
    barrier: bool = False
    """The last stop was the barrier's alone: a motion away from it does for its owner's neutral."""

    def after(self, event: Event, decision: Decision) -> "Monitor":
        said = frozenset(source for source, velocity in event.commands if velocity == NEUTRAL)
        if decision.mode is not Mode.STOPPED:
            escaped = {decision.owner} if self.barrier and decision.output == BACK else set[str]()
            return Monitor(self.neutral | said | escaped, decision.output != STANDSTILL, self.barrier)
        barrier = all(reason in BARRIER_REASONS for reason in decision.reasons)
        ready = {s.config.name for s in decision.sources if s.armed}
        before = said if self.moving and barrier else self.neutral | said
        return Monitor(before & ready, moving=False, barrier=barrier)


def _age(now_s: float, then_s: float) -> int:
    return OLD_TICKS if math.isinf(then_s) else min(OLD_TICKS, round((now_s - then_s) / TICK_S))


def _latched(source: Source) -> str:
    if not source.latched:
        return "armed"
    return "barrier" if source.latched <= BARRIER_REASONS else "stopped"


def _key(state: State, monitor: Monitor) -> Hashable:
    """The state, as far as its future depends on it."""
    assert state.now_s is not None
    now_s = state.now_s
    sources = tuple(
        (
            source.alive is False,
            source.invalid,
            source.velocity,
            _age(now_s, source.sent_s),
            source.neutral_s > source.caused_s,
            _latched(source),
            source.block,
        )
        for source in state.sources
    )
    scan, seen = state.scan, None  # a stale scan is as good as none
    if scan is not None and (age := _age(now_s, scan.taken_s)) < OLD_TICKS:
        seen = (age, scan.problem, KINDS[id(scan.ranges)])
    base = None
    if state.odometry is not None:
        stopped_s = now_s if state.stopped_s is None else state.stopped_s
        base = (
            state.odometry.velocity,
            min(BRAKED_TICKS, round((now_s - stopped_s) / TICK_S)),
            min(BRAKED_TICKS, max(0, round((state.odometry.arrival_s - stopped_s) / TICK_S))),
        )
    return (sources, state.owner, seen, state.estop, state.runaway, base, monitor)


def _check(before: State, decision: Decision, monitor: Monitor, way: Callable[[], list[str]]) -> None:
    """Promises 1 and 7 of the design, on one edge; a broken one names the way there."""
    output = decision.output
    assert all(map(math.isfinite, output)), way()
    assert abs(output.linear_m_s) <= CONFIG.max_linear_m_s, way()
    assert abs(output.angular_rad_s) <= CONFIG.max_angular_rad_s, way()
    assert (decision.mode is Mode.STOPPED) == bool(decision.reasons), way()
    if decision.reasons:
        assert output == STANDSTILL, way()
    if output != STANDSTILL:
        assert decision.owner in monitor.neutral, way()
        assert not before.estop, way()
        owner = next(s for s in decision.sources if s.config.name == decision.owner)
        assert owner.alive is not False, way()
        assert not owner.invalid, way()


def _recovers(state: State) -> bool:
    """Promise 8: clear scans, a base that stands, a reset and the operator's neutral make it drivable again."""
    assert state.now_s is not None
    now_s = state.now_s
    alive = (Liveliness("teleop", alive=True),)
    neutral = (("teleop", NEUTRAL), ("path", NEUTRAL))
    for event in (
        Event("", neutral, alive, odometry=STANDSTILL),
        Event("", neutral, odometry=STANDSTILL, reset=True),
        Event("", neutral, odometry=STANDSTILL),
        Event("", neutral, odometry=STANDSTILL),
    ):
        now_s += TICK_S
        state, decision = step(state, now_s, event.inputs(now_s))
        assert decision.output == STANDSTILL
    now_s += TICK_S
    state, decision = step(state, now_s, Event("", (("teleop", FORWARD),)).inputs(now_s))
    return decision.output == FORWARD


@pytest.fixture(autouse=True)
def _each_kind_of_scan_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The law reads a scan each time; here it is one of four, and half a minute is saved."""
    read: dict[str, tuple[Surroundings, str | None, float]] = {}

    def read_once(ranges: np.ndarray, **geometry: Any) -> tuple[Surroundings, str | None, float]:  # noqa: ANN401 - passed on
        kind = KINDS[id(ranges)]
        if kind not in read:
            read[kind] = read_scan(ranges, **geometry)
        return read[kind]

    monkeypatch.setattr("supervisor.safety.read_scan", read_once)


def explore(events: list[Event], visit: Callable[[State], None]) -> tuple[int, int]:
    """Every reachable state times every event; returns the number of states and edges."""
    state, _ = step(initial_state(CONFIG), 0.0, Inputs())
    start = (state, Monitor())
    queue: deque[tuple[tuple[State, Monitor], tuple[Any, ...]]] = deque([(start, ())])
    known = {_key(*start)}
    edges = 0
    while queue:
        (state, monitor), way = queue.popleft()
        visit(state)
        assert state.now_s is not None
        for event in events:
            now_s = state.now_s + (LATE_S if event.late else TICK_S)
            after, decision = step(state, now_s, event.inputs(now_s))
            moved_on = monitor.after(event, decision)
            _check(state, decision, moved_on, lambda event=event, way=way: [*_names(way), event.name])
            edges += 1
            key = _key(after, moved_on)
            if key not in known:
                known.add(key)
                queue.append(((after, moved_on), (way, event.name)))
    return len(known), edges


def _names(way: tuple[Any, ...]) -> list[str]:
    """The shortest way from the start, event by event."""
    names: list[str] = []
    while way:
        way, name = way
        names.append(name)
    return names[::-1]


@pytest.mark.parametrize(
    ("name", "events"),
    [("one operator", ONE_OPERATOR), ("two sources", TWO_SOURCES), ("a runaway base", RUNAWAY_BASE)],
)
@pytest.mark.proof
@pytest.mark.timeout(600)
def test_every_reachable_state_keeps_the_promises_and_recovers(name: str, events: list[Event]) -> None:
    reasons: set[StopReason] = set()

    def visit(state: State) -> None:
        for source in state.sources:
            reasons.update(source.latched)
        assert _recovers(state)

    started_s = time.perf_counter()
    states, edges = explore(events, visit)
    print(
        f"\n    checked: {name}: {states} states, {edges} edges, {len(reasons)} of {len(StopReason)} reasons, "
        f"{time.perf_counter() - started_s:.0f} s"
    )
    assert states > 100
