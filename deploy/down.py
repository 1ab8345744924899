"""`lifeline down`: stop everything that belongs to a state directory. It works without the simulation too."""

import os
import signal
import time
from contextlib import suppress

from deploy.stack import processes, takedown
from deploy.stack.statedir import LockedError, StateDir, UnwritableError, locked
from deploy.stack.takedown import Say

END_LIMIT_S = 20.0
"""How long `down` waits for an `up` to take everything down: its slowest way, and a little."""


def down(state: StateDir, say: Say) -> None:
    """Stop everything of a state directory; nothing there is fine as well.

    Raises:
        DeployError: something does not end.
    """
    if not state.path.is_dir():
        say("nothing is running")
        return
    asked = False
    try:
        asked = _end_the_command_at_work(state)
        with locked(state, "down"):
            stopped = takedown.stop(state)
    except UnwritableError:  # what runs must end, also where the disk is full
        stopped = takedown.stop(state)
    if stopped.orphaned:
        say(f"supervisord had been killed; stopped what it left: {', '.join(stopped.names)}")
    elif stopped.names or asked:
        say("everything is down")
    else:
        say("nothing is running")


def _end_the_command_at_work(state: StateDir) -> bool:
    """Ask an `up` or a demo in another terminal to end, and wait for it; whether there was one."""
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
