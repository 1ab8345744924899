"""An answer proves presence only while its challenge has not expired."""

import math

from hypothesis import given
from hypothesis import strategies as st

from wire.lease import CHALLENGE_PERIOD_S, LEASE_S, PRESENCE_PERIOD_S, Challenges, issued, proven_s


def test_an_answer_proves_presence_at_the_time_of_its_challenge() -> None:
    challenges = issued(issued((), 7, 1.0), 8, 1.05)
    assert proven_s(challenges, 7) == 1.0
    assert proven_s(challenges, 8) == 1.05


def test_an_answer_to_no_challenge_proves_nothing() -> None:
    assert proven_s(issued((), 7, 1.0), 9) == -math.inf
    assert proven_s((), 0) == -math.inf


def test_a_challenge_expires_just_after_the_lease() -> None:
    first = issued((), 7, 0.0)
    assert proven_s(issued(first, 8, LEASE_S), 7) == 0.0
    assert proven_s(issued(first, 8, math.nextafter(LEASE_S, 1.0)), 7) == -math.inf


@given(st.lists(st.floats(0.0, 0.2), max_size=60))
def test_only_the_challenges_of_one_lease_are_kept(pauses_s: list[float]) -> None:
    challenges: Challenges = ()
    now_s = 0.0
    for number, pause_s in enumerate(pauses_s, 1):
        now_s += pause_s
        challenges = issued(challenges, number, now_s)
        assert all(now_s - one.issued_s <= LEASE_S for one in challenges)
        assert challenges[-1] == (number, now_s)


def test_four_lost_challenges_in_succession_do_not_end_a_lease_on_a_fast_link() -> None:
    assert LEASE_S > 5 * CHALLENGE_PERIOD_S
    assert PRESENCE_PERIOD_S <= 0.1
