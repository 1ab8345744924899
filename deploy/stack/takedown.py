"""End whatever runs of a state directory, under its lock."""

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
"""Two programs one after the other, each with the stopwaitsecs of supervisord.conf, and a little."""
TERM_LIMIT_S = 4.0
"""Longer than the 3 s in which each of our processes ends by itself."""
KILL_LIMIT_S = 2.0

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Stopped:
    """What a stop found."""

    names: tuple[str, ...]
    """Of the processes that ran."""
    orphaned: bool
    """There was no supervisord any more over them."""


def stop(state: StateDir) -> Stopped:
    """Stop everything that belongs to the state directory, and forget it; nothing there is fine as well.

    When this returns, no process of it is left, and no memory keeper of one that was killed before.

    Raises:
        DeployError: something survives even SIGKILL.
    """
    found = processes.of(state.path)
    supervised = any(p.name == "supervisord" for p in found)
    left = found
    if left and supervisord.shutdown(state):
        left = processes.wait_for_none(state.path, SHUTDOWN_LIMIT_S)
    # supervisord first, or it starts again what is stopped behind its back.
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
            f"cannot stop {listed(left)}: they may wait for the kernel; try `lifeline down` again"
        )
    with suppress(UnwritableError):
        state.forget()
    return Stopped(tuple(sorted(p.name for p in found)), orphaned=bool(found) and not supervised)


def _named(found: list[Process], name: str | None) -> list[Process]:
    return [p for p in found if name in {None, p.name}]


def listed(found: list[Process]) -> str:
    """Their names and pids, for a sentence."""
    return ", ".join(f"{p.name} (pid {p.pid})" for p in sorted(found, key=lambda p: p.name))
