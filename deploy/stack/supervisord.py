"""Fetches supervisord into a separate uv environment, starts it, and queries it over its unix socket.

It must never be installed in the same environment as Lifeline: both have an import package `supervisor`.
"""

import http.client
import os
import re
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
from xml.parsers.expat import ExpatError

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir, indented
from wire.host.installation import checkout
from wire.text import printable

REQUIREMENT = "supervisor==4.3.0"
CONFIGURATION = Path(__file__).resolve().parents[1] / "supervisord.conf"
PLUGIN = CONFIGURATION.with_name("supervisord_plugin")
"""The only directory of Lifeline from which supervisord imports."""
BEGIN_OF_LOG = "supervisord started with pid"
HUNG = re.compile(r"^(\S+ \S+),\d+ \w+ exited: (\w+) \(terminated by SIGALRM", re.MULTILINE)
"""The line of supervisord's log for a program that the kernel ended because it hung (wire/host/notify.py): when, and which."""
TOO_LOW = re.compile(
    r"The minimum number of (?:available )?(processes|file descriptors) required .*? is (\d+)"
)
OPTIONS = {"processes": "-u", "file descriptors": "-n"}
"""Options of `ulimit` by the name of the limit in `TOO_LOW`."""
START_LIMIT_S = 20.0
FETCH_LIMIT_S = 180.0
ANSWER_LIMIT_S = 3.0
STARTED = {"STARTING", "RUNNING"}
"""The states of a program that runs or is starting."""
DO_NOT_WAIT = False
"""The argument `wait` of supervisord's calls."""


@dataclass(frozen=True, slots=True)
class Program:
    """The state of a program, as supervisord reports it."""

    name: str
    state: str
    """supervisord's name of the state: STARTING, RUNNING, BACKOFF, STOPPED, EXITED, FATAL, …"""
    pid: int
    start: int
    """Time of the last start [s since 1970]."""


def find_uv() -> str:
    """Find uv by the environment variable UV, on the PATH, or where `make setup` puts it.

    Raises:
        DeployError: uv is missing.
    """
    root = checkout()
    candidates = (os.environ.get("UV"), "uv", str(root / ".uv" / "bin" / "uv") if root else None)
    for candidate in candidates:
        found = shutil.which(candidate) if candidate else None
        if found is not None:
            return str(Path(found).absolute())
    fetch = "run `make setup` to fetch it" if root else "install the package uv"
    raise DeployError(f"uv, which runs supervisord, is missing: {fetch}, or give its path in UV")


def fetch(uv: str, say: Callable[[str], None]) -> bool:
    """Create supervisord's environment, unless uv has it already; then no network access is needed.

    Returns:
        True if it was created now, False if uv had it already.

    Raises:
        DeployError: supervisord cannot be fetched.
    """
    if _run(_command(uv, "--version"), limit_s=START_LIMIT_S).returncode == 0:
        return False
    say(f"fetching {REQUIREMENT} (once)")
    done = _run(_command(uv, "--version", offline=False), limit_s=FETCH_LIMIT_S)
    if done.returncode != 0:
        raise DeployError(
            f"uv could not fetch {REQUIREMENT}; this needs access to the package index once:\n{indented(done.stderr)}"
        )
    return True


def start(uv: str, state: StateDir, launch: Launch, say: Callable[[str], None]) -> None:
    """Start supervisord as a daemon; its socket exists on return, and it starts the programs immediately.

    Raises:
        DeployError: it cannot be fetched, cannot use the name of a file, or did not start.
    """
    command = _command(uv, "--configuration", str(CONFIGURATION))
    environment = launch.environment(state) | {"PYTHONPATH": str(PLUGIN)}
    for value in environment.values():
        if min(value, default=" ") < " " or "%" in value or (value == str(launch.config) and '"' in value):
            raise DeployError(
                f"supervisord cannot use {printable(value)}: it has %, a quotation mark, or a control character; "
                "choose another directory or file"
            )
    done = _run(command, limit_s=START_LIMIT_S, cwd=state.path, environment=environment)
    if done.returncode != 0 and fetch(uv, say):
        done = _run(command, limit_s=START_LIMIT_S, cwd=state.path, environment=environment)
    if done.returncode != 0:
        too_low = TOO_LOW.search(done.stderr)
        if too_low is not None:
            raise DeployError(
                f"supervisord needs at least {too_low[2]} {too_low[1]}: raise their limit (`ulimit {OPTIONS[too_low[1]]}`)"
            )
        raise DeployError(f"supervisord did not start:\n{indented(done.stderr or done.stdout)}")


def _command(uv: str, *arguments: str, offline: bool = True) -> list[str]:
    network = ["--offline"] if offline else []
    # Use this interpreter, so that uv does not search for another.
    environment = [*network, "--python", sys.executable, "--from", REQUIREMENT]
    return [uv, "tool", "run", *environment, "supervisord", *arguments]


def _run(
    command: list[str],
    *,
    limit_s: float,
    cwd: Path | None = None,
    environment: dict[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    # With this project on the PYTHONPATH, supervisord would import Lifeline's `supervisor` instead of its own.
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
            start_new_session=True,  # a separate group, so that Ctrl-C reaches only this process
        )
    except OSError as error:
        raise DeployError(
            f"cannot run {command[0]} ({error.strerror}): give the path of a working uv in UV"
        ) from error
    try:
        output, errors = child.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired as error:
        raise DeployError(f"uv did not finish within {limit_s:g} s: {' '.join(command)}") from error
    finally:
        if child.poll() is None:  # uv and its children that are not yet daemons
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()
    return subprocess.CompletedProcess(command, child.wait(), output, errors)


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
        self._connection = host, connection  # the base class closes it, even if there is no answer
        return connection


def _ask(state: StateDir, method: str, *arguments: str | bool) -> Any:  # noqa: ANN401 - whatever the method answers
    """Call a method; return None if supervisord does not answer."""
    with xmlrpc.client.ServerProxy("http://localhost/RPC2", transport=_UnixTransport(state.socket)) as server:
        try:
            return getattr(server, method)(*arguments)
        except (OSError, http.client.HTTPException, xmlrpc.client.Error, ExpatError):
            return None


def programs(state: StateDir) -> list[Program] | None:
    """Return the programs that were started, and their states; None if supervisord does not answer."""
    answer = cast("list[dict[str, Any]] | None", _ask(state, "supervisor.getAllProcessInfo"))
    if answer is None:
        return None
    return [Program(p["name"], p["statename"], int(p["pid"]), int(p["start"])) for p in answer if p["start"]]


def hangs(state: StateDir) -> list[tuple[str, str]]:
    """Return when a program hung and was ended since supervisord started, and which one; empty if there is no log."""
    return HUNG.findall(state.end_of_log("supervisord").rpartition(BEGIN_OF_LOG)[2])


def stop_program(state: StateDir, name: str) -> bool:
    """Ask supervisord to stop a program and not to start it again; return whether it does."""
    return _ask(state, "supervisor.stopProcess", name, DO_NOT_WAIT) is True


def start_program(state: StateDir, name: str) -> bool:
    """Ask supervisord to start a program that is stopped; return whether it runs or is starting.

    supervisord also accepts the start of a program that is still ending, but does not start it: repeat this call until it returns True.
    """
    _ask(state, "supervisor.startProcess", name, DO_NOT_WAIT)
    return any(one.name == name and one.state in STARTED for one in programs(state) or [])


def shutdown(state: StateDir) -> bool:
    """Ask supervisord to stop its programs and exit; return whether it answered."""
    return _ask(state, "supervisor.shutdown") is not None
