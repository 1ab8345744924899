"""Every reachable state of the interlock, times every class of event, breadth first.

The law itself is run, not a model of it. States whose future cannot differ are merged:

* times count as ages in whole ticks, up to the first that is beyond every timeout;
* which reasons are latched on a source matters only as: none, only the barrier's (an escape clears them),
  or others (a neutral clears them);
* counters are left out: no rule reads them;
* stamped commands are on time, and their epochs are proven: delays are tested elsewhere;
* the robot does not move: moving surroundings are tested elsewhere. Near objects are straight ahead, so only the
  existence of remembered and earlier points matters.

Each certificate is compared with the step that it foresees: of each event, and of the same event without a scan.

An independent monitor checks of the promise "no motion without neutral first".
"""

import math
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from supervisor.config import SupervisorSection
from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.decision import Decision, Mode
from supervisor.law.interlock import BARRIER_REASONS, Source
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness, Odometry, SourceConfig
from supervisor.law.reckoning import STANDSTILL, Odometer, Pose, Velocity
from supervisor.law.safety import step
from supervisor.law.scan import LaserScan, Moment, ScanReading, read_scan
from supervisor.law.state import State
from supervisor.law.writers import WRITER_WINDOW_S
from tests.unit.supervisor.law.law_harness import is_foreseen, on_time, proven_state
from wire.reasons import StopReason

TICK_S = 0.125
LATE_S = 0.75
SLEPT_S = 3600.0
OLD_TICKS = 2
"""An age of this many ticks is beyond every timeout."""

BRAKED_TICKS = 4
"""After this many ticks of zero, braking is complete."""

PATIENT_TICKS = round(PATIENCE_S / TICK_S) + 1
"""A base that lags for this many ticks does not follow."""

WINDOW_TICKS = round(WRITER_WINDOW_S / TICK_S) + 1
"""A writer that was last heard this many ticks ago is inactive."""

_CONFIGURED = SupervisorSection().law()

CONFIG: LawConfig = replace(
    _CONFIGURED,
    sources=(SourceConfig("teleop", 2), SourceConfig("path", 1)),
    command_timeout_s=1.5 * TICK_S,
    lidars=(replace(_CONFIGURED.lidars[0], timeout_s=1.5 * TICK_S),),
    odom_timeout_s=1.5 * TICK_S,
    overrun_s=2 * TICK_S,
    max_linear_m_s=1.0,
    deceleration_m_s2=10.0,
    base_acceleration_m_s2=10.0,
)

FORWARD, BACK, NEUTRAL = Velocity(0.5, 0.0), Velocity(-0.5, 0.0), STANDSTILL
BEAMS = 360
LIDAR, STRANGER = b"lidar", b"stranger"


