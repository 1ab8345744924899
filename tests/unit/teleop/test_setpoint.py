"""What the operator asks of the robot."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.keymap import Action
from teleop.setpoint import Setpoint, Steps

UP, DOWN, LEFT, RIGHT = Action.FASTER, Action.SLOWER, Action.LEFT, Action.RIGHT


def after(actions: list[Action], steps: Steps | None = None) -> Setpoint:
    setpoint = Setpoint(steps or Steps())
    for action in actions:
        setpoint = setpoint.apply(action)
    return setpoint


@pytest.mark.parametrize(
    ("action", "velocity"), [(UP, (0.1, 0.0)), (DOWN, (-0.1, 0.0)), (LEFT, (0.0, 0.2)), (RIGHT, (0.0, -0.2))]
)
def test_one_press_is_one_step(action: Action, velocity: tuple[float, float]) -> None:
    setpoint = after([action])
    assert (setpoint.linear_m_s, setpoint.angular_rad_s) == velocity


@pytest.mark.parametrize(("there", "back"), [(UP, DOWN), (DOWN, UP), (LEFT, RIGHT), (RIGHT, LEFT)])
def test_ten_steps_there_and_ten_back_are_exactly_zero(there: Action, back: Action) -> None:
    setpoint = after([there] * 10 + [back] * 10)
    assert setpoint.is_neutral
    assert (setpoint.linear_m_s, setpoint.angular_rad_s) == (0.0, 0.0)


def test_three_tenths_are_three_tenths() -> None:
    assert after([UP] * 3).linear_m_s == 0.3


@pytest.mark.parametrize("presses", [10, 11, 1000])
def test_it_ends_at_the_limits(presses: int) -> None:
    setpoint = after([UP, LEFT] * presses)
    assert (setpoint.linear_m_s, setpoint.angular_rad_s) == (1.0, 2.0)


def test_presses_beyond_the_limit_need_not_be_counted_back() -> None:
    assert after([UP] * 50 + [DOWN]).linear_m_s == 0.9


def test_a_limit_whose_division_is_inexact_needs_no_counting_back_either() -> None:
    steps = Steps(linear_step_m_s=0.1, max_linear_m_s=1.1)  # 1.1 / 0.1 is a little more than 11
    assert after([UP] * 12 + [DOWN], steps).linear_m_s == 1.0


def test_a_step_that_does_not_divide_the_limit_still_reaches_it_and_comes_back_to_zero() -> None:
    steps = Steps(linear_step_m_s=0.3, max_linear_m_s=1.0)
    assert [after([UP] * presses, steps).linear_m_s for presses in range(6)] == [0.0, 0.3, 0.6, 0.9, 1.0, 1.0]
    assert after([UP] * 9 + [DOWN] * 4, steps).is_neutral


def test_a_step_greater_than_the_limit_is_cut_to_it() -> None:
    assert after([DOWN], Steps(linear_step_m_s=0.5, max_linear_m_s=0.2)).linear_m_s == -0.2


@pytest.mark.parametrize("action", [Action.STOP, Action.ESTOP, Action.QUIT])
def test_every_way_to_stop_is_neutral_at_once(action: Action) -> None:
    assert after([UP, LEFT, LEFT, action]).is_neutral


def test_a_reset_changes_nothing() -> None:
    assert after([UP, Action.RESET]) == after([UP])


def test_turning_on_the_spot_is_not_neutral() -> None:
    assert not after([LEFT]).is_neutral


velocities = st.floats(0.001, 10.0)


@given(
    st.builds(Steps, velocities, velocities, velocities, velocities),
    st.lists(st.sampled_from(list(Action)), max_size=60),
)
def test_it_is_within_the_limits_and_neutral_exactly_at_zero(steps: Steps, actions: list[Action]) -> None:
    setpoint = after(actions, steps)
    assert abs(setpoint.linear_m_s) <= steps.max_linear_m_s
    assert abs(setpoint.angular_rad_s) <= steps.max_angular_rad_s
    assert setpoint.is_neutral == (setpoint.linear_m_s == 0.0 and setpoint.angular_rad_s == 0.0)
