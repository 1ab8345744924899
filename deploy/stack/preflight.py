"""Checks the scene, and the simulated robot against the footprint, before the start; needs the extra `sim`."""

import math

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from sim.config import SceneError, SimSection
from sim.floorplan import Circle
from sim.plant import Plant
from supervisor.config import SupervisorSection
from supervisor.law.clearance import Floats
from wire.host.config import ConfigError, Sections

SLACK_M = 1e-3
OUTLINE_POINTS = 72


def check_scene(launch: Launch, sections: Sections) -> None:
    """Refuse a scene or a simulated robot that would fail or be unsafe at runtime.

    Raises:
        DeployError: the scene is invalid, or the simulated robot extends beyond the footprint.
    """
    footprint, config = sections[SupervisorSection].footprint.hull(), sections[SimSection]
    try:
        scene = config.scene_beside(launch.config)
        plant = Plant(scene, config.limits(), config.lidar_configs(), config.seed, config.build())
    except (ConfigError, SceneError) as error:
        raise DeployError(str(error)) from error
    outline = outline_of(plant)
    out_m = float(footprint.clearance(outline).max())
    if out_m > SLACK_M:
        raise DeployError(
            f"the {config.hull} robot of [sim] extends beyond [supervisor.footprint] by {out_m:.2f} m, and would "
            f"collide with obstacles: set {_footprint(outline)} there"
        )


def outline_of(plant: Plant) -> Floats:
    """Return points (n, 2) [m] around the simulated robot, counter-clockwise in its own frame."""
    outline, pose = plant.outline, plant.true_pose
    if isinstance(outline, Circle):
        angle = np.arange(OUTLINE_POINTS) * (2 * math.pi / OUTLINE_POINTS)
        around = outline.radius_m * np.array([np.cos(angle), np.sin(angle)]).T + (outline.x_m, outline.y_m)
    else:
        around = np.array(outline.corners_m())
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    own: Floats = (around - (pose.x_m, pose.y_m)) @ np.array(((cos, -sin), (sin, cos)))
    return own


def _footprint(outline: Floats) -> str:
    """Return the setting of [supervisor.footprint] that matches the outline."""
    if len(outline) == OUTLINE_POINTS:
        return f"radius_m = {np.hypot(*outline.T).max():.3g}"
    return f"corners_m = {outline.round(3).tolist()}"
