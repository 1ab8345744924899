"""How a base follows its command: two ways, both of which brake at least as hard as they are trusted to.

A turn rate counts by what it moves at the hull's farthest point: ω·radius. From any twist a base therefore stands
within max(|v|, |ω|·radius) / braking, which is what the law trusts it with.
"""

import math
from typing import Protocol

from supervisor.model import STANDSTILL, Velocity


class Base(Protocol):
    """A base's own twist in the course of time."""

    twist: Velocity

    def step(self, target: Velocity, dt_s: float) -> Velocity:
        """The twist after `dt_s` under a command."""
        ...


class MixtureBase:
    """The twist goes straight to the commanded one: on the way it is always a mixture of the two."""

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
    """Each axis has a ramp of its own: on the way from one arc to another the base is on neither."""

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
        target = 0.0  # first to rest
    if abs(target) < abs(value):
        return math.copysign(max(abs(target), abs(value) - down), value)
    return math.copysign(min(abs(target), abs(value) + up), target)
