"""Every key of the wire, with its type, writer and rate. No other file spells a key.

Keys here are relative to the robot's namespace (`robot` by default), which the Bus puts before them.
They follow the zenoh-bridge-ros2dds mapping: ROS 2 topic `/robot/cmd_vel` is key `robot/cmd_vel`.
"""

import re
from dataclasses import dataclass
from typing import Any, Generic

from wire.messages import (
    Bool,
    Clock,
    DiagnosticArray,
    Imu,
    LaserScan,
    M,
    Odometry,
    Point,
    SafetyStatus,
    Twist,
)


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """A stream of messages under one key."""

    key: str
    type: type[M]
    writer: str
    rate_hz: float | None
    """None: on request."""


@dataclass(frozen=True, slots=True)
class Service:
    """A query that is answered with a `std_srvs/srv/Trigger` response.

    Its payload is nothing, or a `std_msgs/msg/String` that says what is wanted.
    """

    key: str
    server: str
    wants: str = ""
    """What its text may say; empty: it takes none."""


CMD_VEL = Topic("cmd_vel", Twist, "supervisor", 50.0)
SCAN = Topic("scan", LaserScan, "sim", 20.0)
ODOM = Topic("odom", Odometry, "sim", 50.0)
STATUS = Topic("supervisor/status", SafetyStatus, "supervisor", 10.0)
ESTOP = Topic("estop", Bool, "anyone", None)
OBSTACLE = Topic("sim/obstacle", Point, "tests, tools", None)
TRUTH = Topic("sim/truth", Odometry, "sim", 50.0)
"""Where the simulated robot really is, in the world's frame; nothing that drives may listen to it."""
IMU = Topic("imu", Imu, "sim", 100.0)
DIAGNOSTICS = Topic("diagnostics", DiagnosticArray, "sim", 1.0)
"""Also at once on a contact of the hull."""
CLOCK = Topic("clock", Clock, "sim", 50.0)
"""Simulated time, for those who need it: with `--speed 2` it runs twice as fast."""

SUPERVISOR_RESET = Service("supervisor/reset", "supervisor")
SIM_RESET = Service("sim/reset", "sim")
SIM_FAULTS = Service(
    "sim/faults",
    "sim",
    "none, or some of freeze, all_nan, silent, blocked FROM TO [CODE], dropout SHARE [CODE], beams SHARE [CODE], "
    "stray SHARE, reach METRES, rate HZ, each for one lidar with NAME: before it, no_odom, odom_zero, odom_freeze, "
    "odom_scale FACTOR, joined by ';'; nothing: which are in force",
)
SIM_TIME = Service("sim/time", "sim", "pause, run, step N, speed FACTOR; nothing: how time passes now")

MAX_LIDAR_TOPIC = 64

ALIVE_PREFIX = "alive"
"""`alive/<node>` is each process's liveliness token."""

SUPERVISOR, TELEOP, SIM = "supervisor", "teleop", "sim"
"""The node names of the three processes."""

ONLY_SUPERVISOR_WRITES = (CMD_VEL.key, STATUS.key)
"""What the hub refuses from any other client."""


def source_cmd_vel(source: str) -> Topic[Twist]:
    """What one command source (`teleop`, `joy`, `path`, …) asks for."""
    return Topic(f"{source}/cmd_vel", Twist, source, 20.0)


def source_holder(source: str) -> Service:
    """Who speaks as this command source: its holder answers with a sentence about itself."""
    return Service(f"{source}/holder", source)


def source_of(key: str) -> str | None:
    """The source that a command's key names; None for any other key."""
    source, _, rest = key.partition("/")
    return source if rest == CMD_VEL.key else None


def lidar_scan(topic: str) -> Topic[LaserScan]:
    """The scans of one of the robot's lidars: `scan` for the first one, `scan_rear` or `rear/scan` for others.

    Raises:
        ValueError: it is no relative key, or the key is something else's.
    """
    if topic == SCAN.key:
        return SCAN
    if re.fullmatch(r"[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*", topic) is None or len(topic) > MAX_LIDAR_TOPIC:
        raise ValueError(
            f"must be a relative key of small letters, digits and _ such as scan_rear, up to {MAX_LIDAR_TOPIC} characters"
        )
    taken = {entry.key for entry in (*TOPICS, *SERVICES)}
    first, last = topic.split("/", maxsplit=1)[0], topic.rsplit("/", maxsplit=1)[-1]
    if topic in taken or first in {ALIVE_PREFIX, SUPERVISOR, SIM} or last in {CMD_VEL.key, "holder"}:
        raise ValueError("must be a key of the lidar's own; this one is something else's")
    return Topic(topic, LaserScan, SCAN.writer, SCAN.rate_hz)


def alive(node: str) -> str:
    """The key of a node's liveliness token."""
    return f"{ALIVE_PREFIX}/{node}"


TOPICS: tuple[Topic[Any], ...] = (
    source_cmd_vel("<source>"),
    CMD_VEL,
    SCAN,
    Topic("<lidar>", LaserScan, SCAN.writer, SCAN.rate_hz),
    ODOM,
    STATUS,
    ESTOP,
    OBSTACLE,
    TRUTH,
    IMU,
    DIAGNOSTICS,
    CLOCK,
)
SERVICES = (SUPERVISOR_RESET, SIM_RESET, SIM_FAULTS, SIM_TIME, source_holder("<source>"))
