"""A picture of the warehouse, without a screen: `python -m sim.render --out docs/images/warehouse.png`."""

import argparse
import math
import os
import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# The distance at which the supervisor stops the robot, drawn on the floor around the hull.
STOP_RING_M = 0.30

# Where the picture is taken from: a look-at point in the world in m, and the eye around it in m and degrees.
_LOOK_AT_M = (-2.1, 0.0, 0.55)
_EYE_DISTANCE_M = 4.0
_EYE_AZIMUTH_DEG = 19.0
_EYE_ELEVATION_DEG = -22.0

# The robot drives out of its bay before the picture is taken: v in m/s, ω in rad/s, how long in s.
_DRIVE_OUT = ((0.8, 0.0, 1.6), (0.8, 0.35, 1.0))

_RGBA_STOP_RING = (0.95, 0.16, 0.12, 0.55)
_RING_SEGMENTS = 72


def render(width: int, height: int) -> NDArray[np.uint8]:
    """The warehouse with the robot in its aisle, shape (height, width, 3), RGB.

    Raises:
        RuntimeError: This machine has no way to draw without a screen.
    """
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")
    try:
        # MuJoCo chooses its GL while it is imported, so not before the line above.
        from sim import mj, plant  # noqa: PLC0415
    except Exception as error:
        raise _no_gl(error) from error

    world = plant.Plant()
    try:
        world.model.vis.global_.offwidth = max(width, int(world.model.vis.global_.offwidth))
        world.model.vis.global_.offheight = max(height, int(world.model.vis.global_.offheight))
        renderer = mj.mujoco.Renderer(world.model, height, width)
    except Exception as error:
        raise _no_gl(error) from error

    with renderer:
        for linear_m_s, angular_rad_s, duration_s in _DRIVE_OUT:
            world.step((linear_m_s, angular_rad_s), round(duration_s / world.timestep_s))
        camera = mj.mujoco.MjvCamera()
        camera.lookat[:] = _LOOK_AT_M
        camera.distance = _EYE_DISTANCE_M
        camera.azimuth, camera.elevation = _EYE_AZIMUTH_DEG, _EYE_ELEVATION_DEG
        renderer.update_scene(world.data, camera)
        x_m, y_m, _ = world.true_pose
        _draw_ring(mj.mujoco, renderer.scene, x_m, y_m, world.hull_radius_m + STOP_RING_M)
        return renderer.render()


def _no_gl(error: Exception) -> RuntimeError:
    """One kind of error for all: each GL loader fails with an exception of its own."""
    return RuntimeError(f"no GL to draw with ({type(error).__name__}: {error})")


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Writes RGB pixels of shape (height, width, 3)."""
    height, width, _ = pixels.shape
    # Filter 1 (the difference to the pixel on the left) makes a third of the size for a rendered picture.
    left = np.zeros_like(pixels)
    left[:, 1:] = pixels[:, :-1]
    rows = np.empty((height, 1 + 3 * width), np.uint8)
    rows[:, 0] = 1
    rows[:, 1:] = (pixels - left).reshape(height, 3 * width)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for name, body in chunks:
            file.write(
                struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
            )


def _draw_ring(mujoco: Any, scene: Any, x_m: float, y_m: float, radius_m: float) -> None:  # noqa: ANN401 - untyped there
    """Adds a ring on the floor to the scene, of straight pieces."""
    half_length_m = radius_m * math.tan(math.pi / _RING_SEGMENTS)
    for segment in range(_RING_SEGMENTS):
        angle_rad = math.tau * segment / _RING_SEGMENTS
        cos_a, sin_a = math.cos(angle_rad), math.sin(angle_rad)
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom],
            mujoco.mjtGeom.mjGEOM_BOX,
            np.array((0.012, half_length_m, 0.001)),
            np.array((x_m + radius_m * cos_a, y_m + radius_m * sin_a, 0.0015)),
            np.array((cos_a, -sin_a, 0.0, sin_a, cos_a, 0.0, 0.0, 0.0, 1.0)),
            np.array(_RGBA_STOP_RING, np.float32),
        )
        scene.geoms[scene.ngeom].emission = 0.6
        scene.ngeom += 1


def main(arguments: list[str] | None = None) -> int:
    """Writes the picture; 1 with one sentence on stderr if this machine cannot draw."""
    parser = argparse.ArgumentParser(prog="python -m sim.render", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the PNG file to write")
    parser.add_argument("--width", type=int, default=1280, help="in pixels, default 1280")
    parser.add_argument("--height", type=int, default=720, help="in pixels, default 720")
    options = parser.parse_args(arguments)
    try:
        pixels = render(options.width, options.height)
    except RuntimeError as error:
        print(f"The warehouse cannot be drawn here: {error}.", file=sys.stderr)
        return 1
    write_png(options.out, pixels)
    return 0


if __name__ == "__main__":
    sys.exit(main())
