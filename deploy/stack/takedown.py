"""Stops all processes of a state directory, also for `lifeline down`. It does not need the extra `sim`."""

import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from deploy.stack import processes, supervisord
from deploy.stack.errors import DeployError
from deploy.stack.processes import Process
from deploy.stack.statedir import LockedError, StateDir, UnwritableError, locked

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

    The caller holds the lock of the directory. On return, no process is left, and no memory keeper of a process that was
    killed earlier.

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


END_LIMIT_S = 20.0
"""How long `down` waits for `up` to stop everything: more than its slowest shutdown."""


def down(state: StateDir, say: Say) -> dict[str, Any]:
    """Stop all processes of a state directory, and return what was stopped; having none is not an error.

    Raises:
        DeployError: a process does not end.
    """
    if not state.path.is_dir():
        say("nothing is running")
        return {"was_running": False, "stopped": [], "supervisord_was_killed": False}
    asked = False
    try:
        asked = _end_the_command_at_work(state)
        with locked(state, "down"):
            stopped = stop(state)
    except UnwritableError:  # stop the processes even if the disk is full
        stopped = stop(state)
    if stopped.orphaned:
        say(f"supervisord had been killed; stopped its remaining processes: {', '.join(stopped.names)}")
    elif stopped.names or asked:
        say("everything is stopped")
    else:
        say("nothing is running")
    return {
        "was_running": asked or bool(stopped.names),
        "stopped": list(stopped.names),
        "supervisord_was_killed": stopped.orphaned,
    }


def _end_the_command_at_work(state: StateDir) -> bool:
    """Ask `up` or `demo` in another terminal to end, and wait for it; return whether one was running."""
    deadline_s = time.monotonic() + END_LIMIT_S
    asked = False
    while True:
        try:
            with locked(state, "down"):
                return asked
        except LockedError as error:
            if time.monotonic() > deadline_s:
                raise
            if not asked and error.pid is not None and error.command != "down":
                asked = True
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(error.pid, signal.SIGTERM)
        time.sleep(processes.POLL_S)
