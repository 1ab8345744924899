"""The permit by the status, and the operator's rhythm."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.path.permit import HEARD_S, LEARNT, TOLERANCE, OffBeat, what_is_missing, what_stops
from tests.unit.teleop import views
from wire.messages import SafetyStatus, SourceStatus, header
from wire.stamp import Stamp


def source(**changes: object) -> SourceStatus:
    return replace(views.source("path", 10), **changes)


def status(mode: int, *sources: SourceStatus, owner: str = "path", **changes: object) -> SafetyStatus:
    return SafetyStatus(header("", 0), mode=mode, owner=owner, sources=list(sources), **changes)  # type: ignore[arg-type]


READY, DRIVING, LIMITED, STOPPED = (
    SafetyStatus.READY,
    SafetyStatus.DRIVING,
    SafetyStatus.LIMITED,
    SafetyStatus.STOPPED,
)


def test_armed_neutral_and_heard_under_a_ready_supervisor_it_may_begin() -> None:
    assert what_is_missing(status(READY, source()), "path") is None
    assert what_is_missing(status(READY, source(), owner="teleop"), "path") is None


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (status(READY, source(name="joy")), "ignores source path"),
        (status(STOPPED, source(), reasons=["ESTOP", "SCAN_STALE"]), "STOPPED: ESTOP, SCAN_STALE"),
        (
            status(STOPPED, source(), reasons=["OVERRUN"], latched=["OVERRUN"]),
            "STOPPED: OVERRUN (over)",
        ),
        (status(STOPPED, source()), "STOPPED: no reason given"),
        (status(DRIVING, source(), owner="teleop"), "teleop drives; it must stop first"),
        (status(LIMITED, source(), owner="a\x1b[2J"), "a?[2J drives; it must stop first"),
        (
            status(READY, source(armed=False, reasons=["COMMAND_TIMEOUT"])),
            "path is not armed: COMMAND_TIMEOUT",
        ),
        (status(READY, source(neutral=False)), "does not hear path"),
        (status(READY, source(age_s=math.nan)), "does not hear path"),
        (status(READY, source(age_s=math.nextafter(HEARD_S, 1.0))), "does not hear path"),
    ],
)
def test_what_it_lacks_is_one_sentence(now: SafetyStatus, words: str) -> None:
    missing = what_is_missing(now, "path")
    assert missing is not None
    assert words in missing


@pytest.mark.parametrize("mode", [READY, DRIVING, LIMITED])
def test_its_own_drive_goes_on(mode: int) -> None:
    assert what_stops(status(mode, source(neutral=False)), "path") is None


def test_a_status_from_before_its_first_motion_is_no_take_over() -> None:
    assert what_stops(status(READY, source(neutral=True), owner="teleop"), "path") is None
    assert what_stops(status(READY, owner="teleop"), "path") is None


def test_another_owner_is_a_take_over() -> None:
    assert what_stops(status(DRIVING, source(neutral=False), owner="teleop"), "path") == "teleop took over"


@pytest.mark.parametrize(
    ("bearing_rad", "side"),
    [(0.0, "ahead"), (1.5, "at 86 deg left"), (3.1, "behind"), (-1.5, "at 86 deg right")],
)
def test_a_stop_at_an_obstacle_says_where_it_is(bearing_rad: float, side: str) -> None:
    now = status(STOPPED, source(), reasons=["OBSTACLE"], nearest_m=0.312, nearest_bearing_rad=bearing_rad)
    assert what_stops(now, "path") == f"STOPPED: OBSTACLE (0.31 m {side})"


def test_an_obstacle_that_is_gone_is_not_looked_for() -> None:
    now = status(
        STOPPED,
        source(),
        reasons=["OBSTACLE"],
        latched=["OBSTACLE"],
        nearest_m=0.31,
        nearest_bearing_rad=0.0,
    )
    assert what_stops(now, "path") == "STOPPED: OBSTACLE (over)"


def test_a_stop_at_an_obstacle_that_nobody_sees_says_no_more_than_that() -> None:
    assert what_stops(status(STOPPED, source(), reasons=["OBSTACLE"]), "path") == "STOPPED: OBSTACLE"


# --- the operator's rhythm

PERIOD_S = 0.05


class Sender:
    """A heartbeat at 20 Hz, some of it late, with keys in between."""

    def __init__(self, gid: bytes = b"a" * 16, start_s: float = 1000.0) -> None:
        self.gid, self.start_s = gid, start_s
        self.sequence = self.beats = 0

    def put(self, time_s: float) -> Stamp:
        self.sequence += 1
        return Stamp(self.sequence, round(time_s * 1e9), self.gid)

    def beat(self, late_s: float = 0.0) -> Stamp:
        self.beats += 1
        return self.put(self.start_s + self.beats * PERIOD_S + late_s)

    def key(self, share: float) -> Stamp:
        """A key this share of a period after the last beat."""
        return self.put(self.start_s + (self.beats + share) * PERIOD_S)


@given(st.lists(st.floats(0.0, 0.99 * TOLERANCE * PERIOD_S), min_size=1, max_size=200))
def test_a_heartbeat_that_is_late_is_no_key(lates_s: list[float]) -> None:
    sender, ear = Sender(), OffBeat(PERIOD_S)
    assert not any(ear.hears_key(sender.beat(late_s)) for late_s in lates_s)


@given(st.lists(st.floats(0.0, 0.99 * PERIOD_S), min_size=1, max_size=200))
def test_single_beats_may_be_as_late_as_they_like(lates_s: list[float]) -> None:
    sender, ear = Sender(), OffBeat(PERIOD_S)
    for late_s in lates_s:
        assert not ear.hears_key(sender.beat(late_s))
        assert not ear.hears_key(sender.beat())


@given(
    st.lists(st.floats(0.0, 0.010), min_size=LEARNT, max_size=40),
    st.floats(0.0, 1.0),
    st.lists(st.floats(0.0, 0.010), min_size=3, max_size=3),
)
def test_a_key_is_heard_with_the_next_beat_at_the_latest(
    before_s: list[float], share: float, after_s: list[float]
) -> None:
    sender, ear = Sender(), OffBeat(PERIOD_S)
    assert not any(ear.hears_key(sender.beat(late_s)) for late_s in before_s)
    key = ear.hears_key(sender.key(share))
    beat = ear.hears_key(sender.beat(after_s[0]))
    assert key or beat
    assert not any(ear.hears_key(sender.beat(late_s)) for late_s in after_s[1:])


def test_missed_beats_are_no_key_and_half_a_second_later_a_key_is_heard_again() -> None:
    sender, ear = Sender(), OffBeat(PERIOD_S)
    assert not any(ear.hears_key(sender.beat()) for _ in range(20))
    sender.beats += 7
    assert not any(ear.hears_key(sender.beat()) for _ in range(12))
    assert ear.hears_key(sender.key(0.2))


def test_samples_that_got_lost_on_the_way_are_no_key() -> None:
    sender, ear = Sender(), OffBeat(PERIOD_S)
    heard = [ear.hears_key(sender.beat()) for n in range(100) if n % 3]
    assert not any(heard)


def test_another_run_of_the_source_begins_its_own_rhythm() -> None:
    ear, sender = OffBeat(PERIOD_S), Sender()
    assert not any(ear.hears_key(sender.beat()) for _ in range(5))
    again = Sender(gid=b"b" * 16, start_s=3.0)
    assert not any(ear.hears_key(again.beat()) for _ in range(LEARNT))
    assert ear.hears_key(again.key(0.3))
