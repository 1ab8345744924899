"""Which cells are measured, and the free area that each needs."""

import math

import numpy as np
import pytest

from commission.plan import MARGIN_M, Base
from deploy.stack.errors import DeployError
from passport.cells import (
    LATER_S,
    LEAST_DECELERATION_M_S2,
    WORDS,
    Fault,
    Plan,
    faults_named,
    needs_m,
    plans,
    problem,
    standing_s,
    trusted_base,
)
from passport.instrument import instrument
from supervisor.config import SupervisorSection
from supervisor.measured import MeasuredSection, MeasuredValue

BASE = Base(0.5, 2.0, 0.3)
CONFIG = SupervisorSection()


def value(number: float, limit: float) -> MeasuredValue:
    return MeasuredValue(value=number, limit=limit, n=9, date="2026-11-28", version="0", how="a test")


def test_the_plain_zero_has_three_speeds_and_each_fault_the_top_speed() -> None:
    found = list(plans(0.8))
    assert found[:3] == [Plan(Fault.ZERO, speed) for speed in (0.264, 0.528, 0.8)]
    others = [one for one in Fault if one not in {Fault.ZERO, Fault.ROS2_KILLED}]
    assert [one.fault for one in found[3:]] == others
    assert {one.speed_m_s for one in found[3:]} == {0.8}
    assert [one.fault.takes_recorder for one in found] == (len(found) - 2) * [False] + 2 * [True]
    assert list(plans(0.8, [Fault.ESTOP])) == [Plan(Fault.ESTOP, 0.8)]


def test_only_a_ros2_robot_has_the_fault_of_its_process_unless_it_is_asked_for() -> None:
    killed = Plan(Fault.ROS2_KILLED, 0.8)
    assert [*plans(0.8), killed] == list(plans(0.8, has_ros2=True))
    assert list(plans(0.8, [Fault.ROS2_KILLED])) == [killed]
    assert killed.fault.takes_recorder


def test_each_fault_has_words_of_its_own() -> None:
    assert [one.words for one in Fault] == list(dict.fromkeys(WORDS.values()))


def test_a_fault_is_found_by_its_name_and_another_name_is_refused_with_the_names() -> None:
    assert faults_named(["estop", "zero"]) == [Fault.ESTOP, Fault.ZERO]
    with pytest.raises(DeployError, match="'fire' is not a valid Fault; there are: zero, operator-killed"):
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


def test_the_base_is_trusted_as_far_as_it_is_configured_and_measured() -> None:
    configured = trusted_base(CONFIG, None)
    assert configured.deceleration_m_s2 == CONFIG.deceleration_m_s2
    assert configured.reaction_s == pytest.approx(CONFIG.odom_timeout_s + CONFIG.transport_s)
    assert trusted_base(CONFIG, MeasuredSection()) == configured
    better = MeasuredSection(
        deceleration_m_s2=value(2.0, 1.9), dead_time_s=value(0.0, -0.01), base_timeout_s=value(0.1, 0.1)
    )
    assert trusted_base(CONFIG, better) == configured
    worse = MeasuredSection(
        deceleration_m_s2=value(1.0, 0.8), dead_time_s=value(0.1, 0.12), base_timeout_s=value(0.4, 0.5)
    )
    found = trusted_base(CONFIG, worse)
    assert (found.acceleration_m_s2, found.deceleration_m_s2) == (CONFIG.base_acceleration_m_s2, 0.8)
    assert found.reaction_s == pytest.approx(0.5 + 0.12 + CONFIG.transport_s)


def test_a_measured_deceleration_without_meaning_counts_as_the_least() -> None:
    measured = MeasuredSection(deceleration_m_s2=value(1.0, -3.0))
    assert trusted_base(CONFIG, measured).deceleration_m_s2 == LEAST_DECELERATION_M_S2


# --- the instrument


def at_rest(noise_m: float, scans: int = 60) -> np.ndarray:
    offsets = noise_m * np.array([(-1.0) ** number for number in range(scans)])
    return np.stack((0.05 * np.arange(scans), 3.0 + offsets), axis=1)


def test_the_uncertainty_is_that_of_two_distances_and_of_the_latency() -> None:
    odometry_s = [0.0, 0.02, 0.05, 0.07, 0.09, 0.11, 0.13, 0.15, 0.17, 0.19]
    found = instrument("front", at_rest(0.001), odometry_s, top_m_s=0.5, latency_s=0.004)
    assert found is not None
    assert found.uncertainty_m == pytest.approx(2.0 * math.sqrt(2.0) * 0.001 + 0.5 * 0.004, rel=0.01)
    assert found.uncertainty_s == pytest.approx(0.03)
    assert "front" in found.wall_fit


def test_a_latency_that_was_not_measured_counts_as_a_period() -> None:
    found = instrument("front", at_rest(0.0), [0.02 * n for n in range(10)], top_m_s=0.5, latency_s=None)
    assert found is not None
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
    assert instrument("front", walls, odometry_s, top_m_s=0.5, latency_s=0.0) is None
