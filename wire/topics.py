"""All keys of the wire, with type, writer, rate, and the roles that may write them. No other file contains a key.

Keys are relative to the robot's namespace (`robot` by default); the Bus adds it as a prefix.
They follow the zenoh-bridge-ros2dds mapping: ROS 2 topic `/robot/cmd_vel` is key `robot/cmd_vel`.
"""

import re
from dataclasses import dataclass, replace
from typing import Any, Generic

from wire.lease import CHALLENGE_PERIOD_S
from wire.message_types import EstopLease, M, SafetyStatus
from wire.roles import Role
from wire.ros import Bool, Clock, DiagnosticArray, Imu, LaserScan, Odometry, Point, Twist


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """A stream of messages under one key."""

    key: str
    type: type[M]
    writer: str
    rate_hz: float | None
    """None for a topic without a fixed rate."""
    roles: tuple[Role, ...] = ()
    """Whose puts the hub accepts; none: only the supervisor, which is the hub, writes it."""
    fresh_only: bool = False
    """Whether a sample is useful only until the next one: then it may be lost, and is never sent again (session.py)."""


@dataclass(frozen=True, slots=True)
class Service:
    """A query with a `std_srvs/srv/Trigger` response.

    Its payload is empty, or a `std_msgs/msg/String` with the request.
    """

    key: str
    server: str
    wants: str = ""
    """The requests that its text may contain; empty if it takes no text."""
    roles: tuple[Role, ...] = ()
    """Whose replies the hub accepts; none: only the supervisor serves it."""


CMD_VEL = Topic("cmd_vel", Twist, "supervisor", 50.0, fresh_only=True)
SENSORS = (Role.SENSOR, Role.BASE)
"""A simulated robot, and a ROS 2 process, are base and sensors in one."""
SCAN = Topic("scan", LaserScan, "sim", 20.0, SENSORS, fresh_only=True)
ANYONE = "anyone"
"""The writer of topics that any program may write."""

ODOM = Topic("odom", Odometry, "sim", 50.0, (Role.BASE,), fresh_only=True)
STATUS = Topic("supervisor/status", SafetyStatus, "supervisor", 10.0, fresh_only=True)
ESTOP = Topic("estop", Bool, ANYONE, None, (Role.OPERATOR, Role.ESTOP, Role.BASE))
OBSTACLE = Topic("sim/obstacle", Point, ANYONE, None, (Role.OPERATOR,))
TRUTH = Topic("sim/truth", Odometry, "sim", 50.0, (Role.BASE,), fresh_only=True)
"""Ground truth of the simulated robot's pose, in the world frame; no driving program may subscribe to it."""
IMU = Topic("imu", Imu, "sim", 100.0, SENSORS, fresh_only=True)
DIAGNOSTICS = Topic("diagnostics", DiagnosticArray, "sim", 1.0, SENSORS)
"""Also published immediately on a contact of the hull."""
CLOCK = Topic("clock", Clock, "sim", 50.0, (Role.BASE,), fresh_only=True)
"""Simulated time; with `--speed 2` it runs twice as fast as real time."""

SUPERVISOR_RESET = Service("supervisor/reset", "supervisor")
SIM_RESET = Service("sim/reset", "sim", roles=(Role.BASE,))
SIM_FAULTS = Service(
    "sim/faults",
    "sim",
    "none, or some of freeze, all_nan, silent, blocked FROM TO [CODE], dropout SHARE [CODE], beams SHARE [CODE], "
    "stray SHARE, reach METRES, rate HZ, each for one lidar with NAME: before it, no_odom, odom_zero, odom_freeze, "
    "odom_scale FACTOR, joined by ';'; nothing: which are in force",
    (Role.BASE,),
)
SIM_TIME = Service(
    "sim/time", "sim", "pause, run, step N, speed FACTOR; nothing: how time passes now", (Role.BASE,)
)

MAX_LIDAR_TOPIC = 64

ALIVE_PREFIX = "alive"
"""`alive/<node>` is each process's liveliness token; `alive/<node>/<epoch>` is that of one run of it."""

SUPERVISOR, TELEOP, SIM, ROS2 = "supervisor", "teleop", "sim", "ros2"
"""The node names of the processes."""

EXEC_SUFFIX = "-exec"
"""`<source>-exec` is the node of `lifeline ros2 exec --source <source>`; no source has a hyphen in its name."""

ESTOP_SUFFIX = "-estop"
"""`<name>-estop` is the node of an e-stop station."""
ESTOP_STATION = "estop_station"
"""The first part of the keys of e-stop stations."""


