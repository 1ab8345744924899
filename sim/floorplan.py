"""The warehouse as seen from above: exact distances from a round hull to whatever stands at its height.

Every solid of the models is an upright box, cylinder or sphere, so its outline is a rectangle or a circle and no ray
fan can miss a corner.
"""

import math

import numpy as np

from sim import mj


class FloorPlan:
    """Outlines of the static geoms that the hull can meet, in the world frame.

    Args:
        model: The compiled model.
        data: Its data, with the poses computed.
        geoms: The ids of the geoms to take.

    Raises:
        ValueError: A geom is tilted, or of a shape that has no simple outline.
    """

    def __init__(self, model: mj.Model, data: mj.Data, geoms: list[int]) -> None:
        boxes: list[tuple[float, float, float, float, float, float]] = []
        circles: list[tuple[float, float, float]] = []
        for geom in geoms:
            x_m, y_m = (float(value) for value in data.geom_xpos[geom, :2])
            rotation = data.geom_xmat[geom].reshape(3, 3)
            shape = model.geom_type[geom]
            if shape != mj.Shape.SPHERE and abs(rotation[2, 2]) < 1.0 - 1e-9:
                raise ValueError(f"Geom {geom} is tilted: the floor plan knows upright shapes only.")
            if shape == mj.Shape.BOX:
                cos_yaw, sin_yaw = float(rotation[0, 0]), float(rotation[1, 0])
                half_x_m, half_y_m = (float(value) for value in model.geom_size[geom, :2])
                boxes.append((x_m, y_m, cos_yaw, sin_yaw, half_x_m, half_y_m))
            elif shape in (mj.Shape.CYLINDER, mj.Shape.SPHERE):
                circles.append((x_m, y_m, float(model.geom_size[geom, 0])))
            else:
                raise ValueError(f"Geom {geom} has a shape without a simple outline.")
        self._boxes = np.array(boxes, dtype=np.float64).reshape(-1, 6).T.copy()
        self._circles = np.array(circles, dtype=np.float64).reshape(-1, 3).T.copy()

    def distance_m(self, x_m: float, y_m: float) -> float:
        """The distance from a point to the nearest outline, 0 inside a box and +inf with nothing there."""
        x, y, cos_yaw, sin_yaw, half_x, half_y = self._boxes
        dx, dy = x_m - x, y_m - y
        beyond_x = np.maximum(np.abs(cos_yaw * dx + sin_yaw * dy) - half_x, 0.0)
        beyond_y = np.maximum(np.abs(cos_yaw * dy - sin_yaw * dx) - half_y, 0.0)
        to_boxes = float(np.min(beyond_x * beyond_x + beyond_y * beyond_y, initial=math.inf))
        x, y, radius = self._circles
        to_circles = float(np.min(np.hypot(x_m - x, y_m - y) - radius, initial=math.inf))
        return min(math.sqrt(to_boxes), to_circles)
