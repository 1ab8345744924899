"""Render pictures of the world without a display: `python -m sim.render --out docs/images/warehouse.png`."""

import argparse
import math
import sys
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim import mj
from sim.build import Build, SceneError
from sim.gl import NoGlError, choose, open_context
from sim.overlay import Overlay, geoms_needed
from sim.plant import Plant
from sim.shown import Mode, Shown
from sim.video import OutputError, refuse_bad_output, write
from sim.views import View, camera, fit

Pixels = NDArray[np.uint8]
"""RGB, shape (height, width, 3)."""

# Camera, the robot's drive to its place (v in m/s, ω in rad/s, duration in s), and time of the picture, which shows the
# forklift and the people.
_VIEW = View((-2.05, -0.62, 0.52), 4.3, 30.0, -25.5)
_DRIVE_OUT = ((0.0, 0.0, 2.2), (0.8, 0.0, 1.5), (0.8, 0.3, 1.1))

_MAX_GEOMS = 10_000


class Studio:
    """Renders pictures of one plant.

    Args:
        plant: The plant, built with `scenery`.
        width: Width of the pictures in pixels.
        height: Height of the pictures in pixels.
        samples: Samples per pixel for anti-aliasing, 1 to 8; rendering on the CPU takes proportionally longer.

    Raises:
        NoGlError: This machine cannot render without a display.
    """

    def __init__(self, plant: Plant, width: int, height: int, samples: int = 8) -> None:
        self._plant, self._width, self._height = plant, width, height
        fit(plant)
        vis = plant.model.vis
        vis.global_.offwidth, vis.global_.offheight = width, height
        vis.quality.offsamples = samples
        vis.quality.shadowsize = 1024 * samples
        self._gl: Any = open_context(width, height)
        mujoco = mj.mujoco
        self._context = mujoco.MjrContext(plant.model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(plant.model, maxgeom=_MAX_GEOMS + geoms_needed(plant.lidars))
        self._option, self._pert = mujoco.MjvOption(), mujoco.MjvPerturb()
        self._rect = mujoco.MjrRect(0, 0, width, height)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def picture(self, view: View | str, shown: Shown | None = None) -> Pixels:
        """Return a picture of the present world, with the overlay around the robot if `shown` is given."""
        mujoco, plant = mj.mujoco, self._plant
        mj.forward(plant.model, plant.data)
        seen_from = mj.fixed_camera(plant.model, view) if isinstance(view, str) else camera(plant, view)
        mujoco.mjv_updateScene(
            plant.model,
            plant.data,
            self._option,
            self._pert,
            seen_from,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        if shown is not None:
            Overlay(self._scene, plant.outline, plant.lidars).update(*plant.true_pose, shown)
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._scene, self._context)
        pixels = np.empty((self._height, self._width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._context)
        return np.ascontiguousarray(pixels[::-1])


def main(arguments: list[str] | None = None) -> int:
    """Write the picture of the README; return 1 if this machine cannot render, 2 for wrong arguments."""
    parser = argparse.ArgumentParser(prog="python -m sim.render", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the PNG file to write")
    parser.add_argument("--width", type=int, default=1280, help="in pixels, default 1280")
    parser.add_argument("--height", type=int, default=720, help="in pixels, default 720")
    options = parser.parse_args(arguments)
    try:
        choose()
        refuse_bad_output(options.out, options.width, options.height, frames=1)
        write(options.out, [_warehouse(options.width, options.height)], fps=1.0)
    except (OutputError, SceneError) as error:
        print(f"The picture cannot be written: {error}", file=sys.stderr)
        return 2
    except NoGlError as error:
        print(f"The warehouse cannot be drawn here: {error}.", file=sys.stderr)
        return 1
    return 0


def _warehouse(width: int, height: int) -> Pixels:
    """Return a picture of the warehouse with the robot in its aisle."""
    plant = Plant(options=Build(moving=True, scenery=True))
    for linear_m_s, angular_rad_s, duration_s in _DRIVE_OUT:
        plant.step((linear_m_s, angular_rad_s), round(duration_s / plant.timestep_s))
    with Studio(plant, width, height) as studio:
        shown = Shown(Mode.DRIVING, (), plant.true_velocity.linear_m_s, math.nan, (plant.scan(),))
        return studio.picture(_VIEW, shown)


if __name__ == "__main__":
    sys.exit(main())
