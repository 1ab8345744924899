"""Ten thousand hostile payloads; `python -m tests.fuzz` feeds a million."""

import logging
import struct
from collections.abc import Callable

import pytest

from supervisor import service
from supervisor.law.reckoning import Velocity
from tests.fuzz import payloads
from tests.fuzz.decoding import Tally, case, fuzz_decoders
from tests.fuzz.driving import scene
from tests.fuzz.places import places
from tests.fuzz.run import run
from wire import bus
from wire.messages import LaserScan, TriggerResponse, Twist, decode, planar_twist

PAYLOADS = 50_000


@pytest.fixture(autouse=True)
def quiet_logs(caplog: pytest.LogCaptureFixture) -> None:
    """Refused payloads are logged; ten thousand lines would not help."""
    for name in ("wire", "sim"):
        caplog.set_level(logging.CRITICAL, name)


@pytest.mark.proof
def test_nothing_raises_nothing_comes_out_beyond_the_limits_and_the_robot_stays_drivable() -> None:
    report = run(0, PAYLOADS, lambda _: None)
    assert report.all_findings == []
    assert report.payloads == PAYLOADS
    assert report.decoding.decoded > 10_000
    assert report.decoding.refused > 10_000
    assert report.while_driving > 1_000


def test_a_payload_and_a_scene_are_the_same_for_the_same_number() -> None:
    assert [case(3, n) for n in range(300)] == [case(3, n) for n in range(300)]
    assert case(3, 5) != case(4, 5)
    first, second = scene(3, 0, 60, ""), scene(3, 0, 60, "")
    assert first == second


@pytest.mark.parametrize("kind", payloads.TYPES, ids=lambda kind: kind.__msgtype__)
def test_every_seed_is_valid_and_every_byte_of_it_is_accounted_for(kind: type[payloads.Message]) -> None:
    for seed in payloads.seeds(kind):
        decode(seed.payload, kind)
        if kind is not TriggerResponse:
            assert places(seed.payload, kind.__msgtype__) == seed.places


def test_the_places_of_a_scan_are_where_its_numbers_are() -> None:
    seed = payloads.seeds(LaserScan)[1]
    assert [p.kind for p in seed.places[:4]] == ["int32", "uint32", "length", "float32"]
    (count,) = struct.unpack_from("<I", seed.payload, seed.lengths[1].offset)
    assert count == 360
    (first,) = struct.unpack_from("<f", seed.payload, seed.lengths[1].offset + 4)
    assert first == pytest.approx(0.4)


async def test_a_decoder_that_raises_anything_else_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def unchecked(attachment: bytes | None) -> tuple[object, ...] | None:
        return None if attachment is None else struct.unpack("<qqB16s", attachment)

    monkeypatch.setattr(bus, "parse_stamp", unchecked)
    tally = Tally()
    fuzz_decoders(0, range(300), tally, "again {}")
    assert any("struct" in finding.what or "error" in finding.what for finding in tally.findings)
    assert tally.findings[0].replay.startswith("again ")


def _three_times(velocity: Velocity) -> Twist:
    return planar_twist(3.0 * velocity.linear_m_s, 3.0 * velocity.angular_rad_s)


def _no_number(_: Velocity) -> Twist:
    return planar_twist(float("nan"), 0.0)


def _creeping(_: Velocity) -> Twist:
    return planar_twist(0.1, 0.0)


@pytest.mark.parametrize("wrong", [_three_times, _no_number, _creeping])
def test_a_supervisor_that_lets_something_out_is_found(
    monkeypatch: pytest.MonkeyPatch, wrong: Callable[[Velocity], Twist]
) -> None:
    """Commands beyond the limits, NaN, and during a stop."""
    monkeypatch.setattr(service, "to_twist", wrong)
    assert any("cmd_vel is" in finding.what for finding in scene(0, 0, 200, "").findings)
