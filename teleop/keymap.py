"""Keys for the program itself; the keys for motion are defined in the pilots."""

from enum import StrEnum


class Command(StrEnum):
    """Commands to the program, as opposed to motion of the robot."""

    ESTOP = "emergency stop"
    RESET = "reset"
    QUIT = "quit"
    SUSPEND = "suspend"


CTRL_C, CTRL_D, CTRL_Z, CTRL_BACKSLASH = "\x03", "\x04", "\x1a", "\x1c"
"""Most terminals send these as signals; if they arrive as keys, they have the same effect."""

_COMMANDS = {
    " ": Command.ESTOP,
    "r": Command.RESET,
    "q": Command.QUIT,
    CTRL_C: Command.QUIT,
    CTRL_D: Command.QUIT,
    CTRL_BACKSLASH: Command.QUIT,
    CTRL_Z: Command.SUSPEND,
}


def command_of(key: str) -> Command | None:
    """Return the program command of a key, with or without caps lock; None if it has none."""
    return _COMMANDS.get(key.lower())


def level_of(key: str) -> int | None:
    """Return the speed level that a key selects; None if it selects none."""
    return int(key) if key in ("1", "2", "3", "4", "5") else None
