"""Keys for the program itself; the keys for motion are defined in the pilots."""

from enum import StrEnum


class Command(StrEnum):
    """Commands to the program, as opposed to motion of the robot. The values are the texts of the help."""

    ESTOP = "stop + emergency stop"
    RESET = "reset the emergency stop"
    QUIT = "quit"
    SUSPEND = "stop, and suspend until fg"
    HELP = "show or hide all keys"


CTRL_C, CTRL_D, CTRL_Z, CTRL_BACKSLASH = "\x03", "\x04", "\x1a", "\x1c"
"""Most terminals send these as signals; if they arrive as keys, they have the same effect."""

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
"""Command of each key; a control mode may use a key otherwise (controls.py)."""
LEVEL_KEYS = ("1", "2", "3", "4", "5")
"""Keys that select the speed level of their digit."""


def command_of(key: str) -> Command | None:
    """Return the program command of a key, with or without caps lock; None if it has none."""
    return COMMANDS.get(key.lower())


def level_of(key: str) -> int | None:
    """Return the speed level that a key selects; None if it selects none."""
    return int(key) if key in LEVEL_KEYS else None


def name_of(key: str) -> str:
    """Return the name of a key as it is printed: "SPACE", "Ctrl-C", "w"."""
    if key == " ":
        return "SPACE"
    return f"Ctrl-{chr(ord(key) | 0x40)}" if len(key) == 1 and key < " " else key
