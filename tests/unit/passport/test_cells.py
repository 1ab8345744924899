"""Which cells are measured, and the free area that each needs."""

import math

import numpy as np
import pytest

from commission.plan import MARGIN_M, Base
from deploy.stack.errors import DeployError
from passport.cells import (
    LATER_S,
    STOP_LIMIT_S,
    TURN_STEADY_S,
    WORDS,
    Fault,
    Plan,
    drive_of,
    faults_named,
    needs_m,
    plans,
    problem,
    standing_m,
    standing_s,
    trusted_bases,
)
from passport.instrument import instrument
from supervisor.config import SupervisorSection
from supervisor.measured import LEAST_DECELERATION_M_S2, MeasuredSection, MeasuredValue
from teleop.pilots.pilot import NEUTRAL, Velocity
from wire.tls import LEASE_S

BASE = Base(0.5, 2.0, 0.3)
TOP = Velocity(0.8, 2.0)
CONFIG = SupervisorSection()


def value(number: float, limit: float) -> MeasuredValue:
    return MeasuredValue(value=number, limit=limit, n=9, date="2026-11-28", version="0", how="a test")


def test_the_plain_zero_has_three_speeds_and_each_fault_the_top_speed() -> None:
    found = list(plans(TOP))
    assert found[:3] == [Plan(Fault.ZERO, speed) for speed in (0.264, 0.528, 0.8)]
    others = [one for one in Fault if one not in {Fault.ZERO, Fault.ROS2_KILLED}]
    assert [one.fault for one in found[3:]] == others
    assert found[3] == Plan(Fault.TURN, 2.0)
    assert {one.speed for one in found[4:]} == {0.8}
    assert [one.fault.takes_recorder for one in found] == (len(found) - 2) * [False] + 2 * [True]
    assert list(plans(TOP, [Fault.ESTOP])) == [Plan(Fault.ESTOP, 0.8)]


def test_only_a_ros2_robot_has_the_fault_of_its_process_unless_it_is_asked_for() -> None:
    killed = Plan(Fault.ROS2_KILLED, 0.8)
    assert [*plans(TOP), killed] == list(plans(TOP, has_ros2=True))
    assert list(plans(TOP, [Fault.ROS2_KILLED])) == [killed]
    assert killed.fault.takes_recorder


def test_without_lifeline_its_own_faults_and_stops_are_left_out() -> None:
    found = list(plans(TOP, with_lifeline=False))
    assert [one.fault for one in found[3:]] == [
        Fault.TURN,
        Fault.OPERATOR_KILLED,
        Fault.OPERATOR_STOPPED,
        Fault.LINK_CUT,
        Fault.LINK_CUT_UP,
        Fault.LINK_CUT_DOWN,
        Fault.LIDAR_SILENT,
        Fault.ODOMETRY_SILENT,
    ]
    assert str(found[0]) == "plain zero without Lifeline at 0.264 m/s"


def test_without_lifeline_a_cell_also_needs_the_way_of_a_robot_that_does_not_stop() -> None:
    usual, alone = Plan(Fault.ZERO, 1.0), Plan(Fault.ZERO, 1.0, with_lifeline=False)
    assert needs_m(alone, BASE) == pytest.approx(needs_m(usual, BASE) + standing_s(alone, BASE))
    blind = Plan(Fault.LIDAR_SILENT, 1.0, with_lifeline=False)
    assert needs_m(blind, BASE) == pytest.approx(needs_m(alone, BASE) + STOP_LIMIT_S)
    turn = Plan(Fault.TURN, 1.0, with_lifeline=False)
    assert needs_m(turn, BASE) == MARGIN_M


def test_each_fault_has_words_of_its_own() -> None:
    assert [one.words for one in Fault] == list(dict.fromkeys(WORDS.values()))


def test_a_fault_is_found_by_its_name_and_another_name_is_refused_with_the_names() -> None:
    assert faults_named(["estop", "zero"]) == [Fault.ESTOP, Fault.ZERO]
    with pytest.raises(
        DeployError, match="'fire' is not a valid Fault; there are: zero, turn, operator-killed"
    ):
        faults_named(["fire"])


def test_a_cell_fits_if_run_up_and_longest_stop_leave_the_margin() -> None:
    plan = Plan(Fault.OPERATOR_KILLED, 1.0)
    needed_m = BASE.run_up_m(1.0) + 1.0 * 0.3 + 1.0 / 4.0 + MARGIN_M
    assert needs_m(plan, BASE) == pytest.approx(needed_m)
    assert problem(plan, BASE, needs_m(plan, BASE)) is None
    refused = problem(plan, BASE, math.nextafter(needs_m(plan, BASE), 0.0))
    assert refused == f"it needs {needed_m:.2f} m ahead of the hull, and the wall is {needed_m:.2f} m away"


