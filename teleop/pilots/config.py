"""The values of robot.toml in use: `[teleop]` and `[teleop.gamepad]`."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from teleop.pilots.pilot import LEVELS, Velocity
from wire import topics
from wire.host.config import (
    Acceleration,
    AngularAcceleration,
    Between,
    Conflict,
    FreeName,
    Section,
    Speed,
    TurnRate,
)

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

    def conflicts(self) -> Iterator[Conflict]:
        if self.turn_axis == self.forward_axis:
            yield Conflict(("turn_axis",), self.turn_axis, "expected another axis than forward_axis")
        if self.turbo_button == self.dead_man_button:
            yield Conflict(
                ("turbo_button",), self.turbo_button, "expected another button than dead_man_button"
            )
        if self.turbo_share < self.normal_share:
            yield Conflict(("turbo_share",), self.turbo_share, "expected at least normal_share")


# At a lower rate, the supervisor would time out between two commands.
CommandRate = Annotated[float, Between(2.0, 200.0)]
# A lower limit would leave too little beyond the periods of the commands and of the status.
RoundTripLimit = Annotated[float, Between(0.2, 10.0)]
# A longer time would let the robot drive on without an operator.
Vigilance = Annotated[float, Between(2.0, 120.0)]
LinearStep = Annotated[float, Between(0.001, 1.0)]
AngularStep = Annotated[float, Between(0.001, 3.2)]
Mode = Literal["incremental", "hold", "gamepad"]


class TeleopSection(Section):
    """Name and rate of this command source, speeds, steps and control mode."""

    source: FreeName = topics.TELEOP
    mode: Mode = "incremental"
    rate_hz: CommandRate = 20.0
    round_trip_limit_s: RoundTripLimit = 0.5
    vigilance_s: Vigilance = 10.0
    linear_step_m_s: LinearStep = 0.1
    angular_step_rad_s: AngularStep = 0.2
    max_linear_m_s: Speed = 1.0
    max_angular_rad_s: TurnRate = 2.0
    level: Annotated[int, Between(1, LEVELS)] = LEVELS
    acceleration_m_s2: Acceleration = 1.0
    angular_acceleration_rad_s2: AngularAcceleration = 4.0
    hold_linear_m_s: Speed = 0.5
    hold_angular_rad_s: TurnRate = 1.0
    gamepad: GamepadSection = GamepadSection()

    def step(self) -> Velocity:
        """Step of each velocity at the highest speed level."""
        return Velocity(self.linear_step_m_s, self.angular_step_rad_s)

    def most(self) -> Velocity:
        """Maximum velocity at the highest speed level."""
        return Velocity(self.max_linear_m_s, self.max_angular_rad_s)
