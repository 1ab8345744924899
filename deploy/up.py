"""`lifeline up`: the stack, with teleop in this terminal; and `lifeline down`."""

import asyncio
import os
import shlex
import signal
import subprocess
import sys
import termios
import time
from contextlib import suppress

from deploy.estop import latched_sentence
from deploy.stack import bringup, interrupts, processes
from deploy.stack.bringup import Say
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import LockedError, StateDir, UnwritableError, locked
from teleop.terminal import RESTORE
from teleop.terminal_guard import BY_PARENT
from wire import topics

END_LIMIT_S = 20.0
"""How long `down` waits for an `up` to take everything down: its slowest way, and a little."""
TELEOP_LIMIT_S = 4.0
"""Longer than the 3 s in which teleop ends by itself."""


def up(state: StateDir, launch: Launch, say: Say, *, detach: bool) -> int:
    """Start everything and drive; returns teleop's exit code, as a shell would.

    Raises:
        DeployError: something is in the way; nothing that was started here is left running.
    """
    if not detach and not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise DeployError(
            "teleop needs a terminal, and this is none: use --detach to start the robot without teleop, "
            "or `lifeline demo`, which needs no keys"
        )
    state.create()
    keep = False
    with interrupts.interrupts(), locked(state, "up"):
        bringup.check_nothing_runs(state)
        try:
            try:
                bringup.start(state, launch, say)
                asyncio.run(bringup.wait_until_alive(state, launch, say))
                latched = latched_sentence(state, launch)
                if latched is not None:
                    say(latched)
                if detach:
                    drive = shlex.join(launch.command(topics.TELEOP))
                    say(
                        f"running at {launch.bus.endpoint}; look with `lifeline status`, end with `lifeline down`"
                    )
                    say(f"drive with `{drive}`")
                    keep = True
                    return 0
                return _teleop_here(state, launch, say)
            finally:
                interrupts.ignore()
        finally:
            if not keep:
                bringup.stop(state)
                with suppress(OSError):  # the terminal may be gone
                    say("everything is down")


def _teleop_here(state: StateDir, launch: Launch, say: Say) -> int:
    """Run teleop in the foreground, and leave the terminal as it was."""
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    mark = {processes.MARK: str(state.path), BY_PARENT: "1"}
    child = subprocess.Popen(launch.command(topics.TELEOP), env=os.environ | mark)
    try:
        code = child.wait()
        if code < 0:
            print(
                RESTORE if os.environ.get("TERM", "dumb") != "dumb" else ""
            )  # it was in the middle of its picture
            say(f"teleop was ended by {signal.Signals(-code).name}")
        return code if code >= 0 else 128 - code
    finally:
        try:
            child.terminate()
            child.wait(TELEOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        # Should a shell have the terminal back already, this must not stop us.
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)
        with suppress(termios.error):
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)


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
            stopped = bringup.stop(state)
    except UnwritableError:  # what runs must end, also where the disk is full
        stopped = bringup.stop(state)
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
