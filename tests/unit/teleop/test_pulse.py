"""Whether the terminal still answers."""

import math

from teleop.pulse import ANSWER_LIMIT_S, TRIES, Pulse


def test_a_terminal_that_never_answered_is_not_reported_as_lost() -> None:
    pulse = Pulse()
    for n in range(50):
        pulse.ask(n / 10)
    assert not pulse.is_lost(5.0)


def test_a_terminal_that_never_answers_is_queried_a_limited_number_of_times() -> None:
    pulse = Pulse()
    for n in range(TRIES):
        assert pulse.is_worth_asking
        pulse.ask(n / 10)
    assert not pulse.is_worth_asking
    pulse.answer(9.0)
    assert pulse.is_worth_asking


def test_a_terminal_that_answered_is_lost_just_after_the_limit() -> None:
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    pulse.ask(0.1)
    assert not pulse.is_lost(ANSWER_LIMIT_S)
    assert pulse.is_lost(math.nextafter(ANSWER_LIMIT_S, 1.0))


def test_slow_but_regular_answers_keep_the_terminal_alive() -> None:
    pulse = Pulse()
    for n in range(40):
        pulse.ask(n / 10)
        if n >= 5:
            pulse.answer(n / 10)
            assert not pulse.is_lost(n / 10 + 0.1)
    assert pulse.open == 5


def test_a_pause_between_queries_does_not_lose_the_terminal() -> None:
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    pulse.ask(60.0)
    assert not pulse.is_lost(60.1)
    pulse.ask(60.1)
    pulse.ask(60.2)
    pulse.ask(60.3)
    assert pulse.is_lost(60.31)


def test_one_answer_restores_a_lost_terminal_and_extra_answers_are_ignored() -> None:
    pulse = Pulse()
    pulse.ask(0.0)
    pulse.answer(0.0)
    pulse.ask(0.1)
    pulse.answer(9.0)
    pulse.answer(9.0)
    assert (pulse.is_lost(9.1), pulse.open) == (False, 0)
