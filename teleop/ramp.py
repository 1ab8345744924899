"""A ramp that limits only increases: the sent velocity grows slowly to the requested one, and falls immediately.

It never exceeds the operator's request, and a stop needs no bypass of the ramp.
"""

import math

from teleop.pilot import NEUTRAL, Velocity

PERIOD_S = 0.02
"""Time between two steps of the ramp: shorter than the 20 Hz heartbeat, and equal to the supervisor's tick."""


class Ramp:
    """Limits the increase of the sent velocity toward the requested one.

    Args:
        acceleration_m_s2: maximum increase of the forward velocity, in either direction.
        angular_acceleration_rad_s2: maximum increase of the turn rate, in either direction.
    """

    def __init__(self, acceleration_m_s2: float, angular_acceleration_rad_s2: float) -> None:
        self._rates = (acceleration_m_s2, angular_acceleration_rad_s2)
        self._sent = NEUTRAL
        self._moving = False
        self._since_s = -math.inf

    @property
    def next_s(self) -> float:
        """Time at which the next step is due; `math.inf` at the end of the ramp."""
        return self._since_s + PERIOD_S if self._moving else math.inf

    def toward(self, wanted: Velocity, now_s: float) -> Velocity:
        """Return the velocity to send at `now_s`. A new ramp makes its first step immediately."""
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
        """Set the sent velocity to zero immediately."""
        self._sent, self._moving = NEUTRAL, False


def _grown(sent: float, wanted: float, most: float) -> float:
    """Return `sent` moved toward `wanted`, by at most `most` away from zero and by any amount toward zero."""
    start = sent if sent * wanted > 0.0 else 0.0
    return math.copysign(min(abs(wanted), abs(start) + most), wanted) if wanted else 0.0
