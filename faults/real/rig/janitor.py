"""Clean up the stage of a killed campaign: `python -m faults.real.rig.janitor DIRECTORY NUMBER`.

It waits for the end of its stdin, which the kernel closes when the campaign ends in any way, and does nothing if
the campaign has cleaned up itself.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from deploy.stack import processes, takedown
from deploy.stack.errors import DeployError
from deploy.stack.statedir import StateDir
from faults.real.rig import cable

STATE = "state"


def sweep(directory: Path, number: int) -> None:
    """End every process of a stage, and remove its mount, its namespace and its directory.

    Args:
        directory: the stage's directory.
        number: the number of its namespace.
    """
    state = StateDir(directory / STATE)
    for process in processes.of(state.path):
        processes.send(process, state.path, signal.SIGCONT)
    with suppress(DeployError):
        takedown.stop(state)
    cable.remove(number)
    if state.path.is_mount():
        # Lazily, because an open log would keep the mount.
        subprocess.run(["umount", "-l", str(state.path)], capture_output=True, check=False)  # noqa: S607 - the system's
    shutil.rmtree(directory, ignore_errors=True)


def hire(module: str, directory: Path) -> "subprocess.Popen[bytes]":
    """Start the janitor `module` for a directory; it cleans up even if this process is killed. `communicate()` dismisses it."""
    return subprocess.Popen(
        [sys.executable, "-m", module, str(directory), str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def sweep_at_the_end(sweep: Callable[[Path, int], None]) -> None:
    """Wait for the end of stdin, then sweep the directory and the namespace that the arguments name, if the directory is still there."""
    directory, number = Path(sys.argv[1]), int(sys.argv[2])
    sys.stdin.buffer.read()
    if directory.exists():
        sweep(directory, number)


if __name__ == "__main__":
    sweep_at_the_end(sweep)
