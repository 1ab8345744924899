"""Limits that assume no distribution."""

import math
import random

import pytest

from passport.statistics import confidence, limit, rank, rounded_up, upper_rate


@pytest.mark.parametrize(("number", "largest"), [(1, 59), (2, 93), (3, 124), (4, 153)])
def test_the_rank_of_a_limit_grows_exactly_at_the_known_numbers_of_runs(number: int, largest: int) -> None:
    assert rank(largest, 0.95) == number
    assert rank(largest - 1, 0.95) == number - 1


def test_a_quantile_of_99_percent_needs_299_runs() -> None:
    assert (rank(298, 0.95, 0.99), rank(299, 0.95, 0.99)) == (0, 1)


def test_ten_limits_in_one_sentence_need_104_runs_each() -> None:
    assert (rank(103, 1.0 - 0.05 / 10), rank(104, 1.0 - 0.05 / 10)) == (0, 1)


def test_the_confidence_is_that_of_the_binomial_distribution() -> None:
    assert confidence(3, 1, 0.5) == pytest.approx(1 - 1 / 8)
    assert confidence(3, 2, 0.5) == pytest.approx(1 - 4 / 8)
    assert confidence(3, 4, 0.5) == pytest.approx(0.0)
    assert confidence(3, 9, 0.5) == pytest.approx(0.0)


def test_a_limit_is_the_ranked_run_and_the_uncertainty_of_the_instrument() -> None:
    values = [float(number) for number in range(93)]
    random.Random(1).shuffle(values)
    assert limit(values, 0.5, 1) == (91.5, 93, True)


def test_with_few_runs_the_limit_is_the_largest_and_is_no_proof() -> None:
    assert limit([1.0, 3.0, 2.0], 0.25, 1) == (3.25, 3, False)


def test_the_doubt_is_divided_by_the_cells_of_a_sentence() -> None:
    assert limit([1.0] * 59, 0.0, 1).proven
    assert not limit([1.0] * 59, 0.0, 2).proven


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_rank_of_all_runs_is_the_smallest(number: int) -> None:
    assert rank(number, 0.0) == number


def test_a_limit_is_printed_rounded_up() -> None:
    assert [rounded_up(value) for value in (0.3401, 0.344, 0.349, 0.35)] == ["0.35", "0.35", "0.35", "0.35"]
    assert rounded_up(0.1 + 0.2) == "0.30"
    assert rounded_up(13.91, 1) == "14.0"


def test_no_failure_in_59_runs_leaves_a_rate_of_5_percent() -> None:
    assert upper_rate(59) == pytest.approx(1 - 0.05 ** (1 / 59))
    assert upper_rate(0) == 1.0
    assert not math.isnan(upper_rate(1))


def test_at_most_35_of_300_fresh_runs_exceed_a_limit_of_59_runs() -> None:
    """With 95 % confidence at most 5 % of all exceed it, so at most 35 of 300 in nearly every measurement."""
    draw = random.Random(7)
    failed = 0
    for _ in range(200):
        found = limit([draw.expovariate(1.0) for _ in range(59)], 0.0, 1)
        failed += sum(draw.expovariate(1.0) > found.value for _ in range(300)) > 35
    assert failed <= 10
