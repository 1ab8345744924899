"""A teleop behind tmux, screen or mosh, which answer the terminal's status requests whether or not a person sees the screen."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.system.operators import LIMIT_S, ROOT, Operator

Started = tuple[Operator, Callable[[], object]]
"""The client in its terminal, and what ends the server with teleop."""


def _environment(**more: str) -> dict[str, str]:
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("TMUX", "STY"))}
    return {**inherited, "LC_ALL": "C.UTF-8", **more}


def _run(*words: str, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words, capture_output=True, text=True, check=False, timeout=LIMIT_S, env=environment, cwd=ROOT
    )


def _start_tmux(directory: Path, command: tuple[str, ...]) -> Started:
    tmux, environment = ("tmux", "-S", f"{directory}/socket", "-f", "/dev/null"), _environment()
    client = Operator(
        *tmux, "new-session", "-x", "100", "-y", "30", shlex.join(command), environment=environment
    )
    return client, lambda: _run(*tmux, "kill-server", environment=environment)


def _start_screen(directory: Path, command: tuple[str, ...]) -> Started:
    environment = _environment(SCREENDIR=str(directory))
    client = Operator("screen", "-c", "/dev/null", "-S", "teleop", *command, environment=environment)
    return client, lambda: _run("screen", "-S", "teleop", "-X", "quit", environment=environment)


def _start_mosh(_: Path, command: tuple[str, ...]) -> Started:
    there = ("env", f"--chdir={ROOT}", *command)  # mosh-server changes to the home directory
    server = ("mosh-server", "new", "-i", "127.0.0.1", "--", *there)
    said = _run(*server, environment=_environment(TERM="xterm-256color"))
    port, key = re.findall(r"MOSH CONNECT (\d+) (\S+)", said.stdout)[0]
    pid = int(re.findall(r"pid = (\d+)", said.stderr)[0])
    environment = _environment(MOSH_KEY=key, MOSH_PREDICTION_DISPLAY="never")
    client = Operator("mosh-client", "127.0.0.1", port, environment=environment)
    return client, lambda: os.kill(pid, signal.SIGKILL)


_STARTS = {"tmux": _start_tmux, "screen": _start_screen, "mosh": _start_mosh}


def needs(program: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"needs {program}")


@contextmanager
def behind(program: str, *command: str) -> Generator[Operator]:
    """Run a command behind `program`; yield the client's terminal."""
    with tempfile.TemporaryDirectory(prefix="lifeline-behind-") as directory:
        client, end = _STARTS[program](Path(directory), command)
        try:
            yield client
        finally:
            end()
            client.close()
