"""The bounds of the numbers in robot.toml: every number has a lower and an upper bound.

The bounds are part of the safety argument: without them, a timeout of `1e9` would disable a watchdog, and a distance of
`1e-9` would disable the barrier. `Between` refuses values outside the bounds, NaN and infinity included; its message
gives the bounds. Types of quantities in more than one section are defined here, all others next to their keys.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import GetCoreSchemaHandler
from pydantic_core import PydanticCustomError, core_schema


@dataclass(frozen=True, slots=True)
class Between:
    """Inclusive bounds of a number, with advice for the error message."""

    low: float
    high: float
    advice: str = ""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def _check(self, value: float) -> float:
        if self.low <= value <= self.high:  # false for NaN
            return value
        advice = f"; {self.advice}" if self.advice else ""
        message = f"must be from {_text(self.low)} to {_text(self.high)}{advice}"
        raise PydanticCustomError("out_of_bounds", "{message}", {"message": message})


def _text(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:.6g}"


Speed = Annotated[float, Between(0.01, 5.0, "in m/s: a faster robot needs more than a planar lidar")]
TurnRate = Annotated[float, Between(0.01, math.tau, "in rad/s: a full turn each second is the most")]
Acceleration = Annotated[
    float, Between(0.05, 20.0, "in m/s²: wheels have no grip for more than twice gravity")
]
AngularAcceleration = Annotated[float, Between(0.05, 100.0, "in rad/s²")]
Angle = Annotated[float, Between(-math.tau, math.tau, "in rad, not in degrees")]
Distance = Annotated[float, Between(-10.0, 10.0, "in m, not in mm")]
"""A coordinate on the robot; the bounds allow a hull as large as a truck."""
Range = Annotated[float, Between(0.1, 200.0, "in m: no planar lidar of a robot has a longer range")]
Beams = Annotated[int, Between(1, 65_536, "as many as one message carries")]
Seed = Annotated[int, Between(0, 2**32 - 1)]
