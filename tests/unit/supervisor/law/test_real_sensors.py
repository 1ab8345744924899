"""Faults of real sensors, in closed loop: dirt, dropouts, a frozen or short-sighted lidar, dust, two writers.

Each of these caused a contact or a small clearance when the law used sectors and shares of beams instead of seen
space.
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from _pytest.mark.structures import ParameterSet

from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Command, Inputs, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from tests.scenes import law
from tests.scenes.base import MixtureBase
from tests.scenes.operators import Reverser, Scripted, Stubborn
from tests.scenes.run import TICK_S, Moment, Outcome, Report, advance, run
from tests.scenes.scene import BOUND_M, TRUSTED_M_S2, BaseNumbers, Profile, rectangle
from tests.scenes.sensing import Eye, Ranges
from tests.scenes.simple import LIDAR, plain_scene
from tests.scenes.world import Measure
from wire.freshness import Sent
from wire.reasons import StopReason

PILLAR_M = 0.05
"""Its radius."""

HULL_M = 0.25
"""The default robot's."""


def proved(*values: object) -> ParameterSet:
    """Values between those that are tried after each change: they are tried with the proofs."""
    return pytest.param(*values, marks=pytest.mark.proof)


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0])
@pytest.mark.parametrize("half_rad", [0.085, 0.12])
def test_a_pillar_inside_dirt_straight_ahead_is_not_hit(half_rad: float, speed_m_s: float) -> None:
    dirty = replace(LIDAR, holes_rad=((-half_rad, half_rad),))
    scene = plain_scene((2.0, 0.0, PILLAR_M), lidars=(dirty,))
    outcome = run(scene, operator=Scripted(Velocity(speed_m_s, 0.0)), stuck_s=math.inf)
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize("speed_m_s", [0.5, 1.0])
def test_a_pillar_behind_which_dirt_appears_during_the_drive_is_not_hit(speed_m_s: float) -> None:
    def dirt(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        angle = LIDAR.angle_min + LIDAR.angle_increment * np.arange(len(ranges))
        return np.where((np.abs(angle) < 0.12) & (at_s > 1.0), np.float32(math.nan), ranges)

    scene = plain_scene((2.0, 0.0, PILLAR_M))
    outcome = run(scene, operator=Scripted(Velocity(speed_m_s, 0.0)), spoil=dirt, stuck_s=math.inf)
    assert outcome.travelled_m > 0.3
    assert outcome.closest_m >= BOUND_M


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize("profile", ["neato_xv", "rep117"])
@pytest.mark.parametrize("share", [0.02, 0.1])
def test_an_object_that_is_missing_from_some_scans_is_not_hit(share: float, profile: Profile) -> None:
    outcomes = [_drive_at_what_drops_out(seed, share, profile) for seed in range(20)]
    assert min(outcome.travelled_m for outcome in outcomes) > 0.2
    assert min(outcome.closest_m for outcome in outcomes) >= BOUND_M


def _drive_at_what_drops_out(seed: int, share: float, profile: Profile) -> Outcome:
    """30 s at 5.5 Hz; each scan misses the object at random."""
    rng = np.random.default_rng(seed)
    nothing = np.float32(math.inf if profile == "rep117" else 0.0)

    def drop(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        return np.where((ranges < 2.0) & (rng.random() < share), nothing, ranges)

    slow = replace(LIDAR, profile=profile, rate_hz=5.5, phase_s=float(rng.uniform(0.0, 0.18)), noise_m=0.002)
    scene = plain_scene((1.0, 0.0, 0.1), lidars=(slow,), duration_s=30.0, seed=seed)
    return run(scene, operator=Scripted(Velocity(0.5, 0.0)), spoil=drop, stuck_s=math.inf)


def _silent_from_the_start(now_s: float, twist: Velocity) -> Velocity | None:
    return None


def _falls_silent(now_s: float, twist: Velocity) -> Velocity | None:
    return None if now_s > 1.5 else twist


def _stuck_at_zero(now_s: float, twist: Velocity) -> Velocity | None:
    return STANDSTILL


def _gets_stuck_at_zero(now_s: float, twist: Velocity) -> Velocity | None:
    return STANDSTILL if now_s > 1.5 else twist


@pytest.mark.parametrize(
    "report", [_silent_from_the_start, _falls_silent, _stuck_at_zero, _gets_stuck_at_zero]
)
def test_a_frozen_lidar_stops_the_robot_without_the_help_of_odometry(report: Report) -> None:
    kept: list[Ranges] = []

    def freeze(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        if at_s < 1.5 or not kept:
            kept[:] = [ranges]
        return kept[0]

    noisy = replace(LIDAR, noise_m=0.002)
    moments: list[Moment] = []
    outcome = run(
        plain_scene((3.0, 0.0, PILLAR_M), lidars=(noisy,)),
        operator=Scripted(Velocity(0.8, 0.0)),
        spoil=freeze,
        report=report,
        watch=moments.append,
        stuck_s=math.inf,
    )
    assert outcome.closest_m >= BOUND_M
    since_s = next(m.now_s for m in moments if m.now_s > 1.5 and m.decision.reasons)
    assert since_s < 2.1
    assert moments[-1].twist == STANDSTILL


@pytest.mark.parametrize("rate_hz", [5.0, proved(10.0), 20.0])
@pytest.mark.parametrize("left_m", [0.5, proved(0.6), proved(0.7), 0.8])
def test_a_lidar_that_freezes_near_a_pillar_does_not_make_it_seem_far(left_m: float, rate_hz: float) -> None:
    """Each repeated scan once counted as a new one, until the third proved the lidar frozen."""
    kept: list[Ranges] = []

    def freeze(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        if not kept or kept[0][180] > left_m + HULL_M:
            kept[:] = [ranges]
        return kept[0]

    noisy = replace(LIDAR, noise_m=0.002, rate_hz=rate_hz)
    scene = plain_scene((3.0, 0.0, 0.1), lidars=(noisy,))
    outcome = run(scene, operator=Scripted(Velocity(1.0, 0.0)), spoil=freeze, stuck_s=math.inf)
    assert outcome.travelled_m > 1.5
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize("range_min", [0.3, proved(0.35), proved(0.45), 0.8])
def test_what_is_too_near_to_be_measured_is_not_taken_to_be_as_far_as_can_be_measured(
    range_min: float,
) -> None:
    """The lidar is on the hull's front edge: nearer than `range_min` to it is well outside of the hull."""
    front = replace(LIDAR, x_m=0.25, range_min=range_min)
    scene = plain_scene(
        (2.0, 0.0, PILLAR_M), hull=rectangle(0.25, 0.25, 0.2), lidars=(front,), duration_s=12.0
    )
    outcome = run(scene, operator=Scripted(Velocity(1.0, 0.0)), stuck_s=math.inf)
    assert outcome.travelled_m > 0.5
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize(
    ("rate_hz", "late_s", "profile"),
    [
        proved(20.0, 0.1, "rep117"),
        (20.0, 0.18, "rep117"),
        proved(10.0, 0.1, "rplidar"),
        (5.5, 0.2, "rplidar"),
    ],
)
@pytest.mark.parametrize("wanted", [Velocity(1.0, 0.0), Velocity(1.0, 0.6), "reversing"])
def test_a_scan_that_was_long_on_its_way_shows_where_things_were_when_it_was_taken(
    rate_hz: float, late_s: float, profile: Profile, wanted: Velocity | Literal["reversing"]
) -> None:
    """It was once placed where the robot was at its arrival."""
    late = replace(LIDAR, rate_hz=rate_hz, late_s=late_s, profile=profile)
    base = BaseNumbers("axis", acceleration_m_s2=2.0, braking_m_s2=TRUSTED_M_S2)
    pillars = ((2.0, 0.0, 0.05), (0.7, 0.9, 0.05), (0.7, -0.9, 0.05), (-1.1, 0.3, 0.05), (-0.6, -0.9, 0.05))
    scene = plain_scene(*pillars, hull=rectangle(0.4, 0.4, 0.2), base=base, lidars=(late,), duration_s=10.0)
    operator = Reverser(np.random.default_rng(1)) if wanted == "reversing" else Scripted(wanted, from_s=1.5)
    outcome = run(scene, operator=operator, stuck_s=math.inf)
    assert outcome.travelled_m > 0.3
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize(
    "noise", [Velocity(0.0, 0.003), Velocity(1e-3, 0.0), Velocity(-1e-3, 0.0)], ids=["gyro", "ahead", "back"]
)
def test_a_lidar_without_noise_is_believed_after_a_long_rest_whatever_the_noise_of_odometry(
    noise: Velocity,
) -> None:
    """The noise once added up to a distance, so identical scans looked frozen: the robot never drove again."""

    def report(now_s: float, twist: Velocity) -> Velocity:
        return Velocity(twist.linear_m_s + noise.linear_m_s, twist.angular_rad_s + noise.angular_rad_s)

    scene = plain_scene((3.0, 0.0, PILLAR_M), duration_s=33.0)
    outcome = run(scene, operator=Scripted(Velocity(0.5, 0.0), from_s=30.0), report=report, stuck_s=math.inf)
    assert outcome.travelled_m > 1.0
    assert set(outcome.stops) <= {"NO_COMMAND", "SCAN_STALE"}


@pytest.mark.parametrize(("gap_m", "duration_s"), [(0.302, 30.0), proved(0.31, 60.0)])
def test_a_command_of_a_millimetre_per_second_does_not_creep_up_to_a_pillar(
    gap_m: float, duration_s: float
) -> None:
    scene = plain_scene((HULL_M + gap_m + PILLAR_M, 0.0, PILLAR_M), duration_s=duration_s)
    outcome = run(scene, operator=Scripted(Velocity(0.001, 0.0)), stuck_s=math.inf)
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize("rate_hz", [5.5, 20.0])
@pytest.mark.parametrize("first", ["of too few beams", "blank"])
def test_a_scan_that_proves_nothing_does_not_make_the_law_forget_a_pillar(first: str, rate_hz: float) -> None:
    """The robot stands before it; one useless scan, five without the pillar; the operator drives on."""
    since: list[float] = []

    def spoil(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        if at_s < 5.0:
            return ranges
        since.append(at_s)
        if len(since) == 1:
            return ranges[:10] if first == "of too few beams" else np.full_like(ranges, math.inf)
        missing = len(since) <= 6
        return np.where((ranges < 1.2) & missing, np.float32(math.inf), ranges)

    scene = plain_scene(
        (1.2, 0.0, PILLAR_M), lidars=(replace(LIDAR, noise_m=0.002, rate_hz=rate_hz),), duration_s=9.0
    )
    outcome = run(scene, operator=Scripted(Velocity(1.0, 0.0)), spoil=spoil, stuck_s=math.inf)
    assert outcome.travelled_m > 0.4
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize("range_max", [0.6, 0.7])
def test_a_robot_drives_only_as_fast_as_its_lidar_sees_far(range_max: float) -> None:
    short = replace(LIDAR, range_max=range_max)
    # It passes a row of posts, so that there is always a return.
    posts = [(0.2 * number - 0.6, 0.6, 0.03) for number in range(12)]
    scene = plain_scene((2.0, 0.0, PILLAR_M), *posts, lidars=(short,), duration_s=8.0)
    outcome = run(scene, operator=Scripted(Velocity(1.0, 0.0)), stuck_s=math.inf)
    assert outcome.travelled_m > 0.5
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize(
    ("kind", "seed"), [("axis", 2), proved("axis", 7), ("axis", 17), ("mixture", 0), proved("mixture", 1)]
)
def test_a_command_that_reverses_while_the_base_still_moves_brings_nothing_nearer(
    kind: Literal["axis", "mixture"], seed: int
) -> None:
    """A hull of 0.8 m x 0.4 m whose base brakes exactly as it is trusted to. Seed 17 once raised ValueError."""
    base = BaseNumbers(kind, acceleration_m_s2=2.0, braking_m_s2=TRUSTED_M_S2)
    pillars = ((1.1, 0.0, 0.05), (0.7, 0.9, 0.05), (0.7, -0.9, 0.05), (-1.1, 0.3, 0.05), (-0.6, -0.9, 0.05))
    scene = plain_scene(*pillars, hull=rectangle(0.4, 0.4, 0.2), base=base, duration_s=8.0, seed=seed)
    outcome = run(scene, operator=Reverser(np.random.default_rng(seed)), stuck_s=math.inf)
    assert outcome.travelled_m > 0.3
    assert outcome.closest_m >= BOUND_M


@pytest.mark.parametrize("every", [0, 2])
@pytest.mark.parametrize("seed", [100, proved(114), proved(1013), proved(1019), 1033])
def test_reversing_with_odometry_that_is_stuck_at_zero_brings_nothing_nearer(seed: int, every: int) -> None:
    """Every second odometry sample may be true, because two programs publish it."""
    count = [0]

    def stuck(now_s: float, twist: Velocity) -> Velocity:
        count[0] += 1
        return twist if every and count[0] % every == 0 else STANDSTILL

    base = BaseNumbers("axis", acceleration_m_s2=2.0, braking_m_s2=TRUSTED_M_S2)
    pillars = ((1.1, 0.0, 0.05), (0.7, 0.9, 0.05), (0.7, -0.9, 0.05), (-1.1, 0.3, 0.05), (-0.6, -0.9, 0.05))
    scene = plain_scene(*pillars, hull=rectangle(0.4, 0.4, 0.2), base=base, duration_s=8.0, seed=seed)
    outcome = run(scene, operator=Reverser(np.random.default_rng(seed)), report=stuck)
    assert outcome.travelled_m > 0.3
    assert outcome.closest_m >= BOUND_M


def test_one_stray_beam_acts_at_once_but_needs_no_operator() -> None:
    """Dust on one beam of one scan, 15 cm ahead of the hull; the operator never sends neutral."""

    def dust(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        return np.where(np.arange(360) == 180, np.float32(0.4), ranges) if _in_dust(at_s) else ranges

    moments: list[Moment] = []
    run(plain_scene(), operator=Stubborn(Velocity(0.3, 0.0)), spoil=dust, watch=moments.append)
    dusty = next(m for m in moments if any(_in_dust(at_s) for _, at_s, _ in m.scans))
    before = [m for m in moments if 1.5 < m.now_s < dusty.now_s]
    after = [m for m in moments if dusty.now_s + 0.5 < m.now_s < dusty.now_s + 1.5]
    assert {m.decision.mode for m in before} == {Mode.DRIVING}
    assert dusty.decision.output == STANDSTILL
    assert {m.decision.mode for m in after} == {Mode.DRIVING}


def _in_dust(at_s: float) -> bool:
    return 2.0 <= at_s < 2.05


def test_a_lidar_on_which_nothing_ever_returns_moves_nothing() -> None:
    def cover(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
        return np.full(len(ranges), math.inf, dtype=np.float32)

    moments: list[Moment] = []
    outcome = run(
        plain_scene((1.5, 0.0, PILLAR_M)),
        operator=Scripted(Velocity(0.4, 0.0)),
        spoil=cover,
        watch=moments.append,
        stuck_s=math.inf,
    )
    assert outcome.travelled_m == 0.0
    assert all(StopReason.SCAN_INVALID in m.decision.reasons for m in moments if m.now_s > 0.5)


class _TwoWriters:
    """A real lidar, and from 1 s on a second writer on its key, by whose scans there is no pillar."""

    SECOND_S = (1.0, 4.0)
    PAUSE_S = (2.0, 2.6)

    def __init__(self, wanted: Velocity, *, lets_go: bool) -> None:
        self._wanted, self._lets_go = wanted, lets_go
        self._scene = plain_scene((1.6, 0.0, PILLAR_M))
        self._empty = plain_scene()
        self._eyes = {
            b"real": (self._scene.world, Eye(LIDAR, len(self._scene.world), [0])),
            b"second": (self._empty.world, Eye(LIDAR, len(self._empty.world), [1])),
        }
        self._sequence = 0
        self.decisions: list[tuple[float, Decision]] = []
        self.closest_m = self._scene.start_m
        self.pose = Pose(0.0, 0.0, 0.0)

    def run(self, duration_s: float) -> None:
        """At 50 Hz; each writer's scan comes every 50 ms, the second one's 20 ms after the real one's."""
        base, measure = MixtureBase(1.0, TRUSTED_M_S2, self._scene.hull.radius_m), Measure(self._scene.hull)
        state, decision = step(initial_state(law.config_of(self._scene)), 0.0, Inputs())
        command = STANDSTILL
        for tick in range(1, round(duration_s / TICK_S) + 1):
            now_s = tick * TICK_S
            twist = base.step(command, TICK_S)
            self.pose = advance(self.pose, twist, TICK_S)
            clearances = measure.clearances_m(self._scene.world, *self.pose)
            self.closest_m = min(self.closest_m, float(clearances.min()))
            asked = STANDSTILL if now_s < 0.3 or (self._lets_go and decision.reasons) else self._wanted
            command = decision.output
            inputs = Inputs(
                commands=(Command("teleop", asked, now_s),),
                scans=tuple(self._scan(who, now_s) for who in self._speaking(tick, now_s)),
                odometry=Odometry(twist, now_s),
            )
            state, decision = step(state, now_s, inputs)
            self.decisions.append((now_s, decision))

    def between(self, start_s: float, end_s: float) -> list[Decision]:
        return [decision for now_s, decision in self.decisions if start_s < now_s < end_s]

    def _speaking(self, tick: int, now_s: float) -> list[bytes]:
        real = tick % 5 in (0, 2) and not self.PAUSE_S[0] <= now_s < self.PAUSE_S[1]
        second = tick % 5 in (1, 3) and self.SECOND_S[0] <= now_s < self.SECOND_S[1]
        return [b"real"] * real + [b"second"] * second

    def _scan(self, who: bytes, now_s: float) -> LaserScan:
        world, eye = self._eyes[who]
        self._sequence += 1
        sent = Sent(who, self._sequence, now_s)
        ranges = eye.scan(world, *self.pose)
        return LaserScan(ranges, LIDAR.angle_min, LIDAR.angle_increment, 0.02, 12.0, now_s, sent, writer=who)


@pytest.mark.parametrize("lets_go", [False, True])
def test_a_second_writer_on_a_lidars_key_stops_the_robot_and_displaces_nobody(*, lets_go: bool) -> None:
    """The real writer pauses for 0.6 s meanwhile, and is heard again, with or without an operator who re-arms."""
    writers = _TwoWriters(Velocity(0.5, 0.0), lets_go=lets_go)
    writers.run(8.0)
    assert writers.closest_m >= BOUND_M
    for start_s, end_s in ((1.3, 2.0), (2.9, 4.0)):
        for decision in writers.between(start_s, end_s):
            assert decision.output == STANDSTILL
            assert StopReason.SENSOR_CONFLICT in decision.causes
    # The operator who re-arms has driven up to the pillar by the real lidar alone.
    assert writers.between(7.0, 8.0)[-1].nearest_m < (0.35 if lets_go else 1.3)
    assert (writers.pose.x_m > 0.9) is lets_go
