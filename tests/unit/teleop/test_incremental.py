"""Control by steps."""

import math

import pytest

from teleop.incremental import Incremental
from teleop.pilot import NEUTRAL, KeyEvent, KeyKind, Pilot, Velocity
from teleop.ramp import Ramp
from teleop.setpoint import Setpoint, Steps


def pilot() -> Incremental:
    return Incremental(Setpoint(), Ramp(1.0, 4.0))


def press(subject: Pilot, keys: str) -> None:
    for key in keys:
        subject.on_key(KeyEvent(key), 0.0)


@pytest.mark.parametrize(
    ("keys", "velocity"),
    [
        ("w", (0.1, 0)),
        ("x", (-0.1, 0)),
        ("a", (0, 0.2)),
        ("d", (0, -0.2)),
        ("WwA", (0.2, 0.2)),
        ("wxx", (-0.1, 0)),
    ],
)
def test_each_press_is_a_step(keys: str, velocity: tuple[float, float]) -> None:
    subject = pilot()
    press(subject, keys)
    assert subject.wanted() == Velocity(*velocity)


def test_s_is_zero_at_once_in_the_middle_of_a_ramp() -> None:
    subject = pilot()
    press(subject, "wwwww")
    assert not subject.velocity(0.2).is_neutral
    press(subject, "s")
    assert (subject.velocity(0.2), subject.wanted(), subject.next_s) == (NEUTRAL, NEUTRAL, math.inf)


def test_a_repeat_is_a_press_and_a_release_is_none() -> None:
    subject = pilot()
    for kind in KeyKind:
        subject.on_key(KeyEvent("w", kind), 0.0)
    assert subject.wanted() == Velocity(0.2)


def test_a_level_is_chosen_by_its_key() -> None:
    subject = pilot()
    assert subject.level == 5
    press(subject, "2w")
    assert (subject.level, subject.wanted()) == (2, Velocity(0.04))


def test_other_keys_and_the_arrows_ask_for_nothing() -> None:
    subject = pilot()
    for key in ("up", "left", "f1", "i", "6", " ", "r", "q", "focus out"):
        subject.on_key(KeyEvent(key), 0.0)
    assert subject.wanted() == NEUTRAL


def test_the_ramp_is_due_while_it_moves() -> None:
    subject = pilot()
    press(subject, "w")
    subject.velocity(1.0)
    assert 1.0 < subject.next_s < 1.05


def test_the_note_names_the_step_at_the_level_and_small_steps_keep_their_digits() -> None:
    subject = pilot()
    press(subject, "3")
    assert subject.note == "each press: 0.06 m/s or 0.12 rad/s"
    assert subject.limit == Velocity(0.6 * 1.0, 0.6 * 2.0)
    small = Incremental(Setpoint(Steps(linear_step_m_s=0.025), level=3), Ramp(1.0, 4.0))
    assert small.note == "each press: 0.015 m/s or 0.12 rad/s"
