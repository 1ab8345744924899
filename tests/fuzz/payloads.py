"""Hostile payloads, drawn from a `Random`: the same one gives the same bytes."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.fuzz.places import Place, places
from wire.messages import (
    MAX_PAYLOAD_BYTES,
    MAX_SEQUENCE_LENGTH,
    Bool,
    Clock,
    DiagnosticArray,
    DiagnosticStatus,
    Imu,
    KeyValue,
    LaserScan,
    Message,
    Odometry,
    Point,
    Quaternion,
    SafetyStatus,
    SourceStatus,
    String,
    Time,
    TriggerResponse,
    Twist,
    Vector3,
    definition,
    encode,
    header,
    laser_scan,
    odometry,
    planar_twist,
)
from wire.stamp import GID_BYTES, Stamp

TYPES: tuple[type[Message], ...] = (
    Twist,
    LaserScan,
    Odometry,
    SafetyStatus,
    Bool,
    Point,
    Imu,
    DiagnosticArray,
    Clock,
    TriggerResponse,
    String,
)
"""All message types of the wire."""

FLOATS = (
    math.nan,
    math.inf,
    -math.inf,
    0.0,
    -0.0,
    5e-324,
    -2.2e-308,
    1e-30,
    1.7e308,
    -1.7e308,
    3.4e38,
    1e19,
    -1e9,
    2.0**53,
    1.0 + 2**-52,
    -1.0,
    2.0,
    math.pi,
)
INTEGERS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 63, (1 << 64) - 1)
LENGTHS = (0, 1, 4, 5, 0xFFFF, MAX_SEQUENCE_LENGTH, 0x10001, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
INT64 = (0, 1, -1, 2**31, -(2**31), 2**62, -(2**62), 2**63 - 1, -(2**63))
ENCAPSULATIONS = (0x0000, 0x0001, 0x0002, 0x0003, 0x0006, 0x0007, 0x0100, 0xFFFF)

FRAME_NAMES = ("", "lidar", "odom\x1b[2J", "\x00", "ß" * 40, "x" * 4000)


@dataclass(frozen=True, slots=True)
class Seed:
    """A valid payload that others are made from."""

    payload: bytes
    places: tuple[Place, ...]
    floats: tuple[Place, ...]
    lengths: tuple[Place, ...]
    order: str
    """`<` or `>`, as struct has it."""


@cache
def seeds(message_type: type[Message]) -> tuple[Seed, ...]:
    """Valid payloads of a type, in both byte orders."""
    name = message_type.__msgtype__
    payloads = [encode(message) for message in _MESSAGES[message_type]()]
    if name != TriggerResponse.__msgtype__:  # of a service, whose definition rosbags cannot join
        payloads += [_big_endian(message) for message in _MESSAGES[message_type]()]
    return tuple(_seed(payload, name) for payload in payloads)


@cache
def large_payloads() -> tuple[tuple[type[Message], bytes], ...]:
    """Return the most expensive payloads, up to the largest accepted size and beyond."""
    many = MAX_SEQUENCE_LENGTH
    key_values = [KeyValue("", "")] * 13_000
    scan = _scan(np.full(many, 3.0))
    scan.intensities = np.ones(many, np.float32)
    statuses = [DiagnosticStatus(0, "", "", "", [])] * 28_000
    large = (
        scan,
        DiagnosticArray(header(""), statuses),
        DiagnosticArray(header(""), [DiagnosticStatus(0, "", "", "", key_values)] * 8),
        SafetyStatus(header(""), reasons=["OBSTACLE"] * many, unknown_sources=["x"] * 30_000),
        SafetyStatus(header(""), sources=[_source("")] * 10_000),
        String("x" * (MAX_PAYLOAD_BYTES - 64)),
        String("x" * MAX_PAYLOAD_BYTES),
    )
    return tuple((type(message), encode(message)) for message in large)


def mutated(random: Random, message_type: type[Message]) -> bytes:
    """Return a payload for a key of this type; it is sometimes valid."""
    seed = random.choice(seeds(message_type))
    payload = bytearray(seed.payload)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        random.choice(MUTATIONS)(random, seed, payload)
    return bytes(payload)


def attachment(random: Random, now_s: float, gids: list[bytes]) -> bytes | None:
    """Any attachment: none, garbled, or a stamp of one of some epochs that come back.

    Args:
        random: the random generator.
        now_s: the sender's clock; most stamps are near it.
        gids: epochs of 16 bytes each.
    """
    dice = random.random()
    if dice < 0.15:
        return None
    if dice < 0.3:
        return random.randbytes(int(random.random() * 80))
    gid = random.choice(gids)
    time_ns = int(now_s * 1e9)
    sequence = int(now_s * 100) if dice < 0.7 else random.choice(INT64)
    if dice > 0.6:
        time_ns = random.choice((time_ns - 10**9, time_ns + 10**9, 0, *INT64))
    packed = Stamp(sequence, time_ns, gid).pack()
    if dice > 0.95:
        return packed[:16] + random.randbytes(1) + packed[17:]
    return packed


def epochs(random: Random, count: int) -> list[bytes]:
    return [random.randbytes(GID_BYTES) for _ in range(count)]


VERBS = ("step", "speed", "rate", "rate 1e-322;", "blocked 0", "step 1;")
WORDS = (
    *("none", "freeze", "all_nan", "silent", "no_odom", "rate", "blocked"),
    *("pause", "run", "step", "speed", ";", ";", "-"),
    *("1", "2", "100", "0.1", "nan", "inf", "-inf", "1e400", "1e-322", "1_0", "٣"),
)
"""Verbs of the sim's requests, and invalid numbers."""


