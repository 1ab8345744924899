"""The extras of the package `lifeline`: which modules each brings, and how to install a missing one."""

import sys
from importlib.util import find_spec
from pathlib import Path

from wire.host.state_directory import checkout

EXTRAS = {
    "gamepad": ("evdev",),
    "metrics": ("prometheus_client",),
    "sim": ("mujoco", "PIL"),
    "station": ("segno", "starlette", "uvicorn", "websockets"),
    "video": ("av",),
    "view": ("rerun",),
}


def missing_extra(error: ImportError) -> str | None:
    """The extra that brings the module that an import did not find; None if no extra brings it."""
    name = (error.name or "").partition(".")[0]
    return next((extra for extra, modules in EXTRAS.items() if name in modules), None)


def require(extra: str) -> None:
    """Check that an extra is installed, without importing it.

    Raises:
        ModuleNotFoundError: one of its modules is missing.
    """
    for name in EXTRAS[extra]:
        if find_spec(name) is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def how_to_install(extra: str) -> str:
    """How to add an extra to those that are installed: `uv tool install` replaces what it installed before."""
    root = checkout()
    if root is not None and Path(sys.prefix).is_relative_to(root):
        return f"install lifeline[{extra}], with `make setup`"
    kept = (known for known, modules in EXTRAS.items() if all(find_spec(name) for name in modules))
    extras = ",".join(sorted({extra, *kept}))
    return f"install lifeline[{extra}], with `uv tool install '.[{extras}]'` in a checkout of Lifeline"
