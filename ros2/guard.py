"""Detects the death of a publisher's process on this host, long before DDS does (20 s by default).

Fast DDS puts the process id into each endpoint's identity. A pidfd of that process becomes readable when it ends.
"""

import asyncio
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

EPROSIMA = b"\x01\x0f"
HOST, PID = slice(2, 4), slice(4, 6)
"""Positions in the identity of an endpoint: Fast DDS's id of the host, and the lower half of the process id."""
PROC = Path("/proc")
DDS_LIBRARIES = (b"libfastdds", b"libfastrtps")


class Guarded(NamedTuple):
    """A process that is watched."""

    pid: int
    pidfd: int


def pid_of(gid: bytes, own_gid: bytes, candidates: Iterable[int]) -> int | None:
    """Return the process of an endpoint; None if it cannot be determined.

    Args:
        gid: the endpoint's identity.
        own_gid: the identity of any endpoint of this process.
        candidates: the processes that may have it, of this host; not read for an endpoint of another one.
    """
    if gid[:2] != EPROSIMA or own_gid[:2] != EPROSIMA or gid[HOST] != own_gid[HOST]:
        return None
    found = list(candidates)
    return found[0] if len(found) == 1 else None


def of_this_process(gids: Sequence[bytes]) -> bytes:
    """Return the identity that belongs to this process; the first one if none shows it, and empty if there is none.

    Args:
        gids: the endpoints with the name of this process's node; a second process `ros2` has the same name.
    """
    own = (gid for gid in gids if _may_be_of(gid, os.getpid()))
    return next(own, gids[0] if gids else b"")


def _may_be_of(gid: bytes, pid: int) -> bool:
    """Return whether an identity has the lower half of a process id."""
    return gid[:2] == EPROSIMA and int.from_bytes(gid[PID], "little") == pid & 0xFFFF


def dds_processes(low: int) -> Iterator[int]:
    """Yield the processes of this host that use Fast DDS and that see these lower 16 bits in their own id.

    In a container, a process sees another id than the host does, and puts it into its identity. The memory map of another
    user's process cannot be read; such a process is included.
    """
    for entry in PROC.iterdir():
        if not entry.name.isdigit() or inner_pid(entry) & 0xFFFF != low:
            continue
        try:
            maps = (entry / "maps").read_bytes()
        except PermissionError:
            yield int(entry.name)
            continue
        except OSError:  # it has ended
            continue
        if any(library in maps for library in DDS_LIBRARIES):
            yield int(entry.name)


def inner_pid(entry: Path) -> int:
    """Return the id that a process has in its own pid namespace; 0 if it has ended.

    Args:
        entry: its directory in /proc.
    """
    try:
        status = (entry / "status").read_bytes()
    except OSError:
        return 0
    return int((status.partition(b"NSpid:")[2].partition(b"\n")[0].split() or [entry.name])[-1])


def is_stopped(pid: int) -> bool:
    """Return whether a process is stopped by a signal, such as that of Ctrl-Z."""
    try:
        fields = (PROC / str(pid) / "stat").read_bytes().rpartition(b")")[2].split()
    except OSError:
        return False
    return fields[:1] in ([b"T"], [b"t"])


class Guard:
    """Watches the processes of publishers.

    Args:
        on_death: called in the event loop with the identity of a publisher whose process has ended.
    """

    def __init__(self, on_death: Callable[[bytes], None]) -> None:
        self._on_death = on_death
        self._loop = asyncio.get_running_loop()
        self._guarded: dict[bytes, Guarded] = {}

    def watch(self, gid: bytes, own_gid: bytes) -> int | None:
        """Watch the process of a publisher; return its id, or None if it is not known."""
        guarded = self._guarded.get(gid)
        if guarded is not None:
            return guarded.pid
        pid = pid_of(gid, own_gid, dds_processes(int.from_bytes(gid[PID], "little")))
        if pid is None:
            return None
        try:
            pidfd = os.pidfd_open(pid)
        except OSError:
            return None
        self._guarded[gid] = Guarded(pid, pidfd)
        self._loop.add_reader(pidfd, self._ended, gid)
        return pid

    def stopped(self) -> frozenset[bytes]:
        """Return the watched publishers whose processes are stopped by a signal."""
        return frozenset(gid for gid, guarded in self._guarded.items() if is_stopped(guarded.pid))

    def forget(self, kept: Iterable[bytes]) -> None:
        """Stop watching all publishers but these."""
        for gid in set(self._guarded).difference(kept):
            self._release(gid)

    def _ended(self, gid: bytes) -> None:
        self._release(gid)
        self._on_death(gid)

    def _release(self, gid: bytes) -> None:
        guarded = self._guarded.pop(gid)
        self._loop.remove_reader(guarded.pidfd)
        with suppress(OSError):
            os.close(guarded.pidfd)
