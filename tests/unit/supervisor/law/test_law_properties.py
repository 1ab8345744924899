"""Properties of the law, checked on more than 10,000 random examples.

The examples are derived from the tests themselves (`derandomize`): a check that fails in CI fails on every
machine, and the same commit always has the same result. `LIFELINE_RANDOM=1` looks for new ones instead.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Literal, TypeVar, cast, get_args

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from supervisor.config import SupervisorSection
from supervisor.law.clearance import (
    CLOSING_TOLERANCE_M_S,
    Barrier,
    Circle,
    ConvexPolygon,
    Hull,
    Kind,
    permitted_closing_speed,
    permitted_scale,
    survey,
)
from supervisor.law.decision import Decision, Mode
from supervisor.law.interlock import BARRIER_REASONS, Source
from supervisor.law.lidar import PROFILES, LidarProfile
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan, Lidar, Moment, Mount, ScanReading, read_scan
from supervisor.law.seen_space import hidden_places
from supervisor.law.state import State
from tests.unit.supervisor.law.closed_loop import Outcome, drive_about
from tests.unit.supervisor.law.law_harness import is_foreseen, on_time, proven_state, with_lidar
from wire.freshness import JUMP, Sent, Track, Verdict, judge
from wire.reasons import StopReason

T = TypeVar("T")
Ranges = npt.NDArray[np.float32]

CONFIG = SupervisorSection().law()

pytestmark = [pytest.mark.proof, pytest.mark.timeout(600)]


def examples(count: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return settings(
        max_examples=count,
        deadline=None,
        database=None,
        derandomize="LIFELINE_RANDOM" not in os.environ,
        suppress_health_check=[HealthCheck.too_slow],
    )


# --- hulls, mounts and scans


@st.composite
def hulls(draw: st.DrawFn) -> Hull:
    """A circle, or a convex polygon: corners of an ellipse in counter-clockwise order."""
    if draw(st.booleans()):
        return Circle(draw(st.floats(0.05, 1.0)))
    count = draw(st.integers(3, 8))
    gaps = np.array(draw(st.lists(st.floats(0.2, 1.0), min_size=count, max_size=count)))
    angles = np.cumsum(gaps) * 2 * math.pi / gaps.sum()
    length_m, width_m = draw(st.floats(0.1, 1.0)), draw(st.floats(0.1, 1.0))
    corners = zip((length_m * np.cos(angles)).tolist(), (width_m * np.sin(angles)).tolist(), strict=True)
    return ConvexPolygon(tuple(corners))


@st.composite
def mounts(draw: st.DrawFn) -> Mount:
    angle = st.floats(-math.pi, math.pi)
    masked = draw(st.lists(st.tuples(angle, angle), max_size=2))
    return Mount(
        draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5)), draw(angle), masked_rad=tuple(masked)
    )


ODD_READINGS = [math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 0.006, 0.019, 0.053, 50.0, 81.83, 1e-45, 3e38]


@st.composite
def readings(draw: st.DrawFn) -> Ranges:
    """Readings of any number of beams, in runs of equal readings."""
    runs = draw(
        st.lists(
            st.tuples(st.one_of(st.sampled_from(ODD_READINGS), st.floats(0.0, 15.0)), st.integers(1, 150)),
            max_size=8,
        )
    )
    if not runs:
        return np.empty(0, dtype=np.float32)
    return np.concatenate([np.full(count, value, dtype=np.float32) for value, count in runs])


@examples(2000)
@given(
    ranges=readings(),
    hull=hulls(),
    mount=mounts(),
    profile=st.sampled_from(list(PROFILES.values())),
    angle_min=st.one_of(st.floats(-4.0, 4.0), st.sampled_from([math.nan, math.inf])),
    increment=st.one_of(st.floats(-0.1, 0.1), st.sampled_from([2 * math.pi / 360, 0.0, math.nan])),
    range_min=st.sampled_from([0.0, 0.02, 0.05, 1.0, -1.0, math.nan]),
    range_max=st.sampled_from([5.6, 12.0, 81.91, 0.5, math.inf]),
)
def test_whatever_a_scan_says_the_view_of_it_is_finite_or_proves_nothing(
    ranges: Ranges,
    hull: Hull,
    mount: Mount,
    profile: LidarProfile,
    angle_min: float,
    increment: float,
    range_min: float,
    range_max: float,
) -> None:
    before = ranges.tobytes()
    ranges.flags.writeable = False
    scan = LaserScan(ranges, angle_min, increment, range_min, range_max, 1.0)
    lidar = Lidar("lidar", mount, profile, 0.25)
    reading: ScanReading | None = None
    for number in range(3):
        moment = Moment(
            1.0 + 0.1 * number, 0.1, Pose(0.1 * number, 0.0, 0.02 * number), 0.1 * number, 0.1 * number
        )
        reading = read_scan(reading, scan, moment, lidar, hull, 2.0, 0.04, in_the_open=False)
        _check_reading(reading, lidar, hull)
    assert ranges.tobytes() == before


def _check_reading(reading: ScanReading, lidar: Lidar, hull: Hull) -> None:
    around, view = reading.around, reading.view
    assert 0.0 <= reading.return_share <= 1.0
    for part in (around.points, around.clearance_m, around.per_linear, around.per_angular):
        assert np.isfinite(part).all()
    assert (reading.problem is not None) == math.isnan(reading.nearest_m)
    if reading.problem is not None:
        return
    assert len(reading.ranges) >= lidar.min_beams
    assert view is not None
    assert np.isfinite(view.free_m).all()
    assert (view.free_m >= 0.0).all()
    assert view.free_m.any()
    hidden = hidden_places(view, lidar.mount, hull, 0.04, 2.0)
    assert np.isfinite(hidden).all()
    assert hull.clearance(hidden).min(initial=0.0) > -1e-6, "nothing can be inside the hull"


points = st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)), min_size=0, max_size=12).map(
    lambda pairs: np.array(pairs, dtype=np.float64).reshape(-1, 2)
)


@examples(2500)
@given(
    hull=hulls(),
    around=points,
    linear=st.floats(-1.0, 1.0),
    angular=st.floats(-2.0, 2.0),
    reaction_s=st.floats(0.01, 1.0),
    kind=st.sampled_from(Kind),
    creep_m_s=st.sampled_from([0.0, 0.1]),
)
def test_after_scaling_nothing_is_closed_on_faster_than_permitted(
    hull: Hull,
    around: npt.NDArray[np.float64],
    linear: float,
    angular: float,
    reaction_s: float,
    kind: Kind,
    creep_m_s: float,
) -> None:
    view = survey(hull, around, kind)
    barrier = Barrier(0.3, 1.5, reaction_s, creep_m_s)
    scale, block = permitted_scale(view, linear, angular, barrier)
    assert 0.0 <= scale <= 1.0
    assert (scale < 1.0) == (block is not None)
    closing = scale * (view.per_linear * linear + view.per_angular * angular)
    permitted = permitted_closing_speed(view.clearance_m, barrier)
    anyhow_m_s = max(CLOSING_TOLERANCE_M_S, creep_m_s if kind is Kind.HIDDEN else 0.0)
    assert (closing <= np.maximum(permitted, anyhow_m_s) + 1e-9).all()
    if block is not None:
        assert block.kind is kind
        assert [block.x_m, block.y_m] in around.tolist()
        assert block.is_approached_by(linear, angular)
        slower, _ = permitted_scale(view, scale * linear, scale * angular, barrier)
        # An arc's way ahead is looked at in poses, which lie elsewhere on the scaled one.
        enough = 1.0 - 1e-9 if angular == 0.0 else 0.8
        assert slower >= enough, "what was scaled once is not scaled again"


speakers = st.tuples(
    st.sampled_from(["A", "A", "B", "C"]),
    st.sampled_from([0.0, 0.001, 0.02, 0.05, 0.05, 0.1, 0.21, 3.0]),  # since the last arrival
    st.sampled_from([0.0] * 7 + [3.0, -0.01, -1000.0, 1000.0]),  # by how much its clock steps
    st.sampled_from([1] * 7 + [0, -3, 7, JUMP, 2 * JUMP, 2**62]),  # its sequence
    st.sampled_from([1, 1, 2, 6]),  # so often on end
)


@examples(2000)
@given(steps=st.lists(speakers, max_size=30))
def test_a_fresh_verdict_is_earned_and_a_run_that_was_followed_stays_ended(
    steps: list[tuple[str, float, float, int, int]],
) -> None:
    timeout_s, arrival_s, track = 0.2, 100.0, Track()
    clock_s, sequence = dict.fromkeys("ABC", 5000.0), dict.fromkeys("ABC", 100)
    heard = dict.fromkeys("ABC", -(2**63))
    ended, counts, speaks, spoke_s, since_s = set[str](), "", "", -math.inf, 0.0
    for who, gap_s, clock_step_s, forward, times in steps:
        clock_s[who] += clock_step_s
        for _ in range(times):
            arrival_s += gap_s
            sent = Sent(who.encode(), sequence[who] + forward, arrival_s + clock_s[who])
            before = track
            track, verdict, on_way_s = judge(before, sent, arrival_s, timeout_s)
            refused_entirely = track is before
            if who in ended or (who != speaks and arrival_s - spoke_s <= timeout_s):
                assert verdict is Verdict.EPOCH
            if verdict is Verdict.EPOCH:
                assert refused_entirely
                assert who != speaks
            if not refused_entirely:
                since_s = arrival_s if who != speaks else since_s
                speaks, spoke_s = who, arrival_s
                sequence[who] = sent.sequence
                assert track.last == sent
            if verdict is Verdict.FRESH:
                if counts not in {"", who}:
                    ended.add(counts)
                counts = who
                assert 0.0 <= on_way_s <= timeout_s
                assert arrival_s - since_s >= timeout_s
                assert before.last is not None
                assert sent.sequence > before.last.sequence
                assert sent.source_time_s >= before.last.source_time_s
                assert sent.sequence > heard[who], "what was heard once never counts again"
            if not refused_entirely and (counts == who or verdict is Verdict.FRESH):
                heard[who] = max(heard[who], sent.sequence)


@examples(400)
@given(
    strays=st.lists(
        st.tuples(
            st.floats(0.0, 3.0),
            st.sampled_from([b"A", b"B", b"C"]),
            st.sampled_from([-1, 0, 2 * JUMP, 2**62]),
            st.floats(-1e6, 1e6),
        ),
        max_size=60,
    ),
    second=st.booleans(),
)
def test_nothing_that_others_send_takes_the_source_from_whoever_speaks_steadily(
    strays: list[tuple[float, bytes, int, float]], *, second: bool
) -> None:
    """Strays with any epoch, also a copied one with a sequence of long ago or far ahead; and a second program."""
    messages = [(-0.5 + n * 0.05, Sent(b"A", 1 + n, n * 0.05)) for n in range(71)]
    messages += [(arrival_s, Sent(epoch, sequence, time_s)) for arrival_s, epoch, sequence, time_s in strays]
    if second:
        messages += [(0.02 + n * 0.05, Sent(b"D", 1 + n, n * 0.05)) for n in range(60)]
    track = Track()
    for arrival_s, sent in sorted(messages, key=lambda message: message[0]):
        track, verdict, _ = judge(track, sent, arrival_s, 0.2)
        steady = sent.epoch == b"A" and 0 < sent.sequence <= 71
        if arrival_s >= 0.0:
            assert verdict is (
                Verdict.FRESH if steady else Verdict.SEQUENCE if sent.epoch == b"A" else Verdict.EPOCH
            )


@examples(300)
@given(
    pause_s=st.floats(0.0, 1.0),
    period_s=st.floats(0.005, 0.19),
    strays_s=st.lists(st.floats(0.0, 0.19), max_size=5),
)
def test_a_run_that_follows_another_one_counts_after_the_timeout_and_its_proof(
    pause_s: float, period_s: float, strays_s: list[float]
) -> None:
    track = Track()
    for n in range(30):
        track, _, _ = judge(track, Sent(b"A", 1 + n, n * 0.05), n * 0.05 - 29 * 0.05, 0.2)
    messages = [(pause_s + n * period_s, Sent(b"B", 1 + n, n * period_s)) for n in range(300)]
    messages += [(stray_s, Sent(b"F", 1, 0.0)) for stray_s in strays_s]
    for arrival_s, sent in sorted(messages, key=lambda message: message[0]):
        track, verdict, _ = judge(track, sent, arrival_s, 0.2)
        if sent.epoch == b"B" and arrival_s > max(pause_s, 0.2 + period_s) + 0.2 + period_s:
            assert verdict is Verdict.FRESH


# --- the law over time


TEMPLATES: dict[str, Ranges] = {}


def _template(name: str) -> Ranges:
    """Scans of 360 beams by name: 3 m in all directions, with the named change."""
    if name not in TEMPLATES:
        ranges = np.full(360, 3.0, dtype=np.float32)
        ahead = slice(165, 196)
        match name:
            case "clear" | "none":
                pass
            case "near ahead":
                ranges[ahead] = 0.5
            case "slow ahead":
                ranges[ahead] = 1.0
            case "near behind":
                ranges[:20] = 0.45
            case "blind ahead":
                ranges[ahead] = math.nan
            case "random":
                ranges = np.random.default_rng(7).uniform(0.3, 6.0, 360).astype(np.float32)
            case "all inf":
                ranges[:] = math.inf
            case "short":
                ranges = ranges[:40]
            case _:
                ranges[:] = math.nan
        TEMPLATES[name] = ranges
    return TEMPLATES[name]


SCANS = [
    *["clear"] * 12,
    "none",
    "none",
    "near ahead",
    "slow ahead",
    "near behind",
    "blind ahead",
    "random",
    "all inf",
    "short",
    "all NaN",
]
VELOCITIES: list[Velocity | None] = [
    *[STANDSTILL] * 4,
    *[Velocity(0.5, 0.0)] * 3,
    Velocity(-0.4, 0.0),
    Velocity(0.3, -1.0),
    Velocity(0.0, 1.5),
    Velocity(3.0, -5.0),
    Velocity(1e-300, 0.0),
    Velocity(-0.0, 0.0),
    None,
    Velocity(math.nan, 0.0),
    Velocity(0.1, math.inf),
    Velocity(1e308, 0.0),
]
EVENTS = [
    *["nothing"] * 10,
    "estop",
    "reset",
    "lost teleop",
    "back teleop",
    "flap teleop",
    "killed teleop",
    "lost path",
    "back path",
    "odometry",
    "silent odometry",
    "runaway",
    "spike",
    "bad scan",
    "clock ahead",
    "clock back",
    "new run",
    "stranger",
]

steps_of_life = st.lists(
    st.tuples(
        st.sampled_from([0.02] * 12 + [0.0, 0.1, 0.15, 0.21, 0.5]),
        st.lists(
            st.tuples(st.sampled_from(["teleop", "teleop", "path", "joy"]), st.sampled_from(VELOCITIES)),
            max_size=3,
        ),
        st.sampled_from(SCANS),
        st.sampled_from(EVENTS),
        st.integers(1, 4),  # so often in a row
    ),
    min_size=1,
    max_size=16,
)


@dataclass
class Witness:
    """Which sources may drive, by the inputs alone and not by the law's latches."""

    config: LawConfig
    clean: set[str] = field(default_factory=set[str])
    """Sources with a neutral command after their last cause."""
    alive: dict[str, bool] = field(default_factory=dict[str, bool])
    last: dict[str, tuple[Velocity | None, float]] = field(
        default_factory=dict[str, tuple[Velocity | None, float]]
    )
    """The last command of each, None for an invalid one, and when the last valid one was accepted."""
    estop: bool = False
    now_s: float | None = None
    driver: str | None = None
    blocked: tuple[str, Velocity] | None = None
    """The sources that the barrier stopped, and their commands."""
    odometry_s: float = math.inf
    """Time of the last odometry."""

    def see(self, now_s: float, inputs: Inputs, before: State, decision: Decision) -> None:
        config = self.config
        accepted = {
            s.config.name: s.counts.accepted - b.counts.accepted
            for s, b in zip(decision.sources, before.interlock.sources, strict=True)
        }
        if inputs.odometry is not None:
            self.odometry_s = inputs.odometry.arrival_s
        shared = (
            decision.alarm
            or StopReason.BASE_UNRESPONSIVE in decision.causes
            or now_s - self.odometry_s > config.odom_timeout_s
            or bool(decision.scan_problem)
            or not decision.scan_age_s <= config.lidars[0].timeout_s
            or self.estop
            or inputs.estop
            or (self.now_s is not None and now_s - self.now_s > config.overrun_s)
        )
        self.estop = (self.estop or inputs.estop) and not (
            decision.reset_reply is not None and decision.reset_reply.success
        )
        self.now_s = now_s
        lost = {change.source for change in inputs.liveliness if not change.alive}
        for change in inputs.liveliness:
            self.alive[change.source] = change.alive
        neutral: set[str] = set()
        for command in inputs.commands:
            name, velocity = command.source, command.velocity
            if not _sensible(velocity, config):
                self.last[name] = (None, self.last.get(name, (None, -math.inf))[1])
            elif accepted[name] > 0:
                self.last[name] = (velocity, command.arrival_s)
                if velocity == STANDSTILL:
                    neutral.add(name)
        bad = {
            s.name
            for s in config.sources
            if shared
            or s.name in lost
            or self.alive.get(s.name) is False
            or self.last.get(s.name, (None, 0.0))[0] is None
            or now_s - self.last[s.name][1] > config.command_timeout_s
        }
        self.clean = (self.clean | neutral) - bad
        if self.driver in bad:
            self.clean = set()
        if self.blocked is not None and self.blocked[0] in neutral:
            self.blocked = None

    def judge(self, decision: Decision) -> None:
        if decision.output != STANDSTILL:
            assert decision.owner in self.clean
            assert (decision.owner, decision.commanded) != self.blocked
            self.blocked = None
        elif decision.reasons and set(decision.reasons) <= BARRIER_REASONS and self.blocked is None:
            self.blocked = (decision.owner, decision.commanded)
        elif not decision.reasons and (decision.owner, decision.commanded) != self.blocked:
            self.blocked = None  # it requests another motion
        self.driver = decision.owner if decision.output != STANDSTILL else None


