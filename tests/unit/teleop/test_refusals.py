"""Whether the supervisor refuses everything: by the counts in its status."""

import math
from dataclasses import replace

import pytest

from teleop.refusals import LOCKED_OUT_S, Refusals
from tests.unit.teleop.views import source

STATUS_S = 0.1
OWN = source("teleop")


def told(
    refusals: Refusals, *, epoch: int = 0, sequence: int = 0, accepted: int = 0, count: int = 20
) -> list[float]:
    """Return when everything was refused, for statuses whose counts grow by these numbers."""
    own, times_s = OWN, list[float]()
    for number in range(count):
        own = replace(
            own,
            refused_epoch=own.refused_epoch + epoch,
            refused_sequence=own.refused_sequence + sequence,
            accepted=own.accepted + accepted,
        )
        if refusals.all_refused(own, number * STATUS_S):
            times_s.append(number * STATUS_S)
    return times_s


@pytest.mark.parametrize("grown", [{"epoch": 2}, {"sequence": 2}, {"epoch": 1, "sequence": 1}], ids=str)
def test_a_source_with_all_commands_refused_is_reported_every_half_second(grown: dict[str, int]) -> None:
    assert told(Refusals(), **grown) == pytest.approx([0.5, 1.0, 1.5])


@pytest.mark.parametrize(
    "grown", [{}, {"accepted": 2}, {"accepted": 1, "epoch": 2}, {"accepted": 1, "sequence": 2}], ids=str
)
def test_no_refusal_is_reported_while_some_commands_are_accepted_or_none_are_sent(
    grown: dict[str, int],
) -> None:
    assert told(Refusals(), **grown) == []


def test_refusals_are_reported_exactly_at_the_limit() -> None:
    for time_s, is_told in ((LOCKED_OUT_S, True), (math.nextafter(LOCKED_OUT_S, 0.0), False)):
        refusals = Refusals()
        assert not refusals.all_refused(OWN, 0.0)
        assert refusals.all_refused(replace(OWN, refused_epoch=1), time_s) is is_told


def test_the_counts_of_a_restarted_supervisor_begin_at_zero() -> None:
    refusals = Refusals()
    assert not refusals.all_refused(replace(OWN, accepted=500, refused_epoch=80), 0.0)
    assert not refusals.all_refused(replace(OWN, accepted=0, refused_epoch=0), 10.0)
    assert not refusals.all_refused(replace(OWN, accepted=0, refused_epoch=1), 10.1)


def test_another_program_is_detected_by_a_refused_epoch_since_the_last_status() -> None:
    refusals = Refusals()
    heard = replace(OWN, refused_epoch=3)
    assert not refusals.another_speaks(heard), "the first status does not show when"
    refusals.all_refused(heard, 0.0)
    assert not refusals.another_speaks(heard)
    assert not refusals.another_speaks(replace(heard, refused_sequence=1)), "its own late command"
    assert refusals.another_speaks(replace(heard, refused_epoch=4))


def test_a_restarted_supervisor_does_not_count_as_another_program() -> None:
    refusals = Refusals()
    refusals.all_refused(replace(OWN, refused_epoch=3), 0.0)
    assert not refusals.another_speaks(OWN)
