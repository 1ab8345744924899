"""What the stamps of headers show about their clock."""

from collections.abc import Callable

import pytest

from wire.header_clock import MIN_MESSAGES, RATE_TOLERANCE, STEPS_BACK, WINDOW_S, HeaderClock, in_words

BEGAN_NS = 1_700_000_000_123_456_789
PERIOD_S = 0.05


def after(seconds: float, stamp_ns: Callable[[float], int]) -> HeaderClock:
    """Return what a topic at 20 Hz shows after this time; the stamp is a function of the time."""
    clock = HeaderClock()
    for n in range(round(seconds / PERIOD_S) + 1):
        clock.hear(stamp_ns(n * PERIOD_S), 50.0 + n * PERIOD_S)
    return clock


def at_rate(rate: float, began_ns: int = BEGAN_NS) -> Callable[[float], int]:
    return lambda passed_s: began_ns + round(passed_s * rate * 1e9)


def test_stamps_that_run_like_real_time_show_nothing() -> None:
    clock = after(10.0, at_rate(1.0))
    assert clock.problem == ""
    assert not clock.is_simulated


@pytest.mark.parametrize("rate", [0.9, 1.0 - 2 * RATE_TOLERANCE, 1.0 + 2 * RATE_TOLERANCE, 2.0])
def test_a_rate_is_named_after_two_windows(rate: float) -> None:
    assert after(WINDOW_S, at_rate(rate)).problem == ""
    assert after(2 * WINDOW_S, at_rate(rate)).problem.startswith(f"run at {rate:.2f} of real time")


def test_one_late_message_is_no_rate() -> None:
    def stamp_ns(passed_s: float) -> int:
        late_s = 0.3 if passed_s == pytest.approx(2 * WINDOW_S) else 0.0
        return BEGAN_NS + round((passed_s - late_s) * 1e9)

    for windows in (2, 3, 4):
        assert after(windows * WINDOW_S, stamp_ns).problem == ""


def test_constant_stamps_are_named_after_one_window() -> None:
    assert after(WINDOW_S - PERIOD_S, at_rate(0.0)).problem == ""
    assert after(WINDOW_S, at_rate(0.0)).problem == "do not change"


def test_whole_seconds_are_named_after_one_window() -> None:
    def stamp_ns(passed_s: float) -> int:
        return (BEGAN_NS // 1_000_000_000 + int(passed_s + 0.1)) * 1_000_000_000

    assert after(WINDOW_S, stamp_ns).problem == "are whole seconds"


def test_stamps_that_alternate_go_back_by_what_is_left_after_a_period() -> None:
    def stamp_ns(passed_s: float) -> int:
        return BEGAN_NS + round((passed_s - 0.15 * (round(passed_s / PERIOD_S) % 2)) * 1e9)

    assert after(WINDOW_S, stamp_ns).problem == "go back again and again, by up to 0.10 s"


def test_two_steps_back_in_a_window_are_no_habit_and_three_are() -> None:
    def clock(steps: int) -> HeaderClock:
        return after(
            WINDOW_S,
            lambda passed_s: BEGAN_NS + round((passed_s - 0.06 * min(steps, int(passed_s / 0.5))) * 1e9),
        )

    assert clock(STEPS_BACK - 1).problem == ""
    assert clock(STEPS_BACK).problem == "go back again and again, by up to 0.01 s"


def test_two_stamps_in_turn_go_back_although_the_first_is_also_the_last() -> None:
    clock = after(WINDOW_S, lambda passed_s: BEGAN_NS + round(passed_s / PERIOD_S) % 2)
    assert clock.problem.startswith("go back again and again")


def test_a_problem_that_is_over_is_no_longer_named() -> None:
    def stamp_ns(passed_s: float) -> int:
        return at_rate(0.9)(min(passed_s, 4.0)) + round(max(0.0, passed_s - 4.0) * 1e9)

    assert after(4.0, stamp_ns).problem != ""
    assert after(4.0 + 2 * WINDOW_S, stamp_ns).problem == ""


def test_simulated_time_is_named_with_what_it_does() -> None:
    clock = after(4.0, at_rate(0.9, began_ns=12_000_000_001))
    assert clock.is_simulated
    assert clock.problem == "run at 0.90 of real time, or their delay grows (simulated time)"
    assert after(4.0, at_rate(1.0, began_ns=12_000_000_001)).problem == ""
    assert after(0.0, lambda _: 10**18 - 1).is_simulated
    assert not after(0.0, lambda _: 10**18).is_simulated


def test_headers_without_stamps_and_few_messages_show_nothing() -> None:
    assert after(4.0, lambda _: 0).problem == ""
    assert not after(4.0, lambda _: 0).is_simulated
    clock = HeaderClock()
    for n in range(MIN_MESSAGES - 1):
        clock.hear(BEGAN_NS, n * WINDOW_S)
    assert clock.problem == ""
    clock.hear(BEGAN_NS, MIN_MESSAGES * WINDOW_S)
    assert clock.problem == "do not change"
    clock.hear(0, MIN_MESSAGES * WINDOW_S)
    assert clock.problem == ""


def test_the_difference_of_a_clock_is_shown_with_its_side() -> None:
    assert in_words(0.25) == "0.25 s ahead of this computer's clock"
    assert in_words(-5.0) == "5.00 s behind this computer's clock"