def _sensible(velocity: Velocity | None, config: LawConfig) -> bool:
    return (
        velocity is not None
        and all(map(math.isfinite, velocity))
        and abs(velocity.linear_m_s) <= 10 * config.max_linear_m_s
        and abs(velocity.angular_rad_s) <= 10 * config.max_angular_rad_s
    )


def _check_decision(decision: Decision, config: LawConfig) -> None:
    output, commanded = decision.output, decision.commanded
    assert all(map(math.isfinite, output))
    assert abs(output.linear_m_s) <= min(config.max_linear_m_s, abs(commanded.linear_m_s))
    assert abs(output.angular_rad_s) <= min(config.max_angular_rad_s, abs(commanded.angular_rad_s))
    cross = output.linear_m_s * commanded.angular_rad_s - output.angular_rad_s * commanded.linear_m_s
    assert abs(cross) < 1e-12, "the same arc"
    assert output.linear_m_s * commanded.linear_m_s >= 0.0
    assert output.angular_rad_s * commanded.angular_rad_s >= 0.0
    assert (decision.mode is Mode.STOPPED) == bool(decision.reasons)
    if decision.mode in (Mode.STOPPED, Mode.READY):
        assert output == STANDSTILL
    else:
        assert (decision.mode is Mode.LIMITED) == (decision.scale < 1.0)
        assert (output == STANDSTILL) == (decision.scale == 0.0)
    assert list(decision.reasons) == [reason for reason in StopReason if reason in decision.reasons]
    if output != STANDSTILL:
        owner = _source(decision, decision.owner)
        assert owner.velocity == commanded
        asking = [s for s in decision.sources if s.armed and not s.neutral and s.alive is not False]
        assert owner.config.priority == max(s.config.priority for s in asking)


