"""Which key asks for what."""

from enum import StrEnum


class Action(StrEnum):
    """What a key asks for."""

    FASTER = "faster"
    SLOWER = "slower"
    LEFT = "left"
    RIGHT = "right"
    STOP = "stop"
    ESTOP = "emergency stop"
    RESET = "reset"
    QUIT = "quit"


CTRL_C = "\x03"
"""A signal rather than a key in most terminals; the same wish where it arrives as a key."""

_KEYS = {
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


def action_for(key: str) -> Action | None:
    """What `key` asks for, with caps lock or without; None: nothing."""
    return _KEYS.get(key.lower())


def legend(linear_step_m_s: float, angular_step_rad_s: float) -> tuple[str, ...]:
    """The keys in three lines of less than 80 columns."""
    rows = (
        (
            f"w / x   forward / backward by {linear_step_m_s:g} m/s",
            f"a / d   left / right by {angular_step_rad_s:g} rad/s",
        ),
        ("s       stop, and arm again", "SPACE   stop + emergency stop"),
        ("r       reset the emergency stop", "q       quit"),
    )
    return tuple(f"  {left:<42}{right}" for left, right in rows)
