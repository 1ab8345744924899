"""Which commands reach the base without Lifeline."""

import math

from passport.bypass import Valve
from supervisor.estop_record import MemoryRecord
from teleop.path.permit import HEARD_S, what_is_missing, what_stops
from wire.messages import planar_twist
from wire.reasons import StopReason

ZERO, MOTION = planar_twist(0.0, 0.0), planar_twist(0.4, 0.1)
NOW_S = 7.0


def valve(record: MemoryRecord | None = None) -> Valve:
    return Valve(("teleop", "path"), record or MemoryRecord())


def test_the_source_that_moved_last_commands_the_base_and_zeros_of_the_other_do_not_reach_it() -> None:
    one = valve()
    assert not one.passes("path", ZERO, NOW_S)
    assert one.passes("teleop", MOTION, NOW_S)
    assert not one.passes("path", ZERO, NOW_S)
    assert one.passes("teleop", ZERO, NOW_S)
    assert one.passes("path", MOTION, NOW_S)
    assert not one.passes("teleop", ZERO, NOW_S)


def test_what_is_no_planar_velocity_does_not_reach_the_base() -> None:
    one = valve()
    aside = planar_twist(0.4, 0.0)
    aside.linear.y = 0.1
    assert not one.passes("teleop", aside, NOW_S)
    assert not one.passes("teleop", planar_twist(math.nan, 0.0), NOW_S)
    assert not one.passes("teleop", planar_twist(0.0, math.inf), NOW_S)
    assert one.status(NOW_S).owner == ""


def test_a_pressed_e_stop_is_recorded_and_nothing_passes_until_its_reset() -> None:
    record = MemoryRecord()
    one = valve(record)
    assert one.passes("teleop", MOTION, NOW_S)
    one.press()
    assert record.latched
    assert not one.passes("teleop", MOTION, NOW_S)
    status = one.status(NOW_S)
    assert status.mode == status.STOPPED
    assert status.causes_and_latched() == ([StopReason.ESTOP], [])
    refused = one.reset(NOW_S)
    assert (refused.success, refused.message) == (False, "teleop requests motion")
    assert one.is_latched
    assert one.reset(NOW_S + HEARD_S + 0.1).success
    assert not record.latched
    assert one.passes("teleop", MOTION, NOW_S)


def test_an_e_stop_that_was_recorded_before_is_latched_from_the_start() -> None:
    assert not valve(MemoryRecord(latched=True)).passes("teleop", MOTION, NOW_S)


def test_a_source_may_drive_once_it_is_heard_and_the_other_does_not_move() -> None:
    one = valve()
    assert what_is_missing(one.status(NOW_S), "path") == "the supervisor does not hear path"
    one.passes("path", ZERO, NOW_S)
    assert what_is_missing(one.status(NOW_S), "path") is None
    one.passes("teleop", MOTION, NOW_S)
    assert what_is_missing(one.status(NOW_S), "path") == "teleop drives; it must stop first"
    assert what_stops(one.status(NOW_S), "teleop") is None
    assert what_is_missing(one.status(NOW_S + HEARD_S + 0.01), "path") == "the supervisor does not hear path"
