"""What counts as kept, as late, and as broken."""

import math

import pytest

from faults.real.demo import MEASURING_S, Outcome, Verdict, drivable_again, judged, summary, timed, worst
from faults.trial import Injected

BOUND_S = 0.2


def test_a_time_is_kept_up_to_its_bound_and_late_just_after() -> None:
    assert timed(BOUND_S, BOUND_S) is Outcome.KEPT
    assert timed(math.nextafter(BOUND_S, 1), BOUND_S) is Outcome.LATE


def test_a_time_is_broken_just_beyond_what_a_busy_machine_adds() -> None:
    limit_s = BOUND_S + MEASURING_S
    assert timed(limit_s, BOUND_S) is Outcome.LATE
    assert timed(math.nextafter(limit_s, 1), BOUND_S) is Outcome.BROKEN


def test_a_time_that_was_not_measured_is_broken() -> None:
    assert timed(math.nan, BOUND_S) is Outcome.BROKEN


def test_no_busy_machine_excuses_a_touch() -> None:
    assert judged(kept=False) is Outcome.BROKEN


@pytest.mark.parametrize("other", list(Outcome))
def test_a_broken_part_breaks_the_whole(other: Outcome) -> None:
    assert worst(other, Outcome.BROKEN) is Outcome.BROKEN
    assert worst(Outcome.BROKEN, other) is Outcome.BROKEN
    assert worst(Outcome.KEPT, other) is other


def test_the_summary_counts_every_outcome() -> None:
    verdicts = [Verdict(1, "", "", "", outcome) for outcome in (Outcome.KEPT, Outcome.KEPT, Outcome.BROKEN)]
    assert summary(verdicts) == "2 of 3 promises kept, 1 BROKEN"


def test_a_robot_that_one_fault_left_undrivable_breaks_the_promise() -> None:
    mended = Injected(fault="", time_s=1.0, parameters={"to_alive_s": 0.5, "to_ready_s": 0.25})
    assert drivable_again([mended, mended]) == ("0.8 s (worst)", Outcome.KEPT)
    assert drivable_again([mended, Injected(fault="", time_s=1.0)]) == ("not drivable", Outcome.BROKEN)
