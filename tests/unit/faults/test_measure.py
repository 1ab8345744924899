"""The consequences of a fault, from the observations."""

import pytest

from faults.measure import BaseReport, Stop, stop_after
from faults.seen import Command, Motion, Seen, Status

FAULT_S = 1.0


def drive(stop_s: float | None) -> Seen:
    """0.5 m/s until `stop_s`, then an immediate standstill; odometry, commands and statuses every 20 ms."""
    seen, x_m = Seen(), 0.0
    for number in range(150):
        now_s = round(0.02 * number, 6)
        speed_m_s = 0.5 if stop_s is None or now_s < stop_s else 0.0
        x_m += 0.02 * speed_m_s
        seen.motions.append(Motion(now_s, x_m, 0.0, speed_m_s, 0.0))
        seen.commands.append(Command(now_s, speed_m_s, 0.0))
        seen.statuses.append(Status(now_s, () if speed_m_s else ("SOURCE_LOST", "COMMAND_TIMEOUT")))
    return seen


def test_a_stop_is_measured_from_the_fault() -> None:
    stop = stop_after(drive(1.2), FAULT_S)
    assert (stop.detector, stop.speed_m_s) == ("SOURCE_LOST", 0.5)
    assert stop.to_zero_s == pytest.approx(0.2)
    assert stop.to_standstill_s == pytest.approx(0.2)
    assert stop.distance_m == pytest.approx(0.1, abs=0.011)


def test_without_a_stop_there_is_nothing_to_measure() -> None:
    assert stop_after(drive(None), FAULT_S) == Stop(None, 0.5, None, None, None)
    assert stop_after(Seen(), FAULT_S) == Stop(None, 0.0, None, None, None)


def test_a_robot_that_was_stopped_already_reports_nothing() -> None:
    assert stop_after(drive(0.5), FAULT_S) == Stop(None, 0.0, None, None, None)


def test_a_base_that_brakes_first_is_the_detector() -> None:
    base = [BaseReport(0.5, "NO_COMMAND"), BaseReport(0.6, "OK"), BaseReport(1.15, "SUPERVISOR_LOST")]
    stop = stop_after(drive(1.2), FAULT_S, base)
    assert stop.detector == "base: SUPERVISOR_LOST"
    assert stop.to_zero_s == pytest.approx(0.15)


def test_a_stop_long_after_is_another_one() -> None:
    seen = drive(2.8)
    assert stop_after(seen, 0.5).detector is None
    assert stop_after(seen, 1.0).detector == "SOURCE_LOST"
    assert stop_after(seen, 1.0, within_s=1.0).detector is None


def test_a_robot_that_stood_has_no_way_to_a_standstill() -> None:
    seen = drive(1.2)
    seen.motions = [motion._replace(linear_m_s=0.0) for motion in seen.motions]
    stop = stop_after(seen, FAULT_S)
    assert (stop.detector, stop.to_standstill_s, stop.distance_m) == ("SOURCE_LOST", None, None)


def test_a_robot_that_swings_back_has_not_stopped_yet() -> None:
    seen = drive(1.2)
    seen.motions = [
        motion._replace(linear_m_s=0.2) if 1.25 < motion.time_s < 1.35 else motion for motion in seen.motions
    ]
    assert stop_after(seen, FAULT_S).to_standstill_s == pytest.approx(0.36)


def test_no_zero_after_the_fault_is_no_time() -> None:
    seen = drive(1.2)
    seen.commands = [command._replace(linear_m_s=0.5) for command in seen.commands]
    assert stop_after(seen, FAULT_S).to_zero_s is None
    seen.commands = [command._replace(linear_m_s=0.0) for command in seen.commands]
    assert stop_after(seen, FAULT_S).to_zero_s is None, "it was zero before"
