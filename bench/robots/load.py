"""Reads the processor time of processes and of the machine from /proc."""

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Usage:
    """Processor time that the existing threads of a process have used until now."""

    cpu_s: float
    delay_s: float
    """Time for which threads were ready to run but waited for a core."""
    slices: int
    """Number of times that a thread received a core."""
    at_s: float
    """Time of the reading; of a difference, its duration. On a saturated machine, many readings take seconds."""

    def __sub__(self, other: "Usage") -> "Usage":
        return Usage(
            self.cpu_s - other.cpu_s,
            self.delay_s - other.delay_s,
            self.slices - other.slices,
            self.at_s - other.at_s,
        )

    @property
    def cpu_percent(self) -> float:
        """Of a difference: of one core."""
        return 100.0 * self.cpu_s / self.at_s


@dataclass(frozen=True)
class Machine:
    """The times of all cores until now [s]."""

    idle_s: float
    stolen_s: float
    """Taken by the host of a virtual machine."""
    total_s: float


def usage(pid: int) -> Usage:
    """Return the usage of a process, without that of threads that have ended."""
    rows: list[list[int]] = []
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with suppress(OSError):  # the thread has ended
            rows.append([int(word) for word in path.read_text().split()])
    return Usage(
        sum(row[0] for row in rows) / 1e9,
        sum(row[1] for row in rows) / 1e9,
        sum(row[2] for row in rows),
        time.monotonic(),
    )


def machine() -> Machine:
    """Return the times of all cores.

    The kernel measures idle time, but counts the rest of /proc/stat by samples, which miss work that begins with a clock
    tick and ends before the next one.
    """
    total_s = time.monotonic() * (os.cpu_count() or 1)
    _, _, _, idle, waiting, _, _, stolen = (
        int(word) / os.sysconf("SC_CLK_TCK")
        for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]
    )
    return Machine(idle + waiting, stolen, total_s)


def busy_percent(before: Machine, after: Machine) -> float:
    """Return the busy share of all cores between two readings [%]."""
    return 100.0 * (1.0 - (after.idle_s - before.idle_s) / (after.total_s - before.total_s))