def _ranges(ahead_m: float = 3.0, everywhere_m: float = 3.0, *, beside: int = 16) -> np.ndarray:
    ranges = np.full(BEAMS, everywhere_m, dtype=np.float32)
    ranges[BEAMS // 2 - beside : BEAMS // 2 + beside + 1] = ahead_m
    return ranges


def _pair(ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two scans that show the same: no real one repeats itself to the bit."""
    return ranges, ranges + np.float32(1e-4)


SCANS: dict[str, tuple[np.ndarray, np.ndarray]] = {
    "clear": _pair(_ranges()),
    "obstacle ahead": _pair(_ranges(ahead_m=0.5)),
    "stray reading ahead": _pair(_ranges(ahead_m=0.5, beside=0)),
    "blind ahead": _pair(_ranges(ahead_m=math.nan)),
    "all NaN": _pair(_ranges(math.nan, math.nan)),
}


WHOLE = {id(ranges) for pair in SCANS.values() for ranges in pair if not np.isnan(ranges).any()}
"""The scans with a return on every beam; the arrays of `SCANS` are the only ones."""


@dataclass(frozen=True)
class Event:
    """What happens within one tick."""

    name: str
    commands: tuple[tuple[str, Velocity | None], ...] = ()
    liveliness: tuple[Liveliness, ...] = ()
    odometry: Velocity | None = None
    estop: bool = False
    estop_unrecorded: bool = False
    reset: bool = False
    late: bool = False
    suspended: bool = False
    scan: str | None = "clear"
    writers: tuple[bytes, ...] = (LIDAR,)
    stamped: bool = True

    def inputs(self, now_s: float, state: State) -> Inputs:
        last = state.sight.lidars[0].scan
        scans: list[LaserScan] = []
        if self.scan is not None:
            increment = 2 * math.pi / BEAMS
            one, other = SCANS[self.scan]
            ranges = other if last is not None and last.ranges is one else one
            for writer in self.writers:
                scans.append(LaserScan(ranges, -math.pi, increment, 0.05, 12.0, now_s, writer=writer))
                ranges = one if ranges is other else other
        return Inputs(
            commands=tuple(
                on_time(source, velocity, now_s) if self.stamped else Command(source, velocity, now_s)
                for source, velocity in self.commands
            ),
            liveliness=self.liveliness,
            scans=tuple(scans),
            odometry=None if self.odometry is None else Odometry(self.odometry, now_s),
            estop=self.estop,
            estop_unrecorded=self.estop_unrecorded,
            reset=self.reset,
            suspended_s=SLEPT_S if self.suspended else 0.0,
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
_TIME = [Event("a tick"), Event("a late tick", late=True), Event("a suspend", suspended=True)]
_STOPS = [
    Event("estop", estop=True),
    Event("reset", reset=True),
    Event("estop and reset", estop=True, reset=True),
    Event("full disk", estop_unrecorded=True),
    Event("forward, full disk", (("teleop", FORWARD),), estop_unrecorded=True),
]


def _with_scans(events: list[Event]) -> list[Event]:
    kinds: list[str | None] = [None, *SCANS]
    return [replace(e, name=f"{e.name}, scan: {kind}", scan=kind) for e in events for kind in kinds]


ONE_OPERATOR = [*_with_scans([_TIME[0], *_TELEOP[:2]]), *_TELEOP[2:], *_TIME[1:], *_tokens("teleop"), *_STOPS]
TWO_SOURCES = [
    *_TIME[:2],
    *_TELEOP[:3],
    *_commands("path", neutral=NEUTRAL, forward=FORWARD),
    *_tokens("teleop"),
    *_tokens("path"),
    Event("both forward", (("teleop", FORWARD), ("path", FORWARD))),
    Event("both neutral", (("teleop", NEUTRAL), ("path", NEUTRAL))),
    Event("teleop back, path forward", (("teleop", BACK), ("path", FORWARD))),
    Event("estop", estop=True),
    Event("reset", reset=True),
    Event("both forward at an obstacle", (("teleop", FORWARD), ("path", FORWARD)), scan="obstacle ahead"),
    Event("path forward at an obstacle", (("path", FORWARD),), scan="obstacle ahead"),
]
BASE = [
    *_TIME[:2],
    *_TELEOP[:2],
    *(
        replace(event, name=f"{event.name}, base {name}", odometry=velocity)
        for event in [Event("a tick"), *_TELEOP[:2]]
        for name, velocity in (("stands", STANDSTILL), ("moves", Velocity(0.4, 0.0)))
    ),
]
WRITERS = [
    _TIME[0],
    *_TELEOP[:2],
    *(
        replace(event, name=f"{event.name}, scan of {name}", writers=writers)
        for event in [Event("a tick"), *_TELEOP[:2]]
        for name, writers in (("a stranger", (STRANGER,)), ("both", (LIDAR, STRANGER)))
    ),
    Event("no scan", scan=None),
    Event("forward without a scan", (("teleop", FORWARD),), scan=None),
]
UNSTAMPED = [replace(event, stamped=False) for event in [*_TIME, *_TELEOP, *_tokens("teleop"), *_STOPS[:2]]]


@dataclass(frozen=True)
class Unstamped:
    """How long commands without stamps have arrived without a gap [ticks], independent of the law's track."""

    run: int = 0
    silent: int = OLD_TICKS

    def after(self, event: Event) -> "Unstamped":
        silent = min(OLD_TICKS, self.silent + (OLD_TICKS if event.late else 1))
        if not any(velocity is not None for _, velocity in event.commands):
            return Unstamped(self.run, silent)
        return Unstamped(0 if silent == OLD_TICKS else min(OLD_TICKS, self.run + silent), 0)


@dataclass(frozen=True)
class Monitor:
    """Which sources have been neutral since the last stop, independent of the law's latches."""

    neutral: frozenset[str] = frozenset()
    moving: bool = False
    """It has moved since the last stop; where only a reading that nothing confirms keeps it, that is no stop."""
    barrier: bool = False
    """The last stop was the barrier's alone: a motion away from it does for its owner's neutral."""
    unstamped: Unstamped | None = None
    """If the only source sends no stamps."""

    @property
    def proven(self) -> bool:
        """Whether the newest command counts."""
        return self.unstamped is None or self.unstamped.run == OLD_TICKS

    def after(self, event: Event, decision: Decision) -> "Monitor":
        unstamped = None if event.stamped else (self.unstamped or Unstamped()).after(event)
        return replace(replace(self, unstamped=unstamped)._hear(event, decision), unstamped=unstamped)

    def _hear(self, event: Event, decision: Decision) -> "Monitor":
        said = frozenset(source for source, velocity in event.commands if velocity == NEUTRAL and self.proven)
        if decision.mode is not Mode.STOPPED:
            escaped = {decision.owner} if self.barrier and decision.output == BACK else set[str]()
            waits = decision.mode is Mode.LIMITED and decision.output == STANDSTILL
            moving = self.moving if waits else decision.output != STANDSTILL
            return Monitor(self.neutral | said | escaped, moving, self.barrier)
        barrier = all(reason in BARRIER_REASONS for reason in decision.reasons)
        ready = {s.config.name for s in decision.sources if s.armed}
        before = said if self.moving and barrier else self.neutral | said
        return Monitor(before & ready, moving=False, barrier=barrier)


def _age(now_s: float, then_s: float, old: int = OLD_TICKS) -> int:
    return old if math.isinf(then_s) else min(old, round((now_s - then_s) / TICK_S))


def _latched(source: Source) -> str:
    if not source.latched:
        return "armed"
    return "barrier" if source.latched <= BARRIER_REASONS else "stopped"


def _key(state: State, monitor: Monitor, *, rivals: bool) -> Hashable:
    """The state, as far as its future depends on it; on when a writer was heard it does only if it has rivals."""
    assert state.clock.now_s is not None
    now_s = state.clock.now_s
    sources = tuple(
        (
            source.alive is False,
            source.invalid,
            source.velocity,
            _age(now_s, source.sent_s),
            source.neutral_s > source.caused_s,
            _latched(source),
            None if source.block is None else (source.block.kind, source.block.per_linear > 0.0),
        )
        for source in state.interlock.sources
    )
    if monitor.unstamped is not None:
        track = state.interlock.sources[0].track
        silent = _age(now_s, track.unstamped_at_s)
        run_s = track.unstamped_at_s - track.unstamped_since_s
        sources = (*sources, (silent, 0 if silent == OLD_TICKS else min(OLD_TICKS, round(run_s / TICK_S))))
    (sight,) = state.sight.lidars
    scan, seen = sight.scan, None
    if scan is not None and scan.view is not None:
        age = _age(now_s, scan.taken_s)
        explained = (
            _age(now_s, scan.view.explained_s.item(BEAMS // 2)),
            _age(now_s, scan.view.explained_s.item(0)),
        )
        # Of a stale scan, nothing counts but what it showed.
        seen = (
            age,
            None if age == OLD_TICKS else (scan.problem is None, *explained),
            len(scan.around.points) > 0,
        )
    kept = (len(sight.earlier) > 0, len(state.sight.memory.points) > 0)
    writers = frozenset(
        (writer.gid, heard, _age(now_s, writer.before_s, WINDOW_TICKS))
        for writer in (sight.writers if rivals else ())
        if (heard := _age(now_s, writer.heard_s, WINDOW_TICKS)) < WINDOW_TICKS
    )
    slept = _age(now_s, state.clock.resumed_s)
    base = None
    if state.base.odometry is not None:
        stopped_s = now_s if state.base.stopped_s is None else state.base.stopped_s
        base = (
            state.base.odometry.velocity,
            _age(now_s, state.base.odometry.arrival_s),
            state.base.following.least,
            state.base.following.most,
            None
            if state.base.following.since_s is None
            else _age(now_s, state.base.following.since_s, PATIENT_TICKS),
            state.base.following.unresponsive,
            min(BRAKED_TICKS, round((now_s - stopped_s) / TICK_S)),
            min(BRAKED_TICKS, max(0, round((state.base.odometry.arrival_s - stopped_s) / TICK_S))),
        )
    return (
        sources,
        state.interlock.owner,
        seen,
        kept,
        writers,
        slept,
        state.interlock.estop,
        state.base.runaway,
        base,
        monitor,
    )


def _check(before: State, decision: Decision, monitor: Monitor, way: Callable[[], list[str]]) -> None:
    """Check promises 1 and 7 on one transition; a violation names the path to it."""
    output = decision.output
    assert all(map(math.isfinite, output)), way()
    assert abs(output.linear_m_s) <= CONFIG.max_linear_m_s, way()
    assert abs(output.angular_rad_s) <= CONFIG.max_angular_rad_s, way()
    assert (decision.mode is Mode.STOPPED) == bool(decision.reasons), way()
    if decision.reasons:
        assert output == STANDSTILL, way()
    if StopReason.OBSTACLE in decision.causes:
        assert output == STANDSTILL, way()
    if any(
        StopReason.OBSTACLE in source.latched - earlier.latched
        for earlier, source in zip(before.interlock.sources, decision.sources, strict=True)
    ):
        assert len(before.sight.lidars[0].earlier) or _showed_something(before), way()
    if output != STANDSTILL:
        assert decision.owner in monitor.neutral, way()
        assert monitor.proven, way()
        assert not before.interlock.estop, way()
        owner = next(s for s in decision.sources if s.config.name == decision.owner)
        assert owner.alive is not False, way()
        assert not owner.invalid, way()


def _showed_something(state: State) -> bool:
    """Return whether the newest scan had a reading near the robot."""
    scan = state.sight.lidars[0].scan
    return scan is not None and len(scan.around.points) > 0


def _recovers(state: State, *, stamped: bool) -> bool:
    """Promise 8: clear scans, a base that stands, a reset and the operator's neutral make it drivable again."""
    assert state.clock.now_s is not None
    now_s = state.clock.now_s
    alive = (Liveliness("teleop", alive=True),)
    neutral = (("teleop", NEUTRAL), ("path", NEUTRAL))
    for event in (
        Event("", neutral, alive, odometry=STANDSTILL),
        Event("", neutral, odometry=STANDSTILL, reset=True),
        *[Event("", neutral, odometry=STANDSTILL)] * (WINDOW_TICKS - 1),
    ):
        now_s += TICK_S
        state, decision = step(state, now_s, replace(event, stamped=stamped).inputs(now_s, state))
        assert decision.output == STANDSTILL
        if (
            all(source.armed for source in state.interlock.sources)
            and len(state.sight.lidars[0].writers) == 1
        ):
            break
    now_s += TICK_S
    state, decision = step(
        state, now_s, Event("", (("teleop", FORWARD),), stamped=stamped).inputs(now_s, state)
    )
    return decision.output == FORWARD


@pytest.fixture(autouse=True)
def _each_scan_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of which every beam returns says the same after any other; that saves half of the time."""
    read: dict[int, ScanReading] = {}

    def read_once(
        previous: ScanReading | None,
        scan: LaserScan,
        moment: Moment,
        *robot: Any,  # noqa: ANN401 - passed on
        **how: Any,  # noqa: ANN401 - likewise
    ) -> ScanReading:
        which = id(scan.ranges)
        if which not in WHOLE:
            return read_scan(previous, scan, moment, *robot, **how)
        if which not in read:
            read[which] = read_scan(None, scan, moment, *robot, **how)
        known, times = read[which], np.full(BEAMS, moment.taken_s)
        assert known.view is not None
        view = known.view._replace(taken_s=moment.taken_s, explained_s=times, returned_s=times)
        return known._replace(taken_s=moment.taken_s, period_s=moment.period_s, view=view)

    monkeypatch.setattr("supervisor.law.sight.read_scan", read_once)


@pytest.fixture(autouse=True)
def _the_robot_gets_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Odometry tells a velocity, and no pose: else there were a state for each."""

    def reckon(_odometer: Odometer, velocity: Velocity, now_s: float, _fastest: Velocity) -> Odometer:
        return Odometer(velocity=velocity, at_s=now_s)

    def where(odometer: Odometer, _now_s: float) -> Pose:
        return odometer.pose

    def remembered(*_: object) -> tuple[Odometer, ...]:
        return ()

    monkeypatch.setattr("supervisor.law.base.reckon", reckon)
    monkeypatch.setattr("supervisor.law.base.remembered", remembered)
    monkeypatch.setattr("supervisor.law.reckoning.where", where)


def explore(events: list[Event], config: LawConfig, visit: Callable[[State], None]) -> tuple[int, int, int]:
    """Visit every reachable state with every event; return the number of states, transitions and foreseen steps."""
    state, decision = step(proven_state(config, now_s=0.0), 0.0, Inputs())
    start = (state, Monitor())
    queue: deque[tuple[tuple[State, Monitor], Decision, tuple[Any, ...]]] = deque([(start, decision, ())])
    rivals = any(STRANGER in event.writers for event in events)
    known = {_key(*start, rivals=rivals)}
    edges = foreseen = 0
    while queue:
        (state, monitor), before, way = queue.popleft()
        visit(state)
        assert state.clock.now_s is not None
        for event in events:
            now_s = state.clock.now_s + (LATE_S if event.late else TICK_S)
            inputs = event.inputs(now_s, state)
            after, decision = step(state, now_s, inputs)
            for heard in (inputs, replace(inputs, scans=())):
                foreseen += is_foreseen(state, before, now_s, heard)
            moved_on = monitor.after(event, decision)
            _check(state, decision, moved_on, lambda event=event, way=way: [*_names(way), event.name])
            edges += 1
            key = _key(after, moved_on, rivals=rivals)
            if key not in known:
                known.add(key)
                queue.append(((after, moved_on), decision, (way, event.name)))
    return len(known), edges, foreseen


def _names(way: tuple[Any, ...]) -> list[str]:
    """Return the shortest path from the start, as events."""
    names: list[str] = []
    while way:
        way, name = way
        names.append(name)
    return names[::-1]


@pytest.mark.parametrize(
    ("name", "events", "reached"),
    [
        (
            "one operator",
            ONE_OPERATOR,
            {StopReason.SCAN_INVALID, StopReason.SCAN_STALE, StopReason.OVERRUN, StopReason.ESTOP_UNRECORDED},
        ),
        ("two sources", TWO_SOURCES, {StopReason.SOURCE_LOST, StopReason.OBSTACLE}),
        ("a base", BASE, {StopReason.ODOM_STALE, StopReason.BASE_UNRESPONSIVE, StopReason.BASE_RUNAWAY}),
        ("two writers", WRITERS, {StopReason.SENSOR_CONFLICT}),
        ("no stamps", UNSTAMPED, {StopReason.COMMAND_TIMEOUT, StopReason.COMMAND_INVALID}),
    ],
)
@pytest.mark.proof
@pytest.mark.timeout(1800)  # for a search that hangs; the longest takes some minutes on a slow machine
def test_every_reachable_state_keeps_the_promises_and_recovers(
    name: str, events: list[Event], reached: set[StopReason]
) -> None:
    reasons: set[StopReason] = set()

    def visit(state: State) -> None:
        for source in state.interlock.sources:
            reasons.update(source.latched)
        assert _recovers(state, stamped=all(event.stamped for event in events))

    alone = all(source == "teleop" for event in events for source, _ in event.commands)
    config = replace(CONFIG, sources=CONFIG.sources[:1]) if alone else CONFIG
    started_s = time.perf_counter()
    states, edges, foreseen = explore(events, config, visit)
    print(
        f"\n    checked: {name}: {states} states, {edges} edges, {foreseen} steps foreseen, {len(reasons)} of {len(StopReason)} reasons, "
        f"{time.perf_counter() - started_s:.0f} s"
    )
    assert states > 100
    assert foreseen > 0
    assert reached <= reasons
