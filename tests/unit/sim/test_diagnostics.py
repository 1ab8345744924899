"""The simulated robot's messages: its sensors', and what the simulation says of itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.drive import Twist
from sim.lidar_config import LidarConfig
from sim.messages import (
    Health,
    base_reason,
    movers_of,
    to_clock,
    to_diagnostics,
    to_imu,
    to_odometry,
    to_scan,
    to_truth,
)
from sim.motion_sensors import ImuConfig, Motion, Reckoning
from sim.pace import Measured
from sim.plant import Pose
from sim.sensor_faults import NO_FAULTS, parse_faults
from wire.messages import DiagnosticArray, DiagnosticStatus, decode, encode
from wire.watchdog import BaseReason

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

WELL = Health(
    base=BaseReason.OK,
    touches=False,
    collisions=0,
    last_contact=None,
    time_s=12.5,
    speed=1.0,
    paused=False,
    measured=Measured(1.0, 0.0),
    faults=NO_FAULTS,
    movers={},
)


def said(health: Health, subject: str) -> tuple[int, str]:
    """One subject's level and sentence, after the way over the wire."""
    message = decode(encode(to_diagnostics(health)), DiagnosticArray)
    (status,) = (s for s in message.status if s.name == f"sim: {subject}")
    assert status.hardware_id == "sim"
    return status.level, status.message


def values(health: Health, subject: str) -> dict[str, str]:
    (status,) = (s for s in to_diagnostics(health).status if s.name == f"sim: {subject}")
    return {value.key: value.value for value in status.values}


def test_a_robot_that_is_well_says_so_of_everything() -> None:
    assert said(WELL, "base") == (OK, "follows cmd_vel")
    assert said(WELL, "hull") == (OK, "the hull has touched nothing since the last reset")
    assert said(WELL, "time") == (OK, "runs at 1 times real time")
    assert said(WELL, "sensors") == (OK, "no fault in force")
    assert said(WELL, "movers") == (OK, "no movers")
    assert values(WELL, "hull") == {"touches": "false", "collisions": "0", "last_contact": ""}
    assert values(WELL, "sensors") == {"faults": "none"}


@pytest.mark.parametrize("reason", BaseReason)
def test_why_the_base_drives_as_it_does_comes_back_from_its_diagnostics(reason: BaseReason) -> None:
    health = replace(WELL, base=reason)
    assert base_reason(decode(encode(to_diagnostics(health)), DiagnosticArray)) == reason
    if reason is not BaseReason.OK:
        assert said(health, "base") == (WARN, f"brakes: {reason}")


def test_diagnostics_of_others_give_no_reason_of_the_base() -> None:
    others = [status for status in to_diagnostics(WELL).status if status.name != "sim: base"]
    assert base_reason(replace(to_diagnostics(WELL), status=others)) is None


@pytest.mark.parametrize(
    ("touches", "collisions", "level", "sentence"),
    [
        (True, 1, ERROR, "the hull touches rack_3"),
        (False, 1, WARN, "the hull has hit something once since the last reset, last rack_3"),
        (False, 3, WARN, "the hull has hit something 3 times since the last reset, last rack_3"),
    ],
)
def test_a_contact_is_an_error_while_it_lasts_and_a_warning_until_the_reset(
    *, touches: bool, collisions: int, level: int, sentence: str
) -> None:
    health = replace(WELL, touches=touches, collisions=collisions, last_contact="rack_3")
    assert said(health, "hull") == (level, sentence)
    assert values(health, "hull")["collisions"] == str(collisions)


def test_a_contact_with_something_that_has_no_name_is_one() -> None:
    assert said(replace(WELL, touches=True), "hull") == (ERROR, "the hull touches something")


def test_lost_time_is_a_warning_with_the_speed_that_was_reached() -> None:
    slow = replace(WELL, speed=50.0, measured=Measured(31.4, 18.6))
    assert said(slow, "time") == (
        WARN,
        "cannot keep up: 31.40 times real time instead of 50; 18.60 s of simulated time were skipped",
    )
    assert values(slow, "time") == {
        "time_s": "12.500",
        "speed": "50",
        "real_time_factor": "31.400",
        "lost_s": "18.600",
        "paused": "false",
    }


