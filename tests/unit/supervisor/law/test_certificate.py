"""A certificate foresees a step: what it covers, where it ends, and that the step decides the same."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.certificate import ROUNDING, Certificate, certify, foreseen
from supervisor.law.decision import Decision
from supervisor.law.estop_stations import Presence, TokenEnd
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness, Odometry, SourceConfig
from supervisor.law.permission import barriers
from supervisor.law.reach import reach_m
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import step
from supervisor.law.state import State
from tests.unit.supervisor.law.closed_loop import drive_about
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    BACK,
    CONFIG,
    FORWARD,
    NEUTRAL,
    SPIN,
    TICK_S,
    Law,
    is_foreseen,
    laser_scan,
    on_time,
    ring,
)
from tests.unit.supervisor.law.smt import decided, reals

WHEEL = b"wheel"
FREE_M = 8.0


def driving(config: LawConfig = CONFIG, velocity: Velocity = FORWARD, *, room_m: float = FREE_M) -> Law:
    """A robot whose base has reached its command, with odometry at every tick."""
    law = Law(config, room_m=room_m)
    law.tick(("teleop", NEUTRAL), **heard(law, STANDSTILL))
    for _ in range(50):
        law.tick(("teleop", velocity), **heard(law, velocity))
    return law


def heard(law: Law, velocity: Velocity) -> dict[str, object]:
    """Odometry that arrives at the next tick."""
    return {
        "odometry": Odometry(velocity, law.now_s + TICK_S, WHEEL),
        "odometry_writers": (WHEEL,),
    }


def certificate(law: Law) -> Certificate:
    found = certify(law.state, law.decision)
    assert found is not None
    return found


def command(
    law: Law, velocity: Velocity | None = SPIN, source: str = "teleop", after_s: float = 0.01
) -> Inputs:
    return Inputs((on_time(source, velocity, law.now_s + after_s),))


def foresees(law: Law, inputs: Inputs, after_s: float = 0.01) -> bool:
    return is_foreseen(law.state, law.decision, law.now_s + after_s, inputs)


@pytest.mark.parametrize("velocity", [FORWARD, BACK, SPIN, Velocity(1.0, 0.0), Velocity(9.0, -9.0), NEUTRAL])
def test_any_command_of_the_owner_passes_on_a_free_path(velocity: Velocity) -> None:
    law = driving()
    assert foresees(law, command(law, velocity))


def test_a_tick_without_a_command_repeats_the_last_one() -> None:
    law = driving()
    assert foreseen(certificate(law), law.now_s + 0.02, Inputs()) == FORWARD
    assert foresees(law, Inputs(), 0.02)


def test_of_several_commands_the_last_one_passes() -> None:
    law = driving()
    commands = tuple(on_time("teleop", v, law.now_s + 0.001 * n) for n, v in enumerate((BACK, NEUTRAL, SPIN)))
    inputs = Inputs(commands)
    assert foreseen(certificate(law), law.now_s + 0.01, inputs) == SPIN
    assert foresees(law, inputs)


def test_names_of_unknown_sources_and_a_challenge_change_nothing() -> None:
    law = driving()
    assert foresees(law, replace(command(law), strangers=("ghost",), station_challenge=7))


def test_until_the_mounting_is_confirmed_each_command_waits_for_the_step() -> None:
    law = driving(replace(CONFIG, unconfirmed_m_s=9.0))
    assert certify(law.state, law.decision) is None
    (lidar,) = law.state.sight.lidars
    confirmed = lidar._replace(agreement=lidar.agreement._replace(not_ruled_out=frozenset()))
    state = law.state._replace(sight=law.state.sight._replace(lidars=(confirmed,)))
    assert certify(state, law.decision) is not None


OUTSIDE = Inputs(
    liveliness=(Liveliness("teleop", alive=True),),
    scans=(laser_scan(ring(), 0.0),),
    undecodable_lidars=(0,),
    odometry_writers=(b"another",),
    estop=True,
    estop_unrecorded=True,
    presences=(Presence("desk", 0, 0, stop=False, leaves=False),),
    station_ends=(TokenEnd("desk"),),
    reset=True,
    suspended_s=1e-9,
)
INSIDE = {"commands", "odometry", "strangers", "station_challenge"}


@pytest.mark.parametrize("name", [part.name for part in fields(Inputs) if part.name not in INSIDE])
def test_every_other_input_waits_for_the_step(name: str) -> None:
    law = driving()
    value = getattr(OUTSIDE, name)
    assert value != getattr(Inputs(), name)
    assert not foresees(law, replace(command(law), **{name: value}))


@pytest.mark.parametrize("velocity", [None, Velocity(math.nan, 0.0), Velocity(100.0, 0.0)])
def test_an_invalid_command_waits_for_the_step_even_if_a_valid_one_follows(velocity: Velocity | None) -> None:
    law = driving()
    assert not foresees(law, command(law, velocity))
    assert not foresees(law, Inputs((*command(law, velocity).commands, *command(law).commands)))


def test_a_command_of_another_source_waits_for_the_step() -> None:
    law = driving()
    assert not foresees(law, command(law, NEUTRAL, "path"))
    assert not foresees(law, Inputs((*command(law).commands, *command(law, NEUTRAL, "path").commands)))


def test_a_command_of_another_epoch_waits_for_the_step() -> None:
    law = driving()
    assert not foresees(law, Inputs((law.stamped(SPIN, sent_s=law.now_s + 0.01, epoch=b"other"),)))


def test_a_replayed_command_waits_for_the_step() -> None:
    law = driving()
    inputs = command(law)
    law.tick(("teleop", FORWARD), **heard(law, FORWARD))
    assert not foresees(law, inputs)


def test_a_command_without_a_stamp_waits_while_its_source_stamps() -> None:
    law = driving()
    assert not foresees(law, Inputs((Command("teleop", SPIN, law.now_s + 0.01),)))


# --- what the last step must have decided


def test_there_is_none_while_the_robot_stands() -> None:
    law = Law(CONFIG)
    assert certify(law.state, law.decision) is None
    law.tick(("teleop", NEUTRAL))
    assert law.decision.reasons == ()
    assert certify(law.state, law.decision) is None


def test_there_is_none_while_a_cause_holds_that_does_not_stop_the_robot() -> None:
    law = driving(room_m=3.0)
    law.ranges = ring(3.0)
    law.ranges[180] = 0.5  # a single reading, which nothing confirms
    law.tick(("teleop", FORWARD), **heard(law, FORWARD))
    assert (law.decision.reasons, len(law.decision.causes)) == ((), 1)
    assert certify(law.state, law.decision) is None


@pytest.mark.parametrize(("velocity", "free"), [(FORWARD, False), (NEUTRAL, True)])
def test_there_is_none_while_another_live_source_requests_motion(velocity: Velocity, *, free: bool) -> None:
    law = driving(replace(CONFIG, sources=(SourceConfig("teleop", 2), SourceConfig("path", 1))))
    law.tick(("teleop", FORWARD), ("path", velocity), **heard(law, FORWARD))
    assert (certify(law.state, law.decision) is not None) == free


def test_a_source_that_fell_silent_while_it_requested_motion_is_no_rival() -> None:
    law = driving(replace(CONFIG, sources=(SourceConfig("teleop", 2), SourceConfig("path", 1))))
    law.tick(("path", FORWARD), ("teleop", FORWARD), **heard(law, FORWARD))
    for _ in range(12):
        law.tick(("teleop", FORWARD), **heard(law, FORWARD))
    assert law.decision.owner == "teleop"
    assert foresees(law, command(law))


def test_there_is_none_while_another_writer_of_odometry_is_active_once_the_owner_is_heard() -> None:
    law = driving()
    other = {"odometry": Odometry(FORWARD, law.now_s + TICK_S, b"other"), "odometry_writers": (b"other",)}
    law.tick(("teleop", FORWARD), **other)
    assert law.decision.causes == ()
    assert (
        certify(law.state, law.decision) is None
    )  # the first one is active, and the next sample may be of either


def test_a_writer_of_odometry_that_fell_silent_is_no_rival() -> None:
    law = driving()
    for _ in range(40):
        other = {"odometry": Odometry(FORWARD, law.now_s + TICK_S, b"new"), "odometry_writers": (b"new",)}
        law.tick(("teleop", NEUTRAL if law.decision.reasons else FORWARD), **other)
    law.tick(("teleop", FORWARD))
    assert certificate(law).odometry_writers == (b"new",)


def test_there_is_none_on_silence_that_only_the_open_explains() -> None:
    law = Law(replace(ANY_AGE, works_in_the_open=True), room_m=math.inf)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.hold(0.1, ("teleop", Velocity(0.2, 0.0)))
    assert (law.decision.scale, law.decision.causes) == (1.0, ())
    assert certify(law.state, law.decision) is None


# --- deadlines


def first_deadline(law: Law, **changes: float) -> float:
    """The deadline after the last step [s], with other values of the configuration."""
    state = law.state._replace(config=replace(law.config, **changes))  # type: ignore[arg-type]
    found = certify(state, law.decision)
    assert found is not None
    return found.until_s + ROUNDING - law.now_s


FAR = {"overrun_s": 50.0, "odom_timeout_s": 50.0}


def test_it_ends_when_the_scan_times_out() -> None:
    law = driving()
    law.scanning = False
    law.tick(("teleop", FORWARD), **heard(law, FORWARD))
    assert first_deadline(law, **FAR) == pytest.approx(law.config.lidars[0].timeout_s - TICK_S)


def test_it_ends_when_the_law_has_not_run_for_too_long() -> None:
    assert first_deadline(driving(), overrun_s=0.05, odom_timeout_s=50.0) == pytest.approx(0.05)


def test_it_ends_when_odometry_times_out() -> None:
    law = driving()
    law.tick(("teleop", FORWARD))
    assert first_deadline(law, overrun_s=50.0, odom_timeout_s=0.05) == pytest.approx(0.03)


def test_without_odometry_it_ends_as_if_odometry_had_just_been_heard() -> None:
    law = Law(CONFIG, room_m=FREE_M)
    law.drive()
    assert first_deadline(law, overrun_s=50.0, odom_timeout_s=0.05) == pytest.approx(0.05)


def test_it_ends_when_the_base_has_lagged_for_too_long() -> None:
    law = driving()
    for _ in range(12):
        law.tick(("teleop", FORWARD), **heard(law, STANDSTILL))
    since_s = law.state.base.following.since_s
    assert since_s is not None
    lidars = tuple(replace(lidar, timeout_s=50.0) for lidar in law.config.lidars)
    config = replace(law.config, lidars=lidars, base_dead_time_s=0.1, overrun_s=50.0, odom_timeout_s=50.0)
    found = certify(law.state._replace(config=config), law.decision)
    assert found is not None
    assert found.until_s + ROUNDING == pytest.approx(since_s + PATIENCE_S + 0.1)


def test_it_holds_up_to_its_deadline_and_no_later() -> None:
    law = driving(ANY_AGE)
    found = certificate(law)
    assert foreseen(found, found.until_s, Inputs()) == FORWARD
    assert is_foreseen(law.state, law.decision, found.until_s, Inputs())
    assert foreseen(found, math.nextafter(found.until_s, math.inf), Inputs()) is None


def test_a_command_ages_until_its_timeout() -> None:
    law = driving(replace(ANY_AGE, overrun_s=50.0, odom_timeout_s=50.0))
    found, timeout_s = certificate(law), CONFIG.command_timeout_s
    owner = found.owner._replace(sent_s=1000.0)
    found = found._replace(owner=owner, until_s=math.inf, free_m=math.inf)
    assert foreseen(found, 1000.0 + timeout_s - 1e-9, Inputs()) == FORWARD
    assert foreseen(found, 1000.0 + timeout_s + 1e-9, Inputs()) is None


def test_a_command_that_its_age_reduces_waits_for_the_step() -> None:
    law = driving()
    fast = Velocity(1.0, 0.0)
    inputs = Inputs((on_time("teleop", fast, law.now_s + 0.001),))
    now_s = next(
        law.now_s + 0.001 * n
        for n in range(1, 200)
        if step(law.state, law.now_s + 0.001 * n, inputs)[1].scale < 1.0
    )
    assert is_foreseen(law.state, law.decision, now_s - 0.001, inputs)
    assert foreseen(certificate(law), now_s, inputs) is None


@pytest.mark.parametrize(("speed_m_s", "free"), [(0.3, True), (0.301, False)])
def test_a_command_above_the_speed_of_an_unmeasured_base_waits_for_the_step(
    speed_m_s: float, *, free: bool
) -> None:
    law = driving(replace(CONFIG, unmeasured_m_s=0.3), Velocity(0.2, 0.0))
    assert foresees(law, command(law, Velocity(speed_m_s, 0.0))) == free


# --- distance


def needed_m(found: Certificate, config: LawConfig, fastest_m_s: float, now_s: float) -> float:
    bounds = barriers(config, now_s - found.taken_s, now_s - found.period_before_s, fastest_m_s)
    reach = max(reach_m(fastest_m_s, bound) for bound in bounds)
    return reach + fastest_m_s * (now_s - found.odometer.at_s) + ROUNDING


CASES: dict[str, tuple[Velocity, Velocity | None, float]] = {
    "a slow command counts as the last output": (Velocity(0.1, 0.0), None, 0.5),
    "a fast one counts": (Velocity(-0.9, 0.0), None, 0.9),
    "each axis counts": (Velocity(0.0, 1.0), None, 0.5 + 0.25),
    "odometry counts": (FORWARD, Velocity(-0.7, 0.4), 0.7 + 0.4 * 0.25),
}


@pytest.mark.parametrize(("wanted", "measured", "fastest_m_s"), CASES.values(), ids=CASES)
def test_it_needs_the_reach_of_the_barrier_and_the_way_since_odometry(
    wanted: Velocity, measured: Velocity | None, fastest_m_s: float
) -> None:
    law = driving()
    now_s, inputs = law.now_s + 0.01, command(law, wanted)
    if measured is not None:
        inputs = replace(inputs, odometry=Odometry(measured, law.now_s, WHEEL), odometry_writers=(WHEEL,))
    found = certificate(law)
    enough_m = needed_m(found, law.config, fastest_m_s, now_s)
    assert foreseen(found._replace(free_m=enough_m), now_s, inputs) == wanted
    assert foreseen(found._replace(free_m=enough_m - 1e-12), now_s, inputs) is None


def test_a_base_that_gets_no_further_command_may_need_more() -> None:
    law = driving(replace(CONFIG, base_timeout_s=2.0))
    found, now_s = certificate(law), law.now_s + 0.01
    enough_m = needed_m(found, law.config, 0.5, now_s)
    assert enough_m > 0.05 + 0.5 * 2.0
    assert foreseen(found._replace(free_m=enough_m - 1e-9), now_s, Inputs()) is None


def test_a_zero_command_needs_no_distance() -> None:
    law = driving()
    assert (
        foreseen(certificate(law)._replace(free_m=-1.0), law.now_s + 0.01, command(law, NEUTRAL)) == NEUTRAL
    )


def test_odometry_from_before_the_last_sample_waits_for_the_step() -> None:
    law = driving()
    for arrival_s, free in ((law.now_s, True), (math.nextafter(law.now_s, 0.0), False)):
        inputs = replace(
            command(law), odometry=Odometry(FORWARD, arrival_s, WHEEL), odometry_writers=(WHEEL,)
        )
        assert foresees(law, inputs) == free


@pytest.mark.parametrize("turn_rad_s", [0.0, 0.5, -0.5])
def test_the_free_distance_is_that_of_the_nearest_point_less_the_way_since_the_scan(
    turn_rad_s: float,
) -> None:
    velocity = Velocity(0.3, turn_rad_s)
    law = driving(velocity=velocity, room_m=1.6)
    clearance_m = law.decision.nearest_m
    law.scanning = False
    for _ in range(3):
        law.tick(("teleop", velocity), **heard(law, velocity))
    turned_m = abs(turn_rad_s) * law.config.hull.radius_m
    # Along the chords of the arc, which are shorter than it by less than 0.1 mm.
    assert certificate(law).free_m == pytest.approx(clearance_m - 0.06 * (0.3 + turned_m), abs=2e-4)


def test_it_holds_in_a_room_that_is_a_little_larger_than_the_reach_of_the_barrier() -> None:
    for room_m, free in ((0.8, True), (0.6, False)):
        law = driving(velocity=SPIN, room_m=room_m)
        assert law.decision.causes == ()
        assert foresees(law, command(law, Velocity(0.3, 0.0))) == free


def test_the_way_since_the_scan_is_straight_and_in_any_direction() -> None:
    law = driving(velocity=SPIN, room_m=1.6)
    pose = law.state.base.odometer.pose
    pose = pose._replace(x_m=pose.x_m + 0.3, y_m=pose.y_m - 0.4)
    base = law.state.base._replace(odometer=law.state.base.odometer._replace(pose=pose))
    found = certify(law.state._replace(base=base), law.decision)
    assert found is not None
    assert found.free_m == pytest.approx(certificate(law).free_m - 0.5)


def test_the_first_odometry_of_all_waits_for_the_step_which_gets_to_know_its_writer() -> None:
    law = Law(CONFIG, room_m=FREE_M)
    law.drive()
    inputs = replace(command(law), **heard(law, FORWARD))
    assert foresees(law, replace(inputs, odometry=None, odometry_writers=()))
    assert not foresees(law, inputs)


def test_its_points_grow_older_by_a_period_until_the_next_scan_shows_them_again() -> None:
    law = driving()
    taken_s = law.now_s
    law.scanning = False
    law.tick(("teleop", FORWARD), **heard(law, FORWARD))
    assert certificate(law).taken_s == taken_s
    assert certificate(law).period_before_s == pytest.approx(taken_s - TICK_S)


def test_remembered_points_count() -> None:
    law = driving(velocity=SPIN, room_m=1.7)
    law.ranges[:60] = 1.2
    law.tick(("teleop", SPIN), **heard(law, SPIN))
    law.ranges[:60] = math.nan
    law.tick(("teleop", SPIN), **heard(law, SPIN))
    print(
        certificate(law).free_m, [(p.around.kind, p.around.clearance_m.min()) for p in law.state.sight.places]
    )


# --- over all real numbers

PREMISES = {
    "signs": "(and (>= stop 0) (>= touch 0) (>= stray 0) (> k 0) (>= late 0) (>= alone 0) (>= t 0) (>= age_i 0) (>= next_i 0))",
    "the oldest scan is taken as the age of each place": "(<= age_i age)",
    "and the latest next scan as the age that it reaches": "(<= next_i next)",
    "the step considers no higher speed": "(and (<= 0 v) (<= v V))",
    "free_m contains the way up to the last odometer": "(and (<= 0 before) (<= free (- clearance before)))",
    "and the hull moves by at most V t since": "(and (<= 0 since) (<= since (* V t)) (<= moved (+ before since)))",
    "the certificate needs the reach of the first bound": "(enough stop (+ next late))",
    "and of the second one, unless it follows from the first": (
        "(or (enough touch (+ age alone late)) (<= (* V (- (+ age alone late) (+ next late))) (- stop touch)))"
    ),
}
REACH = (
    reals("stop touch stray k late alone age next age_i next_i V v t free clearance before since moved")
    + """
