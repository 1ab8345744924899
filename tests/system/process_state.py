"""The state of a process by the kernel."""

import os
from contextlib import suppress
from pathlib import Path

LISTENING = "0A"


def state_of(pid: int) -> str:
    """Return the state as one letter, as ps shows it: S sleeps, T is stopped."""
    return _fields_after_name(pid)[0]


def cpu_s(pid: int) -> float:
    """Return the CPU time that a process has used [s]."""
    user, system = _fields_after_name(pid)[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def memory_bytes(pid: int) -> int:
    """Return the resident memory of a process; 0 if it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (FileNotFoundError, ProcessLookupError):
        return 0


def command_of(pid: int) -> list[str]:
    """Return the words of the command line of a process."""
    return Path(f"/proc/{pid}/cmdline").read_text().split("\0")


def children_of(pid: int) -> list[int]:
    """Return the ids of its child processes."""
    everyone = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal()]
    return [child for child in everyone if _parent_of(child) == pid]


def _parent_of(pid: int) -> int | None:
    """Return the id of its parent; None if the process has ended."""
    try:
        return int(_fields_after_name(pid)[1])
    except (FileNotFoundError, ProcessLookupError):
        return None


def _fields_after_name(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()


def listening(pid: int) -> set[tuple[str, int]]:
    """Return where a process and its children listen: addresses as the kernel writes them, and ports."""
    inodes: set[str] = set()
    for process in (pid, *children_of(pid)):
        with suppress(OSError):  # a child has ended
            entries = list(Path(f"/proc/{process}/fd").iterdir())
            for entry in entries:
                with suppress(OSError):
                    inodes.add(entry.readlink().name)
    found: set[tuple[str, int]] = set()
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            address, _, port = fields[1].partition(":")
            if f"socket:[{fields[9]}]" in inodes and (fields[3] == LISTENING or table.startswith("udp")):
                found.add((address, int(port, 16)))
    return found
