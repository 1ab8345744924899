"""In the open, silence counts as free without a return before, at a speed of its own."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.decision import Mode
from supervisor.law.lidar import PROFILES
from supervisor.law.model import LawConfig
from supervisor.law.reckoning import Velocity
from supervisor.law.scan import Mount
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    BEAMS,
    FORWARD,
    NEUTRAL,
    Law,
    ring,
    with_lidar,
)
from wire.reasons import Limit, StopReason

OPEN = replace(ANY_AGE, works_in_the_open=True)
FAST = Velocity(1.0, 0.0)
NO_RETURN = ring(math.inf)


def in_a_field(config: LawConfig = OPEN) -> Law:
    law = Law(config, room_m=math.inf)
    law.hold(0.1, ("teleop", NEUTRAL))
    return law


def test_in_a_field_without_returns_the_robot_drives_for_ever_at_a_speed_of_its_own() -> None:
    law = in_a_field()
    for _ in range(40):
        assert law.hold(1.0, ("teleop", FAST)).output == Velocity(0.5, 0.0)
    assert (law.decision.mode, law.decision.limit, law.decision.causes) == (
        Mode.LIMITED,
        Limit.IN_THE_OPEN,
        (),
    )
    assert law.decision.detail == "open_m_s permits 0.5 m/s while a lidar is silent"


@pytest.mark.parametrize("name", PROFILES)
def test_that_holds_for_every_sensor(name: str) -> None:
    law = in_a_field(with_lidar(OPEN, profile=PROFILES[name]))
    assert law.hold(20.0, ("teleop", FAST)).output == Velocity(0.5, 0.0)


def test_a_robot_that_does_not_work_in_the_open_does_not_move() -> None:
    law = in_a_field(ANY_AGE)
    assert law.drive(FAST).reasons[0] is StopReason.SCAN_INVALID


@pytest.mark.parametrize(
    ("asked", "output"),
    [
        (FORWARD, FORWARD),
        (Velocity(-1.0, 0.0), Velocity(-0.5, 0.0)),
        (Velocity(0.0, 2.0), Velocity(0.0, 2.0)),  # 0.5 m/s at the rim
        (Velocity(0.5, 2.0), Velocity(0.25, 1.0)),
        (Velocity(0.501, 0.0), Velocity(0.5, 0.0)),
    ],
)
def test_the_speed_of_the_hull_is_limited(asked: Velocity, output: Velocity) -> None:
    decision = in_a_field().drive(asked)
    assert decision.output == pytest.approx(output)
    assert (decision.limit is Limit.IN_THE_OPEN) is (asked != output)


def test_the_configuration_names_the_speed() -> None:
    law = in_a_field(replace(OPEN, open_m_s=0.2))
    assert law.drive(FAST).output == pytest.approx(Velocity(0.2, 0.0))
    assert "0.2 m/s" in law.decision.detail


@pytest.mark.parametrize("asked", [Velocity(0.0, 5e-324), Velocity(5e-324, 0.0), Velocity(-5e-324, 5e-324)])
def test_a_motion_too_slow_for_a_float_is_no_error(asked: Velocity) -> None:
    law = in_a_field(replace(OPEN, shown_m_s2=math.inf))
    assert law.drive(asked).output == pytest.approx(NEUTRAL)


def test_masked_beams_need_no_return_in_the_open() -> None:
    """The others have returned: silence there is proven, and not only assumed."""
    masked = Mount(masked_rad=((1.0, 2.0),))
    law = Law(with_lidar(OPEN, mount=masked), room_m=11.9)
    law.drive(FAST)
    for count in range(BEAMS, 0, -10):
        law.ranges[count - 10 :] = math.inf
        law.tick(("teleop", FAST))
    law.hold(0.5, ("teleop", NEUTRAL))
    scan = law.state.sight.lidars[0].scan
    assert scan is not None
    assert not scan.is_assumed


def test_a_tighter_limit_is_the_one_that_is_named() -> None:
    law = in_a_field(replace(OPEN, blind_budget_m=0.2, open_m_s=0.99))
    law.drive(FAST)
    law.hold(0.1)
    assert law.decision.limit is Limit.COMMAND_AGE
    assert 0.0 < law.decision.output.linear_m_s < 0.99


def test_silence_after_a_return_is_proven_free_up_to_its_limits() -> None:
    """15 s and 5 m: until then at full speed, and then at that of the open."""
    law = Law(OPEN, room_m=11.9)
    law.drive(FAST)
    for count in range(BEAMS, 0, -10):  # not all at once
        law.ranges[count - 10 :] = math.inf
        law.tick(("teleop", FAST))
    assert law.hold(14.0, ("teleop", FAST)).output == FAST
    assert law.hold(2.0, ("teleop", FAST)).output == Velocity(0.5, 0.0)


@pytest.mark.parametrize(("returns", "drives"), [(1, True), (35, True), (36, False), (180, False)])
def test_where_a_tenth_of_the_beams_return_silence_is_judged_by_its_limits(
    returns: int, *, drives: bool
) -> None:
    law = in_a_field()
    law.hold(20.0, ("teleop", FAST))
    law.ranges = NO_RETURN.copy()
    law.ranges[:returns] = 8.0  # behind, to the right
    law.hold(0.5, ("teleop", FAST))
    assert (law.decision.output == Velocity(0.5, 0.0)) is drives
    assert (StopReason.SCAN_BLIND in law.decision.reasons) is not drives


def test_a_pillar_in_a_field_is_an_obstacle() -> None:
    law = in_a_field()
    law.hold(16.0, ("teleop", FORWARD))
    law.ranges = NO_RETURN.copy()
    law.ranges[BEAMS // 2 - 3 : BEAMS // 2 + 4] = 0.5
    law.tick(("teleop", FAST))
    assert law.tick(("teleop", FAST)).reasons == (StopReason.OBSTACLE,)
    assert law.drive(Velocity(-1.0, 0.0)).output == Velocity(-0.5, 0.0)


def test_returns_that_vanish_at_once_are_no_open_field() -> None:
    law = in_a_field()
    law.ranges = NO_RETURN.copy()
    ahead = np.abs(np.arange(BEAMS) - BEAMS // 2) <= 10
    law.ranges[ahead] = 3.0
    law.hold(0.1, ("teleop", FAST))
    law.ranges = NO_RETURN
    assert law.hold(0.5, ("teleop", FAST)).reasons == (StopReason.SCAN_BLIND,)


def test_a_reading_that_the_profile_does_not_explain_is_no_silence() -> None:
    law = in_a_field()
    law.ranges = NO_RETURN.copy()
    law.ranges[BEAMS // 2 - 10 : BEAMS // 2 + 10] = math.nan
    assert law.hold(0.5, ("teleop", FAST)).reasons == (StopReason.SCAN_BLIND,)
