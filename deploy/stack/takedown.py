"""Stops all processes of a state directory; the caller holds its lock."""

import signal
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from deploy.stack import processes, supervisord
from deploy.stack.errors import DeployError
from deploy.stack.processes import Process
from deploy.stack.statedir import StateDir, UnwritableError

SHUTDOWN_LIMIT_S = 12.0
"""Longer than the stopwaitsecs in supervisord.conf of two programs in sequence."""
TERM_LIMIT_S = 4.0
"""Longer than each process's own shutdown limit of 3 s."""
KILL_LIMIT_S = 2.0

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Stopped:
    """The processes that a stop ended."""

    names: tuple[str, ...]
    """Names of the processes that were running."""
    orphaned: bool
    """Whether they ran without supervisord."""


def stop(state: StateDir) -> Stopped:
    """Stop all processes of the state directory and remove its records; having none is not an error.

    On return, no process is left, and no memory keeper of a process that was killed earlier.

    Raises:
        DeployError: a process survives SIGKILL.
    """
    found = processes.of(state.path)
    supervised = any(p.name == "supervisord" for p in found)
    left = found
    if left and supervisord.shutdown(state):
        left = processes.wait_for_none(state.path, SHUTDOWN_LIMIT_S)
    # supervisord first, or it restarts the programs.
    for wanted in ("supervisord", None):
        for number, limit_s in ((signal.SIGTERM, TERM_LIMIT_S), (signal.SIGKILL, KILL_LIMIT_S)):
            deadline_s = time.monotonic() + limit_s
            targets = _named(left, wanted)
            for process in targets:
                processes.send(process, state.path, number)
            while _named(left, wanted) and time.monotonic() < deadline_s:
                time.sleep(processes.POLL_S)
                left = processes.of(state.path)
    left = left or processes.end_keepers(state.path, KILL_LIMIT_S)
    if left:
        raise DeployError(
            f"cannot stop {listed(left)}: they may be blocked in the kernel; try `lifeline down` again"
        )
    with suppress(UnwritableError):
        state.forget()
    return Stopped(tuple(sorted(p.name for p in found)), orphaned=bool(found) and not supervised)


def _named(found: list[Process], name: str | None) -> list[Process]:
    return [p for p in found if name in {None, p.name}]


def listed(found: list[Process]) -> str:
    """Format names and pids for a message."""
    return ", ".join(f"{p.name} (pid {p.pid})" for p in sorted(found, key=lambda p: p.name))
