"""The texts that `lifeline status` and `lifeline watch` share."""

import math

from deploy.stack.formatting import mode_name, nearest, number, speed
from wire.messages import SafetyStatus, header, planar_twist


def test_the_nearest_point_has_a_distance_and_a_direction_if_they_are_known() -> None:
    assert nearest(0.5, math.nan) == "0.50 m"
    assert nearest(0.5, 0.0, " from the hull") == "0.50 m from the hull, ahead"
    assert nearest(0.5, math.pi / 2) == "0.50 m, at 90° left"
    assert nearest(math.nan, 0.0) == "unknown"


def test_a_mode_of_a_newer_supervisor_has_a_name() -> None:
    assert mode_name(SafetyStatus(header("", 0), mode=200)) == "LIMITED"


def test_a_velocity_has_no_negative_zero() -> None:
    assert speed(planar_twist(-0.001, -0.001)) == "0.00 m/s, 0.00 rad/s"


def test_what_json_cannot_represent_is_none() -> None:
    assert [number(value) for value in (None, math.nan, -math.inf, 1.23456)] == [None, None, None, 1.2346]
