"""The samples of a trial's picture: every visible change, and little else."""

import math

from hypothesis import given
from hypothesis import strategies as st

from faults.seen import Command, Motion, Seen, Status
from faults.trial import FINE_S, STEP_M_S, STEP_RAD_S, Sample, thinned, timeline


def stopped_seen() -> Seen:
    """Half a second at 0.5 m/s, zero from then on, and braking at 2 m/s²."""
    seen = Seen()
    for tick in range(100):
        time_s = 0.01 * tick
        speed_m_s = min(0.5, max(0.0, 0.5 - 2.0 * (time_s - 0.5)))
        seen.motions.append(Motion(time_s, 0.0, 0.0, speed_m_s, 0.0))
    seen.motions = [motion._replace(clearance_m=1.0) for motion in seen.motions]
    seen.commands = [Command(0.0, 0.5, 0.0), Command(0.505, 0.0, 0.0)]
    seen.statuses = [
        Status(0.0, (), "teleop", (0.5, 0.0)),
        Status(0.505, ("SOURCE_LOST",), "teleop", (0.5, 0.0)),
    ]
    return seen


def sample(
    time_s: float, commanded: float, permitted: float, true: float, reasons: tuple[str, ...]
) -> Sample:
    return Sample(
        time_s=time_s,
        commanded=(commanded, 0.0),
        permitted=(permitted, 0.0),
        true=(true, 0.0),
        clearance_m=1.0,
        reasons=reasons,
    )


def test_a_timeline_has_a_sample_for_each_period_with_what_held_then() -> None:
    samples = list(timeline(stopped_seen(), FINE_S))
    assert len(samples) == 50
    assert [one.permitted[0] for one in samples[25:27]] == [0.5, 0.0]
    assert (samples[25].reasons, samples[26].reasons) == ((), ("SOURCE_LOST",))
    assert len(list(timeline(stopped_seen()))) == 10


def test_a_steady_motion_needs_two_samples_and_a_stop_is_reported_when_it_came() -> None:
    samples = list(timeline(stopped_seen(), FINE_S))
    steady = list(thinned(samples, 0.0, 0.49))
    assert [one.time_s for one in steady] == [0.0, 0.48]
    kept = list(thinned(samples, 0.0, math.inf))
    assert next(one.time_s for one in kept if one.reasons) == 0.52
    assert len(kept) < 20


def test_a_zero_is_reported_however_slow_the_motion_was() -> None:
    slow = [sample(0.1 * n, 0.02, 0.02 if n < 5 else 0.0, 0.02, ()) for n in range(10)]
    assert [one.time_s for one in thinned(slow, 0.0, math.inf)] == [0.0, 0.5, 0.9]


def test_a_window_without_samples_reports_nothing() -> None:
    assert list(thinned([sample(1.0, 0.0, 0.0, 0.0, ())], 2.0, 3.0)) == []


speeds = st.floats(-1.0, 1.0).map(lambda speed: round(speed, 2))
lists_of_samples = st.lists(
    st.tuples(speeds, speeds, speeds, st.sampled_from([(), ("ESTOP",), ("OBSTACLE",)])), max_size=30
).map(lambda ones: [sample(0.1 * number, *one) for number, one in enumerate(ones)])


@given(lists_of_samples)
def test_nothing_that_is_left_out_differs_from_what_stands_before_it(samples: list[Sample]) -> None:
    kept = list(thinned(samples, 0.0, math.inf))
    assert kept[:1] == samples[:1]
    assert kept[-1:] == samples[-1:]
    for one in samples:
        before = max((k for k in kept if k.time_s <= one.time_s), key=lambda k: k.time_s)
        assert before.reasons == one.reasons
        for was, now in (
            (before.commanded, one.commanded),
            (before.permitted, one.permitted),
            (before.true, one.true),
        ):
            assert abs(was[0] - now[0]) <= STEP_M_S
            assert abs(was[1] - now[1]) <= STEP_RAD_S
        assert (before.permitted[0] == 0.0) == (one.permitted[0] == 0.0)