def _source(decision: Decision, name: str) -> Source:
    return next(source for source in decision.sources if source.config.name == name)


def plain(value: object) -> object:
    """Convert arrays to bytes, so that values can be compared."""
    if isinstance(value, np.ndarray):
        array = cast("npt.NDArray[np.generic]", value)
        return (array.dtype.str, array.shape, array.tobytes())
    if is_dataclass(value) and not isinstance(value, type):
        return tuple(plain(getattr(value, part.name)) for part in fields(value))
    if isinstance(value, tuple):
        return tuple(plain(part) for part in cast("tuple[object, ...]", value))
    if isinstance(value, float) and math.isnan(value):
        return "nan"
    return value


Stamps = Literal["proven", "new", "none"]
"""How the sources stamp their commands: epochs that are proven from the start, epochs that begin, or not at all."""


class Life:
    """The law over time, with every kind of event."""

    def __init__(self, config: LawConfig, stamps: Stamps = "proven") -> None:
        self.config = config
        self.stamps = stamps
        state = proven_state(config) if stamps == "proven" else initial_state(config)
        self.state, self.decision = step(state, 1000.0, Inputs())
        self.now_s = 1000.0
        self.foreseen = 0
        self.witness = Witness(config, now_s=1000.0)
        self.sequence, self.epoch, self.skew_s, self.count = 0, 0, 500.0, 0
        self.has_odometry = False

    def live(
        self, gap_s: float, commands: list[tuple[str, Velocity | None]], scan: str, event: str
    ) -> Decision:
        before_s, self.now_s = self.now_s, self.now_s + gap_s
        self.count += 1
        self.skew_s += {"clock ahead": 30.0, "clock back": -30.0}.get(event, 0.0)
        self.epoch += event == "new run"
        inputs = Inputs(
            commands=tuple(
                self._command(source, velocity, before_s + gap_s * (n + 1) / len(commands))
                for n, (source, velocity) in enumerate(commands)
            ),
            liveliness=_liveliness(event, self.state),
            scans=() if scan == "none" else (self._scan(scan),),
            undecodable_lidars=(0,) if event == "bad scan" else (),
            odometry=self._odometry(event),
            strangers=("ghost",) if event == "stranger" else (),
            estop=event == "estop",
            reset=event == "reset",
        )
        before, state = self.state, self.state
        pure = self.count % 8 == 0
        seen = (plain(before), plain(inputs)) if pure else None
        for heard in (inputs, replace(inputs, scans=())):
            self.foreseen += is_foreseen(before, self.decision, self.now_s, heard)
        self.state, decision = step(state, self.now_s, inputs)
        if pure:
            again, same = step(state, self.now_s, inputs)
            assert plain(again) == plain(self.state), "the same step twice"
            assert plain(same) == plain(decision)
            assert (plain(before), plain(inputs)) == seen, "a step changes nothing that it is given"
        _check_decision(decision, self.config)
        self.witness.see(self.now_s, inputs, before, decision)
        self.witness.judge(decision)
        self.decision = decision
        return decision

    def _command(self, source: str, velocity: Velocity | None, arrival_s: float) -> Command:
        if self.stamps == "proven":
            return on_time(source, velocity, arrival_s)
        sent = None
        if self.stamps == "new" and source != "joy":
            self.sequence += 1
            sent = Sent(f"{source}{self.epoch}".encode(), self.sequence, arrival_s + self.skew_s)
        return Command(source, velocity, arrival_s, sent)

    def _scan(self, name: str) -> LaserScan:
        ranges = _template(name) + np.float32(1e-4 * (self.count % 2))
        ranges.flags.writeable = False
        return LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.05, 12.0, self.now_s)

    def _odometry(self, event: str) -> Odometry | None:
        """Sends at every step from its first message until it becomes silent."""
        odd = {"runaway": Velocity(0.4, 0.2), "spike": Velocity(31.0, 0.0)}
        if event in odd or event == "odometry":
            self.has_odometry = True
        elif event == "silent odometry":
            self.has_odometry = False
        return Odometry(odd.get(event, self.state.base.output), self.now_s) if self.has_odometry else None


