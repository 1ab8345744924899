"""The only file of this package that knows how the law is configured and fed.

`LawConfig` and `Inputs` are taken as they are: where they know `lidars` and `scans`, a scene may have two lidars.
"""

from dataclasses import fields, replace
from typing import Any

from bench.scenes.scene import Lidar, Scene
from bench.scenes.sensing import Ranges
from supervisor import model
from supervisor.config import SupervisorSection
from supervisor.lidar import PROFILES
from supervisor.model import Command, Decision, Inputs, LaserScan, LawConfig, Odometry, Velocity
from supervisor.scan import Mount

SOURCE = "teleop"
RANGE_MIN_M = 0.02

TIMEOUT_PERIODS = 2.25
SHORTEST_TIMEOUT_S = 0.24

_FIELDS = {field.name for field in fields(LawConfig)}
SEVERAL_LIDARS = "lidars" in _FIELDS


def supports(scene: Scene) -> bool:
    """Whether the law can be configured for this scene."""
    return SEVERAL_LIDARS or len(scene.lidars) == 1


def config_of(scene: Scene) -> LawConfig:
    """The default configuration with the scene's hull and lidars."""
    default = SupervisorSection().law()
    changes: dict[str, Any] = {"hull": scene.hull}
    if SEVERAL_LIDARS:
        lidar_config: Any = vars(model)["LidarConfig"]
        lidars: list[Any] = [
            lidar_config(f"lidar{number}", _mount(lidar), PROFILES[lidar.profile], _timeout_s(lidar))
            for number, lidar in enumerate(scene.lidars)
        ]
        changes["lidars"] = tuple(lidars)
    else:
        (lidar,) = scene.lidars
        changes |= {
            "mount": _mount(lidar),
            "profile": PROFILES[lidar.profile],
            "scan_timeout_s": _timeout_s(lidar),
        }
    if "odometry" in _FIELDS:
        changes["odometry"] = scene.odometry_scale is not None
    return replace(default, **changes)


def inputs(
    scene: Scene,
    now_s: float,
    asked: Velocity,
    scans: list[tuple[int, float, Ranges]],
    odometry: Velocity | None,
) -> Inputs:
    """What reaches the law at one tick.

    Args:
        scene: whose lidars these are.
        now_s: the tick.
        asked: the operator's command.
        scans: (lidar, when it was taken, its readings) of each scan since the last tick.
        odometry: the base's own velocity, if it reports any.
    """
    commands = (Command(SOURCE, asked, now_s),)
    moving = None if odometry is None else Odometry(odometry, now_s)
    taken = tuple(_scan(scene.lidars[number], number, at_s, ranges) for number, at_s, ranges in scans)
    if SEVERAL_LIDARS:
        several: dict[str, Any] = {"scans": taken}
        return Inputs(commands=commands, odometry=moving, **several)
    return Inputs(commands=commands, odometry=moving, scan=taken[-1] if taken else None)


def stops(decision: Decision) -> tuple[str, ...]:
    """The reasons why the robot stands, which a neutral command is to clear."""
    return tuple(reason.value for reason in decision.reasons)


def _scan(lidar: Lidar, number: int, taken_s: float, ranges: Ranges) -> LaserScan:
    which: dict[str, Any] = {"lidar": number} if SEVERAL_LIDARS else {}
    return LaserScan(
        ranges,
        lidar.angle_min,
        lidar.angle_increment,
        RANGE_MIN_M,
        lidar.range_max,
        taken_s,
        **which,
    )


def _mount(lidar: Lidar) -> Mount:
    return Mount(lidar.x_m, lidar.y_m, lidar.yaw_rad)


def _timeout_s(lidar: Lidar) -> float:
    return max(SHORTEST_TIMEOUT_S, TIMEOUT_PERIODS / lidar.rate_hz)
