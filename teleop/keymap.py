"""Which key asks for what of the program; the motions stand with their pilots."""

from enum import StrEnum


class Command(StrEnum):
    """What is asked of the program rather than of the robot."""

    ESTOP = "emergency stop"
    RESET = "reset"
    QUIT = "quit"
    SUSPEND = "suspend"


CTRL_C, CTRL_D, CTRL_Z, CTRL_BACKSLASH = "\x03", "\x04", "\x1a", "\x1c"
"""Signals rather than keys in most terminals; the same wish where they arrive as keys."""

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
    """What `key` asks of the program, with caps lock or without; None: nothing."""
    return _COMMANDS.get(key.lower())


def level_of(key: str) -> int | None:
    """The speed level that a key chooses."""
    return int(key) if key in ("1", "2", "3", "4", "5") else None
