"""supervisord itself: in an environment of its own, which uv makes once, and asked over its unix socket.

It must never be installed beside us: its import name is `supervisor`, and so is ours.
"""

import http.client
import os
import shutil
import signal
import socket
import subprocess
import sys
import xmlrpc.client
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from wire.state_directory import checkout

REQUIREMENT = "supervisor==4.3.0"
CONFIGURATION = Path(__file__).resolve().parents[1] / "supervisord.conf"
START_LIMIT_S = 20.0
FETCH_LIMIT_S = 180.0
ANSWER_LIMIT_S = 3.0


@dataclass(frozen=True, slots=True)
class Program:
    """A program as supervisord sees it."""

    name: str
    state: str
    """supervisord's own word: STARTING, RUNNING, BACKOFF, STOPPED, EXITED, FATAL, …"""
    pid: int
    start: int
    """When it was last started [s since 1970]."""


def find_uv() -> str:
    """The uv of the environment variable UV, of the PATH, or the one that `make setup` fetched.

    Raises:
        DeployError: there is none.
    """
    root = checkout()
    candidates = (os.environ.get("UV"), "uv", str(root / ".uv" / "bin" / "uv") if root else None)
    for candidate in candidates:
        found = shutil.which(candidate) if candidate else None
        if found is not None:
            return str(Path(found).absolute())
    raise DeployError("uv is missing, which runs supervisord: `make setup` fetches it, or name it in UV")


def fetch(uv: str, say: Callable[[str], None]) -> None:
    """Make supervisord's environment, unless uv has it already: then no network is asked.

    Raises:
        DeployError: it is not there and cannot be fetched.
    """
    if _run(_command(uv, "--version"), limit_s=START_LIMIT_S).returncode == 0:
        return
    say(f"fetching {REQUIREMENT} (once)")
    done = _run(_command(uv, "--version", offline=False), limit_s=FETCH_LIMIT_S)
    if done.returncode != 0:
        raise DeployError(
            f"uv could not fetch {REQUIREMENT}; it needs the package index once:\n{_indented(done.stderr)}"
        )


def start(uv: str, state: StateDir, launch: Launch) -> None:
    """Start supervisord as a daemon; it has its socket when this returns.

    Raises:
        DeployError: it did not start.
    """
    done = _run(
        _command(uv, "--configuration", str(CONFIGURATION)),
        limit_s=START_LIMIT_S,
        cwd=state.path,
        environment=launch.environment(state),
    )
    if done.returncode != 0:
        raise DeployError(f"supervisord did not start:\n{_indented(done.stderr or done.stdout)}")


def _command(uv: str, *arguments: str, offline: bool = True) -> list[str]:
    network = ["--offline"] if offline else []
    # On our own interpreter, so that no other one is looked for.
    environment = [*network, "--python", sys.executable, "--from", REQUIREMENT]
    return [uv, "tool", "run", *environment, "supervisord", *arguments]


def _run(
    command: list[str],
    *,
    limit_s: float,
    cwd: Path | None = None,
    environment: dict[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    # A PYTHONPATH that holds this project would make supervisord import our `supervisor` for its own.
    inherited = {k: v for k, v in os.environ.items() if k not in {"PYTHONPATH", "PYTHONHOME"}}
    try:
        child = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=cwd,
            env=inherited | (environment or {}),
            start_new_session=True,  # a group of its own: Ctrl-C is ours to handle
        )
    except OSError as error:
        raise DeployError(f"cannot run {command[0]} ({error.strerror}): name a working uv in UV") from error
    try:
        output, errors = child.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired as error:
        raise DeployError(f"uv did not come to an end within {limit_s:g} s: {' '.join(command)}") from error
    finally:
        if child.poll() is None:  # uv and what it started, before that has become a daemon
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()
    return subprocess.CompletedProcess(command, child.wait(), output, errors)


def _indented(text: str) -> str:
    return "\n".join(f"    {line}" for line in text.strip().splitlines()[-8:])


class _UnixConnection(http.client.HTTPConnection):
    def __init__(self, path: Path) -> None:
        super().__init__("localhost", timeout=ANSWER_LIMIT_S)
        self._path = path

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(ANSWER_LIMIT_S)
        self.sock.connect(str(self._path))


class _UnixTransport(xmlrpc.client.Transport):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def make_connection(self, host: Any) -> http.client.HTTPConnection:  # noqa: ANN401 - the base class's signature
        connection = _UnixConnection(self._path)
        self._connection = host, connection  # the base class closes it, also where nobody answers
        return connection


def _ask(state: StateDir, method: str) -> Any:  # noqa: ANN401 - whatever the method answers
    """Call a method; None where no supervisord answers."""
    with xmlrpc.client.ServerProxy("http://localhost/RPC2", transport=_UnixTransport(state.socket)) as server:
        try:
            return getattr(server, method)()
        except (OSError, http.client.HTTPException, xmlrpc.client.Error):
            return None


def programs(state: StateDir) -> list[Program] | None:
    """The programs and their states; None where no supervisord answers."""
    answer = cast("list[dict[str, Any]] | None", _ask(state, "supervisor.getAllProcessInfo"))
    if answer is None:
        return None
    return [Program(p["name"], p["statename"], int(p["pid"]), int(p["start"])) for p in answer]


def shutdown(state: StateDir) -> bool:
    """Ask supervisord to stop its programs and end; whether it heard."""
    return _ask(state, "supervisor.shutdown") is not None
