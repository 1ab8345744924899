"""`lifeline up`: the stack, with teleop in this terminal."""

import asyncio
import os
import shlex
import signal
import subprocess
import sys
import termios
from contextlib import suppress

from deploy.estop import latched_sentence
from deploy.stack import bringup, interrupts, processes, takedown
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir, locked
from deploy.stack.takedown import Say
from teleop.terminal import RESTORE
from teleop.terminal_guard import BY_PARENT
from wire import topics

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
                takedown.stop(state)
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
