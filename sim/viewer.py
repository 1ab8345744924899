"""MuJoCo's window with the plant, the lidar's points and the supervisor's mode, on a machine with a display.

The window runs on a separate thread without Python. The physics only pass it a copy of the state for each frame, which
takes 0.3 ms. Setting its text blocks until the window is drawn, so this happens on another thread.
"""

import importlib
import logging
import os
import queue
import re
import threading
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from sim import mj
from sim.overlay import Overlay, Shown
from sim.plant import Plant

_log = logging.getLogger(__name__)

# Camera above and behind the robot, inside the hall even at the start; it looks down the aisle and follows the robot.
VIEW_DISTANCE_M = 3.2
VIEW_AZIMUTH_DEG = 0.0
VIEW_ELEVATION_DEG = -65.0

OPEN_LIMIT_S = 20.0
"""Time limit for opening the window; a display over a network may be slow."""


class NoDisplayError(Exception):
    """A window was requested and cannot be opened."""


def has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(plant: Plant) -> Callable[[Shown], None]:
    """Open the window and return a function that draws one frame; after the window is closed, it does nothing.

    Raises:
        NoDisplayError: There is no display, or MuJoCo cannot use it.
    """
    if not has_display():
        raise NoDisplayError("there is no display for a window")
    handle = _launch(plant)
    camera = handle.cam
    camera.type = int(mj.mujoco.mjtCamera.mjCAMERA_TRACKING)
    camera.trackbodyid = mj.id_of(plant.model, "body", "robot")
    camera.distance, camera.azimuth, camera.elevation = VIEW_DISTANCE_M, VIEW_AZIMUTH_DEG, VIEW_ELEVATION_DEG
    return _Window(handle, plant).draw


class _Window:
    def __init__(self, handle: Any, plant: Plant) -> None:  # noqa: ANN401 - untyped there
        self._handle, self._plant = handle, plant
        self._overlay = Overlay(handle.user_scn, plant.outline, plant.lidars)
        self._words = _Words(handle)
        self._is_open = True

    def draw(self, shown: Shown) -> None:
        if not self._is_open:
            return
        if not self._handle.is_running():
            self._is_open = False
            _log.info("the window was closed; the simulation goes on without it")
            return
        self._overlay.update(*self._plant.true_pose, shown)
        self._words.say(words(shown))
        self._handle.sync()


class _Words:
    """Passes the newest text to the window on a thread, and drops older ones."""

    def __init__(self, handle: Any) -> None:  # noqa: ANN401 - untyped there
        self._handle = handle
        self._newest = ("", "")
        self._changed = threading.Event()
        threading.Thread(target=self._hand_over, name="window's words", daemon=True).start()

    def say(self, columns: tuple[str, str]) -> None:
        if columns != self._newest:
            self._newest = columns
            self._changed.set()

    def _hand_over(self) -> None:
        font, corner = mj.mujoco.mjtFontScale.mjFONTSCALE_150, mj.mujoco.mjtGridPos.mjGRID_TOPLEFT
        while self._handle.is_running():
            self._changed.wait()
            self._changed.clear()
            self._handle.set_texts((font, corner, *self._newest))


def words(shown: Shown) -> tuple[str, str]:
    """Return the text in the window's corner, as two columns."""
    rows = [("mode", shown.mode.value), ("speed", shown.speed), ("nearest", shown.nearest)]
    if shown.why:
        rows.insert(1, ("why", shown.why))
    left, right = zip(*rows, strict=True)
    return "\n".join(left), "\n".join(right)


def _launch(plant: Plant) -> Any:  # noqa: ANN401 - untyped there
    """Open a window and return MuJoCo's handle.

    MuJoCo ends the process if it cannot open a window, so a small hidden window is tried first. If MuJoCo's threads fail
    later, the wait for them would never end, so their failures are caught.
    """
    answers: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def launch() -> None:
        viewer: Any = importlib.import_module("mujoco.viewer")
        answers.put(viewer.launch_passive(plant.model, plant.data, show_left_ui=False, show_right_ui=False))

    with _failures_of_threads_to(answers), warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        if not _can_open_a_window():
            why = "; ".join(_plain(str(warning.message)) for warning in told) or "unknown reason"
            raise NoDisplayError(f"no window can be opened here ({why})")
        threading.Thread(target=launch, daemon=True).start()
        try:
            answer = answers.get(timeout=OPEN_LIMIT_S)
        except queue.Empty:
            answer = TimeoutError(f"no answer in {OPEN_LIMIT_S:g} s")
    if isinstance(answer, BaseException):
        raise NoDisplayError(
            f"MuJoCo cannot open a window here ({mj.one_line(Exception(answer))})"
        ) from answer
    return answer


def _plain(warning: str) -> str:
    """Return the readable part of a glfw warning such as `(65550) b'X11: Failed to open display'`."""
    return re.sub(r"^\(\d+\) b?(['\"])(.*)\1$", r"\2", warning)


def _can_open_a_window() -> bool:
    """Try to open a hidden window; the causes of a failure are raised as warnings."""
    glfw: Any = importlib.import_module("glfw")
    if not glfw.init():
        return False
    glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
    window = glfw.create_window(64, 64, "", None, None)
    glfw.default_window_hints()
    if not window:
        return False
    glfw.destroy_window(window)
    return True


@contextmanager
def _failures_of_threads_to(answers: "queue.SimpleQueue[Any]") -> Generator[None]:
    before = threading.excepthook
    threading.excepthook = lambda failure: answers.put(failure.exc_value)
    try:
        yield
    finally:
        threading.excepthook = before
