"""Codes and sessions: once, for a minute, and with a limit for everything."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.pairing import (
    CODE_LIFETIME_S,
    MAX_SESSIONS,
    SESSION_LIFETIME_S,
    Pairing,
    Session,
)

CODE = "abcdefghjkmn"


def offered(at_s: float = 0.0) -> Pairing:
    pairing = Pairing()
    pairing.offer(CODE, at_s)
    return pairing


def test_a_code_pairs_one_page_and_no_second_one() -> None:
    pairing = offered()
    session = pairing.pair(CODE, "token", 1.0)
    assert session is not None
    assert session.token == "token"
    assert pairing.pair(CODE, "another", 1.0) is None


def test_a_code_counts_until_its_minute_ends() -> None:
    assert offered(5.0).pair(CODE, "token", 5.0 + CODE_LIFETIME_S) is not None
    assert offered(5.0).pair(CODE, "token", math.nextafter(5.0 + CODE_LIFETIME_S, math.inf)) is None


@pytest.mark.parametrize("code", ["", CODE[:-1], f"{CODE}x", CODE.upper(), "\ud800", "é" * 12])
def test_a_code_that_differs_pairs_nothing(code: str) -> None:
    assert offered().pair(code, "token", 0.0) is None


def test_before_the_first_code_the_empty_one_pairs_nothing() -> None:
    assert Pairing().pair("", "token", 0.0) is None


def test_wrong_codes_do_not_withdraw_the_present_one() -> None:
    pairing = offered()
    assert all(pairing.pair("wrong", "token", 0.0) is None for _ in range(100))
    assert pairing.pair(CODE, "token", 0.0) is not None


def test_a_new_code_ends_the_one_before_it() -> None:
    pairing = offered()
    pairing.offer("another-code", 1.0)
    assert pairing.pair(CODE, "token", 1.0) is None
    assert pairing.pair("another-code", "token", 1.0) is not None


def test_a_session_resumes_until_its_time_ends() -> None:
    pairing = offered()
    session = pairing.pair(CODE, "token", 2.0)
    assert pairing.resume("token", 2.0 + SESSION_LIFETIME_S) is session
    assert pairing.resume("token", math.nextafter(2.0 + SESSION_LIFETIME_S, math.inf)) is None
    assert pairing.resume("token", 2.0) is None  # it is forgotten


@pytest.mark.parametrize("token", ["", "toke", "token2", "\udfff"])
def test_a_token_that_nobody_has_resumes_nothing(token: str) -> None:
    pairing = offered()
    assert pairing.resume(token, 0.0) is None
    pairing.pair(CODE, "token", 0.0)
    assert pairing.resume(token, 0.0) is None


def test_a_session_too_many_ends_the_oldest() -> None:
    pairing = Pairing()
    for number in range(MAX_SESSIONS + 1):
        pairing.offer(CODE, 0.0)
        pairing.pair(CODE, f"token{number}", 0.0)
    resumed = [pairing.resume(f"token{number}", 0.0) is not None for number in range(MAX_SESSIONS + 1)]
    assert resumed == [False] + [True] * MAX_SESSIONS


def test_a_session_too_many_ends_the_oldest_whose_page_is_not_connected() -> None:
    pairing, connected = Pairing(), list[Session]()
    for number in range(MAX_SESSIONS + 1):
        pairing.offer(CODE, 0.0)
        session = pairing.pair(CODE, f"token{number}", 0.0, connected)
        assert session is not None
        connected += [session] if number < 2 else []
    resumed = [pairing.resume(f"token{number}", 0.0) is not None for number in range(MAX_SESSIONS + 1)]
    assert resumed == [True, True, False] + [True] * (MAX_SESSIONS - 2)


@given(st.lists(st.tuples(st.sampled_from(["offer", "pair", "guess", "wait"]), st.floats(0.0, 100.0))))
def test_there_are_never_more_sessions_than_codes_that_were_offered(
    steps: list[tuple[str, float]],
) -> None:
    pairing, now_s, offers, sessions = Pairing(), 0.0, 0, 0
    for step, length_s in steps:
        if step == "offer":
            pairing.offer(CODE, now_s)
            offers += 1
        elif step == "wait":
            now_s += length_s
        else:
            code = CODE if step == "pair" else "wrong"
            sessions += pairing.pair(code, "token", now_s) is not None
        assert sessions <= offers
