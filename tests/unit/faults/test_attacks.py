"""Each attack sends what its name says, deterministically by seed."""

import itertools
import math
import random

import pytest

from faults.attacks import ATTACKS, KEYS, SOURCE_KEYS, Knowledge, Shot
from wire import topics
from wire.messages import (
    MAX_PAYLOAD_BYTES,
    LaserScan,
    Odometry,
    Point,
    Twist,
    UndecodableError,
    decode,
    planar_twist,
)
from wire.stamp import Stamp, parse_stamp

MANY = 300
HEARD = [(planar_twist(0.5, 0.0), Stamp(3, 5, b"T" * 16))]


def _shots(name: str, seed: int = 7, count: int = MANY) -> list[Shot]:
    attack, _ = ATTACKS[name]
    knows = Knowledge(random.Random(seed), lambda: 7, lambda: 7, HEARD)
    return list(itertools.islice(attack(knows), count))


@pytest.mark.parametrize("name", sorted(set(ATTACKS) - {"oversized", "second_lidar"}))
def test_the_same_seed_says_the_same(name: str) -> None:
    keys = [shot.key for shot in _shots(name)]
    assert keys
    assert keys == [shot.key for shot in _shots(name)]


@pytest.mark.parametrize("name", ["malformed", "truncated", "wrong_type"])
def test_most_of_what_is_spoilt_cannot_be_decoded(name: str) -> None:
    undecodable = 0
    shots = [shot for shot in _shots(name) if shot.key in SOURCE_KEYS]
    for shot in shots:
        try:
            decode(shot.payload, Twist)
        except UndecodableError:
            undecodable += 1
    assert undecodable > len(shots) / 2


def test_garbage_comes_on_every_key() -> None:
    assert {shot.key for shot in _shots("malformed", count=2000)} == set(KEYS)


def test_some_payloads_are_larger_than_any_message_may_be() -> None:
    sizes = [len(shot.payload) for shot in _shots("oversized", count=60)]
    assert max(sizes) > MAX_PAYLOAD_BYTES


@pytest.mark.parametrize("name", ["not_finite", "huge"])
def test_values_are_senseless_in_messages_that_can_be_decoded(name: str) -> None:
    def is_senseless(value: float) -> bool:
        return not math.isfinite(value) or abs(value) > 100 or 0 < abs(value) < 1e-100

    types = {topics.SCAN.key: LaserScan, topics.ODOM.key: Odometry, topics.OBSTACLE.key: Point}
    for shot in _shots(name):
        message = decode(shot.payload, types.get(shot.key, Twist))
        if isinstance(message, Twist):
            values = [getattr(part, axis) for part in (message.linear, message.angular) for axis in "xyz"]
        elif isinstance(message, LaserScan):
            values = [float(message.ranges[0])] if message.ranges[0] != 0 else [math.inf]
        elif isinstance(message, Odometry):
            values = [message.twist.twist.linear.x]
        else:
            values = [message.x]
        assert any(map(is_senseless, values)), shot.key


def test_attachments_are_of_many_kinds() -> None:
    stamps = [parse_stamp(shot.attachment) for shot in _shots("attachments")]
    assert any(stamp is None for stamp in stamps)
    assert any(stamp is not None and stamp.sequence < 0 for stamp in stamps)
    teleops = [stamp for stamp in stamps if stamp is not None and stamp.gid == HEARD[0][1].gid]
    assert HEARD[0][1] in teleops, "replayed"
    assert len({stamp.sequence for stamp in teleops}) == 3, "and forged"


def test_a_rogue_writes_on_cmd_vel_and_on_whatever_matches_it() -> None:
    keys = {shot.key for shot in _shots("rogue_cmd_vel")}
    assert {topics.CMD_VEL.key, "**"} <= keys


def test_an_emergency_stop_is_said_once() -> None:
    assert [shot.key for shot in _shots("estop")] == [topics.ESTOP.key]


def test_a_second_lidar_proves_nothing() -> None:
    scan = decode(_shots("second_lidar", count=1)[0].payload, LaserScan)
    assert all(math.isnan(value) for value in scan.ranges)


@pytest.mark.parametrize("name", ["second_lidar_steady", "second_lidar_flood"])
def test_a_plausible_second_lidar_sees_free_space_and_no_two_of_its_scans_are_equal(name: str) -> None:
    shots = _shots(name, count=20)
    scans = [decode(shot.payload, LaserScan) for shot in shots]
    assert {shot.key for shot in shots} == {topics.SCAN.key}
    assert all(
        len(scan.ranges) == 360 and 4.9 < scan.ranges.min() < scan.ranges.max() < 5.1 for scan in scans
    )
    assert len({scan.ranges.tobytes() for scan in scans}) == 20


def test_a_second_writer_stamps_its_scans_in_order_or_not_at_all() -> None:
    kinds: set[bool] = set()
    for seed in range(20):
        stamps = [parse_stamp(shot.attachment) for shot in _shots("second_lidar_flood", seed, 5)]
        found = [stamp for stamp in stamps if stamp is not None]
        kinds.add(bool(found))
        assert len(found) in {0, 5}
        assert [stamp.sequence for stamp in found] == list(range(1, len(found) + 1))
        assert [stamp.source_time_ns for stamp in found] == [n * 500_000 for n in range(1, len(found) + 1)]
        assert len({stamp.gid for stamp in found}) <= 1
    assert kinds == {True, False}
