"""The pace: which step is due when, whatever the timers do."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.pace import (
    MAX_CATCH_UP_S,
    MAX_SINGLE_STEPS,
    Every,
    Measured,
    Pace,
    Request,
    TimeRequest,
    TimeRequestError,
    parse_speed,
    parse_time_request,
)

DT_S = 0.002


def due_steps(pace: Pace, now_s: float) -> int:
    """Make every step that is due by now."""
    pace.elapse(now_s)
    steps = 0
    while pace.is_due:
        pace.stepped()
        steps += 1
    return steps


def test_the_first_step_is_due_one_step_after_the_start() -> None:
    pace = Pace(DT_S, now_s=10.0)
    assert pace.due_s == 10.0 + DT_S
    assert due_steps(pace, 10.0 + 0.9 * DT_S) == 0
    assert due_steps(pace, pace.due_s) == 1


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.0, 2.0, 10.0])
def test_sixty_seconds_of_unsteady_timers_lose_and_gain_nothing(speed: float) -> None:
    shaky = random.Random(0)
    start_s = 123_456.789  # a machine that has been up for a day
    pace = Pace(DT_S, start_s, speed)
    now_s, steps = start_s, 0
    while now_s < start_s + 60.0:
        now_s = max(now_s, pace.due_s) + shaky.expovariate(1 / 0.001)
        steps += due_steps(pace, now_s)
    drift = steps * DT_S / ((now_s - start_s) * speed) - 1.0
    print(f"\n    measured: drift at {speed:g} times real time over 60 s: {100 * drift:+.5f} %")
    assert abs(drift) < 0.0001
    assert pace.measure(now_s).lost_s == 0.0


@given(st.lists(st.floats(0.0, MAX_CATCH_UP_S), min_size=1, max_size=50), st.sampled_from([0.1, 1.0, 7.0]))
def test_however_the_wakes_fall_a_step_is_due_exactly_when_it_was_announced(
    waits_s: list[float], speed: float
) -> None:
    pace, now_s, steps = Pace(DT_S, 0.0, speed), 0.0, 0
    for wait_s in waits_s:
        now_s += wait_s
        announced_s = pace.due_s
        made = due_steps(pace, now_s)
        steps += made
        if abs(now_s - announced_s) > 1e-6:
            assert (made > 0) == (now_s > announced_s)
    assert steps == pytest.approx(now_s * speed / DT_S, abs=1.001)


def test_a_stall_is_made_up_for_up_to_a_tenth_of_a_second_and_the_rest_has_not_happened() -> None:
    pace = Pace(DT_S, 0.0, speed=2.0)
    pace.elapse(1.0)
    steps = 0
    while pace.is_due:
        pace.stepped()
        steps += 1
    assert steps * DT_S == pytest.approx(2.0 * MAX_CATCH_UP_S, abs=1.5 * DT_S)
    measured = pace.measure(1.0)
    assert measured.lost_s == pytest.approx(2.0 * (1.0 - MAX_CATCH_UP_S), abs=1.5 * DT_S)
    assert measured.factor == pytest.approx(0.2, abs=0.01)
    assert pace.measure(2.0) == Measured(0.0, 0.0)


def test_a_measurement_of_no_time_says_nothing() -> None:
    assert math.isnan(Pace(DT_S, 5.0).measure(5.0).factor)


def test_a_pause_lets_nothing_come_due_and_its_time_is_not_lost() -> None:
    pace = Pace(DT_S, 0.0)
    due_steps(pace, 1.0)
    pace.measure(1.0)
    pace.pause(1.0)
    assert pace.paused
    assert pace.due_s == math.inf
    assert due_steps(pace, 100.0) == 0
    pace.run(100.0)
    assert not pace.paused
    assert due_steps(pace, 100.05) == pytest.approx(25, abs=1)
    assert pace.measure(100.05).lost_s == 0.0


def test_single_steps_are_due_at_once_and_only_in_a_pause() -> None:
    pace = Pace(DT_S, 0.0)
    with pytest.raises(TimeRequestError, match="ask for pause first"):
        pace.step(3)
    pace.pause(0.0)
    pace.elapse(7.0)
    pace.step(3)
    assert pace.due_s == 7.0
    assert pace.single_steps == 3
    with pytest.raises(TimeRequestError, match="3 single steps are still to be made"):
        pace.step(1)
    assert due_steps(pace, 7.0) == 3
    assert pace.due_s == math.inf


def test_a_run_or_a_pause_ends_single_steps() -> None:
    pace = Pace(DT_S, 0.0)
    pace.pause(0.0)
    pace.step(100)
    pace.pause(0.0)
    assert not pace.is_due
    pace.step(100)
    pace.run(0.0)
    assert not pace.is_due


def test_a_change_of_speed_counts_from_now_on() -> None:
    pace = Pace(DT_S, 0.0)
    assert due_steps(pace, 0.05) == 25
    pace.set_speed(0.05, 4.0)
    assert pace.speed == 4.0
    assert due_steps(pace, 0.10) == 100


@pytest.mark.parametrize(
    ("text", "request_"),
    [
        ("", TimeRequest(Request.ASK)),
        (" ", TimeRequest(Request.ASK)),
        ("pause", TimeRequest(Request.PAUSE)),
        (" run ", TimeRequest(Request.RUN)),
        ("step 1", TimeRequest(Request.STEP, 1)),
        (f"step {MAX_SINGLE_STEPS}", TimeRequest(Request.STEP, MAX_SINGLE_STEPS)),
        ("speed 0.1", TimeRequest(Request.SPEED, 0.1)),
        ("speed  100", TimeRequest(Request.SPEED, 100.0)),
    ],
)
def test_a_request_reads_as_it_is_written(text: str, request_: object) -> None:
    parsed = parse_time_request(text)
    assert parsed == request_
    assert type(parsed) is type(request_)


@pytest.mark.parametrize(
    "text",
    ["stop", "pause now", "step", "step 0", "step -1", "step 1.5", "step ²", f"step {MAX_SINGLE_STEPS + 1}"],
)
def test_another_text_is_refused_with_the_forms_of_a_time_request(text: str) -> None:
    with pytest.raises(TimeRequestError, match=r"give one of: pause, run, step N .*, speed FACTOR"):
        parse_time_request(text)


@pytest.mark.parametrize("text", ["0", "0.0999", "100.1", "-1", "nan", "inf", "fast", ""])
def test_a_speed_out_of_bounds_is_refused_with_the_bounds(text: str) -> None:
    with pytest.raises(TimeRequestError, match=r"from 0\.1 to 100 times real time, not"):
        parse_speed(text)


@pytest.mark.parametrize(
    ("rate_hz", "samples"), [(50.0, 500), (20.0, 200), (60.0, 600), (500.0, 5000), (1.0, 10)]
)
def test_samples_come_at_their_exact_mean_rate(rate_hz: float, samples: int) -> None:
    every = Every(rate_hz, DT_S)
    due = [step for step in range(1, 5001) if every.due(step)]
    assert len(due) == samples
    assert due[0] == math.ceil(round(500 / rate_hz, 6))
    assert every.period_s() == pytest.approx(1 / rate_hz)


def test_more_than_one_sample_for_a_step_there_is_never() -> None:
    every = Every(2000.0, DT_S)
    assert all(every.due(step) for step in range(1, 100))
    assert every.period_s() == DT_S


def test_slow_motion_keeps_the_rate_by_the_real_clock_and_fast_motion_does_not() -> None:
    slow, fast = Every(20.0, DT_S), Every(20.0, DT_S)
    assert sum(slow.due(step, 0.2) for step in range(1, 501)) == 100  # one simulated second takes five
    assert sum(fast.due(step, 5.0) for step in range(1, 501)) == 20
    assert slow.period_s(0.2) == pytest.approx(0.01)


def test_a_rate_that_is_raised_counts_from_the_last_sample() -> None:
    every = Every(1.0, DT_S)
    assert not any(every.due(step) for step in range(1, 400))
    every.rate_hz = 20.0
    assert every.rate_hz == 20.0
    assert [step for step in range(400, 480) if every.due(step)] == [400, 425, 450, 475]


def test_a_number_of_thousands_of_digits_is_refused_as_any_other() -> None:
    """Python refuses to read one, and nobody answered."""
    with pytest.raises(TimeRequestError, match="step N"):
        parse_time_request("step " + "9" * 5000)
