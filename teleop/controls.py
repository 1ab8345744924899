"""The function of the keys in each control mode, and their legend."""

from typing import assert_never

from teleop.keymap import Command, command_of
from teleop.view import Control, KeyHelp


def command_for(key: str, control: Control) -> Command | None:
    """Return the program command of a key in a control mode; None if it has none."""
    command = command_of(key)
    if control is Control.HOLD and key.lower() == "q":
        return None  # a speed, in the layout of teleop_twist_keyboard
    if control is Control.VIEW_ONLY and command is Command.RESET:
        return None  # a viewer may stop the robot, but not reset the e-stop
    return command


_STOPS = (KeyHelp("SPACE", "stop + emergency stop"), KeyHelp("r", "reset the emergency stop"))


def legend(control: Control, linear_step_m_s: float, angular_step_rad_s: float) -> tuple[KeyHelp, ...]:
    """Return the legend of a control mode."""
    match control:
        case Control.INCREMENTAL:
            return (
                KeyHelp("w / x", f"forward / backward by {linear_step_m_s:g} m/s"),
                KeyHelp("a / d", f"left / right by {angular_step_rad_s:g} rad/s"),
                KeyHelp("s", "stop, and arm again"),
                *_STOPS,
                KeyHelp("1 to 5", "speed level"),
                KeyHelp("q", "quit"),
            )
        case Control.HOLD:
            return (
                KeyHelp("u i o", "hold: forward, with a turn"),
                KeyHelp("j k l", "hold: turn left / right; k stops"),
                KeyHelp("m , .", "hold: backward, with a turn"),
                KeyHelp("arrows", "the same"),
                *_STOPS,
                KeyHelp("q / z", "both speeds up / down by 10 %"),
                KeyHelp("w / x", "linear speed, e / c angular"),
                KeyHelp("1 to 5", "speed level"),
                KeyHelp("Ctrl-C", "quit"),
            )
        case Control.GAMEPAD:
            return (
                KeyHelp("stick", "drive, with the dead-man button"),
                KeyHelp("s", "stop; then press the button again"),
                *_STOPS,
                KeyHelp("1 to 5", "speed level"),
                KeyHelp("q", "quit"),
            )
        case Control.VIEW_ONLY:
            return (_STOPS[0], KeyHelp("q", "quit"))
        case _:
            assert_never(control)
