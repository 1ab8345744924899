"""Render pictures of the world without a display: cameras that fit any layout, captions, and the pictures."""

import math
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from sim import mj
from sim.gl import open_context
from sim.overlay import COLOURS, Mode, Overlay, Shown, geoms_needed
from sim.plant import Plant
from sim.video import Pixels

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


_PANEL = (18, 24, 32, 205)
_INK, _DIM = (255, 255, 255, 255), (190, 200, 210, 255)
_DARK_INK = (16, 20, 26, 255)
_LIGHT_MODES = (Mode.LIMITED, Mode.DRIVING, Mode.ALONE)


def captioned(pixels: Pixels, shown: Shown) -> Pixels:
    """Return the picture with a panel along its lower edge; in a narrow picture, the least important texts are omitted.

    Args:
        pixels: RGB, shape (height, width, 3); not modified.
        shown: The values to show.
    """
    picture = Image.fromarray(pixels).convert("RGBA")
    layer = Image.new("RGBA", picture.size, (0, 0, 0, 0))
    draw = ImageDraw.Draw(layer)
    unit = max(8, round(0.040 * picture.height))
    font = ImageFont.load_default(unit)
    margin, pad = unit, 0.55 * unit
    top, bottom = picture.height - margin - 2.0 * unit, float(picture.height - margin)
    middle = 0.5 * (top + bottom)

    badge_right = margin + 2 * pad + max(font.getlength(mode) for mode in Mode if mode is not Mode.ALONE)
    badge_right = max(badge_right, margin + 2 * pad + font.getlength(shown.mode))
    texts = [(shown.speed, _INK), (f"nearest {shown.nearest}", _INK), (shown.why, _DIM)]
    places: list[tuple[float, str, tuple[int, ...]]] = []
    x = badge_right + 1.5 * pad
    for number, (text, ink) in enumerate(texts):
        # Fields of fixed width keep the line still while digits change.
        width = max(font.getlength(text), font.getlength(("-0.00 m/s", "nearest 0.00 m", "")[number]))
        if not text or x + width + pad > picture.width - margin:
            break
        places.append((x, text, ink))
        x += width + 1.5 * pad

    draw.rounded_rectangle((margin, top, x - 0.5 * pad, bottom), radius=0.5 * unit, fill=_PANEL)
    colour = tuple(round(255 * part) for part in COLOURS[shown.mode])
    draw.rounded_rectangle((margin, top, badge_right, bottom), radius=0.5 * unit, fill=(*colour, 255))
    badge_ink = _DARK_INK if shown.mode in _LIGHT_MODES else _INK
    draw.text((0.5 * (margin + badge_right), middle), shown.mode, fill=badge_ink, font=font, anchor="mm")
    for x, text, ink in places:
        draw.text((x, middle), text, fill=ink, font=font, anchor="lm")
    return np.asarray(Image.alpha_composite(picture, layer).convert("RGB"))


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
