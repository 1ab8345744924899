"""Where the hull comes to rest, compared with a simulation in small steps and with the numbers of a drive."""

import math

import pytest

from lifeline.view.ghost import Stopping, rest_of, stopping_of
from supervisor.config import SupervisorSection
from supervisor.measured import LEAST_DECELERATION_M_S2, MeasuredSection, MeasuredValue

STOPPING = Stopping(reaction_s=0.2, deceleration_m_s2=1.0, deceleration_rad_s2=4.0)
STEP_S = 1e-4


def simulated(linear_m_s: float, angular_rad_s: float) -> tuple[float, float, float]:
    x_m = y_m = yaw_rad = now_s = 0.0
    while linear_m_s or angular_rad_s:
        x_m += linear_m_s * math.cos(yaw_rad) * STEP_S
        y_m += linear_m_s * math.sin(yaw_rad) * STEP_S
        yaw_rad += angular_rad_s * STEP_S
        now_s += STEP_S
        if now_s > STOPPING.reaction_s:
            linear_m_s = math.copysign(
                max(0.0, abs(linear_m_s) - STOPPING.deceleration_m_s2 * STEP_S), linear_m_s
            )
            slower_rad_s = max(0.0, abs(angular_rad_s) - STOPPING.deceleration_rad_s2 * STEP_S)
            angular_rad_s = math.copysign(slower_rad_s, angular_rad_s)
    return x_m, y_m, yaw_rad


def test_straight_ahead_it_is_the_reaction_and_the_braking() -> None:
    assert rest_of(1.0, 0.0, STOPPING) == pytest.approx((0.2 + 0.5, 0.0, 0.0))
    assert rest_of(-1.0, 0.0, STOPPING) == pytest.approx((-0.7, 0.0, 0.0))
    assert rest_of(0.0, 0.0, STOPPING) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("linear_m_s", "angular_rad_s"), [(0.5, 0.5), (1.0, -0.8), (-0.4, 0.6), (0.0, 2.0), (1.0, 0.0)]
)
def test_it_is_where_a_simulated_robot_stands(linear_m_s: float, angular_rad_s: float) -> None:
    """The two velocities may end at different times, so an arc is exact only to some centimetres."""
    ghost, stands = rest_of(linear_m_s, angular_rad_s, STOPPING), simulated(linear_m_s, angular_rad_s)
    assert math.dist(ghost[:2], stands[:2]) < 0.05
    assert ghost.yaw_rad == pytest.approx(stands[2], abs=0.001)


def measured(limit: float) -> MeasuredValue:
    return MeasuredValue(value=limit, limit=limit, n=3, date="2026-01-01", version="1", how="test")


def test_measured_limits_count_where_they_are_worse() -> None:
    config = SupervisorSection()
    own = stopping_of(config, MeasuredSection())
    worse = stopping_of(config, MeasuredSection(deceleration_m_s2=measured(0.3), dead_time_s=measured(0.4)))
    better = stopping_of(config, MeasuredSection(deceleration_m_s2=measured(9.0), dead_time_s=measured(-1.0)))
    assert better == own
    assert worse.deceleration_m_s2 == 0.3
    assert worse.deceleration_rad_s2 == pytest.approx(0.3 / 0.25)
    assert worse.reaction_s == pytest.approx(own.reaction_s - config.base_dead_time_s + 0.4)


def test_a_measured_deceleration_below_zero_gives_a_long_way_and_no_error() -> None:
    weak = stopping_of(SupervisorSection(), MeasuredSection(deceleration_m_s2=measured(-0.2)))
    assert weak.deceleration_m_s2 == LEAST_DECELERATION_M_S2
    assert rest_of(1.0, 0.0, weak).x_m > 10.0
