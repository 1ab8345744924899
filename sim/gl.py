"""GL context for rendering without a display: EGL if it works, else OSMesa; MUJOCO_GL (egl, osmesa, glfw) overrides."""

import ctypes
import ctypes.util
import importlib
import os
import sys
from collections.abc import Mapping
from typing import Any

WHAT_TO_DO = "install what is needed: apt install libegl1 libegl-mesa0"


class NoGlError(Exception):
    """This machine cannot render without a display; the message says why, and what to do."""


def choose(environment: Mapping[str, str] = os.environ) -> str:
    """Return MuJoCo's GL backend: `egl`, `osmesa` or `glfw`; empty where MuJoCo uses the system's own.

    Raises:
        NoGlError: There is no backend, or not the one in MUJOCO_GL.
    """
    if sys.platform != "linux":
        return ""
    asked = environment.get("MUJOCO_GL", "").strip().lower()
    if asked in ("glfw", "glx"):
        return "glfw"
    found = {"egl": _has_egl_device(), "osmesa": ctypes.util.find_library("OSMesa") is not None}
    if asked in found:
        if not found[asked]:
            raise NoGlError(
                f"MUJOCO_GL asks for {asked}, which does not work here; unset it, or {WHAT_TO_DO}"
            )
        return asked
    for name, works in found.items():
        if works:
            return name
    raise NoGlError(f"there is neither EGL nor OSMesa to draw with; {WHAT_TO_DO}")


def open_context(width: int, height: int) -> Any:  # noqa: ANN401 - MuJoCo has no types
    """Create a GL context of this size in pixels and make it current.

    Raises:
        NoGlError: No context can be created.
    """
    name = choose()
    try:
        module = f"mujoco.{name}" if name else "mujoco.rendering.classic.gl_context"
        context = importlib.import_module(module).GLContext(width, height)
        context.make_current()
    except Exception as error:  # each loader raises another type of exception
        raise NoGlError(f"{name or 'OpenGL'} does not work here ({error}); {WHAT_TO_DO}") from error
    return context


def _has_egl_device() -> bool:
    """Return whether EGL finds a device to render with, possibly the CPU; the library alone is not enough."""
    name = ctypes.util.find_library("EGL")
    if name is None:
        return False
    try:
        lookup = ctypes.CDLL(name).eglGetProcAddress
        lookup.restype, lookup.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        address = lookup(b"eglQueryDevicesEXT")
    except (OSError, AttributeError):
        return False
    if not address:
        return False
    count = ctypes.c_int(0)
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int))
    return bool(query(address)(0, None, ctypes.byref(count))) and count.value > 0
