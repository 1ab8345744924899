"""The pure parts of an exam: which faults are injected, when a robot has its speed, where the pillar is; and the base."""

import math

import pytest

from faults.grade.exam import MOVING_M_S, STEADY_M_S, STEADY_S, counting, is_steady, place_ahead
from faults.grade.marks import Fault
from faults.grade.robot import Base, Setup
from faults.grade.rubric import DEFAULT, parse
from recordings.incidents.braking import Motion
from wire import cdr
from wire.cdr import Planar

FORWARD, STANDSTILL = cdr.twist(Planar(0.5, 0.0)), cdr.twist(cdr.STANDSTILL)


def drive(speeds_m_s: list[float], period_s: float = 0.1) -> list[Motion]:
    return [
        Motion(number * period_s, number * period_s * speed, 0.0, speed, 0.0)
        for number, speed in enumerate(speeds_m_s)
    ]


def test_a_fault_without_points_is_not_injected() -> None:
    rubric = parse(DEFAULT.read_text().replace("points = 25", "points = 0"), "mine")
    assert list(counting(rubric)) == [fault for fault in Fault if fault is not Fault.KILLED]


def test_the_program_hangs_first_if_only_its_continuation_has_points() -> None:
    rubric = parse(DEFAULT.read_text().replace("points = 20", "points = 0"), "mine")
    assert Fault.STOPPED in counting(rubric)
    neither = parse(
        DEFAULT.read_text().replace("points = 20", "points = 0").replace("points = 10", "points = 0"), "mine"
    )
    assert Fault.STOPPED not in counting(neither)


def test_a_robot_has_its_speed_once_it_has_not_changed_for_the_whole_time() -> None:
    count = round(STEADY_S / 0.1) + 1
    assert is_steady(drive([0.3] * count))
    assert not is_steady(drive([0.3] * (count - 2)))
    assert not is_steady(drive([MOVING_M_S] * count))
    assert not is_steady(drive([0.3] * (count - 1) + [0.3 + 2 * STEADY_M_S]))
    assert not is_steady([])


def test_the_pillar_is_in_the_direction_of_the_last_travel() -> None:
    diagonal = [Motion(0.1 * n, 0.1 * n, 0.1 * n, 0.5, 0.0) for n in range(5)]
    x_m, y_m = place_ahead(diagonal, 1.0)
    assert x_m == pytest.approx(0.4 + math.sqrt(0.5))
    assert y_m == pytest.approx(0.4 + math.sqrt(0.5))
    assert place_ahead([Motion(0.0, 1.0, 2.0, 0.0, 0.0)], 1.0) == (2.0, 2.0)


async def test_a_base_without_a_timeout_keeps_its_last_command() -> None:
    base = Base(None)
    assert base.output(0.0) == STANDSTILL
    base.command(FORWARD, None, 1.0)
    assert base.output(1e6) == FORWARD
    base.forget()
    assert base.output(1e6) == STANDSTILL


async def test_a_base_with_a_timeout_stops_just_after_it() -> None:
    base = Base(0.5)
    base.command(FORWARD, None, 1.0)
    assert base.output(1.5) == FORWARD
    assert base.output(math.nextafter(1.5, 2.0)) == STANDSTILL


@pytest.mark.parametrize("payload", [b"", b"garbage", FORWARD[:-1], FORWARD * 2])
async def test_a_base_ignores_what_is_no_twist(payload: bytes) -> None:
    base = Base(None)
    base.command(FORWARD, None, 1.0)
    base.command(payload, None, 2.0)
    assert base.output(2.0) == FORWARD


def test_a_setup_says_what_the_program_drives() -> None:
    assert "keeps the last command" in str(Setup())
    assert "stops after 0.5 s" in str(Setup(timeout_s=0.5))
    assert "supervisor" in str(Setup(lifeline=True))
