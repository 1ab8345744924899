"""A rectangular room with one pillar, and the ranges that a lidar in it measures."""

import numpy as np
import numpy.typing as npt

# The walls are within the range of the lidar from everywhere: a direction without any return is soon unseen space.
HALF_LENGTH_M, HALF_WIDTH_M = 5.5, 4.0
PILLAR_M = (4.0, 2.0)
PILLAR_RADIUS_M = 0.2
BEAMS = 360

Floats = npt.NDArray[np.float64]


def ranges_m(x_m: float, y_m: float, yaw_rad: float) -> Floats:
    """Return the (360,) distances from a place in the room, counter-clockwise from straight behind."""
    angles = yaw_rad - np.pi + np.arange(BEAMS) * (2 * np.pi / BEAMS)
    along, across = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        walls = np.minimum(
            (np.copysign(HALF_LENGTH_M, along) - x_m) / along,
            (np.copysign(HALF_WIDTH_M, across) - y_m) / across,
        )
    to_x, to_y = PILLAR_M[0] - x_m, PILLAR_M[1] - y_m
    ahead = to_x * along + to_y * across
    past = to_x * across - to_y * along
    depth_squared = PILLAR_RADIUS_M**2 - past**2
    hit = (depth_squared >= 0) & (ahead > 0)
    pillar = np.where(hit, ahead - np.sqrt(np.maximum(depth_squared, 0.0)), np.inf)
    return np.minimum(walls, pillar)
