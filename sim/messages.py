"""Convert the robot's state to the messages of a real base, and the simulation's state to diagnostics.

Headers have wall-clock stamps, for people and recordings.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from sim.drive import Twist
from sim.lidar import Ranges
from sim.lidar_config import LidarConfig
from sim.motion_sensors import ImuConfig, Motion, Reckoning
from sim.pace import Measured
from sim.plant import Pose
from sim.sensor_faults import NO_FAULTS, SensorFaults
from wire import cdr
from wire.messages import (
    Clock,
    DiagnosticArray,
    DiagnosticStatus,
    Imu,
    KeyValue,
    LaserScan,
    Odometry,
    Quaternion,
    Time,
    Vector3,
    header,
    laser_scan,
    odometry,
)
from wire.watchdog import BaseReason

PLANAR = (0, 1, 5)
"""Indices of x, y and yaw among x, y, z, roll, pitch, yaw."""
SPEEDS = (0, 5)
"""Indices of v and ω among the six components of a twist."""
HELD_BY_THE_FLOOR = 1e-6
"""Variance of the components that are zero for a planar robot; zero would mean unknown."""


def to_scan(ranges: Ranges, lidar: LidarConfig, period_s: float, reach_m: float | None = None) -> LaserScan:
    """Return a scan in the lidar's frame, with all readings taken at the same time.

    Args:
        ranges: (beams,) in m.
        lidar: the lidar's configuration.
        period_s: simulated time since the previous scan.
        reach_m: the present maximum range; None: the configured one.
    """
    message = laser_scan(
        ranges,
        angle_min_rad=lidar.angle_min_rad,
        angle_increment_rad=lidar.angle_increment_rad,
        range_m=(lidar.range_min_m, min(lidar.range_max_m, reach_m or lidar.range_max_m)),
        period_s=period_s,
    )
    message.header.frame_id = lidar.name
    return message


def to_odometry(reckoning: Reckoning) -> Odometry:
    """Return wheel odometry: the pose in `odom`, the twist in `base_link`."""
    message = odometry(reckoning[:3], reckoning[3:5])
    message.pose.covariance = _covariance(reckoning.pose_covariance, PLANAR)
    message.twist.covariance = _covariance(reckoning.twist_covariance, SPEEDS)
    return message


def to_truth(pose: Pose, velocity: Twist) -> Odometry:
    """Return the robot's true pose in the world and its true velocity; covariances are zero because they are exact."""
    message = odometry(pose, velocity)
    message.header.frame_id = "world"
    return message


def to_imu(motion: Motion, config: ImuConfig) -> Imu:
    """Return rates and specific force in the frame `imu`, without orientation: its first covariance element is -1."""
    unknown = np.zeros(9)
    unknown[0] = -1.0
    return Imu(
        header("imu"),
        Quaternion(0.0, 0.0, 0.0, 1.0),
        unknown,
        Vector3(*motion.gyro_rad_s),
        _equal_variances(config.gyro_noise_rad_s),
        Vector3(*motion.accel_m_s2),
        _equal_variances(config.accel_noise_m_s2),
    )


def to_clock(time_s: float) -> Clock:
    """Return simulated time as a message."""
    return Clock(Time(*cdr.time_of(round(time_s * 1e9))))


def _equal_variances(deviation: float) -> np.ndarray:
    """Return the 3 × 3 covariance, row by row as (9,), of three independent components."""
    full = np.zeros(9)
    full[::4] = deviation**2
    return full


