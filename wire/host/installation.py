"""How Lifeline is installed on this machine: its checkout, its state directory, its extras, and how a shell finds its command."""

import os
import shlex
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

ENVIRONMENT = "LIFELINE_STATE_DIR"
IN_CHECKOUT = ".lifeline"
INSTALLED = "~/.local/state"


def checkout() -> Path | None:
    """Return the repository that Lifeline runs from; None if it is installed elsewhere."""
    root = Path(__file__).resolve().parents[2]
    return root if (root / "pyproject.toml").is_file() else None


def state_directory() -> Path:
    """Return the absolute path of the state directory.

    It is `$LIFELINE_STATE_DIR`, else `.lifeline` in the checkout, else `lifeline` in the user's directory for state
    (`$XDG_STATE_HOME`, by default `~/.local/state`). The working directory has no influence: a supervisor that is
    started in another directory must find the record of a pressed e-stop.

    Raises:
        ConfigError: the path begins with the home of a user that does not exist.
    """
    from wire.host.config import absolute  # noqa: PLC0415 - imports pydantic, which `checkout` does not need

    named = os.environ.get(ENVIRONMENT)
    if named:
        return absolute(Path(named))
    root = checkout()
    if root is not None:
        return root / IN_CHECKOUT
    state_home = Path(os.environ.get("XDG_STATE_HOME", ""))
    # The XDG Base Directory Specification: relative paths are ignored.
    return (state_home if state_home.is_absolute() else absolute(Path(INSTALLED))) / "lifeline"


# --- the extras of the package `lifeline`

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


# --- the commands in messages


def runnable(message: str) -> str:
    """Return a message whose commands in backticks run in the present directory with the present PATH."""
    if "`lifeline " in message:
        message = message.replace("`lifeline ", f"`{_lifeline()} ")
    root = checkout()
    if "`make " in message and root is not None and root != _here():
        message = message.replace("`make ", f"`make -C {shlex.quote(str(root))} ")
    return message


def _lifeline() -> str:
    root = checkout()
    beside = (Path(sys.executable).parent, *(() if root is None else (root / ".venv/bin",)))
    own = next((path for directory in beside if (path := directory / "lifeline").exists()), None)
    on_path = shutil.which("lifeline")
    if own is None or (on_path is not None and own.samefile(on_path)):
        return "lifeline"
    here = _here()
    return shlex.quote(str(own.relative_to(here) if here and own.is_relative_to(here) else own))


def _here() -> Path | None:
    try:
        return Path.cwd()
    except OSError:  # the directory was removed
        return None
