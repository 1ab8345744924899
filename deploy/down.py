"""`lifeline down`: stop all processes of a state directory. It does not need the extra `sim`."""

import os
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from deploy.stack import processes, takedown
from deploy.stack.statedir import LockedError, StateDir, UnwritableError, locked
from deploy.stack.takedown import Say

END_LIMIT_S = 20.0
"""How long `down` waits for `up` to stop everything: more than its slowest shutdown."""


def down(state: StateDir, say: Say) -> dict[str, Any]:
    """Stop all processes of a state directory, and return what was stopped; having none is not an error.

    Raises:
        DeployError: a process does not end.
    """
    if not state.path.is_dir():
        say("nothing is running")
        return _document(was_running=False)
    asked = False
    try:
        asked = _end_the_command_at_work(state)
        with locked(state, "down"):
            stopped = takedown.stop(state)
    except UnwritableError:  # stop the processes even if the disk is full
        stopped = takedown.stop(state)
    if stopped.orphaned:
        say(f"supervisord had been killed; stopped its remaining processes: {', '.join(stopped.names)}")
    elif stopped.names or asked:
        say("everything is stopped")
    else:
        say("nothing is running")
    return _document(
        was_running=asked or bool(stopped.names),
        stopped=stopped.names,
        supervisord_was_killed=stopped.orphaned,
    )


def _document(
    *, was_running: bool, stopped: Sequence[str] = (), supervisord_was_killed: bool = False
) -> dict[str, Any]:
    return {
        "was_running": was_running,
        "stopped": list(stopped),
        "supervisord_was_killed": supervisord_was_killed,
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
            holder = error.holder
            if not asked and holder is not None and holder.command != "down":
                asked = True
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(holder.pid, signal.SIGTERM)
        time.sleep(processes.POLL_S)