def _covariance(known: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Return the 6 × 6 covariance, row by row as (36,), from the covariance of some of the axes."""
    full = np.zeros(36)
    full[::7] = HELD_BY_THE_FLOOR
    for row, variances in zip(axes, known.tolist(), strict=True):
        for column, variance in zip(axes, variances, strict=True):
            full[6 * row + column] = variance
    return full


# --- diagnostics: base, hull, time, sensors and movers

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
HARDWARE = "sim"
BASE = f"{HARDWARE}: base"
"""The name of the base's status; its value `reason` is a BaseReason."""
MOVERS = f"{HARDWARE}: movers"


@dataclass(frozen=True, slots=True)
class Health:
    """The values to report.

    Attributes:
        base: the result of the base's watchdog.
        touches: whether the hull has contact now.
        collisions: number of collisions since the last reset.
        last_contact: the object of the last contact.
        time_s: simulated time.
        speed: requested simulated seconds per second.
        paused: whether the simulation is paused.
        measured: the pace since the last report.
        faults: the active sensor faults.
        movers: x, y [m] and yaw [rad] of the movers in the world frame, by name, also those of a placed `pillar`.
    """

    base: BaseReason
    touches: bool
    collisions: int
    last_contact: str | None
    time_s: float
    speed: float
    paused: bool
    measured: Measured
    faults: SensorFaults
    movers: Mapping[str, tuple[float, float, float]]


def to_diagnostics(health: Health) -> DiagnosticArray:
    """Return the diagnostics: one status for each of the same five subjects."""
    statuses = [
        _hull(health),
        _time(health),
        _sensors(health.faults),
        _movers(health.movers),
        _base(health.base),
    ]
    return DiagnosticArray(header(""), statuses)


def base_reason(message: DiagnosticArray) -> str | None:
    """Return the BaseReason in a diagnostics message; None if it has none."""
    told = (value for status in message.status if status.name == BASE for value in status.values)
    return next((value.value for value in told if value.key == "reason"), None)


def movers_of(message: DiagnosticArray) -> dict[str, Pose] | None:
    """Return the movers in a diagnostics message, by name; None if it has none."""
    for status in message.status:
        if status.name == MOVERS:
            with suppress(TypeError, ValueError):
                return {value.key: Pose(*map(float, value.value.split())) for value in status.values}
    return None


def contact_sentence(health: Health) -> str:
    """Return a sentence about the present contact of the hull, or the contacts since the last reset."""
    what = health.last_contact or "something"
    if health.touches:
        return f"the hull touches {what}"
    if health.collisions:
        times = "once" if health.collisions == 1 else f"{health.collisions} times"
        return f"the hull has hit something {times} since the last reset, last {what}"
    return "the hull has touched nothing since the last reset"


def pace_sentence(speed: float, measured: Measured) -> str:
    """Return a sentence about the lost simulated time and the achieved speed."""
    return (
        f"cannot keep up: {measured.factor:.2f} times real time instead of {speed:g}; "
        f"{measured.lost_s:.2f} s of simulated time were skipped"
    )


def _base(reason: BaseReason) -> DiagnosticStatus:
    level, sentence = (OK, "follows cmd_vel") if reason is BaseReason.OK else (WARN, f"brakes: {reason}")
    return _status("base", level, sentence, reason=reason)


def _hull(health: Health) -> DiagnosticStatus:
    level = ERROR if health.touches else WARN if health.collisions else OK
    return _status(
        "hull",
        level,
        contact_sentence(health),
        touches=str(health.touches).lower(),
        collisions=str(health.collisions),
        last_contact=health.last_contact or "",
    )


def _time(health: Health) -> DiagnosticStatus:
    level, sentence = OK, f"runs at {health.speed:g} times real time"
    if health.measured.lost_s > 0.0:
        level, sentence = WARN, pace_sentence(health.speed, health.measured)
    if health.paused:
        level, sentence = WARN, f"paused at {health.time_s:.3f} s"
    return _status(
        "time",
        level,
        sentence,
        time_s=f"{health.time_s:.3f}",
        speed=f"{health.speed:g}",
        real_time_factor=f"{health.measured.factor:.3f}",
        lost_s=f"{health.measured.lost_s:.3f}",
        paused=str(health.paused).lower(),
    )


def _sensors(faults: SensorFaults) -> DiagnosticStatus:
    if faults == NO_FAULTS:
        return _status("sensors", OK, "no fault in force", faults="none")
    return _status("sensors", WARN, f"faults in force: {faults}", faults=str(faults))


def _movers(movers: Mapping[str, tuple[float, float, float]]) -> DiagnosticStatus:
    places = {name: f"{x_m:.2f} {y_m:.2f} {yaw_rad:.2f}" for name, (x_m, y_m, yaw_rad) in movers.items()}
    return _status("movers", OK, f"{len(places)} movers" if places else "no movers", **places)


def _status(subject: str, level: int, sentence: str, /, **values: str) -> DiagnosticStatus:
    return DiagnosticStatus(
        level,
        f"{HARDWARE}: {subject}",
        sentence,
        HARDWARE,
        [KeyValue(key, value) for key, value in values.items()],
    )
