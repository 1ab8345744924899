"""Two supervisors in one namespace."""

from hypothesis import given
from hypothesis import strategies as st

from teleop.supervisors import HOLD_S, KEPT_RUNS, Supervisors

A, B, C = b"a" * 16, b"b" * 16, b"c" * 16
PERIOD_S = 0.1


def heard(*runs: bytes) -> Supervisors:
    """Return what is known after these runs have spoken, one each `PERIOD_S` from 0."""
    supervisors = Supervisors()
    for number, run in enumerate(runs):
        supervisors.heard(run, PERIOD_S * number)
    return supervisors


def test_one_supervisor_and_its_restarts_are_no_conflict() -> None:
    assert not heard().are_several(0.0)
    assert not heard(A, A, B, B, C, C, C).are_several(0.6)


def test_a_run_that_speaks_again_after_another_is_a_second_robot() -> None:
    assert heard(A, B, A).are_several(0.2)


def test_the_conflict_ends_a_second_after_one_of_the_two_is_silent() -> None:
    supervisors = heard(A, B, A, *[A] * 20)
    assert supervisors.are_several(0.2 + HOLD_S - 1e-9)
    assert not supervisors.are_several(0.2 + HOLD_S)


@given(st.lists(st.binary(min_size=16, max_size=16), unique=True))
def test_any_number_of_restarts_in_succession_is_no_conflict(runs: list[bytes]) -> None:
    assert not heard(*runs).are_several(PERIOD_S * len(runs))


def test_many_runs_of_strangers_take_no_memory() -> None:
    runs = [bytes([number]) * 16 for number in range(100)]
    assert not heard(*runs, runs[0]).are_several(0.0), "forgotten"
    assert heard(*runs, runs[-KEPT_RUNS + 1]).are_several(0.0)