(define-fun reach ((distance Real) (reaction Real) (w Real)) Real (+ distance stray (* w reaction) (* k w w)))
(define-fun enough ((distance Real) (reaction Real)) Bool (<= (+ (reach distance reaction V) (* V t)) free))
(define-fun outside ((distance Real) (reaction Real)) Bool (>= clearance (+ (reach distance reaction v) moved)))
"""
)
"""A place with its least clearance, its age now (`age_i`) and when it is seen again (`next_i`). k = 1 / 2a; `alone` is the
timeout of the base; v is the speed of the step, V that of the certificate; t is the time since the last odometer."""
OUTSIDE_BOTH = "(and (outside stop (+ next_i late)) (outside touch (+ age_i alone late)))"
"""`in_reach` selects no point of the place, for either bound."""


def in_reach_answer(without: str = "") -> str:
    """Return z3's answer to whether a point may be in reach."""
    given = "".join(f"(assert {premise})" for name, premise in PREMISES.items() if name != without)
    return decided(f"{REACH}{given}(assert (not {OUTSIDE_BOTH}))")


def test_what_the_certificate_needs_leaves_no_point_in_reach_over_all_reals() -> None:
    assert in_reach_answer() == "unsat"


@pytest.mark.parametrize("name", PREMISES)
def test_that_no_point_is_in_reach_needs_each_premise(name: str) -> None:
    """So the proof is not empty, and no premise is there in vain."""
    assert in_reach_answer(without=name) == "sat"


