"""How often a stream arrives."""

import math

import pytest

from teleop.telemetry import RATE_MIN_S, RATE_WINDOW_S, Meter


def test_a_rate_is_not_known_before_it_says_something() -> None:
    meter = Meter()
    assert math.isnan(meter.rate_hz(0, 10.0))
    assert math.isnan(meter.rate_hz(5, 10.0 + RATE_MIN_S - 0.01))
    assert meter.rate_hz(9, 10.9) == pytest.approx(10.0)


def test_it_is_that_of_the_last_two_seconds() -> None:
    meter = Meter()
    rates = [meter.rate_hz(min(n * 5, 100), n / 10) for n in range(61)]
    assert rates[20] == pytest.approx(50.0)
    assert rates[20 + round(RATE_WINDOW_S * 10)] == pytest.approx(0.0)
    assert 0.0 < rates[30] < 50.0


def test_after_a_pause_in_the_looking_it_is_that_since_the_last_look() -> None:
    meter = Meter()
    meter.rate_hz(0, 0.0)
    meter.rate_hz(10, 1.0)
    assert meter.rate_hz(10, 60.0) == pytest.approx(0.0)
    assert meter.rate_hz(20, 61.0) == pytest.approx(10.0)


def test_looks_far_apart_keep_one_another_as_the_start() -> None:
    meter = Meter()
    assert [meter.rate_hz(n * 30, n * 3.0) for n in range(1, 4)] == [
        pytest.approx(math.nan, nan_ok=True),
        pytest.approx(10.0),
        pytest.approx(10.0),
    ]
