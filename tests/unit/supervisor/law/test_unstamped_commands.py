"""Commands without stamps, as a ROS 2 bridge sends them: nobody can tell their age, and a backlog arrives in a burst."""

import random
from itertools import accumulate

import pytest

from supervisor.law.decision import Mode
from supervisor.law.model import Command, Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.unit.supervisor.law.law_harness import ANY_AGE, CONFIG, FORWARD, NEUTRAL, TICK_S, Law
from wire.reasons import StopReason

TIMEOUT_S = CONFIG.command_timeout_s
BACKLOG = (NEUTRAL, *[FORWARD] * 29)
"""One and a half seconds of an operator who begins to drive, at 20 Hz."""


def held(law: Law, velocity: Velocity, seconds: float, period_s: float = 0.04) -> list[Velocity]:
    """Send a command without a stamp each period; return the outputs."""
    ticks = round(period_s / TICK_S)
    outputs: list[Velocity] = []
    for n in range(round(seconds / TICK_S)):
        law.tick_unstamped(*[velocity] * (n % ticks == 0))
        outputs.append(law.decision.output)
    return outputs


def driving() -> Law:
    """A source without stamps drives the robot."""
    law = Law(ANY_AGE)
    held(law, NEUTRAL, 2 * TIMEOUT_S)
    assert held(law, FORWARD, 0.2)[-1] == FORWARD
    return law


def burst(law: Law, spread_s: float = 0.0) -> list[Velocity]:
    """Deliver the backlog, evenly spread over a time; return the outputs, also of the second after it."""
    start_s, outputs = law.now_s + TICK_S, list[Velocity]()
    for n, velocity in enumerate(BACKLOG):
        law.now_s = start_s + spread_s * n / (len(BACKLOG) - 1)
        outputs.append(law.step(Inputs(commands=(Command("teleop", velocity, law.now_s),))).output)
    for _ in range(50):
        outputs.append(law.tick().output)
    return outputs


def test_a_backlog_in_one_step_arms_and_moves_nothing() -> None:
    law = Law()
    law.hold(1.0)
    law.tick_unstamped(*BACKLOG)
    assert not law.state.interlock.sources[0].armed
    assert law.decision.reasons == (StopReason.NO_COMMAND,)
    assert {law.tick().output for _ in range(50)} == {STANDSTILL}


@pytest.mark.parametrize("spread_s", [0.0, 0.003, 0.05, 0.99 * TIMEOUT_S])
def test_a_backlog_that_arrives_within_one_timeout_moves_nothing(spread_s: float) -> None:
    law = Law()
    law.hold(1.0)
    assert set(burst(law, spread_s)) == {STANDSTILL}


@pytest.mark.parametrize("stall_s", [TIMEOUT_S + TICK_S, 1.0, pytest.param(60.0, marks=pytest.mark.proof)])
def test_a_backlog_after_a_stall_does_not_move_a_robot_that_was_driven_before_it(stall_s: float) -> None:
    law = driving()
    assert law.hold(stall_s).reasons == (StopReason.COMMAND_TIMEOUT,)
    assert set(burst(law, 0.003)) == {STANDSTILL}
    assert not law.state.interlock.sources[0].armed


def test_the_neutral_of_a_backlog_does_not_arm_the_commands_that_follow_it() -> None:
    law = driving()
    law.hold(1.0)
    law.tick_unstamped(*BACKLOG)
    assert set(held(law, FORWARD, 5.0)) == {STANDSTILL}
    assert law.decision.reasons == (StopReason.COMMAND_TIMEOUT,)
    held(law, NEUTRAL, 0.04)
    assert held(law, FORWARD, 0.04)[-1] == FORWARD


def test_a_stall_within_the_timeout_does_not_stop_a_proven_source() -> None:
    """What such a stall withholds is no older than the timeout, and the newest command comes last."""
    law = driving()
    assert law.hold(0.14).output == FORWARD
    law.tick_unstamped(FORWARD, FORWARD, FORWARD)
    assert law.decision.output == FORWARD
    assert law.hold(TIMEOUT_S + TICK_S).reasons == (StopReason.COMMAND_TIMEOUT,)


def test_a_source_without_stamps_is_obeyed_at_each_change_of_its_command() -> None:
    law = driving()
    for n in range(100):
        velocity = Velocity(0.1 + n * 1e-3, 0.1 * (n % 3))
        assert law.tick_unstamped(velocity).commanded == velocity
        assert law.tick().mode is not Mode.STOPPED


@pytest.mark.parametrize("rate_hz", [10.0, 20.0])
@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.proof), pytest.param(2, marks=pytest.mark.proof)]
)
def test_a_source_without_stamps_at_10_or_20_hz_drives_on_in_spite_of_jitter(
    rate_hz: float, seed: int
) -> None:
    """Each command is late by up to 70 ms, for a minute."""
    chance = random.Random(seed)
    law = Law(ANY_AGE)
    start_s = law.now_s
    sent_s = [start_s + n / rate_hz for n in range(round(60.0 * rate_hz))]
    arrivals_s = list(accumulate((at_s + chance.uniform(0.0, 0.07) for at_s in sent_s), max))
    driven_s, heard = 0.0, 0
    while law.now_s < start_s + 59.5:
        law.now_s += TICK_S
        commands: list[Command] = []
        while arrivals_s[heard] <= law.now_s:
            velocity = NEUTRAL if arrivals_s[heard] < start_s + 0.5 else FORWARD
            commands.append(Command("teleop", velocity, arrivals_s[heard]))
            heard += 1
        law.step(Inputs(commands=tuple(commands)))
        driven_s += TICK_S * (law.decision.output == FORWARD)
        if law.now_s > start_s + 0.7:
            assert law.decision.output == FORWARD
    assert driven_s > 58.0
