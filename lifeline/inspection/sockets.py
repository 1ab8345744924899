"""Finds the process at the other end of a TCP connection of this machine, from /proc (Linux).

The hub reports the address of each client, and the kernel knows which process has this address. A process therefore
cannot hide its pid or claim another one. Sockets of other users' processes are visible only to root. At the hub's Unix socket, the
hub knows no address: there, the ids of our sessions contain their pids.
"""

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from wire.host.connections import tcp_sockets

SOCKET = re.compile(r"socket:\[(\d+)\]")


@dataclass(frozen=True, slots=True)
class Process:
    """A running process of this machine."""

    pid: int
    arguments: tuple[str, ...]
    """Its command line."""
    uptime_s: float


def processes_at(addresses: set[str]) -> dict[str, Process]:
    """Return the process that owns each of these local addresses (`127.0.0.1:37276`), as far as they can be found."""
    inodes = {row.inode: row.local for row in tcp_sockets() if row.local in addresses}
    found: dict[str, Process] = {}
    for pid, inode in _open_sockets():
        if inode in inodes and (process := _process(pid)) is not None:
            found.setdefault(inodes[inode], process)
    return found


def processes_with(pids: Mapping[str, int]) -> dict[str, Process]:
    """Return the processes with these pids, as far as they exist, by the same names."""
    found = {name: _process(pid) for name, pid in pids.items()}
    return {name: process for name, process in found.items() if process is not None}


def _open_sockets() -> Iterator[tuple[int, str]]:
    """Yield the pid and the inode of each socket that a process has open."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        with suppress(OSError):
            for descriptor in (entry / "fd").iterdir():
                with suppress(OSError):
                    match = SOCKET.fullmatch(str(descriptor.readlink()))
                    if match is not None:
                        yield int(entry.name), match[1]


def _process(pid: int) -> Process | None:
    """Return a process; None if it has ended."""
    try:
        arguments = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        # The name in parentheses may contain spaces; the start time is the 20th field after it.
        ticks = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])
        uptime_s = float(Path("/proc/uptime").read_text().split()[0]) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None
    return Process(pid, tuple(os.fsdecode(one) for one in arguments if one), uptime_s)
