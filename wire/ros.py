"""The standard ROS 2 messages in use, as defined in Jazzy (msg/ros.msg).

rosbags has two hundred message types. Loading them all takes 60 ms and 2 MB, and the peers of a SIGKILLed process notice
its end only after the kernel has freed its memory.
"""

from dataclasses import dataclass, is_dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

Floats64 = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]


@dataclass
class Time:
    """`builtin_interfaces/msg/Time`."""

    sec: int
    nanosec: int
    __msgtype__: ClassVar[str] = "builtin_interfaces/msg/Time"


@dataclass
class Header:
    """`std_msgs/msg/Header`."""

    stamp: Time
    frame_id: str
    __msgtype__: ClassVar[str] = "std_msgs/msg/Header"


@dataclass
class Bool:
    """`std_msgs/msg/Bool`."""

    data: bool
    __msgtype__: ClassVar[str] = "std_msgs/msg/Bool"


@dataclass
class String:
    """`std_msgs/msg/String`."""

    data: str
    __msgtype__: ClassVar[str] = "std_msgs/msg/String"


@dataclass
class Clock:
    """`rosgraph_msgs/msg/Clock`."""

    clock: Time
    __msgtype__: ClassVar[str] = "rosgraph_msgs/msg/Clock"


@dataclass
class Vector3:
    """`geometry_msgs/msg/Vector3`."""

    x: float
    y: float
    z: float
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/Vector3"


@dataclass
class Point:
    """`geometry_msgs/msg/Point`."""

    x: float
    y: float
    z: float
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/Point"


@dataclass
class Quaternion:
    """`geometry_msgs/msg/Quaternion`."""

    x: float
    y: float
    z: float
    w: float
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/Quaternion"


@dataclass
class Pose:
    """`geometry_msgs/msg/Pose`."""

    position: Point
    orientation: Quaternion
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/Pose"


@dataclass
class PoseWithCovariance:
    """`geometry_msgs/msg/PoseWithCovariance`; the covariance is (36,)."""

    pose: Pose
    covariance: Floats64
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/PoseWithCovariance"


@dataclass
class Twist:
    """`geometry_msgs/msg/Twist`."""

    linear: Vector3
    angular: Vector3
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/Twist"


@dataclass
class TwistWithCovariance:
    """`geometry_msgs/msg/TwistWithCovariance`; the covariance is (36,)."""

    twist: Twist
    covariance: Floats64
    __msgtype__: ClassVar[str] = "geometry_msgs/msg/TwistWithCovariance"


@dataclass
class Odometry:
    """`nav_msgs/msg/Odometry`."""

    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance
    __msgtype__: ClassVar[str] = "nav_msgs/msg/Odometry"


@dataclass
class LaserScan:
    """`sensor_msgs/msg/LaserScan`; ranges and intensities are (n,)."""

    header: Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: Floats32
    intensities: Floats32
    __msgtype__: ClassVar[str] = "sensor_msgs/msg/LaserScan"


@dataclass
class Imu:
    """`sensor_msgs/msg/Imu`; the covariances are (9,)."""

    header: Header
    orientation: Quaternion
    orientation_covariance: Floats64
    angular_velocity: Vector3
    angular_velocity_covariance: Floats64
    linear_acceleration: Vector3
    linear_acceleration_covariance: Floats64
    __msgtype__: ClassVar[str] = "sensor_msgs/msg/Imu"


@dataclass
class KeyValue:
    """`diagnostic_msgs/msg/KeyValue`."""

    key: str
    value: str
    __msgtype__: ClassVar[str] = "diagnostic_msgs/msg/KeyValue"


@dataclass
class DiagnosticStatus:
    """`diagnostic_msgs/msg/DiagnosticStatus`."""

    OK: ClassVar[int] = 0
    WARN: ClassVar[int] = 1
    ERROR: ClassVar[int] = 2
    STALE: ClassVar[int] = 3

    level: int
    name: str
    message: str
    hardware_id: str
    values: list[KeyValue]
    __msgtype__: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticStatus"


@dataclass
class DiagnosticArray:
    """`diagnostic_msgs/msg/DiagnosticArray`."""

    header: Header
    status: list[DiagnosticStatus]
    __msgtype__: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticArray"


TYPES: tuple[type[Any], ...] = tuple(
    [one for one in list(globals().values()) if isinstance(one, type) and is_dataclass(one)]
)
"""All message types in this module."""
