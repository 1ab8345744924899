"""Convert the robot's state to the messages of a real base. Headers have wall-clock stamps, for people and recordings."""

import numpy as np

from sim.drive import Twist
from sim.encoders import Reckoning
from sim.imu import ImuConfig, Motion
from sim.lidar import Ranges
from sim.lidar_geometry import LidarConfig
from sim.plant import Pose
from wire.messages import (
    Clock,
    Imu,
    LaserScan,
    Odometry,
    Quaternion,
    Time,
    Vector3,
    header,
    laser_scan,
    odometry,
)

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
        np.diag(np.full(3, config.gyro_noise_rad_s**2)).reshape(-1),
        Vector3(*motion.accel_m_s2),
        np.diag(np.full(3, config.accel_noise_m_s2**2)).reshape(-1),
    )


def to_clock(time_s: float) -> Clock:
    """Return simulated time as a message."""
    seconds, nanoseconds = divmod(round(time_s * 1e9), 1_000_000_000)
    return Clock(Time(seconds, nanoseconds))


def _covariance(known: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Return the 6 × 6 covariance, row by row as (36,), from the covariance of some of the axes."""
    full = np.diag(np.full(6, HELD_BY_THE_FLOOR))
    full[np.ix_(axes, axes)] = known
    return full.reshape(-1)