def test_a_fault_that_takes_the_recorder_needs_the_way_of_a_base_that_drives_on() -> None:
    seen, unseen = Plan(Fault.ZERO, 1.0), Plan(Fault.SUPERVISOR_STOPPED, 1.0)
    assert standing_s(unseen, BASE) == pytest.approx(0.3 + 0.5 + LATER_S)
    assert needs_m(unseen, BASE) == pytest.approx(needs_m(seen, BASE) + standing_s(unseen, BASE))


def test_a_speed_at_which_no_stop_is_measured_is_refused() -> None:
    assert problem(Plan(Fault.ZERO, 0.08), BASE, 10.0) is None
    assert problem(Plan(Fault.ZERO, 0.079), BASE, 10.0) == "stops are measured from 0.08 m/s on"


def test_a_turn_needs_no_way_ahead_but_an_angle_that_can_be_followed() -> None:
    base = Base(1.5, 5.0, 0.3)
    plan = Plan(Fault.TURN, 2.0)
    drive = drive_of(plan, base)
    assert (drive.way_m, drive.speed) == (0.0, 2.0)
    assert drive.turn_rad == pytest.approx(2.0**2 / 3.0 + 2.0 * TURN_STEADY_S)
    assert needs_m(plan, base) == MARGIN_M
    assert problem(plan, base, MARGIN_M) is None
    assert problem(plan, base, 0.4) == "it needs 0.50 m ahead of the hull, and the wall is 0.40 m away"
    weak = Base(0.5, 5.0, 0.3)
    assert problem(plan, weak, 9.0) == "it needs a turn of 5.2 rad, and more than 3 rad are not followed"
    assert problem(Plan(Fault.TURN, 0.05), base, 9.0) == "stops are measured from 0.08 rad/s on"


def test_a_plan_knows_what_the_operator_requests_before_and_after_its_fault() -> None:
    zero, turn, killed = Plan(Fault.ZERO, 0.4), Plan(Fault.TURN, 2.0), Plan(Fault.OPERATOR_KILLED, 0.8)
    assert [one.velocity for one in (zero, turn, killed)] == [(0.4, 0.0), (0.0, 2.0), (0.8, 0.0)]
    assert [one.after for one in (zero, turn, killed)] == [NEUTRAL, NEUTRAL, (0.8, 0.0)]
    assert [str(one) for one in (zero, turn)] == ["plain zero at 0.4 m/s", "plain zero in a turn at 2 rad/s"]


def test_in_a_turn_the_rim_of_the_hull_is_trusted_as_far_as_its_centre() -> None:
    bases = trusted_bases(CONFIG, None, LEASE_S)
    turning = bases.of(Plan(Fault.TURN, 1.0))
    assert bases.of(Plan(Fault.ZERO, 1.0)) == bases.straight
    assert turning.acceleration_m_s2 == CONFIG.base_angular_acceleration_rad_s2
    assert turning.deceleration_m_s2 * CONFIG.footprint.hull().radius_m == pytest.approx(
        CONFIG.deceleration_m_s2
    )
    assert turning.reaction_s == bases.straight.reaction_s


def test_a_base_that_stands_in_time_brakes_at_the_latest_time_that_permits_it() -> None:
    plan = Plan(Fault.ROS2_KILLED, 1.0)
    braking_s = 1.0 / BASE.deceleration_m_s2
    assert standing_m(plan, BASE) == pytest.approx(standing_s(plan, BASE) - braking_s / 2.0)


def test_an_operator_that_does_not_hear_the_supervisor_is_stopped_by_the_end_of_its_link() -> None:
    longest_s = CONFIG.odom_timeout_s
    for lease_s in (0.0, longest_s, 2.0):
        bases = trusted_bases(CONFIG, None, lease_s)
        for fault in (Fault.OPERATOR_KILLED, Fault.LINK_CUT, Fault.LINK_CUT_UP):
            assert bases.of(Plan(fault, 0.5)) == bases.straight
        unheard = bases.of(Plan(Fault.LINK_CUT_DOWN, 0.5))
        later_s = unheard.reaction_s - bases.straight.reaction_s
        assert later_s == pytest.approx(max(0.0, lease_s - longest_s))


