"""Which key asks for what."""

import string

import pytest

from teleop.keymap import CTRL_C, Action, action_for, legend

KEYS = {
    "w": Action.FASTER,
    "x": Action.SLOWER,
    "a": Action.LEFT,
    "d": Action.RIGHT,
    "s": Action.STOP,
    " ": Action.ESTOP,
    "r": Action.RESET,
    "q": Action.QUIT,
    CTRL_C: Action.QUIT,
}


@pytest.mark.parametrize(("key", "action"), KEYS.items())
def test_each_key_has_its_action(key: str, action: Action) -> None:
    assert action_for(key) is action


@pytest.mark.parametrize("key", list("wxadsrq"))
def test_caps_lock_takes_no_key_away(key: str) -> None:
    assert action_for(key.upper()) is action_for(key)


def test_every_other_key_does_nothing() -> None:
    others = [chr(code) for code in range(256) if chr(code).lower() not in KEYS]
    assert [key for key in others if action_for(key) is not None] == []


def test_every_action_has_a_key() -> None:
    assert set(KEYS.values()) == set(Action)


def test_the_legend_names_every_key_and_fits_a_terminal() -> None:
    lines = legend(0.1, 0.2)
    words = set(" ".join(lines).split())
    assert {*"wxadsrq", "SPACE", "0.1", "0.2"} <= words
    assert max(len(line) for line in lines) < 80
    assert set("".join(lines)) <= set(string.printable)
