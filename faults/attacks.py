"""A client that ignores the protocol: its messages, drawn from a random generator, and the client that sends them."""

import asyncio
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from random import Random
from typing import NamedTuple

import numpy as np

from wire import topics
from wire.bus import Bus
from wire.messages import (
    Bool,
    LaserScan,
    Point,
    Twist,
    Vector3,
    encode,
    laser_scan,
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
FREE_M, NOISE_M = 5.0, 0.002
"""Radius of the empty round room that a second lidar reports, and the noise of its readings."""
SCAN_PERIOD_S = 0.05
PERIOD_S = 0.01
"""At higher rates, several messages are sent together."""
SECOND = "second_teleop"
SECOND_PERIOD_S = 0.05
HOUR_NS = 3_600_000_000_000


class Shot(NamedTuple):
    """One message."""

    key: str
    """Key relative to the namespace."""
    payload: bytes
    attachment: bytes | None = None


class Knowledge(NamedTuple):
    """The data from which an attacker draws its messages."""

    chance: Random
    now_ns: Callable[[], int]
    """The clock of plausible stamps."""
    header_ns: Callable[[], int]
    """The clock of headers."""
    heard: Sequence[tuple[Twist, Stamp]] = ()
    """Commands of teleop that were heard before, in order of time."""


Attack = Callable[[Knowledge], Iterator[Shot]]


def malformed(knows: Knowledge) -> Iterator[Shot]:
    """Random bytes, some of them after a correct header."""
    chance = knows.chance
    while True:
        start = b"\x00\x01\x00\x00" if chance.random() < 0.5 else b""
        yield Shot(chance.choice(KEYS), start + chance.randbytes(chance.randrange(200)))


def truncated(knows: Knowledge) -> Iterator[Shot]:
    """Messages of the right type, truncated."""
    chance, whole = knows.chance, _right_ones(knows)
    while True:
        key = chance.choice(list(whole))
        payload = whole[key]
        yield Shot(key, payload[: chance.randrange(len(payload))])


def oversized(knows: Knowledge) -> Iterator[Shot]:
    """A correct message, followed by far too many bytes."""
    chance, whole = knows.chance, _right_ones(knows)
    while True:
        key = chance.choice(list(whole))
        size = chance.choice((1 << 10, 1 << 16, (1 << 20) + 1, MAX_OVERSIZED_BYTES))
        yield Shot(key, whole[key] + bytes(chance.randrange(size)))


def wrong_type(knows: Knowledge) -> Iterator[Shot]:
    """A valid message of another topic."""
    chance, whole = knows.chance, _right_ones(knows)
    while True:
        key, other = chance.sample(list(whole), 2)
        yield Shot(key, whole[other])


def not_finite(knows: Knowledge) -> Iterator[Shot]:
    """Messages with NaN and infinite values."""
    yield from _with_values(knows, (math.nan, math.inf, -math.inf))


def huge(knows: Knowledge) -> Iterator[Shot]:
    """Values beyond every robot's limits."""
    yield from _with_values(knows, (1e3, -1e6, 1e39, -1e300, 5e-324))


def attachments(knows: Knowledge) -> Iterator[Shot]:
    """Valid commands: replayed, with teleop's own epoch, or with attachments of other layouts, times and epochs."""
    chance, heard = knows.chance, knows.heard
    teleops_gid = heard[-1][1].gid if heard else bytes(GID_BYTES)
    motion = encode(planar_twist(SPEED_M_S, 0.0))
    while True:
        if chance.random() < 0.5:
            message = chance.choice((planar_twist(SPEED_M_S, 0.0), planar_twist(0.0, 1.0), zero_twist()))
            now_ns = knows.now_ns()
            known = [
                (message, Stamp(1 << 40, now_ns + HOUR_NS, teleops_gid)),
                (message, Stamp(1 << 50, 0, teleops_gid)),
                (message, Stamp(1, now_ns, chance.randbytes(GID_BYTES))),
                *([chance.choice(heard)] if heard else ()),
            ]
            message, stamp = chance.choice(known)
            yield Shot(SOURCE_KEYS[0], encode(message), stamp.pack())
            continue
        gid = chance.choice((bytes(GID_BYTES), b"\xff" * GID_BYTES, chance.randbytes(GID_BYTES)))
        number = chance.choice((0, 1, -1, 2**63 - 1, -(2**63), chance.randrange(2**40)))
        time_ns = chance.choice((0, -1, 2**63 - 1, -(2**63), chance.randrange(2**60)))
        good = Stamp(number, time_ns, gid).pack()
        attachment = chance.choice((None, b"", good, good[:-1], good + b"\0", chance.randbytes(33)))
        yield Shot(chance.choice(SOURCE_KEYS), motion, attachment)


def flood(knows: Knowledge) -> Iterator[Shot]:
    """Valid messages of one kind, at the highest possible rate."""
    chance, whole = knows.chance, _right_ones(knows)
    key = chance.choice(
        [*SOURCE_KEYS[:1] * 3, topics.SCAN.key, topics.ODOM.key, topics.ESTOP.key, topics.IMU.key]
    )
    while True:
        yield Shot(key, whole[key])


def rogue_cmd_vel(knows: Knowledge) -> Iterator[Shot]:
    """Commands on cmd_vel, bypassing the supervisor."""
    chance = knows.chance
    while True:
        speed_m_s = chance.choice((SPEED_M_S, -SPEED_M_S, math.nan))
        yield Shot(chance.choice(ROGUE_KEYS), encode(planar_twist(speed_m_s, 0.5)))


def second_lidar(knows: Knowledge) -> Iterator[Shot]:
    """A second client's scans, all NaN."""
    while True:
        yield Shot(topics.SCAN.key, encode(_scan([math.nan] * 360, knows.header_ns())))


def second_plausible_lidar(knows: Knowledge, rate_hz: float) -> Iterator[Shot]:
    """A second client's plausible scans; all without a stamp, or all with valid stamps in order."""
    chance = knows.chance
    gid = chance.randbytes(GID_BYTES) if chance.random() < 0.5 else None
    for number in itertools.count(1):
        attachment = None if gid is None else Stamp(number, number * round(1e9 / rate_hz), gid).pack()
        yield Shot(topics.SCAN.key, encode(free_scan(chance, knows.header_ns())), attachment)


def free_scan(chance: Random, time_ns: int | None = None) -> LaserScan:
    """Return a plausible scan of an empty round room; no two are equal."""
    noise = np.random.default_rng(chance.randrange(1 << 31))
    ranges = noise.normal(FREE_M, NOISE_M, 360).astype(np.float32)
    return laser_scan(ranges, range_m=(0.1, 12.0), period_s=SCAN_PERIOD_S, time_ns=time_ns)


def estop(knows: Knowledge) -> Iterator[Shot]:  # noqa: ARG001 - as every attack
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
    "second_lidar_steady": (partial(second_plausible_lidar, rate_hz=STEADY_HZ), STEADY_HZ),
    "second_lidar_flood": (partial(second_plausible_lidar, rate_hz=FLOOD_HZ), FLOOD_HZ),
    "estop": (estop, 50.0),
}
"""Each attack, and its rate in messages per second."""


