"""Floor plan of the world: exact distances from a hull to the objects at its height.

Every solid in the models is an upright box, cylinder or sphere, so its outline is a rectangle or a circle. Exact
distances miss no corner, unlike a fan of rays.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import mj

Floats = NDArray[np.float64]

_UPRIGHT = 1.0 - 1e-9


class Circle(NamedTuple):
    """A round outline in the world frame."""

    x_m: float
    y_m: float
    radius_m: float


class Rectangle(NamedTuple):
    """A rectangular outline in the world frame; its own x axis points along yaw."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_x_m: float
    half_y_m: float

    def corners_m(self) -> list[tuple[float, float]]:
        """Return the four corners, counter-clockwise."""
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return [
            (self.x_m + u * cos_yaw - v * sin_yaw, self.y_m + u * sin_yaw + v * cos_yaw)
            for u, v in (
                (self.half_x_m, self.half_y_m),
                (-self.half_x_m, self.half_y_m),
                (-self.half_x_m, -self.half_y_m),
                (self.half_x_m, -self.half_y_m),
            )
        ]


Outline = Circle | Rectangle


class Standing(NamedTuple):
    """A named object on the floor, with its outline."""

    name: str
    outline: Outline


class Nearest(NamedTuple):
    """The object nearest to a hull: its distance in m, negative by the depth of an overlap, and its name."""

    distance_m: float
    name: str


NOTHING = Nearest(math.inf, "")


def way_out_m(hull: Outline, x_m: float, y_m: float, angles_rad: Floats) -> Floats:
    """Return the distances [m] at which rays from a point leave a hull, shape (n,).

    Args:
        hull: The hull; its pose is ignored.
        x_m: Position of the point, in the hull's frame.
        y_m: Position of the point, in the hull's frame.
        angles_rad: (n,) directions of the rays, in the hull's frame.

    Returns:
        The distances; 0 for a ray that misses the hull.
    """
    cos, sin = np.cos(angles_rad), np.sin(angles_rad)
    if isinstance(hull, Circle):
        along_m = x_m * cos + y_m * sin
        square_m2 = along_m**2 - (x_m**2 + y_m**2 - hull.radius_m**2)
        return np.where(square_m2 > 0.0, np.maximum(0.0, np.sqrt(np.maximum(square_m2, 0.0)) - along_m), 0.0)
    enter_m, leave_m = np.full_like(cos, -math.inf), np.full_like(cos, math.inf)
    for at_m, slope, half_m in ((x_m, cos, hull.half_x_m), (y_m, sin, hull.half_y_m)):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            edges_m = np.stack(((-half_m - at_m) / slope, (half_m - at_m) / slope))
        # A ray along an edge gives 0 / 0.
        enter_m = np.maximum(enter_m, np.where(np.isnan(edges_m), -math.inf, edges_m).min(axis=0))
        leave_m = np.minimum(leave_m, np.where(np.isnan(edges_m), math.inf, edges_m).max(axis=0))
    return np.where(enter_m <= leave_m, np.maximum(0.0, leave_m), 0.0)


class FloorPlan:
    """Outlines of objects in the world frame, for distances to a hull."""

    def __init__(self, standing: Iterable[Standing]) -> None:
        boxes: list[tuple[float, ...]] = []
        circles: list[tuple[float, ...]] = []
        box_names: list[str] = []
        circle_names: list[str] = []
        for name, outline in standing:
            if isinstance(outline, Circle):
                circles.append(outline)
                circle_names.append(name)
            else:
                yaw_rad = outline.yaw_rad
                boxes.append((*outline[:2], math.cos(yaw_rad), math.sin(yaw_rad), *outline[3:]))
                box_names.append(name)
        self._names = box_names + circle_names
        self._boxes = np.array(boxes, dtype=np.float64).reshape(-1, 6).T.copy()
        self._circles = np.array(circles, dtype=np.float64).reshape(-1, 3).T.copy()

    def nearest(self, hull: Outline) -> Nearest:
        """Return the object nearest to the hull; `NOTHING` on an empty floor."""
        if not self._names:
            return NOTHING
        distances_m = self.distances_m(hull)
        index = int(np.argmin(distances_m))
        return Nearest(float(distances_m[index]), self._names[index])

    def overlapping(self, hull: Outline, by_m: float) -> list[str]:
        """Return the names of all objects that overlap the hull by more than `by_m`."""
        return [self._names[index] for index in np.flatnonzero(self.distances_m(hull) < -by_m)]

    def distances_m(self, hull: Outline) -> Floats:
        """Return the distances [m] to all outlines, shape (outlines,), rectangles before circles; negative if they overlap."""
        boxes, (x, y, radius) = self._boxes, self._circles
        if isinstance(hull, Circle):
            to_boxes = _to_rectangle(hull.x_m, hull.y_m, boxes) - hull.radius_m
            to_circles = np.hypot(hull.x_m - x, hull.y_m - y) - radius - hull.radius_m
        else:
            cos_yaw, sin_yaw = math.cos(hull.yaw_rad), math.sin(hull.yaw_rad)
            own = np.array((*hull[:2], cos_yaw, sin_yaw, *hull[3:])).reshape(6, 1)
            to_boxes = _between_rectangles(own, boxes)
            to_circles = _to_rectangle(x, y, own) - radius
        return np.concatenate((to_boxes, to_circles))


