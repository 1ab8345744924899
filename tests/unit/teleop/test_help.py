"""The help: every key of each control mode, on terminals of any size."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.gamepad.pad import Gamepad, Layout
from teleop.pilots.config import GamepadSection
from teleop.pilots.keyboard import MOTIONS, SPEEDS, STEPS, Hold, Incremental
from teleop.pilots.keys import COMMANDS, PRESENCE_KEY, STOP_KEY, name_of
from teleop.pilots.pilot import KeyEvent, Pilot, Ramp, Velocity
from teleop.screen.controls import LEGENDS, command_for, help_lines, help_page, key_help
from teleop.screen.dashboard import render_dashboard
from teleop.screen.view import Control, KeyHelp, Tone, View
from tests.unit.teleop.views import driving, over, room, stopped, text
from wire.messages import SafetyStatus

NAMED_KEYS = ["up", "down", "left", "right", "home", "end", "f1", "tab", "enter", "escape", "backspace"]
ALL_KEYS = [chr(code) for code in range(128)] + NAMED_KEYS
LAYOUT = Layout(GamepadSection(), 1, 0, 310, 311, Velocity(1.0, 2.0))


def keys_of(row: KeyHelp) -> list[str]:
    """The keys of a row; "1 to 5" stands for all between."""
    first, _, last = row.keys.partition(" to ")
    return [str(digit) for digit in range(int(first), int(last) + 1)] if last else row.keys.split()


def listed(control: Control) -> set[str]:
    return {key for row in key_help(control) for key in keys_of(row)}


def pilot_of(control: Control) -> Pilot:
    """A pilot in motion, if keys can do that, so that a stop is visible."""
    match control:
        case Control.HOLD:
            pilot = Hold(Velocity(0.5, 1.0), Velocity(1.0, 2.0), Ramp(1e6, 1e6), level=3)
            pilot.rely_on_releases(reported=True)
            return pilot
        case Control.GAMEPAD:
            return Gamepad(LAYOUT, level=3)
        case _:
            pilot = Incremental(Ramp(1e6, 1e6), level=3)
            for key in "wa":
                pilot.on_key(KeyEvent(key), 0.0)
            return pilot


def state_of(pilot: Pilot) -> tuple[object, ...]:
    pilot.velocity(0.0)
    return pilot.wanted(), pilot.limit, pilot.note


def acts(key: str, control: Control) -> bool:
    """Whether this key has a function, found by pressing it."""
    if command_for(key, control) is not None:
        return True
    if control is Control.VIEW_ONLY:
        return False
    pilot = pilot_of(control)
    before = state_of(pilot)
    is_known = pilot.on_key(KeyEvent(key), 0.0)
    return is_known and (state_of(pilot) != before or key == PRESENCE_KEY)


@pytest.mark.parametrize("control", [Control.INCREMENTAL, Control.HOLD, Control.VIEW_ONLY])
def test_the_help_lists_exactly_the_keys_that_act(control: Control) -> None:
    present = "3"  # the level that is selected already
    acting = {name_of(key.lower()) for key in ALL_KEYS if acts(key, control)} | {present}
    expected = listed(control) - {"k"} | {present}
    assert acting == expected


@pytest.mark.parametrize("control", Control)
def test_the_emergency_stop_is_the_first_key(control: Control) -> None:
    assert key_help(control)[0].keys == "SPACE"


def test_the_help_lists_the_keys_beside_a_gamepad() -> None:
    commands = {name_of(key) for key in COMMANDS}
    assert listed(Control.GAMEPAD) == {"stick", "s", "1", "2", "3", "4", "5", *commands}


def test_the_help_lists_every_key_of_each_table() -> None:
    assert {*STEPS, STOP_KEY, *map(name_of, COMMANDS)} <= listed(Control.INCREMENTAL)
    assert {*MOTIONS, *SPEEDS} <= listed(Control.HOLD)


def test_in_hold_mode_h_stops_as_any_other_key_and_the_question_mark_shows_the_help() -> None:
    assert command_for("h", Control.HOLD) is None
    assert "h" not in listed(Control.HOLD)
    pilot = pilot_of(Control.HOLD)
    for key in ("h", "?"):
        pilot.on_key(KeyEvent("i"), 0.0)
        pilot.velocity(0.0)
        assert pilot.wanted() == Velocity(0.5, 0.0)
        pilot.on_key(KeyEvent(key), 0.0)
        pilot.velocity(0.0)
        assert pilot.wanted().is_neutral


@pytest.mark.parametrize("control", Control)
def test_the_legend_names_only_keys_of_the_help(control: Control) -> None:
    named = {key for row in LEGENDS[control] for key in row.keys.split()} - {"/", "to", "arrows"}
    assert named <= listed(control)
    assert "?" in named


def test_the_side_of_a_motion_is_that_to_which_the_robot_moves() -> None:
    does = {key: row.does for row in key_help(Control.HOLD) for key in keys_of(row)}
    assert (does["u"], does["o"], does["j"]) == ("forward to the left", "forward to the right", "turn left")
    # On the keyboard, m is at the lower left.
    assert (does["m"], does["."], does["k"][:4]) == ("backward to the left", "backward to the right", "stop")
    assert (does["w"], does["q"], does["c"]) == (
        "linear speed +10 %, -10 %",
        "both speeds +10 %, -10 %",
        "turn rate +10 %, -10 %",
    )


@pytest.mark.parametrize("control", Control)
def test_the_printed_help_has_every_row_and_less_than_80_columns(control: Control) -> None:
    lines = help_lines(key_help(control))
    assert all(len(line) < 80 for line in lines)
    assert all(f" {row.does}" in "\n".join(lines) for row in key_help(control))


# --- the page

ROWS = (KeyHelp("w", "forward"), KeyHelp("q Ctrl-C", "quit"))


def page(rows: tuple[KeyHelp, ...], columns: int, height: int) -> list[str]:
    return [text(line) for line in help_page(rows, columns, height)]


def test_each_function_has_a_line() -> None:
    assert page(ROWS, 20, 2) == ["w       forward", "q Ctrl-C quit"]
    first = help_page(ROWS, 20, 2)[0]
    assert first[0].tone is Tone.STRONG


def test_a_long_text_continues_in_the_next_line() -> None:
    assert page((KeyHelp("w", "forward by one step"),), 18, 2) == ["w       forward by", "        one step"]


def test_without_room_for_a_line_each_the_functions_run_on() -> None:
    assert page(ROWS, 40, 1) == ["w: forward; q Ctrl-C: quit"]


def test_what_still_does_not_fit_is_announced() -> None:
    assert page(ROWS, 12, 1) == ["more keys: e"]
    assert page(ROWS, 12, 2) == ["w: forward;", "more keys: e"]


@pytest.mark.parametrize(("columns", "height"), [(0, 5), (20, 0)])
def test_a_page_without_cells_is_empty(columns: int, height: int) -> None:
    assert page(ROWS, columns, height) == []


@given(
    st.lists(st.builds(KeyHelp, st.text(max_size=12), st.text(max_size=40)), max_size=12).map(tuple),
    st.integers(0, 60),
    st.integers(0, 20),
)
def test_a_page_fits_for_any_text(rows: tuple[KeyHelp, ...], columns: int, height: int) -> None:
    lines = page(rows, columns, height)
    assert len(lines) <= height
    assert all(len(line) <= columns for line in lines)


# --- the dashboard with the help open


def helped(control: Control, newest: SafetyStatus | None = None) -> View:
    return driving(
        newest, control=control, help=key_help(control), limit=Velocity(0.6, 1.2), scan=room(1, 1, 1, 1)
    )


def shown(view: View, columns: int, rows: int) -> str:
    return "\n".join(text(line) for line in render_dashboard(view, columns, rows))


@pytest.mark.parametrize("size", [(80, 24), (100, 30), (160, 50)])
@pytest.mark.parametrize("control", Control)
def test_the_dashboard_shows_every_key_and_still_the_state_and_the_command(
    control: Control, size: tuple[int, int]
) -> None:
    columns, rows = size
    view = helped(control, stopped("SCAN_STALE", "ESTOP", scan_age_s=0.4))
    lines = shown(view, columns, rows).splitlines()
    assert [len(line) for line in lines] == [columns] * rows
    screen = " ".join(line[: columns // 2 - 5].strip() for line in lines)
    for row in key_help(control):
        assert f"{row.keys:<7} {row.does}" in screen
    assert lines[0].startswith(" STOPPED: ")
    assert lines[1].endswith(" SCAN_STALE ESTOP ")
    for label in (" requested ", " permitted ", " measured ", " nearest "):
        assert any(label in line for line in lines)
    assert any("? hides all keys" in line for line in lines)


@pytest.mark.parametrize("control", Control)
def test_opening_the_help_leaves_the_head_and_the_panel_unchanged(control: Control) -> None:
    view = helped(control, over("OVERRUN"))
    closed = driving(view.status, control=control, limit=view.limit)
    assert render_dashboard(view, 80, 24)[:3] == render_dashboard(closed, 80, 24)[:3]
    panel = {line[-44:].strip() for line in shown(closed, 80, 24).splitlines()[3:16]}
    assert panel <= {line[-44:].strip() for line in shown(view, 80, 24).splitlines()} | {""}


@pytest.mark.parametrize("size", [(40, 12), (79, 23), (60, 10)])
@pytest.mark.parametrize("control", Control)
def test_a_small_terminal_shows_state_and_command_and_then_the_keys(
    control: Control, size: tuple[int, int]
) -> None:
    lines = shown(helped(control, stopped("ESTOP")), *size).splitlines()
    assert len(lines) <= size[1]
    assert "STOPPED: ESTOP" in lines[0]
    if control is not Control.VIEW_ONLY:
        assert "+0.50 m/s" in lines[0] + lines[1]
    screen = " ".join(line.strip() for line in lines)
    assert ("more keys: enlarge the terminal" in screen) is not all(
        row.does in screen for row in key_help(control)
    )


@pytest.mark.parametrize("rows", [1, 2])
def test_on_the_smallest_terminal_the_state_comes_first(rows: int) -> None:
    lines = shown(helped(Control.HOLD, stopped("ESTOP")), 40, rows).splitlines()
    assert len(lines) == rows
    assert "STOPPED: ESTOP" in lines[0]


def test_the_limit_of_the_speed_level_is_shown_in_units() -> None:
    view = driving(limit=Velocity(0.6, 1.2), level=3, control_note="each press: 0.06 m/s or 0.12 rad/s")
    screen = shown(view, 80, 24)
    assert "incremental   speed ■■■□□ 3 of 5" in screen
    assert "  up to   0.60 m/s, 1.20 rad/s" in screen
    assert " each press: 0.06 m/s or 0.12 rad/s" in screen
