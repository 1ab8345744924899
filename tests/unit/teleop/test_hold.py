"""Control by holding."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.hold import LEAST, MOTIONS, SPEEDS, Hold
from teleop.pilot import NEUTRAL, KeyEvent, KeyKind, Velocity
from teleop.ramp import Ramp

PRESS, REPEAT, RELEASE = KeyKind.PRESS, KeyKind.REPEAT, KeyKind.RELEASE


def pilot(*, releases: bool = True, ramp: Ramp | None = None) -> Hold:
    subject = Hold(Velocity(0.5, 1.0), Velocity(1.0, 2.0), ramp or Ramp(1e6, 1e6))
    subject.rely_on_releases(reported=releases)
    return subject


def happen(subject: Hold, *events: tuple[str, KeyKind], at_s: float = 1.0) -> Velocity:
    for key, kind in events:
        subject.on_key(KeyEvent(key, kind), at_s)
    return subject.velocity(at_s)


@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        ("u", (0.5, 1.0)),
        ("i", (0.5, 0.0)),
        ("o", (0.5, -1.0)),
        ("j", (0.0, 1.0)),
        ("l", (0.0, -1.0)),
        ("m", (-0.5, -1.0)),
        (",", (-0.5, 0.0)),
        (".", (-0.5, 1.0)),
        ("up", (0.5, 0.0)),
        ("down", (-0.5, 0.0)),
        ("left", (0.0, 1.0)),
        ("right", (0.0, -1.0)),
        ("I", (0.5, 0.0)),
    ],
)
def test_a_key_moves_from_its_press_to_its_release(key: str, velocity: tuple[float, float]) -> None:
    subject = pilot()
    assert happen(subject, (key, PRESS)) == Velocity(*velocity)
    assert subject.wanted() == Velocity(*velocity)
    assert happen(subject, (key, REPEAT), at_s=60.0) == Velocity(*velocity)
    assert str(happen(subject, (key, RELEASE), at_s=60.0)) == str(NEUTRAL)


def test_releasing_one_of_two_held_keys_keeps_the_motion_of_the_other() -> None:
    subject = pilot()
    assert happen(subject, ("i", PRESS), ("l", PRESS)) == Velocity(0.5, -1.0)
    assert happen(subject, ("i", RELEASE)) == Velocity(0.0, -1.0)
    assert happen(subject, ("l", RELEASE)) == NEUTRAL


def test_a_held_forward_key_still_moves_after_a_turn_key_is_tapped() -> None:
    assert happen(pilot(), ("up", PRESS), ("left", PRESS), ("left", RELEASE)) == Velocity(0.5, 0.0)


def test_opposite_keys_cancel_and_equal_ones_do_not_add_up() -> None:
    assert happen(pilot(), ("i", PRESS), (",", PRESS)) == NEUTRAL
    assert happen(pilot(), ("i", PRESS), ("u", PRESS), ("up", PRESS)) == Velocity(0.5, 1.0)


@pytest.mark.parametrize("key", ["k", "s", "5x", "f1", "escape", "focus out", "\xff", "h", "r"])
def test_any_other_key_stops_and_a_key_that_is_still_held_must_be_pressed_again(key: str) -> None:
    subject = pilot()
    assert happen(subject, ("i", PRESS), (key, PRESS)) == NEUTRAL
    assert happen(subject, ("i", REPEAT)) == NEUTRAL
    assert happen(subject, ("i", RELEASE), ("i", PRESS), at_s=1.1) == Velocity(0.5)


def test_letting_go_bypasses_the_ramp() -> None:
    subject = pilot(ramp=Ramp(1.0, 4.0))
    happen(subject, ("i", PRESS))
    assert 0.0 < subject.velocity(1.1).linear_m_s < 0.5
    subject.let_go()
    assert (subject.velocity(1.1), subject.wanted(), subject.next_s) == (NEUTRAL, NEUTRAL, math.inf)


def test_a_key_release_bypasses_the_ramp() -> None:
    subject = pilot(ramp=Ramp(1.0, 4.0))
    happen(subject, ("i", PRESS))
    subject.velocity(1.4)
    assert happen(subject, ("i", RELEASE), at_s=1.4) == NEUTRAL


@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        ("q", (0.55, 1.1)),
        ("z", (0.45, 0.9)),
        ("w", (0.55, 1.0)),
        ("x", (0.45, 1.0)),
        ("e", (0.5, 1.1)),
        ("c", (0.5, 0.9)),
    ],
)
def test_a_speed_key_changes_the_speed_by_ten_per_cent_during_motion(
    key: str, velocity: tuple[float, float]
) -> None:
    subject = pilot()
    assert happen(subject, ("u", PRESS), (key, PRESS)) == pytest.approx(velocity)


def test_the_speed_stays_between_its_minimum_and_its_maximum() -> None:
    subject = pilot()
    assert happen(subject, *[("q", PRESS)] * 50, ("u", PRESS)) == Velocity(1.0, 2.0)
    assert happen(subject, *[("z", PRESS)] * 90) == Velocity(LEAST * 1.0, LEAST * 2.0)


def test_a_speed_level_limits_the_speed_immediately() -> None:
    subject = pilot()
    assert happen(subject, ("u", PRESS), ("1", PRESS)) == pytest.approx((0.2, 0.4))
    assert subject.level == 1
    assert happen(subject, ("5", PRESS), at_s=1.1) == Velocity(0.5, 1.0)


def test_the_note_names_the_key_detection_and_the_speeds() -> None:
    assert pilot().note == "releases reported: 0.50 m/s, 1.00 rad/s"
    assert pilot(releases=False).note == "by key repeat: 0.50 m/s, 1.00 rad/s"
    assert pilot().explanation.startswith("the terminal reports")
    assert pilot(releases=False).explanation.startswith("no key releases")


def test_all_keys_are_released_when_the_terminal_stops_reporting_releases() -> None:
    subject = pilot()
    happen(subject, ("i", PRESS))
    subject.rely_on_releases(reported=True)
    assert subject.velocity(1.0) == Velocity(0.5)
    subject.rely_on_releases(reported=False)
    assert subject.velocity(1.0) == NEUTRAL


def test_without_releases_a_key_moves_once_it_repeats_and_stops_soon_after() -> None:
    subject = pilot(releases=False)
    assert happen(subject, ("i", PRESS), at_s=0.0) == NEUTRAL
    assert subject.next_s == math.inf
    assert happen(subject, ("i", PRESS), at_s=0.5) == NEUTRAL
    assert happen(subject, ("i", PRESS), at_s=0.53) == Velocity(0.5)
    assert subject.next_s == pytest.approx(0.63)
    assert subject.velocity(subject.next_s) == NEUTRAL
    assert subject.next_s == math.inf


def test_without_releases_another_key_stops_until_it_repeats() -> None:
    subject = pilot(releases=False)
    happen(subject, ("i", PRESS), at_s=0.0)
    assert happen(subject, ("i", PRESS), at_s=0.03) == Velocity(0.5)
    assert happen(subject, ("l", PRESS), at_s=0.05) == NEUTRAL
    assert happen(subject, ("l", PRESS), at_s=0.08) == Velocity(0.0, -1.0)
    assert happen(subject, ("k", PRESS), at_s=0.09) == NEUTRAL


events = st.tuples(
    st.sampled_from([*MOTIONS, *SPEEDS, "k", "1", "3", "focus out", " "]),
    st.sampled_from(KeyKind),
    st.floats(0.0, 0.3),
)


@given(st.lists(events, max_size=60), st.floats(0.1, 10.0))
def test_with_releases_the_robot_moves_only_while_a_motion_key_is_down(
    stream: list[tuple[str, KeyKind, float]], acceleration: float
) -> None:
    subject, down, now_s = pilot(ramp=Ramp(acceleration, acceleration)), set[str](), 0.0
    for key, kind, gap_s in stream:
        now_s += gap_s
        velocity = happen(subject, (key, kind), at_s=now_s)
        if kind is RELEASE:
            down.discard(key)
        elif kind is PRESS:
            down.add(key)
        assert velocity.is_neutral or down & MOTIONS.keys()
        assert abs(velocity.linear_m_s) <= 0.2 * subject.level + 1e-9
        assert abs(velocity.angular_rad_s) <= 0.4 * subject.level + 1e-9
        assert subject.next_s > now_s


@given(st.lists(st.tuples(st.sampled_from([*MOTIONS, "k", "q"]), st.floats(0.0, 0.3)), max_size=60))
def test_without_releases_the_robot_stops_when_no_key_has_repeated_recently(
    stream: list[tuple[str, float]],
) -> None:
    subject, now_s, longest_s = pilot(releases=False), 0.0, 0.275
    for key, gap_s in stream:
        later_s = now_s + gap_s
        if gap_s > longest_s:
            assert subject.velocity(later_s) == NEUTRAL
        now_s = later_s
        happen(subject, (key, PRESS), at_s=now_s)
    assert subject.velocity(now_s + longest_s) == NEUTRAL