def survey(model: mj.Model, data: mj.Data, geoms: Iterable[int]) -> tuple[list[Standing], list[int]]:
    """Return the outlines of geoms at the poses of the last step, and the geoms without one: tilted or of another shape."""
    standing: list[Standing] = []
    others: list[int] = []
    for geom in geoms:
        outline = outline_of(model, data, geom)
        if outline is None:
            others.append(geom)
        else:
            standing.append(Standing(mj.geom_label(model, geom), outline))
    return standing, others


def outline_of(model: mj.Model, data: mj.Data, geom: int) -> Outline | None:
    """Return the outline of a geom from above if it is a circle or a rectangle, else None."""
    x_m, y_m, _ = data.geom_xpos[geom].tolist()
    rotation = data.geom_xmat[geom].tolist()
    half_x_m, half_y_m, _ = model.geom_size[geom].tolist()
    shape = model.geom_type[geom]
    upright = abs(rotation[8]) > _UPRIGHT
    if shape == mj.Shape.SPHERE or (shape == mj.Shape.CYLINDER and upright):
        return Circle(x_m, y_m, half_x_m)
    if shape == mj.Shape.BOX and upright:
        return Rectangle(x_m, y_m, math.atan2(rotation[3], rotation[0]), half_x_m, half_y_m)
    return None


def _to_rectangle(x_m: float | Floats, y_m: float | Floats, rectangles: Floats) -> Floats:
    """Return the distances from points to rectangles, negative inside; the shapes are broadcast."""
    x, y, cos_yaw, sin_yaw, half_x, half_y = rectangles
    dx, dy = x_m - x, y_m - y
    beyond_x = np.abs(cos_yaw * dx + sin_yaw * dy) - half_x
    beyond_y = np.abs(cos_yaw * dy - sin_yaw * dx) - half_y
    outside = np.hypot(np.maximum(beyond_x, 0.0), np.maximum(beyond_y, 0.0))
    return outside + np.minimum(np.maximum(beyond_x, beyond_y), 0.0)


def _between_rectangles(own: Floats, others: Floats) -> Floats:
    """Return the distances from one rectangle, shape (6, 1), to others, shape (6, n).

    The nearest points of two separate convex outlines include a corner of one of them. The depth of an overlap is the
    smallest overlap along any of the four axes (separating axis theorem).
    """
    x, y, cos_yaw, sin_yaw, half_x, half_y = others
    own_x, own_y, own_cos, own_sin, own_half_x, own_half_y = own
    cos_between = np.abs(cos_yaw * own_cos + sin_yaw * own_sin)
    sin_between = np.abs(sin_yaw * own_cos - cos_yaw * own_sin)
    dx, dy = x - own_x, y - own_y
    gap: Floats = np.maximum.reduce(
        (
            np.abs(own_cos * dx + own_sin * dy) - own_half_x - half_x * cos_between - half_y * sin_between,
            np.abs(own_cos * dy - own_sin * dx) - own_half_y - half_x * sin_between - half_y * cos_between,
            np.abs(cos_yaw * dx + sin_yaw * dy)
            - half_x
            - own_half_x * cos_between
            - own_half_y * sin_between,
            np.abs(cos_yaw * dy - sin_yaw * dx)
            - half_y
            - own_half_x * sin_between
            - own_half_y * cos_between,
        )
    )
    from_own = _to_rectangle(*_corners(own), others).min(axis=0, initial=math.inf)
    from_others = _to_rectangle(*_corners(others), own).min(axis=0, initial=math.inf)
    return np.where(gap > 0.0, np.minimum(from_own, from_others), gap)


def _corners(rectangles: Floats) -> tuple[Floats, Floats]:
    """Return the x and y coordinates of the corners of n rectangles, each of shape (4, n)."""
    x, y, cos_yaw, sin_yaw, half_x, half_y = rectangles
    u, v = _CORNER_X * half_x, _CORNER_Y * half_y
    return x + u * cos_yaw - v * sin_yaw, y + u * sin_yaw + v * cos_yaw


_CORNER_X = np.array((1.0, -1.0, -1.0, 1.0)).reshape(4, 1)
_CORNER_Y = np.array((1.0, 1.0, -1.0, -1.0)).reshape(4, 1)
