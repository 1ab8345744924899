"""Speed follows the link: the permitted speed falls as the owner's command ages, within the blind budget."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law.decision import Mode
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.unit.supervisor.law.law_harness import ANY_AGE, BACK, CONFIG, FORWARD, NEUTRAL, TICK_S, Law
from wire.reasons import Limit

FULL = Velocity(1.0, 0.0)
SPIN = Velocity(0.0, 2.0)


def law_with(**changes: float) -> Law:
    return Law(replace(CONFIG, **changes), room_m=8.0)  # type: ignore[arg-type]


def outputs_until_zero(law: Law, velocity: Velocity, tick_s: float = TICK_S) -> list[Velocity]:
    """Return the outputs of a command that is not renewed, one for each tick."""
    law.tick(("teleop", NEUTRAL))
    law.tick(("teleop", velocity))
    outputs = [law.decision.output]
    while outputs[-1] != STANDSTILL:
        law.now_s += tick_s
        outputs.append(law.step(Inputs()).output)
    return outputs


@given(
    timeout_s=st.floats(0.05, 2.0),
    budget_m=st.floats(0.01, 2.0),
    speed_m_s=st.floats(0.05, 1.0),
    turn_rad_s=st.floats(-2.0, 2.0),
    tick_s=st.floats(0.005, CONFIG.transport_s),
)
def test_no_command_drives_farther_than_the_blind_budget(
    timeout_s: float, budget_m: float, speed_m_s: float, turn_rad_s: float, tick_s: float
) -> None:
    law = law_with(command_timeout_s=timeout_s, blind_budget_m=budget_m)
    outputs = outputs_until_zero(law, Velocity(speed_m_s, turn_rad_s), tick_s)
    driven_m = sum(abs(output.linear_m_s) for output in outputs) * tick_s
    turned_m = sum(abs(output.angular_rad_s) for output in outputs) * tick_s * law.config.hull.radius_m
    assert max(driven_m, turned_m) <= budget_m + 1e-9


def test_the_speed_falls_steadily_and_the_arc_keeps_its_shape() -> None:
    outputs = outputs_until_zero(law_with(), Velocity(1.0, 0.5))
    speeds = [output.linear_m_s for output in outputs]
    assert speeds == sorted(speeds, reverse=True)
    assert len(set(speeds)) > 4
    assert all(o.angular_rad_s == pytest.approx(0.5 * o.linear_m_s) for o in outputs)


def test_an_aged_command_is_limited_by_its_age_and_stops_nothing() -> None:
    law = law_with()
    law.tick(("teleop", NEUTRAL))
    law.tick(("teleop", FULL))
    law.hold(0.14)
    decision = law.decision
    assert (decision.mode, decision.limit, decision.reasons) == (Mode.LIMITED, Limit.COMMAND_AGE, ())
    assert decision.detail == "the next command is late"
    assert decision.scale == pytest.approx(0.4 * 0.2 / 0.215**2 * (1.0 - 0.14 / 0.2))
    assert law.tick(("teleop", FULL)).output == FULL  # without a neutral command
    assert law.decision.limit is None
    neutral = law.tick(("teleop", NEUTRAL))
    assert (neutral.mode, neutral.scale, neutral.limit) == (Mode.READY, 1.0, None)


@pytest.mark.parametrize(
    ("velocity", "rim_m_s"), [(FORWARD, 0.5), (BACK, 0.5), (SPIN, 0.5), (Velocity(0.1, 1.6), 0.4)]
)
def test_the_faster_of_the_origin_and_the_rim_has_the_permitted_speed(
    velocity: Velocity, rim_m_s: float
) -> None:
    law = law_with()
    law.tick(("teleop", NEUTRAL))
    law.tick(("teleop", velocity))
    scale = law.hold(0.18).scale
    assert scale == pytest.approx(0.4 * 0.2 / 0.215**2 * (1.0 - 0.18 / 0.2) / rim_m_s)


def test_a_speed_that_the_budget_never_permits_is_not_blamed_on_the_next_command() -> None:
    law = law_with(blind_budget_m=0.06)
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", FULL)).detail == "blind_budget_m permits less than this speed"
    assert law.hold(0.1).detail == "blind_budget_m permits less than this speed"
    fresh_m_s = 2.0 * 0.06 * 0.2 / (0.2 + CONFIG.transport_s / 2.0) ** 2
    law.tick(("teleop", Velocity(fresh_m_s, 0.0)))
    assert law.tick().detail == "the next command is late"


@pytest.mark.parametrize("velocity", [FULL, SPIN, BACK])
def test_commands_at_20_hz_are_never_limited_by_the_defaults(velocity: Velocity) -> None:
    law = law_with()
    law.tick(("teleop", NEUTRAL))
    for n in range(100):
        decision = law.tick(("teleop", velocity)) if n % 3 == 0 else law.tick()  # every 60 ms
        assert decision.output == velocity


def test_a_command_of_exactly_the_permitted_speed_is_not_limited() -> None:
    law = law_with(blind_budget_m=0.06)
    fresh_m_s = 2.0 * 0.06 * 0.2 / (0.2 + CONFIG.transport_s / 2.0) ** 2
    law.tick(("teleop", NEUTRAL))
    assert law.tick(("teleop", Velocity(fresh_m_s, 0.0))).limit is None
    assert law.tick(("teleop", Velocity(math.nextafter(fresh_m_s, 1.0), 0.0))).limit is Limit.COMMAND_AGE


def test_a_slow_robot_is_not_limited_before_a_long_timeout_ends() -> None:
    law = law_with(command_timeout_s=0.5)
    slow = Velocity(0.1, 0.0)
    law.tick(("teleop", NEUTRAL))
    law.tick(("teleop", slow))
    assert law.hold(0.42).output == slow
    assert law.hold(0.1).mode is Mode.STOPPED


def test_the_barrier_limits_more_than_the_age_where_it_permits_less() -> None:
    law = Law(room_m=0.8)
    law.tick(("teleop", NEUTRAL))
    limited = law.tick(("teleop", FULL))
    assert (limited.mode, limited.limit) == (Mode.LIMITED, None)
    assert law.hold(0.18).limit is Limit.COMMAND_AGE


def test_without_a_budget_the_age_limits_nothing() -> None:
    law = Law(ANY_AGE)
    law.drive()
    assert law.hold(0.18).output == FORWARD
    assert math.isinf(ANY_AGE.blind_budget_m)
