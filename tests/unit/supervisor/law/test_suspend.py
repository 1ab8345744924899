"""A suspend of the machine: earlier data looks fresh, and must not move the robot."""

import math
from dataclasses import replace

import pytest

from supervisor.law.decision import Mode
from supervisor.law.model import Command, Inputs
from tests.unit.supervisor.law.law_harness import (
    CONFIG,
    FORWARD,
    NEUTRAL,
    SCAN_TIMEOUT_S,
    TICK_S,
    Law,
    odometry,
    on_time,
)
from wire.reasons import StopReason

SLEPT_S = 3600.0
HELD_S = max(CONFIG.command_timeout_s, SCAN_TIMEOUT_S)


def driving(now_s: float = 1000.0) -> Law:
    law = Law(now_s=now_s)
    law.drive()
    assert law.hold(0.1, ("teleop", FORWARD)).mode is Mode.DRIVING
    return law


def resume(law: Law, *commands: Command, slept_s: float = SLEPT_S) -> None:
    """The next step, on time by the monotonic clock, which stood still."""
    law.now_s += 0.001
    law.step(Inputs(commands=commands, suspended_s=slept_s))


def test_a_suspend_stops_with_overrun_though_everything_looks_fresh() -> None:
    law = driving()
    resume(law)
    assert law.decision.mode is Mode.STOPPED
    assert law.decision.output == NEUTRAL
    assert set(law.decision.reasons) == {
        StopReason.OVERRUN,
        StopReason.SCAN_STALE,
        StopReason.COMMAND_TIMEOUT,
    }


def test_a_suspend_counts_from_just_beyond_the_overrun_limit() -> None:
    law = driving()
    resume(law, slept_s=CONFIG.overrun_s)
    assert law.decision.mode is Mode.DRIVING
    resume(law, slept_s=math.nextafter(CONFIG.overrun_s, 1.0))
    assert StopReason.OVERRUN in law.decision.reasons


def test_after_a_suspend_motion_alone_never_moves_and_neutral_arms() -> None:
    law = driving()
    resume(law)
    decision = law.hold(2.0, ("teleop", FORWARD))
    assert decision.output == NEUTRAL
    assert StopReason.OVERRUN in decision.reasons
    assert law.drive().mode is Mode.DRIVING


def test_what_comes_with_the_first_step_after_a_suspend_does_not_count() -> None:
    law = driving()
    resume(law, on_time("teleop", NEUTRAL, law.now_s + 0.001), on_time("teleop", FORWARD, law.now_s + 0.001))
    assert law.state.sight.lidars[0].scan is None, (
        "a scan that was taken in with the suspend may be older than it"
    )
    (teleop,) = [s for s in law.decision.sources if s.config.name == "teleop"]
    assert teleop.neutral_s < law.now_s
    assert law.now_s - teleop.sent_s > SLEPT_S


def test_a_command_and_odometry_from_before_a_suspend_are_as_old_as_they_are() -> None:
    law = driving()
    law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s))
    resume(law)
    (teleop,) = [s for s in law.decision.sources if s.config.name == "teleop"]
    assert law.now_s - teleop.sent_s == pytest.approx(SLEPT_S + 0.001)
    assert law.state.base.odometry is not None
    assert law.now_s - law.state.base.odometry.arrival_s == pytest.approx(SLEPT_S + TICK_S + 0.001)


def test_odometry_that_was_heard_before_a_suspend_must_be_heard_again() -> None:
    law = driving()
    law.tick(("teleop", FORWARD), odometry=odometry(0.5, law.now_s))
    resume(law)
    law.hold(1.0, ("teleop", NEUTRAL))
    law.drive()
    assert law.decision.causes == (StopReason.ODOM_STALE,)
    assert law.decision.mode is Mode.STOPPED
    law.tick(("teleop", NEUTRAL), odometry=odometry(0.0, law.now_s))
    assert law.tick(("teleop", FORWARD)).mode is Mode.DRIVING


def test_a_neutral_that_was_still_on_its_way_does_not_arm() -> None:
    law = driving()
    resume(law)
    resumed_s = law.now_s
    while law.now_s + 0.02 - resumed_s <= HELD_S:
        decision = law.tick(("teleop", NEUTRAL))
        assert StopReason.OVERRUN in decision.reasons
    law.tick(("teleop", FORWARD))
    assert law.now_s - resumed_s > HELD_S
    assert law.decision.output == NEUTRAL
    assert law.drive().mode is Mode.DRIVING


@pytest.mark.parametrize("is_over", [False, True])
def test_overrun_is_held_until_just_after_the_timeouts(is_over: bool) -> None:  # noqa: FBT001
    law = driving(-0.2)
    law.now_s = -0.001
    resume(law)
    assert law.state.clock.resumed_s == 0.0, "so that no difference of times is rounded"
    while law.now_s + 0.05 < HELD_S:
        law.tick(("teleop", FORWARD))
    law.now_s = math.nextafter(HELD_S, math.inf) if is_over else HELD_S
    law.step(Inputs(commands=(on_time("teleop", NEUTRAL, law.now_s),)))
    assert (law.decision.mode is Mode.READY) is is_over


def test_neither_odometry_nor_free_places_from_before_a_suspend_count() -> None:
    law = Law(config=replace(CONFIG, unseen_memory_s=1.0))
    law.tick(odometry=odometry(0.2, law.now_s + TICK_S))
    assert law.state.sight.past
    law.now_s += 0.001
    law.scanning = False
    law.step(Inputs(odometry=odometry(0.5, law.now_s), undecodable_lidars=(0,), suspended_s=SLEPT_S))
    assert law.state.sight.past == ()
    assert law.state.base.odometry is not None
    assert law.state.base.odometry.velocity == (0.2, 0.0), "what came with the suspend may be from before it"


def test_a_suspend_does_not_reset_an_estop() -> None:
    law = driving()
    law.tick(("teleop", NEUTRAL), estop=True)
    resume(law)
    law.hold(1.0, ("teleop", NEUTRAL))
    assert law.decision.reasons[0] is StopReason.ESTOP


def test_an_estop_that_comes_with_the_suspend_counts() -> None:
    law = driving()
    law.now_s += 0.001
    law.step(Inputs(estop=True, suspended_s=SLEPT_S))
    assert law.decision.reasons[0] is StopReason.ESTOP