def _right_ones(knows: Knowledge) -> dict[str, bytes]:
    """Return a message of the right type for a key."""
    chance, time_ns = knows.chance, knows.header_ns()
    scan = _scan([chance.uniform(0.5, 12.0) for _ in range(360)], time_ns)
    twist = encode(planar_twist(chance.uniform(-1.0, 1.0), chance.uniform(-2.0, 2.0)))
    return {
        **dict.fromkeys((*SOURCE_KEYS, topics.CMD_VEL.key), twist),
        topics.SCAN.key: encode(scan),
        topics.ODOM.key: encode(odometry((0.0, 0.0, 0.0), (chance.uniform(-1.0, 1.0), 0.0), time_ns=time_ns)),
        topics.ESTOP.key: encode(Bool(data=False)),
        topics.OBSTACLE.key: encode(Point(0.0, 0.0, -1.0)),
        topics.STATUS.key: chance.randbytes(80),
        topics.IMU.key: chance.randbytes(300),
    }


def _with_values(knows: Knowledge, values: tuple[float, ...]) -> Iterator[Shot]:
    chance = knows.chance
    while True:
        value = chance.choice(values)
        key = chance.choice((*SOURCE_KEYS, topics.SCAN.key, topics.ODOM.key, topics.OBSTACLE.key))
        if key == topics.SCAN.key:
            message = _scan([value] * chance.choice((1, 90, 360)), knows.header_ns())
        elif key == topics.ODOM.key:
            message = odometry((value, 0.0, 0.0), (value, value), time_ns=knows.header_ns())
        elif key == topics.OBSTACLE.key:
            message = Point(value, chance.choice((0.0, value)), 0.0)
        else:
            message = _twist(value, chance)
        yield Shot(key, encode(message))


