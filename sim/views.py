"""Cameras: views that fit any layout, and the cameras of a model. Pure except for the latter."""

import math
from typing import NamedTuple

from sim import mj
from sim.plant import Plant

FIELD_OF_VIEW_RAD = math.radians(50.0)
"""Vertical field of view, as in models/hall.xml."""


class ViewError(ValueError):
    """There is no such camera; the message lists the available ones."""


class View(NamedTuple):
    """A camera that looks at a point from a distance.

    Attributes:
        look_at_m: The point in the world frame; relative to the robot if the view follows it.
        distance_m: Distance from the point to the camera.
        azimuth_deg: Viewing direction, counter-clockwise from x; from the robot's start heading if it follows.
        elevation_deg: Viewing angle above the horizontal; negative when looking down.
        follows: Whether the camera moves with the robot; it does not turn with it.
    """

    look_at_m: tuple[float, float, float]
    distance_m: float
    azimuth_deg: float
    elevation_deg: float
    follows: bool = False


FOLLOW = View((0.5, 0.0, 0.1), 2.6, -16.0, -40.0, follows=True)
NAMES = ("follow", "corner", "top")


def view_of(plant: Plant, name: str, aspect: float) -> View | str:
    """Return the view of this name, or the name itself if the model has a camera of that name.

    Args:
        plant: The plant.
        name: The name of a view or of a camera.
        aspect: The picture's width divided by its height.

    Raises:
        ViewError: There is neither a view nor a camera of this name.
    """
    own = mj.camera_names(plant.model)
    if name in own:
        return name
    match name:
        case "follow":
            return FOLLOW
        case "corner":
            return _corner(plant)
        case "top":
            return _top(plant, aspect)
        case _:
            known = ", ".join((*NAMES, *own))
            raise ViewError(f"There is no camera named {name!r}; there are {known}.")


def camera(plant: Plant, view: View) -> mj.Camera:
    """Return MuJoCo's camera for a view at the robot's present pose."""
    (x_m, y_m, z_m), azimuth_deg = view.look_at_m, view.azimuth_deg
    if view.follows:
        heading_rad = plant.start_pose.yaw_rad
        robot_x_m, robot_y_m, _ = plant.true_pose
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        x_m, y_m = robot_x_m + cos * x_m - sin * y_m, robot_y_m + sin * x_m + cos * y_m
        azimuth_deg += math.degrees(heading_rad)
    return mj.free_camera((x_m, y_m, z_m), view.distance_m, azimuth_deg, view.elevation_deg)


def _corner(plant: Plant) -> View:
    """Return a view of the whole hall, over its south-west corner."""
    size_x_m, size_y_m = plant.size_m or _reach_m(plant)
    return View((0.0, -0.03 * size_y_m, 0.0), 0.92 * math.hypot(size_x_m, size_y_m), 62.0, -55.0)


def _top(plant: Plant, aspect: float) -> View:
    """Return a view of the whole hall from above: x to the right, y up."""
    size_x_m, size_y_m = plant.size_m or _reach_m(plant)
    height_m = 1.06 * max(size_y_m, size_x_m / aspect)
    return View((0.0, 0.0, 0.0), 2.0 + 0.5 * height_m / math.tan(0.5 * FIELD_OF_VIEW_RAD), 90.0, -90.0)


def _reach_m(plant: Plant) -> tuple[float, float]:
    """Return the extent along x and y [m] of a world without known walls, from its objects."""
    size_m = 2.0 * mj.reach_m(plant.model, plant.data)
    return size_m, size_m


def fit(plant: Plant) -> None:
    """Set MuJoCo's extent of a world without known walls, from which it computes the near clipping plane.

    By default, MuJoCo includes the removed pillar far below the floor, and clips everything nearer than a metre.
    """
    if plant.size_m is None:
        plant.model.stat.extent = mj.reach_m(plant.model, plant.data)
