"""Quantiles, bounds of rates and bins, compared with independent methods."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faults.report.statistics import log_bins, quantile, upper_quantile, upper_rate

times = st.lists(st.floats(0.0, 1e3), min_size=1, max_size=60)


@given(times, st.floats(0.0, 1.0))
def test_a_quantile_is_the_one_of_numpy(values: list[float], share: float) -> None:
    expected = float(np.quantile(values, share, method="inverted_cdf"))
    found = quantile(sorted(values), share)
    # If share times number is an integer except for rounding, both neighbours are correct.
    if abs(share * len(values) - round(share * len(values))) > 1e-9:
        assert found == expected
    assert sum(value <= found for value in values) >= share * len(values) - 1e-9


def test_of_nothing_there_is_no_quantile_and_one_value_is_all_of_them() -> None:
    assert math.isnan(quantile([], 0.5))
    assert [quantile([3.0], share) for share in (0.0, 0.5, 1.0)] == [3.0, 3.0, 3.0]


@given(st.integers(1, 200))
def test_the_limit_of_a_quantile_is_the_first_value_that_exceeds_it_with_the_confidence(count: int) -> None:
    """Exact for any continuous distribution: the number of values below the quantile is binomial."""
    limit = upper_quantile([float(rank) for rank in range(1, count + 1)], 0.95)
    chances = [math.comb(count, k) * 0.95**k * 0.05 ** (count - k) for k in range(count + 1)]
    if math.isinf(limit):
        assert sum(chances[:count]) < 0.95
    else:
        assert sum(chances[: int(limit)]) >= 0.95 > sum(chances[: int(limit) - 1])


def test_fewer_than_59_values_give_no_limit_of_the_95_percent_quantile() -> None:
    assert math.isinf(upper_quantile([1.0] * 58, 0.95))
    assert upper_quantile([1.0] * 58 + [2.0], 0.95) == 2.0


@pytest.mark.parametrize("count", [1, 2, 30, 1000, 100_000])
def test_without_an_event_the_bound_is_exact_and_near_the_rule_of_three(count: int) -> None:
    assert upper_rate(count) == pytest.approx(1.0 - 0.05 ** (1.0 / count))
    if count >= 30:
        assert upper_rate(count) == pytest.approx(3.0 / count, rel=0.06)


@given(st.integers(1, 60), st.data())
def test_at_the_bound_so_few_events_are_as_unlikely_as_it_says(count: int, data: st.DataObject) -> None:
    events = data.draw(st.integers(0, count - 1))
    rate = upper_rate(count, events)
    few = sum(math.comb(count, k) * rate**k * (1.0 - rate) ** (count - k) for k in range(events + 1))
    assert few == pytest.approx(0.05, rel=1e-6)
    assert events / count < rate <= 1.0


def test_a_rate_of_nothing_or_of_everything_may_be_one() -> None:
    assert upper_rate(0) == 1.0
    assert upper_rate(5, 5) == 1.0
    assert upper_rate(100_000, 100) == pytest.approx(0.0011895, rel=0.01)


@given(times)
def test_every_value_is_in_one_bin(values: list[float]) -> None:
    counts = log_bins(values, 1e-4, 5, 4)
    assert len(counts) == 20
    assert sum(counts) == len(values)


def test_a_value_at_the_edge_of_a_bin_belongs_to_the_upper_one_and_what_lies_beyond_to_the_ends() -> None:
    assert log_bins([0.0, 1.0, 9.0, 10.1, 99.0, 1e6], 1.0, 2, 1) == [3, 3]