def _twist(value: float, chance: Random) -> Twist:
    """Return a Twist with the value in one of its six components."""
    twist = zero_twist()
    part: Vector3 = chance.choice((twist.linear, twist.angular))
    setattr(part, chance.choice("xyz"), value)
    return twist


def _scan(ranges_m: list[float], time_ns: int) -> LaserScan:
    with np.errstate(over="ignore"):  # a huge value becomes infinite in 32 bits
        ranges = np.array(ranges_m).astype(np.float32)
    scan = laser_scan(ranges, range_m=(0.1, 12.0), period_s=SCAN_PERIOD_S, time_ns=time_ns)
    scan.angle_max = math.pi
    return scan


class Attacker:
    """A client with at most one attack at a time.

    Args:
        bus: a client of its own, for a program that poses as teleop.
        put: sends any bytes.
        clocks: the clock of stamps, and that of headers [ns].
        heard: returns the commands of teleop that were heard so far.
    """

    def __init__(
        self,
        bus: Bus,
        put: Callable[[Shot], object],
        clocks: tuple[Callable[[], int], Callable[[], int]],
        heard: Callable[[], Sequence[tuple[Twist, Stamp]]],
    ) -> None:
        self._bus, self._put, self._clocks, self._heard = bus, put, clocks, heard
        self._attack: asyncio.Task[None] | None = None
        self._sent = 0

    def begin(self, name: str, seed: int, for_s: float) -> None:
        """End the present attack, and begin one that ends after `for_s`."""
        self.end()
        self._sent = 0
        chance = Random(seed)  # noqa: S311 - to be repeated is what it is for
        work = self._pose_as_teleop(chance, for_s) if name == SECOND else self._shoot(name, chance, for_s)
        self._attack = asyncio.ensure_future(work)

    def end(self) -> int:
        """End the attack; return the number of sent messages."""
        if self._attack is not None:
            self._attack.cancel()
            self._attack = None
        return self._sent

    async def _shoot(self, name: str, chance: Random, for_s: float) -> None:
        clock = asyncio.get_running_loop().time
        attack, rate_hz = ATTACKS[name]
        shots = attack(Knowledge(chance, *self._clocks, tuple(self._heard())))
        began_s = clock()
        while (elapsed_s := clock() - began_s) < for_s:
            while self._sent <= elapsed_s * rate_hz:
                shot = next(shots, None)
                if shot is None:
                    return
                self._sent += 1
                self._put(shot)
            await asyncio.sleep(PERIOD_S)

    async def _pose_as_teleop(self, chance: Random, for_s: float) -> None:
        """Publish as a second teleop, with a token and valid stamps: neutral first or not, then motion."""
        token = self._bus.declare_alive(topics.TELEOP)
        commands = self._bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        neutral_first = chance.randrange(6)
        try:
            for number in range(round(for_s / SECOND_PERIOD_S)):
                commands.put(planar_twist(0.0 if number < neutral_first else SPEED_M_S, 0.0))
                self._sent += 1
                await asyncio.sleep(SECOND_PERIOD_S)
        finally:
            token.withdraw()
