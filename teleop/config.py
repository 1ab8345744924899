"""`[teleop]` of robot.toml."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from teleop.gamepad_config import GamepadSection
from teleop.pilot import Velocity
from teleop.setpoint import LEVELS, Steps
from wire import topics
from wire.host.config import FreeName, Section
from wire.host.quantities import Acceleration, AngularAcceleration, Between, Speed, TurnRate

# At a lower rate, the supervisor would time out between two commands.
CommandRate = Annotated[float, Between(2.0, 200.0)]
# A lower limit would leave too little beyond the periods of the commands and of the status.
RoundTripLimit = Annotated[float, Between(0.2, 10.0)]
LinearStep = Annotated[float, Between(0.001, 1.0)]
AngularStep = Annotated[float, Between(0.001, 3.2)]


class Mode(StrEnum):
    """Control mode of the operator."""

    INCREMENTAL = "incremental"
    HOLD = "hold"
    GAMEPAD = "gamepad"


class TeleopSection(Section):
    """Name and rate of this command source, speeds, steps and control mode."""

    source: FreeName = topics.TELEOP
    mode: Annotated[Mode, Field(strict=False)] = Mode.INCREMENTAL
    rate_hz: CommandRate = 20.0
    round_trip_limit_s: RoundTripLimit = 0.5
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

    def to_steps(self) -> Steps:
        return Steps(
            self.linear_step_m_s, self.angular_step_rad_s, self.max_linear_m_s, self.max_angular_rad_s
        )

    def most(self) -> Velocity:
        """Maximum velocity at the highest speed level."""
        return Velocity(self.max_linear_m_s, self.max_angular_rad_s)
