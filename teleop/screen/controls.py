"""The function of the keys in each control mode, their legend, and their complete list.

`key_help` derives the complete list from the tables that process the keys. The legend is the short form for the last
rows of the dashboard.
"""

import textwrap
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import assert_never

from teleop.pilots.keyboard import MOTIONS, SPEEDS, STEPS
from teleop.pilots.keys import COMMANDS, LEVEL_KEYS, PRESENCE_KEY, STOP_KEY, Command, name_of
from teleop.screen.view import Control, KeyHelp, Line, Segment, Tone

NOT_IN_HOLD = ("q", "h")
"""Keys that are no commands in hold mode, which has the layout of teleop_twist_keyboard: q is a speed, h stops."""


def command_for(key: str, control: Control) -> Command | None:
    """Return the program command of a key in a control mode; None if it has none."""
    command = COMMANDS.get(key.lower())  # with or without caps lock
    if control is Control.HOLD and key.lower() in NOT_IN_HOLD:
        return None
    if control is Control.VIEW_ONLY and command is Command.RESET:
        return None  # a viewer may stop the robot, but not reset the e-stop
    return command


# --- the legend

_STOPS = (KeyHelp("SPACE", Command.ESTOP), KeyHelp("r", Command.RESET))
_ALL = KeyHelp("?", "all keys")


LEGENDS = {
    Control.INCREMENTAL: (
        KeyHelp("w / x", "faster forward / backward"),
        KeyHelp("a / d", "more to the left / right"),
        KeyHelp("s", "stop, and arm again"),
        *_STOPS,
        KeyHelp("1 to 5", "speed level"),
        KeyHelp("q", "quit"),
        _ALL,
    ),
    Control.HOLD: (
        KeyHelp("u i o", "hold: forward, and turn"),
        KeyHelp("j k l", "hold: turn; k stops"),
        KeyHelp("m , .", "hold: backward, and turn"),
        KeyHelp("arrows", "the same; not in tmux"),
        *_STOPS,
        KeyHelp("q / z", "both speeds +10 / -10 %"),
        KeyHelp("w / x", "linear, e / c angular"),
        KeyHelp("1 to 5", "speed level"),
        KeyHelp("Ctrl-C", "quit"),
        _ALL,
    ),
    Control.GAMEPAD: (
        KeyHelp("stick", "drive, with the dead-man button"),
        KeyHelp("s", "stop; then press the button again"),
        *_STOPS,
        KeyHelp("1 to 5", "speed level"),
        KeyHelp("q", "quit"),
        _ALL,
    ),
    Control.VIEW_ONLY: (_STOPS[0], KeyHelp("q", "quit"), _ALL),
}
"""The legend of each control mode: its most important keys."""


# --- the complete list


def key_help(control: Control) -> tuple[KeyHelp, ...]:
    """Return all keys of a control mode, one row for each function, those that stop the robot first."""
    levels = KeyHelp(f"{LEVEL_KEYS[0]} to {LEVEL_KEYS[-1]}", "speed level, 20 to 100 %")
    commands = _rows((key, command) for key in COMMANDS if (command := command_for(key, control)))
    match control:
        case Control.INCREMENTAL:
            steps = ((key, f"{_motion(*step)} by one step") for key, step in STEPS.items())
            stop = KeyHelp(STOP_KEY, "stop, and arm again")
            here = KeyHelp(PRESENCE_KEY, "show that you are here")
            return (*commands, *_rows(steps), stop, levels, here)
        case Control.HOLD:
            motions = ((key, _motion(*motion)) for key, motion in MOTIONS.items())
            stop = KeyHelp("k", "stop, like any other key")
            return (*commands, *_rows(motions), stop, *_speeds(), levels)
        case Control.GAMEPAD:
            stop = KeyHelp(STOP_KEY, "stop; press button again")
            return (*commands, KeyHelp("stick", "drive, with dead-man button"), stop, levels)
        case Control.VIEW_ONLY:
            return commands
        case _:
            assert_never(control)


def help_lines(rows: Iterable[KeyHelp]) -> list[str]:
    """Return the keys as text in two columns, less than 80 characters wide."""
    cells = [f"{row.keys:<7} {row.does}" for row in rows]
    half = (len(cells) + 1) // 2
    return [
        f"  {left:<42}{right}".rstrip()
        for left, right in zip_longest(cells[:half], cells[half:], fillvalue="")
    ]


def _rows(functions: Iterable[tuple[str, str]]) -> tuple[KeyHelp, ...]:
    """Return one row for each function, with all of its keys."""
    keys_of: dict[str, list[str]] = {}
    for key, does in functions:
        keys_of.setdefault(does, []).append(name_of(key))
    return tuple(KeyHelp(" ".join(keys), does) for does, keys in keys_of.items())


def _motion(forward: int, left: int) -> str:
    """Return the direction of a motion; the side of a turn is that to which the robot moves."""
    if not forward:
        return f"turn {'left' if left > 0 else 'right'}"
    way = "forward" if forward > 0 else "backward"
    return f"{way} to the {'left' if forward * left > 0 else 'right'}" if left else way


def _speeds() -> list[KeyHelp]:
    """Return one row for each speed that the keys of hold mode change, with its keys and changes."""
    changes: dict[str, list[tuple[str, str]]] = {}
    for key, (linear, angular) in SPEEDS.items():
        what = "turn rate" if linear == 1.0 else "linear speed" if angular == 1.0 else "both speeds"
        factor = angular if linear == 1.0 else linear
        changes.setdefault(what, []).append((key, f"{100 * (factor - 1.0):+.0f} %"))
    return [
        KeyHelp(" ".join(key for key, _ in some), f"{what} {', '.join(change for _, change in some)}")
        for what, some in changes.items()
    ]


# --- the help on the screen


KEY_COLUMNS = 8
"""Width of the column of keys; longer names of keys extend into the next column."""


def help_page(rows: Sequence[KeyHelp], columns: int, height: int) -> list[Line]:
    """Return all keys as at most `height` lines of at most `columns` characters.

    One row for each function if there is room; otherwise the rows run on, and what still does not fit is counted.
    """
    if columns < 1 or height < 1:
        return []
    table = [line for row in rows for line in _row(row, columns)]
    if len(table) <= height:
        return table
    words = "; ".join(f"{row.keys}: {row.does}" for row in rows)
    flow = textwrap.wrap(words, columns)
    if len(flow) > height:
        flow[height - 1 :] = ["more keys: enlarge the terminal"[:columns]]
    return [(Segment(line),) for line in flow]


def _row(row: KeyHelp, columns: int) -> list[Line]:
    """Return the lines of one function; a text that is too long continues below its beginning."""
    keys = f"{row.keys:<{KEY_COLUMNS - 1}} "
    text = f"{keys}{row.does}"
    if len(text) <= columns:
        return [(Segment(keys, Tone.STRONG), Segment(row.does))]
    indent = " " * min(KEY_COLUMNS, columns // 2)
    first, *others = textwrap.wrap(text, columns, subsequent_indent=indent) or [""]
    return [
        (Segment(first[: len(keys)], Tone.STRONG), Segment(first[len(keys) :])),
        *((Segment(other),) for other in others),
    ]