def _liveliness(event: str, state: State) -> tuple[Liveliness, ...]:
    match event.split(" "):
        case ["lost", source]:
            return (Liveliness(source, alive=False),)
        case ["back", source]:
            return (Liveliness(source, alive=True),)
        case ["flap", source]:
            return (Liveliness(source, alive=False), Liveliness(source, alive=True))
        case ["killed", source]:  # somebody else holds the token of the source as well
            return (Liveliness(source, alive=False, epoch=_run_of(source, state)),)
        case _:
            return ()


def _run_of(name: str, state: State) -> bytes:
    """Return the epoch of a source's newest commands; empty if they have none."""
    last = next(s.track.last for s in state.interlock.sources if s.config.name == name)
    return b"" if last is None else last.epoch


driven: list[bool] = []
foreseen: list[bool] = []


@examples(3200)
@given(steps=steps_of_life, stamps=st.sampled_from(get_args(Stamps)))
def test_no_life_of_the_robot_breaks_a_promise(
    steps: list[tuple[float, list[tuple[str, Velocity | None]], str, str, int]], stamps: Stamps
) -> None:
    life = Life(CONFIG, stamps)
    for _ in range(1 if stamps == "proven" else 14):  # a source is observed first
        life.live(0.02, [("teleop", STANDSTILL), ("path", STANDSTILL)], "clear", "nothing")
    moved = False
    for gap_s, commands, scan, event, times in steps:
        for n in range(times):
            decision = life.live(gap_s, commands, scan, event if n == 0 else "nothing")
            moved = moved or decision.output != STANDSTILL
    driven.append(moved)
    foreseen.append(life.foreseen > 0)


