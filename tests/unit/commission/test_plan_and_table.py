"""The plan of the first drive, what is typed, and the table that it writes."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from commission import plan
from commission.estimate import UNKNOWN, Estimate
from commission.measured import Result, TableError, check_place, with_results
from commission.plan import MARGIN_M, Base, Drive

BASE = Base(acceleration_m_s2=0.5, deceleration_m_s2=0.3, reaction_s=0.6)
STEPS = [plan.AHEAD, plan.LEFT, plan.HEADINGS, plan.ESTOP, *(plan.stops(v, BASE) for v in plan.speeds(1.0))]

# --- the plan


def test_a_drive_needs_its_way_and_its_longest_stop_and_the_margin() -> None:
    assert Drive(0.4, speed=0.3).needs_m(BASE) == pytest.approx(0.4 + 0.3 * 0.6 + 0.3**2 / 0.6 + MARGIN_M)
    assert Drive(turn_rad=1.0).needs_m(BASE) == MARGIN_M


@given(speed=st.floats(0.05, 1.0), deceleration=st.floats(0.1, 2.0), reaction=st.floats(0.0, 1.0))
def test_a_weaker_or_later_base_never_needs_less(speed: float, deceleration: float, reaction: float) -> None:
    base = Base(0.5, deceleration, reaction)
    for worse in (
        base._replace(deceleration_m_s2=0.9 * deceleration),
        base._replace(reaction_s=reaction + 0.1),
    ):
        assert plan.stops(speed, worse).needs_m(worse) >= plan.stops(speed, base).needs_m(base)


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_a_step_fits_exactly_at_what_it_needs(step: plan.Step) -> None:
    needs_m = step.needs_m(BASE)
    facing_rad = -step.heading_rad
    assert plan.problem(step, BASE, needs_m, facing_rad) is None
    assert "ahead of the hull" in (plan.problem(step, BASE, math.nextafter(needs_m, 0.0), facing_rad) or "")


def test_a_step_with_all_its_drives_ends_about_where_it_began() -> None:
    for step in (plan.HEADINGS, plan.stops(0.5, BASE)):
        assert sum(drive.way_m for drive in step.drives) == pytest.approx(0.0)
    turned_rad = sum(drive.turn_rad for drive in (*plan.LEFT.drives, *plan.HEADINGS.drives))
    assert turned_rad == pytest.approx(0.0)


def test_a_robot_that_does_not_face_the_wall_is_told_which_way_to_turn() -> None:
    assert plan.problem(plan.AHEAD, BASE, 9.0, plan.FACING_RAD) is None
    assert plan.problem(plan.AHEAD, BASE, 9.0, 0.6) == "the robot must turn 34° left first"
    assert plan.problem(plan.HEADINGS, BASE, 9.0, -1.2) == "the robot must turn 34° right first"


def test_no_stop_is_faster_than_the_robot_may_drive() -> None:
    assert list(plan.speeds(0.3)) == [0.2, 0.3]
    assert list(plan.speeds(0.1)) == []


def test_a_way_back_is_that_of_the_drive_before_less_its_own_stop() -> None:
    assert Drive(-0.75).back(0.9).way_m == pytest.approx(-0.86)
    assert Drive(-0.75).back(0.02).way_m == -0.1
    assert Drive(0.75).back(0.9).way_m == 0.75


def test_the_first_turn_is_shorter_than_two_judgements_of_the_law() -> None:
    from supervisor.law.agreement import DOUBTS, STEP_RAD  # noqa: PLC0415

    assert plan.TURN_RAD < DOUBTS * STEP_RAD - 0.1


# --- the table

FILE = """\
# my robot
[supervisor]
deceleration_m_s2 = 1.5   # a guess
sources = [ # one
  { name = "path", priority = 10 },
]

