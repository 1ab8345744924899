"""What is observed at the wheels after a fault, and the mark for it."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faults.grade.marks import AGAIN_M, POINTS, Fault, Grade, Observed, cm, mark, observed, swings, untested
from faults.grade.rubric import Rubric, read
from faults.measure import MOVING_M_S
from recordings.incidents.braking import Motion

RUBRIC = read(None)
STOPPED = Observed(
    speed_m_s=0.5,
    standstill_s=0.3,
    distance_m=0.1,
    again_m=0.0,
    fastest_m_s=0.5,
    nearest_m=2.0,
    touched=False,
    swings=1,
    ended=False,
    curve=((-0.5, 0.5), (0.3, 0.0)),
)
DRIVES_ON = replace(STOPPED, standstill_s=None, distance_m=2.2, swings=0)
STOPPING = (Fault.KILLED, Fault.STOPPED, Fault.UNPLUGGED)
FAULT_S = 2.0


def share(fault: Fault, seen: Observed, rubric: Rubric = RUBRIC) -> float:
    found = mark(fault, seen, rubric)
    return found.points / found.of


def drive(speed_m_s: Callable[[float], float], until_s: float = 7.0) -> list[Motion]:
    """Motion along x with samples every 10 ms, and an object at x = 10 m that a hull of 0.25 m may touch."""
    motions: list[Motion] = []
    x_m = 0.0
    for number in range(round(100 * until_s)):
        now_s = number / 100
        x_m += 0.01 * speed_m_s(now_s)
        clearance_m = 9.75 - x_m
        motions.append(
            Motion(now_s, x_m, 0.0, speed_m_s(now_s), 0.0, clearance_m, is_touching=clearance_m <= 0.0)
        )
    return motions


# --- observed


def test_the_stop_after_a_fault_is_measured_from_the_fault() -> None:
    seen = observed(drive(lambda t: 0.5 if t < FAULT_S + 0.2 else 0.0), FAULT_S, 0.1, ended=True)
    assert seen.speed_m_s == 0.5
    assert seen.standstill_s == pytest.approx(0.2)
    assert seen.distance_m == pytest.approx(0.1, abs=0.011)
    assert seen.again_m == pytest.approx(0.0)
    assert (seen.swings, seen.touched, seen.ended, seen.has_stopped) == (1, False, True, True)


def test_a_robot_that_moves_again_has_not_stopped() -> None:
    seen = observed(drive(lambda t: 0.0 if FAULT_S < t < FAULT_S + 1.0 else 0.5), FAULT_S, 0.1, ended=False)
    assert seen.standstill_s is not None
    assert seen.again_m > 1.0
    assert not seen.has_stopped


def test_a_robot_that_drives_on_has_its_way_and_its_contact() -> None:
    seen = observed(drive(lambda _: 2.0), FAULT_S, 0.1, ended=False)
    assert seen.standstill_s is None
    assert seen.distance_m == pytest.approx(10.0, abs=0.03)
    assert seen.touched
    assert seen.nearest_m < 0.0


def test_a_robot_that_turns_on_the_spot_moves() -> None:
    still = drive(lambda _: 0.0)
    spins = [motion._replace(angular_rad_s=1.0 if motion.time_s >= 3.0 else 0.0) for motion in still]
    seen = observed(spins, FAULT_S, 0.1, ended=False)
    assert seen.again_m == pytest.approx(1.0, abs=0.01)
    assert seen.fastest_m_s == pytest.approx(0.25)
    assert share(Fault.RESUMED, seen) == 0.0
    forward = [motion._replace(linear_m_s=0.5) for motion in spins]
    assert share(Fault.GARBAGE, observed(forward, FAULT_S, 0.1, ended=False)) == 0.0
    curve = [motion._replace(angular_rad_s=1.0) for motion in forward]
    assert share(Fault.GARBAGE, observed(curve, FAULT_S, 0.1, ended=False)) == 1.0


def test_a_contact_before_the_fault_does_not_count() -> None:
    before = [motion._replace(is_touching=True) for motion in drive(lambda _: 0.5)]
    after = [motion._replace(is_touching=False) if motion.time_s >= FAULT_S else motion for motion in before]
    assert not observed(after, FAULT_S, 0.1, ended=False).touched


def test_a_curve_is_short_and_begins_just_before_the_fault() -> None:
    curve = observed(drive(lambda _: 0.5, until_s=20.0), 10.0, 0.1, ended=False).curve
    assert len(curve) <= POINTS
    assert -1.0 <= curve[0][0] < 0.0 < curve[-1][0]


@pytest.mark.parametrize(
    ("speeds", "count"),
    [
        ([0.5] * 9, 0),
        ([0.5, 0.3, 0.1, 0.0, 0.0], 1),
        ([0.0, 0.2, 0.4], 1),
        ([0.5, 0.45, 0.5, 0.45], 0),
        ([0.5, 0.3, 0.5, 0.3], 3),
        ([0.5, 0.4, 0.5], 0),
        ([0.0, 0.5, 0.0, 0.05, 0.0], 2),
        ([], 0),
    ],
)
def test_swings_are_counted_beyond_the_limit_only(speeds: list[float], count: int) -> None:
    assert swings(speeds, 0.1) == count


@given(st.lists(st.floats(-1.0, 1.0), max_size=30))
def test_swings_are_the_same_for_the_mirrored_speeds(speeds: list[float]) -> None:
    assert swings(speeds, 0.1) == swings([-speed for speed in speeds], 0.1)


# --- marks


@pytest.mark.parametrize("fault", STOPPING)
def test_a_stop_at_the_limits_has_all_points_and_half_just_beyond_them(fault: Fault) -> None:
    limit = getattr(RUBRIC, fault)
    at_limits = replace(STOPPED, standstill_s=limit.standstill_s, distance_m=limit.distance_m)
    assert share(fault, at_limits) == 1.0
    assert share(fault, replace(at_limits, standstill_s=math.nextafter(limit.standstill_s, 9))) == 0.5
    assert share(fault, replace(at_limits, distance_m=math.nextafter(limit.distance_m, 9))) == 0.5


@pytest.mark.parametrize("fault", STOPPING)
def test_no_stop_a_stop_that_does_not_last_and_a_contact_have_no_points(fault: Fault) -> None:
    for seen, word in (
        (DRIVES_ON, "without stopping"),
        (replace(STOPPED, again_m=math.nextafter(AGAIN_M, 1)), "moved again"),
        (replace(STOPPED, touched=True), "touched"),
    ):
        found = mark(fault, seen, RUBRIC)
        assert found.points == 0.0
        assert word in found.sentence
    assert share(fault, replace(STOPPED, again_m=AGAIN_M)) == 1.0


def test_a_robot_that_moves_by_itself_when_the_program_continues_has_no_points() -> None:
    at_rest = replace(STOPPED, speed_m_s=0.0, fastest_m_s=0.0, standstill_s=0.0, distance_m=0.0)
    limit_m = RUBRIC.resumed.distance_m
    assert share(Fault.RESUMED, replace(at_rest, again_m=limit_m)) == 1.0
    assert share(Fault.RESUMED, replace(at_rest, again_m=math.nextafter(limit_m, 1))) == 0.0
    moving = mark(Fault.RESUMED, replace(at_rest, speed_m_s=MOVING_M_S), RUBRIC)
    assert moving.points == 0.0
    assert "had not stopped" in moving.sentence


def test_garbage_may_end_the_program_or_stop_the_robot_but_not_make_it_faster() -> None:
    faster_m_s = RUBRIC.garbage.faster_m_s
    assert share(Fault.GARBAGE, DRIVES_ON) == 1.0
    assert share(Fault.GARBAGE, replace(DRIVES_ON, fastest_m_s=0.5 + faster_m_s / 2)) == 1.0
    assert share(Fault.GARBAGE, replace(DRIVES_ON, fastest_m_s=0.5 + 2 * faster_m_s)) == 0.0
    assert share(Fault.GARBAGE, replace(DRIVES_ON, touched=True)) == 0.0
    assert share(Fault.GARBAGE, STOPPED) == 1.0
    assert share(Fault.GARBAGE, replace(STOPPED, ended=True)) == 1.0
    assert share(Fault.GARBAGE, replace(STOPPED, ended=True, distance_m=3.0)) == 0.5
    assert share(Fault.GARBAGE, replace(DRIVES_ON, ended=True)) == 0.0


def test_an_obstacle_must_not_be_touched_and_half_of_the_points_are_for_the_distance() -> None:
    clearance_m = RUBRIC.obstacle.clearance_m
    assert share(Fault.OBSTACLE, replace(STOPPED, nearest_m=clearance_m)) == 1.0
    assert share(Fault.OBSTACLE, replace(STOPPED, nearest_m=math.nextafter(clearance_m, 0))) == 0.5
    assert share(Fault.OBSTACLE, replace(STOPPED, nearest_m=0.0, touched=True)) == 0.0
    assert share(Fault.OBSTACLE, DRIVES_ON) == 0.0


def test_two_instances_may_keep_or_stop_the_robot_but_not_fight() -> None:
    assert share(Fault.SECOND, STOPPED) == 1.0
    assert share(Fault.SECOND, DRIVES_ON) == 1.0
    assert share(Fault.SECOND, replace(DRIVES_ON, swings=2)) == 0.0
    assert share(Fault.SECOND, replace(DRIVES_ON, touched=True)) == 0.0


def test_a_distance_is_in_centimetres_below_a_metre() -> None:
    assert (cm(0.995), cm(1.0)) == ("100 cm", "1.00 m")
    assert cm(0.07) == "7 cm"


# --- the total


def grade(*marks: object, pass_percent: float = 50.0) -> Grade:
    return Grade("program", "robot", pass_percent, marks)  # pyright: ignore[reportArgumentType]


def test_a_fault_that_was_not_tested_does_not_count() -> None:
    left = untested(Fault.UNPLUGGED, "no root", RUBRIC)
    found = grade(mark(Fault.KILLED, STOPPED, RUBRIC), mark(Fault.STOPPED, DRIVES_ON, RUBRIC), left)
    assert (found.points, found.of, left.of) == (25.0, 45, 15)
    assert found.passed
    assert found.sentence == (
        "25 of 45 points, 56 %: passed (from 50 %); without unplugged, which could not be tested"
    )


def test_a_program_passes_at_the_pass_mark_and_not_below_it() -> None:
    marks = [mark(Fault.KILLED, replace(STOPPED, distance_m=3.0), RUBRIC)]
    assert grade(*marks, pass_percent=50.0).passed
    failed = grade(*marks, pass_percent=math.nextafter(50.0, 100.0))
    assert not failed.passed
    assert "not passed" in failed.sentence


def test_a_program_that_was_not_tested_has_not_passed() -> None:
    assert not grade().passed
    assert not grade(untested(Fault.UNPLUGGED, "no root", RUBRIC)).passed