def test_those_lives_did_drive() -> None:
    """Properties of a robot that never moves prove nothing."""
    if not driven:
        pytest.skip("the lives were not lived in this run")
    assert sum(driven) > 0.2 * len(driven)
    assert sum(foreseen) > 0.05 * len(foreseen), "each certificate was compared with its step"


@examples(600)
@given(hull=hulls(), mount=mounts(), steps=steps_of_life)
def test_no_hull_and_no_mount_breaks_a_promise(
    hull: Hull, mount: Mount, steps: list[tuple[float, list[tuple[str, Velocity | None]], str, str, int]]
) -> None:
    life = Life(with_lidar(replace(CONFIG, hull=hull), mount=mount))
    for gap_s, commands, scan, event, _ in steps:
        life.live(gap_s, commands, scan, event)


# --- the closed loop


@pytest.mark.parametrize("block", range(4))
def test_straight_or_on_the_spot_the_hull_comes_no_closer_than_29_cm_by_its_own_motion(block: int) -> None:
    outcomes = [drive_about(seed, arcs=False) for seed in range(block * 30, block * 30 + 30)]
    for outcome in outcomes:
        assert outcome.closest_m > min(0.29, outcome.start_m - 0.01), outcome
    _tell(outcomes)


@pytest.mark.parametrize("block", range(2))
def test_on_arcs_that_change_at_any_moment_it_comes_no_closer_either(block: int) -> None:
    """Found by these drives: on an arc the closing speed grows while the hull turns; 0.18 m was the worst."""
    seeds = [286, 329, 375, 1035, *range(block * 40, block * 40 + 40)]
    outcomes = [drive_about(seed) for seed in seeds]
    for outcome in outcomes:
        assert outcome.closest_m > min(0.29, outcome.start_m - 0.01), outcome
    _tell(outcomes)


def _tell(outcomes: list[Outcome]) -> None:
    closest_m = min(outcome.closest_m for outcome in outcomes if outcome.start_m > 0.3)
    way_m, stops = sum(outcome.way_m for outcome in outcomes), sum(outcome.stops for outcome in outcomes)
    print(f"\n    {len(outcomes)} runs: closest {closest_m:.4f} m, {way_m:.0f} m driven, {stops} stops")
    assert way_m > 20.0
    assert stops > 20