def text(random: Random) -> str:
    """Return a request for a service."""
    dice = random.random()
    if dice < 0.1:
        return random.randbytes(int(random.random() * 60)).decode("latin-1")
    if dice < 0.3:
        return f"{random.choice(VERBS)} {random.choice('-0123456789') * int(random.random() ** 4 * 20_000)}"
    words = [random.choice(WORDS) for _ in range(int(random.random() * 6))]
    return random.choice((" ", "  ", ";", "\t", "; ", "\n")).join(words)


def _special_floats(random: Random, seed: Seed, payload: bytearray) -> None:
    """Replace one, some or all of the floats."""
    if not seed.floats:
        return
    some = random.choice((1, 2, 8, len(seed.floats)))
    begin = int(random.random() * len(seed.floats))
    value = random.choice(FLOATS)
    for place in seed.floats[begin : begin + some]:
        _put(payload, place, _float_bytes(seed.order, place.size, value))
        if random.random() < 0.1:
            value = random.choice(FLOATS)


def _near_floats(random: Random, seed: Seed, payload: bytearray) -> None:
    """Return a plausible velocity, distance or angle."""
    if seed.floats:
        for _ in range(random.choice((1, 2, 6))):
            place = random.choice(seed.floats)
            _put(payload, place, _float_bytes(seed.order, place.size, random.gauss(0.0, 2.0)))


def _integers(random: Random, seed: Seed, payload: bytearray) -> None:
    place = random.choice(seed.places)
    value = random.choice(INTEGERS) & ((1 << 8 * place.size) - 1)
    _put(payload, place, value.to_bytes(place.size, "little" if seed.order == "<" else "big"))


def _lengths(random: Random, seed: Seed, payload: bytearray) -> None:
    if not seed.lengths:
        _cut(random, seed, payload)
        return
    place = random.choice(seed.lengths)
    (now,) = struct.unpack_from(f"{seed.order}I", seed.payload, place.offset)
    value = random.choice((*LENGTHS, now + 1, now - 1, now + 4)) & 0xFFFFFFFF
    _put(payload, place, struct.pack(f"{seed.order}I", value))


def _flip(random: Random, _seed: Seed, payload: bytearray) -> None:
    for _ in range(random.choice((1, 2, 8))):
        if payload:
            payload[int(random.random() * len(payload))] ^= 1 << random.getrandbits(3)


def _cut(random: Random, _: Seed, payload: bytearray) -> None:
    del payload[int(random.random() * (len(payload) + 1)) :]


def _extend(random: Random, _: Seed, payload: bytearray) -> None:
    count = random.choice((1, 3, 4, 8, 60, 2000))
    payload += bytes(count) if random.random() < 0.5 else random.randbytes(count)


def _splice(random: Random, _: Seed, payload: bytearray) -> None:
    """The head of one message, the tail of another."""
    other = random.choice(seeds(random.choice(TYPES))).payload
    payload[int(random.random() * (len(payload) + 1)) :] = other[int(random.random() * len(other)) :]


def _other_type(random: Random, _: Seed, payload: bytearray) -> None:
    payload[:] = random.choice(seeds(random.choice(TYPES))).payload


def _encapsulation(random: Random, _: Seed, payload: bytearray) -> None:
    payload[:2] = random.choice(ENCAPSULATIONS).to_bytes(2, "big")


def _block(random: Random, _: Seed, payload: bytearray) -> None:
    """Fill, remove or repeat a piece."""
    begin = int(random.random() * (len(payload) + 1))
    piece = slice(begin, begin + random.choice((1, 4, 8, 64)))
    match random.getrandbits(2):
        case 0:
            del payload[piece]
        case 1:
            payload[begin:begin] = payload[piece]
        case 2:
            payload[piece] = bytes([random.choice((0x00, 0x7F, 0x80, 0xFF))]) * len(payload[piece])
        case _:
            payload[piece] = random.randbytes(len(payload[piece]))


def _noise(random: Random, _: Seed, payload: bytearray) -> None:
    payload[:] = random.randbytes(int(random.random() * 200))


def _as_it_is(_: Random, _seed: Seed, _payload: bytearray) -> None:
    """Valid messages are part of the drawn payloads."""


