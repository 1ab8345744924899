"""Checks the scene, and the simulated robot against the footprint, before the start; needs the extra `sim`."""

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from sim.config import SceneError, SimSection
from sim.floorplan import Circle
from sim.plant import Plant
from supervisor.config import SupervisorSection
from supervisor.law.clearance import Floats
from wire.host.config import ConfigError, Sections
from wire.outline import line_around

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
    """Return points (n, 2) [m] around the simulated robot, counter-clockwise in its own frame, whose origin is its centre."""
    outline = plant.outline
    if isinstance(outline, Circle):
        return line_around([(0.0, 0.0)], outline.radius_m, OUTLINE_POINTS)
    return np.array(outline._replace(x_m=0.0, y_m=0.0, yaw_rad=0.0).corners_m())


def _footprint(outline: Floats) -> str:
    """Return the setting of [supervisor.footprint] that matches the outline."""
    if len(outline) == OUTLINE_POINTS:
        return f"radius_m = {np.hypot(*outline.T).max():.3g}"
    return f"corners_m = {outline.round(3).tolist()}"