def test_without_lifeline_the_timeout_of_the_base_begins_only_when_the_link_has_ended() -> None:
    plan = Plan(Fault.LINK_CUT_DOWN, 0.5, with_lifeline=False)
    measured = MeasuredSection(base_timeout_s=value(0.6, 0.7))
    for lease_s in (0.4, 2.0):
        alone = trusted_bases(CONFIG, None, lease_s).of(plan)
        assert alone.reaction_s == pytest.approx(lease_s + CONFIG.base_timeout_s + CONFIG.transport_s)
        worse = trusted_bases(CONFIG, measured, lease_s).of(plan)
        assert worse.reaction_s == pytest.approx(lease_s + 0.7 + CONFIG.transport_s)
    assert (
        trusted_bases(CONFIG, None, 0.4).of(plan._replace(fault=Fault.LINK_CUT))
        == trusted_bases(CONFIG, None, 0.4).straight
    )


def test_the_base_is_trusted_as_far_as_it_is_configured_and_measured() -> None:
    configured = trusted_bases(CONFIG, None, LEASE_S).straight
    assert configured.deceleration_m_s2 == CONFIG.deceleration_m_s2
    assert configured.reaction_s == pytest.approx(CONFIG.odom_timeout_s + CONFIG.transport_s)
    assert trusted_bases(CONFIG, MeasuredSection(), LEASE_S).straight == configured
    better = MeasuredSection(
        deceleration_m_s2=value(2.0, 1.9), dead_time_s=value(0.0, -0.01), base_timeout_s=value(0.1, 0.1)
    )
    assert trusted_bases(CONFIG, better, LEASE_S).straight == configured
    worse = MeasuredSection(
        deceleration_m_s2=value(1.0, 0.8), dead_time_s=value(0.1, 0.12), base_timeout_s=value(0.4, 0.5)
    )
    found = trusted_bases(CONFIG, worse, LEASE_S).straight
    assert (found.acceleration_m_s2, found.deceleration_m_s2) == (CONFIG.base_acceleration_m_s2, 0.8)
    assert found.reaction_s == pytest.approx(0.5 + 0.12 + CONFIG.transport_s)


def test_a_measured_deceleration_without_meaning_counts_as_the_least() -> None:
    measured = MeasuredSection(deceleration_m_s2=value(1.0, -3.0))
    assert trusted_bases(CONFIG, measured, LEASE_S).straight.deceleration_m_s2 == LEAST_DECELERATION_M_S2


# --- the instrument


BEARINGS = np.stack((0.05 * np.arange(60), np.full(60, 0.1)), axis=1)


def at_rest(noise_m: float, scans: int = 60) -> np.ndarray:
    offsets = noise_m * np.array([(-1.0) ** number for number in range(scans)])
    return np.stack((0.05 * np.arange(scans), 3.0 + offsets), axis=1)


def test_the_uncertainty_is_that_of_two_distances_and_of_the_latency() -> None:
    odometry_s = [0.0, 0.02, 0.05, 0.07, 0.09, 0.11, 0.13, 0.15, 0.17, 0.19]
    bearings = at_rest(0.002)
    top = Velocity(0.5, 1.5)
    found = instrument("front", at_rest(0.001), bearings, odometry_s, top=top, latency_s=0.004)
    assert found is not None
    assert found.uncertainty_m == pytest.approx(2.0 * math.sqrt(2.0) * 0.001 + 0.5 * 0.004, rel=0.01)
    assert found.uncertainty_rad == pytest.approx(2.0 * math.sqrt(2.0) * 0.002 + 1.5 * 0.004, rel=0.01)
    assert found.uncertainty_s == pytest.approx(0.03)
    assert "front" in found.wall_fit


def test_a_latency_that_was_not_measured_counts_as_a_period() -> None:
    odometry_s = [0.02 * n for n in range(10)]
    found = instrument("front", at_rest(0.0), BEARINGS, odometry_s, top=Velocity(0.5, 1.0), latency_s=None)
    assert found is not None
    assert found.uncertainty_rad == pytest.approx(1.0 * 0.05)
    assert found.uncertainty_m == pytest.approx(0.5 * 0.05)


@pytest.mark.parametrize(
    ("walls", "odometry_s"),
    [
        (at_rest(0.001, scans=9), [0.02 * n for n in range(10)]),
        (at_rest(0.001), [0.02 * n for n in range(9)]),
        (at_rest(0.001), [0.2 * n * n for n in range(10)]),
        (at_rest(1.0), [0.02 * n for n in range(10)]),
    ],
)
def test_a_wall_or_odometry_that_is_hardly_seen_is_no_instrument(
    walls: np.ndarray, odometry_s: list[float]
) -> None:
    top = Velocity(0.5, 1.0)
    assert instrument("front", walls, BEARINGS, odometry_s, top=top, latency_s=0.0) is None
