"""Makes the commands in a message run in the reader's shell: `lifeline` by its path unless the PATH leads to it."""

import shlex
import shutil
import sys
from pathlib import Path

from wire.host.state_directory import checkout


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