[measured] # of spring
deceleration_m_s2 = { value = 1.0, limit = 0.9, n = 4, date = "2026-04-01", version = "0.1.0", how = "tape" }
base_timeout_s = { value = 0.2, limit = 0.25, n = 3, date = "2026-04-01", version = "0.1.0", how = "check-base" } # by hand

[teleop]
rate_hz = 20.0
"""


def result(*path: str, value: float = 1.23456, limit: float = 1.2) -> Result:
    return Result(path, Estimate(value, 0.1, 8), limit, "stops")


def trial(*path: str) -> Result:
    return Result(path, Estimate(0.1, math.inf, 1), None, "one e-stop")


def write(text: str, *results: Result) -> str:
    return with_results(text, list(results), date="2026-11-27", version="0.1.0")


def test_only_the_measured_values_of_a_file_change() -> None:
    written = write(FILE, result("deceleration_m_s2"), result("lidars", "front", "yaw_rad", value=0.01))
    measured = tomllib.loads(written)["measured"]
    assert measured["deceleration_m_s2"]["value"] == 1.2346
    assert measured["deceleration_m_s2"]["date"] == "2026-11-27"
    assert measured["base_timeout_s"]["value"] == 0.2
    assert measured["lidars"]["front"]["yaw_rad"]["n"] == 8
    kept = [line for line in FILE.splitlines() if not line.startswith("deceleration_m_s2 = {")]
    assert [line for line in kept if line not in written.splitlines()] == []


def test_a_second_writing_replaces_the_first() -> None:
    once = write(FILE, result("lidars", "front", "yaw_rad"), result("slip", value=0.0, limit=0.01))
    assert write(once, result("lidars", "front", "yaw_rad"), result("slip", value=0.0, limit=0.01)) == once


def test_a_file_without_the_section_gets_it_at_its_end() -> None:
    text = '[supervisor]\n[[supervisor.lidars]]\nname = "front"\ntopic = "scan"'
    written = write(text, result("lidars", "front", "yaw_rad", value=0.1), trial("estop_s"))
    assert written.startswith(text)
    assert tomllib.loads(written)["measured"].keys() == {"lidars", "estop_s"}
    assert tomllib.loads(write("", trial("estop_s")))["measured"].keys() == {"estop_s"}


def test_what_was_not_determined_is_not_written() -> None:
    unknown = Result(("slip",), UNKNOWN, math.nan, "")
    single = Result(("dead_time_s",), Estimate(0.1, math.inf, 1), math.inf, "")
    written = write("", unknown, single, trial("estop_s"))
    assert tomllib.loads(written)["measured"].keys() == {"estop_s"}


def test_a_single_trial_is_written_without_a_limit() -> None:
    written = tomllib.loads(write("", trial("estop_s")))["measured"]["estop_s"]
    assert written["value"] == 0.1
    assert "limit" not in written


def test_a_file_without_a_place_for_a_later_result_is_refused_before_the_robot_moves() -> None:
    unknown = [Result(("lidars", "front", "yaw_rad"), UNKNOWN, math.nan, ""), trial("estop_s")]
    check_place(FILE, unknown)
    for text in ("measured = {}\n", "[measured.lidars]\nfront = 3\n"):
        with pytest.raises(TableError):
            check_place(text, unknown)


@pytest.mark.parametrize(
    "text",
    [
        "measured = 3\n",
        "measured = {}\n",
        "[[measured]]\nx = 1\n",
        "a = { b = 1,\n c = 2 }\n",
        "[measured]\nlidars = 3\n",
        "[measured\n",
        "[measured]\nwrong = 1\n",
    ],
)
def test_a_file_whose_section_is_not_one_is_refused_and_stays(text: str) -> None:
    with pytest.raises(TableError):
        write(text, result("lidars", "front", "yaw_rad"))


def test_a_number_beyond_all_bounds_is_refused() -> None:
    with pytest.raises(TableError, match=r"deceleration_m_s2\.value = 12340"):
        write("", result("deceleration_m_s2", value=12340.0))
