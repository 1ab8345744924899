"""MuJoCo's own window on the plant, where there is a display."""

import importlib
import os
from collections.abc import Callable
from typing import Any

from sim import mj
from sim.plant import Plant

# Above and behind the robot, within the hall also at its start, looking down the aisle and following it.
VIEW_DISTANCE_M = 3.2
VIEW_AZIMUTH_DEG = 0.0
VIEW_ELEVATION_DEG = -65.0


class NoDisplayError(Exception):
    """A window was asked for where none can open."""


def has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(plant: Plant) -> Callable[[], None]:
    """Open the window and return what draws one frame; a window that was closed draws nothing.

    Raises:
        NoDisplayError: there is no display, or MuJoCo cannot use it.
    """
    if not has_display():
        raise NoDisplayError("there is no display for a window; leave out --viewer to run without one")
    viewer: Any = importlib.import_module("mujoco.viewer")
    try:
        handle = viewer.launch_passive(plant.model, plant.data, show_left_ui=False, show_right_ui=False)
    except Exception as error:
        raise NoDisplayError(f"MuJoCo cannot open a window here ({error}); use --no-viewer") from error

    camera = handle.cam
    camera.type = int(mj.mujoco.mjtCamera.mjCAMERA_TRACKING)
    camera.trackbodyid = mj.body_id(plant.model, "robot")
    camera.distance, camera.azimuth, camera.elevation = VIEW_DISTANCE_M, VIEW_AZIMUTH_DEG, VIEW_ELEVATION_DEG

    def draw() -> None:
        if handle.is_running():
            handle.sync()

    return draw
