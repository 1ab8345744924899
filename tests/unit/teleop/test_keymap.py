"""The meaning of each key."""

import pytest

from teleop.controls import command_for, legend
from teleop.hold import MOTIONS, SPEEDS
from teleop.keymap import CTRL_BACKSLASH, CTRL_C, CTRL_D, CTRL_Z, Command, level_of, name_of
from teleop.view import Control

COMMANDS = {
    " ": Command.ESTOP,
    "r": Command.RESET,
    "q": Command.QUIT,
    CTRL_C: Command.QUIT,
    CTRL_D: Command.QUIT,
    CTRL_BACKSLASH: Command.QUIT,
    CTRL_Z: Command.SUSPEND,
    "?": Command.HELP,
    "h": Command.HELP,
}


@pytest.mark.parametrize(("key", "command"), COMMANDS.items())
def test_each_key_has_its_command(key: str, command: Command) -> None:
    assert command_for(key, Control.INCREMENTAL) is command


@pytest.mark.parametrize("key", ["q", "r", "h"])
def test_caps_lock_takes_no_key_away(key: str) -> None:
    assert command_for(key.upper(), Control.INCREMENTAL) is command_for(key, Control.INCREMENTAL)


@pytest.mark.parametrize("control", Control)
def test_every_other_key_is_no_command(control: Control) -> None:
    others = [chr(code) for code in range(256) if chr(code).lower() not in COMMANDS]
    assert [key for key in [*others, "up", "f1", "focus out"] if command_for(key, control)] == []


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("key", [" ", CTRL_C, CTRL_D, CTRL_Z, "?"])
def test_the_emergency_stop_and_the_way_out_are_the_same_everywhere(key: str, control: Control) -> None:
    assert command_for(key, control) is COMMANDS[key]


def test_while_holding_q_is_a_speed_and_does_not_quit() -> None:
    assert command_for("q", Control.HOLD) is None
    assert "q" in SPEEDS


def test_no_key_for_holding_is_a_command() -> None:
    assert [key for key in (*MOTIONS, *SPEEDS) if command_for(key, Control.HOLD)] == []


def test_who_only_looks_on_releases_nothing() -> None:
    assert command_for("r", Control.VIEW_ONLY) is None


def test_there_are_five_levels() -> None:
    assert [level_of(key) for key in ("0", "1", "5", "6", "w", "11", "")] == [
        None,
        1,
        5,
        None,
        None,
        None,
        None,
    ]


@pytest.mark.parametrize("control", Control)
def test_the_legend_of_each_mode_says_how_to_stop_and_how_to_leave(control: Control) -> None:
    rows = legend(control)
    assert "SPACE" in {row.keys for row in rows}
    assert [row.keys for row in rows if row.does == "quit"] == ["Ctrl-C" if control is Control.HOLD else "q"]
    assert all(row.keys.isascii() and len(f"{row.keys:<8}{row.does}") < 42 for row in rows)


def test_the_legend_names_no_step_because_the_level_changes_it() -> None:
    assert "m/s" not in str(legend(Control.INCREMENTAL))
    assert "rad/s" not in str(legend(Control.INCREMENTAL))


def test_a_key_without_a_character_has_a_name() -> None:
    keys = (" ", CTRL_C, CTRL_BACKSLASH, "w", "up")
    assert [name_of(key) for key in keys] == ["SPACE", "Ctrl-C", "Ctrl-\\", "w", "up"]