MUTATIONS: tuple[Callable[[Random, Seed, bytearray], None], ...] = (
    _special_floats,
    _special_floats,
    _special_floats,
    _near_floats,
    _integers,
    _lengths,
    _lengths,
    _flip,
    _flip,
    _cut,
    _extend,
    _splice,
    _other_type,
    _encapsulation,
    _block,
    _noise,
    _as_it_is,
)


def _put(payload: bytearray, place: Place, value: bytes) -> None:
    """Bytes that an earlier mutation has removed are not changed."""
    if place.offset + place.size <= len(payload):
        payload[place.offset : place.offset + place.size] = value


def _float_bytes(order: str, size: int, value: float) -> bytes:
    if size == 8:
        return struct.pack(f"{order}d", value)
    with np.errstate(over="ignore"):
        return np.array(value).astype(f"{order}f4").tobytes()


def _seed(payload: bytes, name: str) -> Seed:
    found = () if name == TriggerResponse.__msgtype__ else places(payload, name)
    if not found:
        found = (Place("bool", 4, 1), Place("length", 8, 4))
    return Seed(
        payload,
        found,
        tuple(p for p in found if p.kind.startswith("float")),
        tuple(p for p in found if p.kind == "length"),
        "<" if payload[1] else ">",
    )


_big_store = get_typestore(Stores.ROS2_JAZZY)
_big_store.register(
    {
        name: parts
        for name, parts in get_types_from_msg(
            definition(SafetyStatus.__msgtype__).text, SafetyStatus.__msgtype__
        ).items()
        if name.startswith("lifeline_msgs/")
    }
)


def _big_endian(message: Message) -> bytes:
    return bytes(_big_store.serialize_cdr(message, message.__msgtype__, little_endian=False))


def _scan(ranges: "np.ndarray[Any, Any]", frame: str = "lidar") -> LaserScan:
    scan = laser_scan(ranges.astype(np.float32), range_m=(0.05, 12.0), period_s=0.05, time_ns=1_000_000_000)
    scan.header.frame_id = frame
    return scan


def _source(name: str) -> SourceStatus:
    return SourceStatus(name, 100, 1, True, False, True, 0.01, ["OBSTACLE"] if name else [], 1, 2, 3, 4, 5)  # noqa: FBT003


def _twists() -> list[Message]:
    return [planar_twist(0.5, -1.0), planar_twist(0.0, 0.0), planar_twist(-0.3, 2.0)]


def _scans() -> list[Message]:
    rooms = [np.full(360, 3.0), np.full(360, 0.4), np.full(90, np.inf), np.linspace(0.1, 12.0, 120)]
    return [_scan(room, frame) for room, frame in zip(rooms, FRAME_NAMES, strict=False)]


def _odometries() -> list[Message]:
    return [
        odometry((1.0, -2.0, 0.5), (0.3, 0.2), time_ns=1),
        odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0),
    ]


def _statuses() -> list[Message]:
    names = ["teleop", "joy", "path"]
    full = SafetyStatus(
        header("base_link", 1),
        mode=3,
        reasons=["OBSTACLE", "SCAN_STALE"],
        owner="teleop",
        scale=0.4,
        nearest_m=0.5,
        nearest_bearing_rad=1.0,
        scan_age_s=0.01,
        scan_problem="no sector with enough valid readings",
        unknown_sources=["stranger", "\x1b]0;x\x07"],
        sources=[_source(name) for name in names],
        causes=["OBSTACLE"],
        latched=["SCAN_STALE"],
        detail="something is too close at 40° left",
        rmw_zenoh_nodes=["/talker", "\x1b]0;x\x07"],
        source_times=[Time(123_456, 789), Time(0, 0), Time(2**31 - 1, 999_999_999)],
    )
    return [SafetyStatus(header("base_link", 1)), full]


def _imus() -> list[Message]:
    covariance = np.zeros(9)
    unit, vector = Quaternion(0.0, 0.0, 0.0, 1.0), Vector3(0.0, 0.0, 9.81)
    return [Imu(header("imu", 1), unit, covariance, vector, covariance, vector, covariance)]


def _diagnostics() -> list[Message]:
    status = DiagnosticStatus(1, "sim: collisions", "none", "", [KeyValue("count", "0"), KeyValue("", "")])
    return [DiagnosticArray(header("", 1), [status, status]), DiagnosticArray(header("", 1), [])]


_MESSAGES: dict[type[Message], Callable[[], list[Message]]] = {
    Twist: _twists,
    LaserScan: _scans,
    Odometry: _odometries,
    SafetyStatus: _statuses,
    Bool: lambda: [Bool(False), Bool(True)],  # noqa: FBT003 - a Bool is what it is
    Point: lambda: [Point(1.0, 2.0, 0.0), Point(0.0, 0.0, -1.0)],
    Imu: _imus,
    DiagnosticArray: _diagnostics,
    Clock: lambda: [Clock(Time(1, 2))],
    TriggerResponse: lambda: [
        TriggerResponse(success=True, message="done"),
        TriggerResponse(success=False, message=""),
    ],
    String: lambda: [String("freeze; rate 5"), String("")],
}