def source_cmd_vel(source: str) -> Topic[Twist]:
    """Return the topic of the commands of one source (`teleop`, `joy`, `path`, …)."""
    return Topic(f"{source}/cmd_vel", Twist, source, 20.0, (Role.OPERATOR,), fresh_only=True)


def source_holder(source: str) -> Service:
    """Return the service at which the process that holds a command source describes itself in one sentence."""
    return Service(f"{source}/holder", source, roles=(Role.OPERATOR,))


def estop_presence(station: str) -> Topic[EstopLease]:
    """Return the topic on which an e-stop station answers the supervisor's challenges."""
    key, rate_hz = f"{ESTOP_STATION}/{station}/presence", 1.0 / CHALLENGE_PERIOD_S
    return Topic(key, EstopLease, "e-stop station", rate_hz, (Role.OPERATOR, Role.ESTOP))


def estop_challenge(station: str) -> Topic[EstopLease]:
    """Return the topic of the supervisor's challenges to an e-stop station."""
    key = f"{ESTOP_STATION}/{station}/challenge"
    return Topic(key, EstopLease, SUPERVISOR, 1.0 / CHALLENGE_PERIOD_S)


def estop_node(station: str) -> str:
    """Return the node name of an e-stop station, for its tokens."""
    return f"{station}{ESTOP_SUFFIX}"


def is_supervisors(key: str) -> bool:
    """Return whether only the supervisor may write this key: the hub refuses it from every client."""
    first, last = key.partition("/")[0], key.rpartition("/")[2]
    return key in {CMD_VEL.key, STATUS.key} or (first == ESTOP_STATION and last == "challenge")


def source_of(key: str) -> str | None:
    """Return the source in the key of a command; None for any other key."""
    source, _, rest = key.partition("/")
    return source if rest == CMD_VEL.key else None


def lidar_scan(topic: str) -> Topic[LaserScan]:
    """Return the scan topic of one of the robot's lidars, such as `scan`, `scan_rear` or `rear/scan`.

    Raises:
        ValueError: the topic is not a relative key, or its key is already used.
    """
    if topic == SCAN.key:
        return SCAN
    if re.fullmatch(r"[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*", topic) is None or len(topic) > MAX_LIDAR_TOPIC:
        raise ValueError(
            f"must be a relative key of small letters, digits and _ such as scan_rear, up to {MAX_LIDAR_TOPIC} characters"
        )
    taken = {entry.key for entry in (*TOPICS, *SERVICES)}
    first, last = topic.split("/", maxsplit=1)[0], topic.rsplit("/", maxsplit=1)[-1]
    if (
        topic in taken
        or first in {ALIVE_PREFIX, SUPERVISOR, SIM, ESTOP_STATION}
        or last in {CMD_VEL.key, "holder"}
    ):
        raise ValueError("is already used for another topic or a node; choose a key such as scan_rear")
    return replace(SCAN, key=topic)


def alive(node: str, epoch: bytes = b"") -> str:
    """Return the key of a node's liveliness token, or of the token of one of its runs.

    Any client can hold the same token, which then outlives the node. The token of a run is the node's own: its epoch is
    the gid in the stamps of a source's commands, or the id of a server's session.
    """
    return f"{ALIVE_PREFIX}/{node}/{epoch.hex()}" if epoch else f"{ALIVE_PREFIX}/{node}"


def token_of(text: str) -> tuple[str, bytes] | None:
    """Return the node and the epoch (empty: none) of a token's key after `alive/`; None if it has another form."""
    node, slash, epoch = text.partition("/")
    if not slash:
        return node, b""
    return (node, bytes.fromhex(epoch)) if re.fullmatch("([0-9a-f]{2}){1,16}", epoch) else None


SOURCE_PLACEHOLDER, LIDAR_PLACEHOLDER, STATION_PLACEHOLDER = "<source>", "<lidar>", "<station>"

TOPICS: tuple[Topic[Any], ...] = (
    source_cmd_vel(SOURCE_PLACEHOLDER),
    CMD_VEL,
    SCAN,
    replace(SCAN, key=LIDAR_PLACEHOLDER),
    ODOM,
    STATUS,
    ESTOP,
    estop_presence(STATION_PLACEHOLDER),
    estop_challenge(STATION_PLACEHOLDER),
    OBSTACLE,
    TRUTH,
    IMU,
    DIAGNOSTICS,
    CLOCK,
)
SERVICES = (SUPERVISOR_RESET, SIM_RESET, SIM_FAULTS, SIM_TIME, source_holder(SOURCE_PLACEHOLDER))
