"""A ramp that only ever holds speed back: what is sent grows slowly towards what is wanted, and falls at once.

So it never asks for more than the operator wants, and no stop has to be led past it.
"""

import math

from teleop.pilot import NEUTRAL, Velocity

PERIOD_S = 0.02
"""Between two steps of a ramp that moves: finer than the 20 Hz heartbeat, and as often as the supervisor ticks."""


class Ramp:
    """The velocity sent, on its way to the one wanted.

    Args:
        acceleration_m_s2: how fast the forward velocity may grow, in either direction.
        angular_acceleration_rad_s2: likewise the turn rate.
    """

    def __init__(self, acceleration_m_s2: float, angular_acceleration_rad_s2: float) -> None:
        self._rates = (acceleration_m_s2, angular_acceleration_rad_s2)
        self._sent = NEUTRAL
        self._moving = False
        self._since_s = -math.inf

    @property
    def next_s(self) -> float:
        """When the next step is due; `math.inf`: it has arrived."""
        return self._since_s + PERIOD_S if self._moving else math.inf

    def toward(self, wanted: Velocity, now_s: float) -> Velocity:
        """What is sent at `now_s`. A ramp that sets out does its first step at once."""
        elapsed_s = max(0.0, now_s - self._since_s)
        if not self._moving:
            elapsed_s = min(elapsed_s, PERIOD_S)
        self._sent = Velocity(
            *(
                _grown(sent, goal, rate * elapsed_s)
                for sent, goal, rate in zip(self._sent, wanted, self._rates, strict=True)
            )
        )
        self._moving, self._since_s = self._sent != wanted, now_s
        return self._sent

    def reset(self) -> None:
        """Zero at once."""
        self._sent, self._moving = NEUTRAL, False


def _grown(sent: float, wanted: float, most: float) -> float:
    """`sent` moved to `wanted`, by at most `most` away from zero and by any amount towards it."""
    start = sent if sent * wanted > 0.0 else 0.0
    return math.copysign(min(abs(wanted), abs(start) + most), wanted) if wanted else 0.0
