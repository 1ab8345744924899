"""The messages of an attacker on the wire, drawn from a random generator. Pure."""

import math
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from faults import writers
from wire import topics
from wire.messages import (
    Bool,
    LaserScan,
    Point,
    Twist,
    Vector3,
    encode,
    header,
    odometry,
    planar_twist,
    zero_twist,
)
from wire.stamp import GID_BYTES, Stamp

SOURCE_KEYS = tuple(topics.source_cmd_vel(name).key for name in (topics.TELEOP, "joy", "path", "stranger"))
KEYS = (
    *SOURCE_KEYS,
    *(topic.key for topic in topics.TOPICS if "<" not in topic.key),
    topics.alive(topics.SUPERVISOR),
    topics.alive(topics.TELEOP),
)
ROGUE_KEYS = (topics.CMD_VEL.key, "*", "**", "c*", "cmd_vel/**")
"""Key expressions that match cmd_vel."""
MAX_OVERSIZED_BYTES = 3 << 20
SPEED_M_S = 0.9
STEADY_HZ, FLOOD_HZ = 20.0, 2000.0
"""Rate of a second lidar's scans."""


class Shot(NamedTuple):
    """One message."""

    key: str
    """Key relative to the namespace."""
    payload: bytes
    attachment: bytes | None = None


Attack = Callable[[random.Random], Iterator[Shot]]


def malformed(chance: random.Random) -> Iterator[Shot]:
    """Random bytes, some of them after a correct header."""
    while True:
        start = b"\x00\x01\x00\x00" if chance.random() < 0.5 else b""
        yield Shot(chance.choice(KEYS), start + chance.randbytes(chance.randrange(200)))


def truncated(chance: random.Random) -> Iterator[Shot]:
    """Messages of the right type, truncated."""
    whole = _right_ones(chance)
    while True:
        key = chance.choice(list(whole))
        payload = whole[key]
        yield Shot(key, payload[: chance.randrange(len(payload))])


def oversized(chance: random.Random) -> Iterator[Shot]:
    """A correct message, followed by far too many bytes."""
    whole = _right_ones(chance)
    while True:
        key = chance.choice(list(whole))
        size = chance.choice((1 << 10, 1 << 16, (1 << 20) + 1, MAX_OVERSIZED_BYTES))
        yield Shot(key, whole[key] + bytes(chance.randrange(size)))


def wrong_type(chance: random.Random) -> Iterator[Shot]:
    """A valid message of another topic."""
    whole = _right_ones(chance)
    while True:
        key, other = chance.sample(list(whole), 2)
        yield Shot(key, whole[other])


def not_finite(chance: random.Random) -> Iterator[Shot]:
    """Messages with NaN and infinite values."""
    yield from _with_values(chance, (math.nan, math.inf, -math.inf))


def huge(chance: random.Random) -> Iterator[Shot]:
    """Values beyond every robot's limits."""
    yield from _with_values(chance, (1e3, -1e6, 1e39, -1e300, 5e-324))


def attachments(chance: random.Random) -> Iterator[Shot]:
    """Valid commands with attachments of other layouts, times and epochs."""
    payload = encode(planar_twist(SPEED_M_S, 0.0))
    while True:
        gid = chance.choice((bytes(GID_BYTES), b"\xff" * GID_BYTES, chance.randbytes(GID_BYTES)))
        number = chance.choice((0, 1, -1, 2**63 - 1, -(2**63), chance.randrange(2**40)))
        time_ns = chance.choice((0, -1, 2**63 - 1, -(2**63), chance.randrange(2**60)))
        good = Stamp(number, time_ns, gid).pack()
        attachment = chance.choice((None, b"", good, good[:-1], good + b"\0", chance.randbytes(33)))
        yield Shot(chance.choice(SOURCE_KEYS), payload, attachment)


def flood(chance: random.Random) -> Iterator[Shot]:
    """Valid messages of one kind, at the highest possible rate."""
    whole = _right_ones(chance)
    key = chance.choice(
        [*SOURCE_KEYS[:1] * 3, topics.SCAN.key, topics.ODOM.key, topics.ESTOP.key, topics.IMU.key]
    )
    while True:
        yield Shot(key, whole[key])


def rogue_cmd_vel(chance: random.Random) -> Iterator[Shot]:
    """Commands on cmd_vel, bypassing the supervisor."""
    while True:
        speed_m_s = chance.choice((SPEED_M_S, -SPEED_M_S, math.nan))
        yield Shot(chance.choice(ROGUE_KEYS), encode(planar_twist(speed_m_s, 0.5)))