def test_a_pause_is_a_warning_whatever_the_pace_was() -> None:
    paused = replace(WELL, paused=True, measured=Measured(math.nan, 0.3))
    assert said(paused, "time") == (WARN, "paused at 12.500 s")


def test_faults_in_force_are_a_warning_that_names_them() -> None:
    faulty = replace(WELL, faults=parse_faults("freeze; rate 2"))
    assert said(faulty, "sensors") == (WARN, "faults in force: freeze; rate 2")


def test_whoever_goes_about_is_reported_with_the_place_whatever_the_name() -> None:
    busy = replace(WELL, movers={"level": (1.0, -2.5, 0.0), "forklift": (0.25, 3.0, 1.57)})
    assert said(busy, "movers") == (OK, "2 movers")
    assert values(busy, "movers") == {"level": "1.00 -2.50 0.00", "forklift": "0.25 3.00 1.57"}


def test_the_movers_come_back_from_the_diagnostics() -> None:
    busy = replace(WELL, movers={"forklift": (0.25, 3.0, 1.57), "pillar": (1.0, -2.5, 0.0)})
    message = decode(encode(to_diagnostics(busy)), DiagnosticArray)
    assert movers_of(message) == busy.movers
    (told,) = (status for status in message.status if status.name == "sim: movers")
    told.values[0].value = "here"
    assert movers_of(message) is None
    assert movers_of(replace(message, status=[])) is None


def test_a_scan_has_its_lidar_s_frame_and_geometry_and_the_present_reach() -> None:
    lidar = LidarConfig(name="front", beams=3, span_rad=math.pi)
    message = to_scan(np.ones(3, np.float32), lidar, 0.05, reach_m=2.0)
    assert message.header.frame_id == "front"
    assert (message.range_min, message.range_max) == pytest.approx((0.1, 2.0))
    assert (message.angle_min, message.angle_increment) == pytest.approx((-0.5 * math.pi, 0.5 * math.pi))
    assert to_scan(np.ones(3, np.float32), lidar, 0.05).range_max == pytest.approx(12.0)


def test_odometry_has_the_covariance_of_its_axes_and_the_truth_has_none() -> None:
    message = to_odometry(Reckoning(1.0, 2.0, 0.0, 0.5, 0.1, 4.0 * np.eye(3), 9.0 * np.eye(2)))
    assert np.diag(message.pose.covariance.reshape(6, 6)) == pytest.approx([4.0, 4.0, 1e-6, 1e-6, 1e-6, 4.0])
    assert np.diag(message.twist.covariance.reshape(6, 6)) == pytest.approx(
        [9.0, 1e-6, 1e-6, 1e-6, 1e-6, 9.0]
    )
    truth = to_truth(Pose(1.0, 2.0, 0.0), Twist(0.5, 0.1))
    assert (truth.header.frame_id, truth.pose.pose.position.x, truth.twist.twist.linear.x) == (
        "world",
        1.0,
        0.5,
    )
    assert not truth.pose.covariance.any()


def test_the_inertial_unit_has_no_orientation_and_the_variance_of_its_noise() -> None:
    message = to_imu(Motion((0.1, 0.2, 0.3), (0.0, 0.0, 9.81)), ImuConfig(0.5, 2.0))
    assert message.orientation_covariance[0] == -1.0
    assert message.angular_velocity_covariance[0] == pytest.approx(0.25)
    assert message.linear_acceleration_covariance[0] == pytest.approx(4.0)
    assert (message.angular_velocity.z, message.linear_acceleration.z) == (0.3, 9.81)


def test_the_clock_is_simulated_time_to_the_nanosecond() -> None:
    clock = to_clock(12.5).clock
    assert (clock.sec, clock.nanosec) == (12, 500_000_000)
