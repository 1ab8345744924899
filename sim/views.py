"""From where the world is looked at: views that fit any layout, and the cameras that a model brings. Pure but for those."""

import math
from typing import NamedTuple

from sim import mj
from sim.plant import Plant

FIELD_OF_VIEW_RAD = math.radians(50.0)
"""Upright, as in models/hall.xml."""


class ViewError(ValueError):
    """There is no such camera; the message says which there are."""


class View(NamedTuple):
    """A camera that looks at a point from a distance.

    Attributes:
        look_at_m: In the world; from the robot where the view follows it.
        distance_m: From the point to the eye.
        azimuth_deg: Which way it looks, counter-clockwise from x; from the robot's start heading where it follows.
        elevation_deg: Downwards is negative.
        follows: Whether it goes along with the robot. It does not turn with it.
    """

    look_at_m: tuple[float, float, float]
    distance_m: float
    azimuth_deg: float
    elevation_deg: float
    follows: bool = False


FOLLOW = View((0.5, 0.0, 0.1), 2.6, -16.0, -40.0, follows=True)
NAMES = ("follow", "corner", "top")


def view_of(plant: Plant, name: str, aspect: float) -> View | str:
    """The view of this name, or the name itself where the model has a camera of that name.

    Args:
        plant: What is looked at.
        name: Of a view or of a camera.
        aspect: The picture's width over its height.

    Raises:
        ViewError: There is neither.
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
    """MuJoCo's camera for a view, now."""
    (x_m, y_m, z_m), azimuth_deg = view.look_at_m, view.azimuth_deg
    if view.follows:
        heading_rad = plant.start_pose.yaw_rad
        robot_x_m, robot_y_m, _ = plant.true_pose
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        x_m, y_m = robot_x_m + cos * x_m - sin * y_m, robot_y_m + sin * x_m + cos * y_m
        azimuth_deg += math.degrees(heading_rad)
    return mj.free_camera((x_m, y_m, z_m), view.distance_m, azimuth_deg, view.elevation_deg)


def _corner(plant: Plant) -> View:
    """The whole hall, over the walls of its south-west corner."""
    size_x_m, size_y_m = plant.size_m or _reach_m(plant)
    return View((0.0, -0.03 * size_y_m, 0.0), 0.92 * math.hypot(size_x_m, size_y_m), 62.0, -55.0)


def _top(plant: Plant, aspect: float) -> View:
    """The whole hall as a plan: x to the right, y upwards."""
    size_x_m, size_y_m = plant.size_m or _reach_m(plant)
    height_m = 1.06 * max(size_y_m, size_x_m / aspect)
    return View((0.0, 0.0, 0.0), 2.0 + 0.5 * height_m / math.tan(0.5 * FIELD_OF_VIEW_RAD), 90.0, -90.0)


def _reach_m(plant: Plant) -> tuple[float, float]:
    """As much of a world without known walls as its things take."""
    size_m = 2.0 * mj.reach_m(plant.model, plant.data)
    return size_m, size_m


def fit(plant: Plant) -> None:
    """Lets MuJoCo know how large a world without known walls is, from which it reckons how near it draws.

    By itself it counts the pillar, which waits far below the floor, and cuts off whatever is nearer than a metre.
    """
    if plant.size_m is None:
        plant.model.stat.extent = mj.reach_m(plant.model, plant.data)
