"""Runs a supervisor, or the whole simulated robot, while a context is open."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.rig.program import running
from deploy.stack.errors import ignore, interrupts
from deploy.stack.launch import free_loopback_endpoint
from deploy.stack.statedir import StateDir

UP_LIMIT_S = 60.0


@dataclass(frozen=True)
class Supervisor:
    """A running supervisor."""

    endpoint: str
    pid: int


@contextmanager
def supervisor(module: str = "supervisor", options: Sequence[str] = ()) -> Generator[Supervisor]:
    """Run a supervisor, or another module in its place, while the context is open.

    Args:
        module: what runs.
        options: of its command line, beside the endpoint.

    Raises:
        RuntimeError: the context body raised one, and the supervisor has ended; the message contains the end of its log.
    """
    endpoint = free_loopback_endpoint()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "supervisor.log"
        command = [sys.executable, "-m", module, "--endpoint", endpoint, *options]
        environment = os.environ | {"LIFELINE_STATE_DIR": folder}
        with (
            log.open("wb") as file,
            running(command, environment, stdout=file, stderr=file) as process,
        ):
            try:
                yield Supervisor(endpoint, process.pid)
            except RuntimeError as error:
                if process.poll() is None:
                    raise
                raise RuntimeError(
                    f"{error}; the {module} has ended, and its log ends with:\n{log.read_text()[-600:]}"
                ) from error


@dataclass(frozen=True)
class SimulatedRobot:
    """A running sim and supervisor."""

    state: StateDir
    endpoint: str
    up_s: float
    """Duration of `lifeline up --detach`, which ends when every node is alive."""


@contextmanager
def simulated_robot() -> Generator[SimulatedRobot]:
    """Start the simulated robot as its users do, without teleop, and take it down at the end; the first signal raises `Interrupted`.

    Raises:
        RuntimeError: it does not start.
    """
    with tempfile.TemporaryDirectory(prefix="lifeline-", ignore_cleanup_errors=True) as folder:
        state, endpoint = StateDir(Path(folder).resolve()), free_loopback_endpoint()
        options = ("--state-dir", folder)
        with interrupts():
            try:
                try:
                    began_s = time.perf_counter()
                    _lifeline("up", "--detach", "--no-viewer", "--endpoint", endpoint, *options)
                    yield SimulatedRobot(state, endpoint, time.perf_counter() - began_s)
                finally:
                    ignore()
            finally:
                _lifeline("down", *options)


def _lifeline(*arguments: str) -> None:
    command = [sys.executable, "-c", "from lifeline.cli.entry import main; main()", *arguments]
    # In a separate process session, so that Ctrl-C does not interrupt the command.
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=UP_LIMIT_S, start_new_session=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"lifeline {arguments[0]} failed: {done.stderr}")