def second_lidar(chance: random.Random) -> Iterator[Shot]:  # noqa: ARG001 - as every attack
    """A second client's scans, all NaN."""
    while True:
        yield Shot(topics.SCAN.key, encode(_scan([math.nan] * 360)))


def second_lidar_steady(chance: random.Random) -> Iterator[Shot]:
    """A second client's plausible scans, at a lidar's rate."""
    yield from _free_space(chance, STEADY_HZ)


def second_lidar_flood(chance: random.Random) -> Iterator[Shot]:
    """The same, at the highest possible rate."""
    yield from _free_space(chance, FLOOD_HZ)


def _free_space(chance: random.Random, rate_hz: float) -> Iterator[Shot]:
    for attachment in writers.attachments(chance, rate_hz):
        yield Shot(topics.SCAN.key, encode(writers.free_scan(chance)), attachment)


def estop(chance: random.Random) -> Iterator[Shot]:  # noqa: ARG001 - as every attack
    """One emergency stop."""
    yield Shot(topics.ESTOP.key, encode(Bool(data=True)))


ATTACKS: dict[str, tuple[Attack, float]] = {
    "malformed": (malformed, 400.0),
    "truncated": (truncated, 400.0),
    "oversized": (oversized, 20.0),
    "wrong_type": (wrong_type, 400.0),
    "not_finite": (not_finite, 400.0),
    "huge": (huge, 400.0),
    "attachments": (attachments, 400.0),
    "flood": (flood, 10_000.0),
    "rogue_cmd_vel": (rogue_cmd_vel, 400.0),
    "second_lidar": (second_lidar, 20.0),
    "second_lidar_steady": (second_lidar_steady, STEADY_HZ),
    "second_lidar_flood": (second_lidar_flood, FLOOD_HZ),
    "estop": (estop, 50.0),
}
"""Each attack, and its rate in messages per second."""


def _right_ones(chance: random.Random) -> dict[str, bytes]:
    """Return a message of the right type for a key."""
    scan = _scan([chance.uniform(0.5, 12.0) for _ in range(360)])
    twist = encode(planar_twist(chance.uniform(-1.0, 1.0), chance.uniform(-2.0, 2.0)))
    return {
        **dict.fromkeys((*SOURCE_KEYS, topics.CMD_VEL.key), twist),
        topics.SCAN.key: encode(scan),
        topics.ODOM.key: encode(odometry((0.0, 0.0, 0.0), (chance.uniform(-1.0, 1.0), 0.0))),
        topics.ESTOP.key: encode(Bool(data=False)),
        topics.OBSTACLE.key: encode(Point(0.0, 0.0, -1.0)),
        topics.STATUS.key: chance.randbytes(80),
        topics.IMU.key: chance.randbytes(300),
    }


def _with_values(chance: random.Random, values: tuple[float, ...]) -> Iterator[Shot]:
    while True:
        value = chance.choice(values)
        key = chance.choice((*SOURCE_KEYS, topics.SCAN.key, topics.ODOM.key, topics.OBSTACLE.key))
        if key == topics.SCAN.key:
            message = _scan([value] * chance.choice((1, 90, 360)))
        elif key == topics.ODOM.key:
            message = odometry((value, 0.0, 0.0), (value, value))
        elif key == topics.OBSTACLE.key:
            message = Point(value, chance.choice((0.0, value)), 0.0)
        else:
            message = _twist(value, chance)
        yield Shot(key, encode(message))


def _twist(value: float, chance: random.Random) -> Twist:
    """Return a Twist with the value in one of its six components."""
    twist = zero_twist()
    part: Vector3 = chance.choice((twist.linear, twist.angular))
    setattr(part, chance.choice("xyz"), value)
    return twist


def _scan(ranges_m: list[float]) -> LaserScan:
    with np.errstate(over="ignore"):  # a huge value becomes infinite in 32 bits
        ranges = np.array(ranges_m).astype(np.float32)
    return LaserScan(
        header("lidar"),
        angle_min=-math.pi,
        angle_max=math.pi,
        angle_increment=math.tau / max(1, len(ranges_m)),
        time_increment=0.0,
        scan_time=0.05,
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
        intensities=np.empty(0, dtype=np.float32),
    )
