"""`[teleop.gamepad]` of robot.toml."""

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from wire.host.config import Section
from wire.host.quantities import Between

AxisName = Annotated[str, Field(pattern=r"^ABS_[A-Z0-9_]+$")]
ButtonName = Annotated[str, Field(pattern=r"^(BTN|KEY)_[A-Z0-9_]+$")]
Share = Annotated[float, Between(0.01, 1.0)]
LimitS = Annotated[float, Between(0.2, 30.0)]
"""Bounds of a silence limit; without an upper bound, the robot could be driven without a sign of life of the pad."""


class GamepadSection(Section):
    """Axes and buttons by their Linux names (shown by `evtest`), dead zone and velocity shares of the stick."""

    device: Annotated[str, Field(pattern=r"^/.+")] | None = None
    """Device such as /dev/input/by-id/...-event-joystick; None: the only connected gamepad."""
    forward_axis: AxisName = "ABS_Y"
    turn_axis: AxisName = "ABS_X"
    forward_inverted: bool = True
    """Whether the axis decreases when the stick is pushed forward, as in the kernel's convention."""
    turn_inverted: bool = True
    """Whether the axis decreases when the stick is pushed to the left; a turn to the left is positive."""
    dead_man_button: ButtonName = "BTN_TL"
    turbo_button: ButtonName = "BTN_TR"
    dead_zone: Annotated[float, Between(0.01, 0.5)] = 0.15
    """Share of the stick's range that counts as centred; a larger `flat` of the driver takes precedence."""
    normal_share: Share = 0.5
    turbo_share: Share = 1.0
    """Shares of max_linear_m_s and max_angular_rad_s, without and with the turbo button."""
    silence_limit_s: LimitS = 2.0
    """A pad that sends nothing for longer than this while driving counts as lost."""
    pulse_limit_s: LimitS = 0.5
    """The same for a pad with motion sensors, which send continuously."""

    @field_validator("turn_axis")
    @classmethod
    def _is_another_axis(cls, value: str, info: ValidationInfo) -> str:
        if value == info.data.get("forward_axis"):
            raise ValueError("expected another axis than forward_axis")
        return value

    @field_validator("turbo_button")
    @classmethod
    def _is_another_button(cls, value: str, info: ValidationInfo) -> str:
        if value == info.data.get("dead_man_button"):
            raise ValueError("expected another button than dead_man_button")
        return value

    @field_validator("turbo_share")
    @classmethod
    def _is_no_less_than_normal(cls, value: float, info: ValidationInfo) -> float:
        if value < info.data.get("normal_share", value):
            raise ValueError("expected at least normal_share")
        return value
