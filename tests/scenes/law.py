"""Configures the law and builds its inputs; the only file of this package that does so."""

import math
from dataclasses import replace

import numpy as np

import supervisor.law.scan
from supervisor.config import SupervisorSection
from supervisor.law.decision import Decision
from supervisor.law.lidar import PROFILES
from supervisor.law.model import Command, Inputs, LawConfig, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.scan import LaserScan, Mount
from tests.scenes.scene import Lidar, Scene, timeout_s
from tests.scenes.sensing import Ranges
from wire.freshness import Sent

SOURCE = "teleop"
EPOCH = bytes(16)
LATE_FROM_S = 1.2
"""Time from which scans are late. Before it, they arrive without delay, because the law takes the fastest scans as undelayed."""


def config_of(scene: Scene) -> LawConfig:
    """Return the default configuration with the scene's hull and lidars."""
    configured = scene.configured
    lidars = tuple(
        supervisor.law.scan.Lidar(
            f"lidar{number}",
            _mount(lidar),
            PROFILES[lidar.profile],
            timeout_s(lidar.rate_hz) + configured.latency_s,
            latency_s=configured.latency_s,
        )
        for number, lidar in enumerate(scene.lidars)
    )
    return replace(
        SupervisorSection().law(),
        hull=scene.hull,
        lidars=lidars,
        odometry=scene.odometry_scale is not None,
        deceleration_m_s2=configured.braking_m_s2,
        base_dead_time_s=configured.dead_s,
        base_timeout_s=configured.timeout_s,
        base_acceleration_m_s2=scene.base.acceleration_m_s2,
        base_angular_acceleration_rad_s2=scene.base.acceleration_m_s2 / scene.hull.radius_m,
    )


def inputs(
    scene: Scene,
    now_s: float,
    asked: Velocity,
    scans: list[tuple[int, float, Ranges]],
    odometry: Velocity | None,
) -> Inputs:
    """Build the inputs of the law at one tick.

    Args:
        scene: the scene that has these lidars.
        now_s: time of the tick.
        asked: the operator's command.
        scans: (lidar, time of the scan, readings) of each scan since the last tick.
        odometry: the base's reported velocity; None without odometry.
    """
    commands = (Command(SOURCE, asked, now_s),)
    moving = None if odometry is None else Odometry(odometry, now_s)
    taken = tuple(_scan(scene.lidars[number], number, at_s, ranges) for number, at_s, ranges in scans)
    return Inputs(commands=commands, odometry=moving, scans=taken)


def stops(decision: Decision) -> tuple[str, ...]:
    """Return the stop reasons."""
    return tuple(reason.value for reason in decision.reasons)


def on_way_s(lidar: Lidar, taken_s: float) -> float:
    """Return the delay of a scan from the lidar to the law."""
    return lidar.latency_s + (lidar.late_s if taken_s > LATE_FROM_S else 0.0)


def _scan(lidar: Lidar, number: int, taken_s: float, ranges: Ranges) -> LaserScan:
    stamp = Sent(EPOCH, round(taken_s * 1e6), taken_s + lidar.latency_s) if lidar.late_s else None
    return LaserScan(
        np.where((ranges > 0.0) & (ranges < lidar.range_min), np.float32(-math.inf), ranges),
        lidar.angle_min,
        lidar.angle_increment,
        lidar.range_min,
        lidar.range_max,
        taken_s + on_way_s(lidar, taken_s),
        stamp,
        lidar=number,
    )


def _mount(lidar: Lidar) -> Mount:
    return Mount(lidar.x_m, lidar.y_m, lidar.yaw_rad)
