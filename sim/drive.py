"""The base's drive: limits and ramp of the commanded twist, and the geometry of the wheels.

Pure: no clock and no simulator. In the body frame, x points forward and y left; ω is positive counter-clockwise.
"""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple


class Twist(NamedTuple):
    """The velocity of a ground robot in its own frame."""

    linear_m_s: float
    angular_rad_s: float


STANDSTILL = Twist(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Limits of the base, as magnitudes.

    The angular limits are four times the linear limits: at the rim of the 0.25 m hull, both are the same in m/s².

    Raises:
        ValueError: A limit is not positive and finite.
    """

    max_linear_m_s: float = 1.0
    max_angular_rad_s: float = 2.0
    acceleration_m_s2: float = 1.0
    braking_m_s2: float = 2.0
    angular_acceleration_rad_s2: float = 4.0
    angular_braking_rad_s2: float = 8.0

    def __post_init__(self) -> None:
        _require_positive(self)


@dataclass(frozen=True, slots=True)
class WheelGeometry:
    """Two driven wheels on one axle; the body frame's origin is midway between them.

    Raises:
        ValueError: A length is not positive and finite.
    """

    radius_m: float
    track_m: float

    def __post_init__(self) -> None:
        _require_positive(self)

    def wheel_speeds(self, twist: Twist) -> tuple[float, float]:
        """Return the (left, right) wheel speeds in rad/s for a twist."""
        half_difference_m_s = 0.5 * self.track_m * twist.angular_rad_s
        return (
            (twist.linear_m_s - half_difference_m_s) / self.radius_m,
            (twist.linear_m_s + half_difference_m_s) / self.radius_m,
        )

    def twist(self, left: float, right: float) -> Twist:
        """Return the twist for (left, right) wheel speeds in rad/s, or the displacement in m and rad for angles in rad."""
        left_m, right_m = left * self.radius_m, right * self.radius_m
        return Twist(0.5 * (left_m + right_m), (right_m - left_m) / self.track_m)


class Drive:
    """Ramps the twist toward the commanded one.

    Each axis speeds up at its acceleration limit and slows down at its braking limit. Before a change of sign, the axis
    brakes to zero. When both axes brake, they take the same time, so that a robot that is stopped on an arc stays on
    this arc. A supervisor that scales a twist down relies on this.
    """

    def __init__(self, limits: DriveLimits | None = None) -> None:
        self.limits = limits or DriveLimits()
        self.twist = STANDSTILL
        """The present output of the ramp."""

    def reset(self, twist: Twist = STANDSTILL) -> None:
        """Restart the ramp from this twist."""
        self.twist = twist

    def step(self, target: tuple[float, float], dt_s: float) -> Twist:
        """Advance by `dt_s` toward the target (v in m/s, ω in rad/s), clamped to the limits.

        A target that is not finite counts as standstill.
        """
        limits = self.limits
        v, omega = self.twist
        v_target, omega_target = target
        if not (math.isfinite(v_target) and math.isfinite(omega_target)):
            v_target = omega_target = 0.0
        v_target = _clamp(v_target, limits.max_linear_m_s)
        omega_target = _clamp(omega_target, limits.max_angular_rad_s)
        if v == v_target and omega == omega_target:
            return self.twist

        v_braking, omega_braking = limits.braking_m_s2, limits.angular_braking_rad_s2
        if _slows_down(v, v_target) and _slows_down(omega, omega_target):
            v_time_s = abs(v_target - v) / v_braking
            omega_time_s = abs(omega_target - omega) / omega_braking
            longer_s = max(v_time_s, omega_time_s)
            if min(v_time_s, omega_time_s) > 0.0:  # braking from the smallest floats takes zero time
                v_braking *= v_time_s / longer_s
                omega_braking *= omega_time_s / longer_s
        self.twist = Twist(
            _ramp(v, v_target, limits.acceleration_m_s2, v_braking, dt_s),
            _ramp(omega, omega_target, limits.angular_acceleration_rad_s2, omega_braking, dt_s),
        )
        return self.twist


def _clamp(value: float, magnitude: float) -> float:
    return max(-magnitude, min(magnitude, value))


def _slows_down(value: float, target: float) -> bool:
    """Return whether the target has a smaller magnitude than the value, and not the opposite sign."""
    return value != target and value * target >= 0.0 and abs(target) < abs(value)


def _ramp(value: float, target: float, acceleration: float, braking: float, dt_s: float) -> float:
    """Return one axis after `dt_s`: brake to the slowest value between both, then speed up in the remaining time."""
    slowest = min(value, target, key=abs) if value * target >= 0.0 else 0.0
    fall = abs(value - slowest)
    if braking * dt_s < fall:
        return value - math.copysign(braking * dt_s, value)
    rise = acceleration * (dt_s - fall / braking)
    if abs(target - slowest) <= rise:
        return target
    return slowest + math.copysign(rise, target)


def _require_positive(limits: DriveLimits | WheelGeometry) -> None:
    for field in fields(limits):
        value: float = getattr(limits, field.name)
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{field.name} must be positive and finite, not {value}.")
