"""Where the hull comes to rest if the operator's link dies now. Pure."""

import math
from typing import NamedTuple

from supervisor.config import SupervisorSection
from supervisor.law.reckoning import Pose
from supervisor.measured import MeasuredSection


class Stopping(NamedTuple):
    """What is known of the robot's stops: the configured numbers, or the measured limits if they are worse."""

    reaction_s: float
    """From the death of the link until the base brakes."""
    deceleration_m_s2: float
    deceleration_rad_s2: float


def stopping_of(config: SupervisorSection, measured: MeasuredSection) -> Stopping:
    """Return what is known of a robot's stops. On the spot, the outermost point of the hull decelerates as the hull does when it drives straight."""
    deceleration_m_s2, dead_s = measured.worse_braking(config.deceleration_m_s2, config.base_dead_time_s)
    return Stopping(
        config.command_timeout_s + config.transport_s + dead_s,
        deceleration_m_s2,
        deceleration_m_s2 / config.footprint.hull().radius_m,
    )


def rest_of(linear_m_s: float, angular_rad_s: float, stopping: Stopping) -> Pose:
    """Return where the robot comes to rest, in its base frame of now, if it drives on for the reaction time and then brakes.

    Args:
        linear_m_s: its speed.
        angular_rad_s: its rate.
        stopping: what is known of its stops.
    """
    reaction_s = stopping.reaction_s
    way_m = linear_m_s * reaction_s + linear_m_s * abs(linear_m_s) / (2.0 * stopping.deceleration_m_s2)
    turn_rad = angular_rad_s * reaction_s
    turn_rad += angular_rad_s * abs(angular_rad_s) / (2.0 * stopping.deceleration_rad_s2)
    # The chord of an arc of constant curvature; the two velocities may end at different times.
    half_rad = turn_rad / 2.0
    chord_m = way_m * (math.sin(half_rad) / half_rad if abs(half_rad) > 1e-6 else 1.0)
    return Pose(chord_m * math.cos(half_rad), chord_m * math.sin(half_rad), turn_rad)
