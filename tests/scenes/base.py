"""Two models of a base. Both brake at least as hard as the law assumes.

A turn rate ω counts as the speed of the hull's farthest point, ω·radius. From any twist, a base is therefore at rest
after at most max(|v|, |ω|·radius) / braking, as the law assumes.
"""

import math
from typing import Protocol

from supervisor.law.reckoning import STANDSTILL, Velocity


class Base(Protocol):
    """The twist of a base over time."""

    twist: Velocity

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        """Advance the time, and return the twist after `dt_s` under a command."""
        ...


class MixtureBase:
    """Both axes change in proportion, so that they reach the commanded twist together."""

    def __init__(self, acceleration_m_s2: float, braking_m_s2: float, radius_m: float) -> None:
        self.twist = STANDSTILL
        self._acceleration, self._braking, self._radius_m = acceleration_m_s2, braking_m_s2, radius_m

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        linear = target.linear_m_s - self.twist.linear_m_s
        angular = target.angular_rad_s - self.twist.angular_rad_s
        change = max(abs(linear), abs(angular) * self._radius_m)
        fades = (
            self.twist.linear_m_s * linear + self.twist.angular_rad_s * angular * self._radius_m**2
        ) < 0.0
        rate = self._braking if fades else self._acceleration
        share = 1.0 if change == 0.0 else min(1.0, rate * dt_s / change)
        self.twist = Velocity(
            self.twist.linear_m_s + share * linear, self.twist.angular_rad_s + share * angular
        )
        return self.twist


class AxisBase:
    """Each axis has its own ramp, so that the base follows neither arc while it changes between two."""

    def __init__(self, acceleration_m_s2: float, braking_m_s2: float, radius_m: float) -> None:
        self.twist = STANDSTILL
        self._acceleration, self._braking, self._radius_m = acceleration_m_s2, braking_m_s2, radius_m

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        up, down, radius_m = self._acceleration * dt_s, self._braking * dt_s, self._radius_m
        self.twist = Velocity(
            _ramp(self.twist.linear_m_s, target.linear_m_s, up, down),
            _ramp(self.twist.angular_rad_s, target.angular_rad_s, up / radius_m, down / radius_m),
        )
        return self.twist


def _ramp(value: float, target: float, up: float, down: float) -> float:
    if value * target < 0.0:
        target = 0.0  # brake to rest before reversing
    if abs(target) < abs(value):
        return math.copysign(max(abs(target), abs(value) - down), value)
    return math.copysign(min(abs(target), abs(value) + up), target)
