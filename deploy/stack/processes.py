"""Finds the processes of a state directory by a mark in their environment, not by recorded pids.

Every process of a stack carries its state directory in the environment, and its children inherit it. A child
whose supervisord was killed is therefore found, after any number of restarts. A process that reuses a pid is not
signalled: the mark is read again after a pidfd has been opened.
"""

import itertools
import os
import select
import signal
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from wire.host import memory_keeper

MARK = "LIFELINE_STACK"
POLL_S = 0.02
OURS = {
    **{name: name for name in ("supervisor", "sim", "ros2", "teleop")},
    "lifeline.cli.app": "station",
}
"""The names of our processes, by their modules."""
LISTINGS = 8
"""Listings of all processes in one search: more than the forks by which a daemon leaves its parent behind. On a machine
where other programs start processes all the time, each listing has new ones."""


@dataclass(frozen=True, slots=True)
class Process:
    """A running process of the stack."""

    pid: int
    name: str
    """`supervisord`, one of the names in `OURS`, or the name of memory keepers."""


def of(state_dir: Path) -> list[Process]:
    """Return the running processes of a state directory, without this process and memory keepers."""
    return [process for process in _marked(state_dir) if process.name != memory_keeper.NAME]


def keepers(state_dir: Path) -> list[Process]:
    """Return the memory keepers of a state directory, including those whose process was killed."""
    return [process for process in _marked(state_dir) if process.name == memory_keeper.NAME]


def send(process: Process, state_dir: Path, number: signal.Signals) -> None:
    """Signal a process if its pid has not been reused."""
    with _handle(process, state_dir) as handle, suppress(ProcessLookupError, PermissionError):
        if handle is not None:
            signal.pidfd_send_signal(handle, number)


def wait_for_none(state_dir: Path, limit_s: float) -> list[Process]:
    """Wait until no process of a state directory runs; return those that remain after `limit_s`."""
    deadline_s = time.monotonic() + limit_s
    while (left := of(state_dir)) and time.monotonic() < deadline_s:
        time.sleep(POLL_S)
    return left


def end_keepers(state_dir: Path, limit_s: float) -> list[Process]:
    """End the memory keepers that killed processes left behind, and return those that remain after `limit_s`.

    Call it once the processes themselves are gone: one that still runs replaces its keeper.
    """
    deadline_s = time.monotonic() + limit_s
    while (left := keepers(state_dir)) and time.monotonic() < deadline_s:
        for keeper in left:
            with _handle(keeper, state_dir) as handle, suppress(ProcessLookupError, PermissionError):
                if handle is not None:
                    memory_keeper.expedite(keeper.pid)
                    signal.pidfd_send_signal(handle, signal.SIGKILL)
                    select.select([handle], [], [], max(0.0, deadline_s - time.monotonic()))
    return left


@contextmanager
def _handle(process: Process, state_dir: Path) -> Generator[int | None]:
    """Open a pidfd of a process; yield None if the process is gone or its pid was reused."""
    try:
        handle = os.pidfd_open(process.pid)
    except (ProcessLookupError, PermissionError):
        yield None
        return
    try:
        yield handle if _name(process.pid, state_dir) == process.name else None
    finally:
        os.close(handle)


def _marked(state_dir: Path) -> list[Process]:
    """Return the processes with the mark of a state directory.

    A process that ends before it is read may leave a child that is not in the listing, such as a supervisord
    that becomes a daemon. The new processes are therefore read until there are none, in at most `LISTINGS`.
    """
    found: list[Process] = []
    seen = {os.getpid()}
    for _ in range(LISTINGS):
        new = {int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal()} - seen
        if not new:
            break
        seen |= new
        found += [Process(pid, name) for pid in sorted(new) if (name := _name(pid, state_dir)) is not None]
    return found


def _name(pid: int, state_dir: Path) -> str | None:
    """Return the name of a process; None if it is gone, a zombie, or not of this state directory."""
    try:
        environment = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        arguments = [os.fsdecode(a) for a in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")]
    except OSError:
        return None
    if os.fsencode(f"{MARK}={state_dir}") not in environment:
        return None
    if memory_keeper.is_keeper(pid):
        return memory_keeper.NAME
    for option, value in itertools.pairwise(arguments):
        if option == "-m" and value in OURS:
            return OURS[value]
    return "supervisord" if any(Path(a).name == "supervisord" for a in arguments) else None