def test_the_way_of_two_motions_is_at_most_the_sum_of_both_over_all_reals() -> None:
    given = (
        reals("x y X Y one other both")
        + """
(define-fun is-length ((l Real) (x Real) (y Real)) Bool (and (>= l 0) (= (* l l) (+ (* x x) (* y y)))))
(assert (and (is-length one x y) (is-length other X Y) (is-length both (+ x X) (+ y Y))))
"""
    )
    assert decided(given) == "sat"
    assert decided(given + "(assert (> both (+ one other)))") == "unsat"


# --- in random scenes


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize("block", range(4))
def test_in_random_scenes_a_step_decides_what_its_certificate_foresees(block: int) -> None:
    """Any commands, and odometry of any base, at any time until the deadline; half of the robots have odometry."""
    counts: Counter[str] = Counter()
    for seed in range(1000 + block * 25, 1025 + block * 25):
        drive_about(seed, 4.0, watch=_prober(counts))
    print(f"\n    {dict(counts)}")
    assert counts["foreseen"] > 0.1 * counts["driving"]
    assert counts["near"] > 100, "points are not far beyond the reach"


def _prober(counts: Counter[str]) -> Callable[[State, Decision, Velocity, np.random.Generator], None]:
    def watch(state: State, decision: Decision, twist: Velocity, rng: np.random.Generator) -> None:
        now_s, found = state.clock.now_s, certify(state, decision)
        counts["driving"] += decision.output != STANDSTILL
        if found is None or now_s is None:
            return
        for _ in range(3):
            until_s = now_s + float(rng.choice([0.0, 0.001, 0.02, found.until_s - now_s])) * rng.uniform()
            inputs = _random_inputs(state, twist, now_s, until_s, rng)
            if is_foreseen(state, decision, until_s, inputs):
                counts["foreseen"] += 1
                counts["near"] += found.free_m < 1.5

    return watch


def _random_inputs(
    state: State, twist: Velocity, now_s: float, until_s: float, rng: np.random.Generator
) -> Inputs:
    def between_s() -> float:
        return float(rng.uniform(now_s, until_s))

    commands = tuple(
        Command("teleop", Velocity(*(float(rng.uniform(-limit, limit)) for limit in (1.1, 2.2))), arrival_s)
        for arrival_s in sorted(between_s() for _ in range(int(rng.integers(0, 3))))
    )
    odometry = None
    if state.base.odometry is not None and rng.random() < 0.5:
        off = rng.choice([0.0, 0.1, 1.0])
        velocity = Velocity(*(value + float(off * rng.normal()) for value in twist))
        odometry = Odometry(velocity, between_s())
    return Inputs(commands, odometry=odometry)
