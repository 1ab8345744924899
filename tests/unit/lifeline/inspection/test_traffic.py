"""Rates, sizes, ages and writers of samples."""

import math

import pytest

from lifeline.inspection.traffic import MAX_KEYS, MAX_WRITERS, KeyTraffic, Traffic
from wire.bus import Overheard
from wire.stamp import Stamp

KEY = "robot/scan"


def sample(
    at_s: float, epoch: bytes | None = b"a", sequence: int = 1, age_s: float = 0.0, size: int = 100
) -> Overheard:
    stamp = None if epoch is None else Stamp(sequence, round((at_s - age_s) * 1e9), epoch.ljust(16)).pack()
    return Overheard(KEY, bytes(size), stamp, at_s)


def heard(*samples: Overheard) -> KeyTraffic:
    traffic = Traffic()
    for one in samples:
        traffic.add(one)
    return traffic.keys[KEY]


def test_the_rate_is_that_between_the_first_and_the_last_arrival() -> None:
    subject = heard(*(sample(10.0 + 0.05 * n) for n in range(41)))
    assert subject.rate_hz == pytest.approx(20.0)
    assert subject.bytes_s == pytest.approx(2000.0)
    gaps = subject.gaps
    assert (gaps.number, gaps.minimum_s, gaps.maximum_s) == (40, pytest.approx(0.05), pytest.approx(0.05))
    assert gaps.deviation_s == pytest.approx(0.0, abs=1e-9)


def test_one_sample_has_no_rate() -> None:
    assert math.isnan(heard(sample(1.0)).rate_hz)
    assert math.isnan(KeyTraffic().rate_hz)


def test_the_age_is_the_arrival_less_the_source_time() -> None:
    ages = heard(sample(1.0, age_s=0.002), sample(2.0, age_s=0.004, sequence=2)).ages
    assert (ages.minimum_s, ages.mean_s, ages.maximum_s) == pytest.approx((0.002, 0.003, 0.004))
    assert not heard(sample(1.0, epoch=None)).ages.number


@pytest.mark.parametrize(
    ("age_s", "is_other"), [(-0.004, False), (59.0, False), (-0.006, True), (61.0, True)]
)
def test_an_impossible_age_shows_the_clock_of_another_machine(age_s: float, is_other: bool) -> None:  # noqa: FBT001
    assert heard(sample(100.0, age_s=age_s)).is_other_clock is is_other


def test_writers_count_as_two_only_if_they_are_active_at_the_same_time() -> None:
    one_after_another = heard(
        sample(1.0, b"a"), sample(2.0, b"a", 2), sample(2.5, b"b"), sample(3.0, b"b", 2)
    )
    assert (len(one_after_another.writers), one_after_another.concurrent()) == (2, 1)
    together = heard(sample(1.0, b"a"), sample(1.5, b"b"), sample(2.0, b"a", 2), sample(2.5, None))
    assert (len(together.writers), together.concurrent()) == (3, 2)


def test_a_flood_of_writers_or_keys_takes_bounded_memory() -> None:
    subject = heard(*(sample(float(n), n.to_bytes(2, "big")) for n in range(MAX_WRITERS + 5)))
    assert (len(subject.writers), subject.is_flooded) == (MAX_WRITERS, True)
    traffic = Traffic()
    for n in range(MAX_KEYS + 5):
        traffic.add(sample(1.0)._replace(key=f"robot/{n}"))
    assert len(traffic.keys) == MAX_KEYS


def test_keys_outside_of_the_namespace_are_foreign() -> None:
    traffic = Traffic()
    for key in ("robot/scan", "robot2/scan", "demo/x"):
        traffic.add(sample(1.0)._replace(key=key))
    assert list(traffic.foreign("robot")) == ["demo/x", "robot2/scan"]


def test_a_flood_of_epochs_before_the_first_sample_of_a_writer_does_not_hide_it() -> None:
    flood = [sample(1.0 + 0.001 * n, bytes([n])) for n in range(MAX_WRITERS)]
    subject = heard(*flood, sample(1.1, b"sim", 1), sample(1.2, b"sim", 2))
    assert subject.is_flooded
    assert subject.concurrent() == 2


def test_a_copied_epoch_has_two_writers() -> None:
    subject = heard(sample(1.0, sequence=7), sample(1.1, sequence=8), sample(1.2, sequence=8))
    assert subject.concurrent() == 2


def test_an_epoch_whose_sequence_increases_has_one_writer() -> None:
    assert heard(*(sample(1.0 + n, sequence=n) for n in range(3))).concurrent() == 1
