"""Reads the processor time and memory of processes and of the machine from /proc."""

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_CLOCK_TICKS_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Usage:
    """Processor time that the existing threads of a process have used until now."""

    cpu_s: float
    delay_s: float
    """Time for which threads were ready to run but waited for a core."""
    at_s: float
    """Time of the reading; of a difference, its duration. On a saturated machine, many readings take seconds."""

    def __sub__(self, other: "Usage") -> "Usage":
        return Usage(self.cpu_s - other.cpu_s, self.delay_s - other.delay_s, self.at_s - other.at_s)

    @property
    def cpu_percent(self) -> float:
        """Of a difference: of one core."""
        return 100.0 * self.cpu_s / self.at_s


def usage(pid: int, thread: int | None = None) -> Usage:
    """Return the usage of a process, without that of threads that have ended, or of one thread; the main thread has the process's id."""
    rows: list[list[int]] = []
    for path in Path(f"/proc/{pid}/task").glob(f"{'*' if thread is None else thread}/schedstat"):
        with suppress(OSError):  # the thread has ended
            rows.append([int(word) for word in path.read_text().split()])
    return Usage(sum(row[0] for row in rows) / 1e9, sum(row[1] for row in rows) / 1e9, time.monotonic())


def status(pid: int, name: str) -> int:
    """Return a number of the main thread's /proc/<pid>/status.

    Raises:
        RuntimeError: the process has ended.
    """
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{name}:"):
            return int(line.split()[1])
    raise RuntimeError("the process has ended")


@dataclass(frozen=True)
class Machine:
    """The times of all cores until now [s]."""

    idle_s: float
    total_s: float


def machine() -> Machine:
    """Return the times of all cores.

    The kernel measures idle time, but counts the rest of /proc/stat by samples, which miss work that begins with a clock
    tick and ends before the next one.
    """
    total_s = time.monotonic() * (os.cpu_count() or 1)
    _, _, _, _, idle, waiting, *_ = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    return Machine((int(idle) + int(waiting)) / _CLOCK_TICKS_S, total_s)


def busy_percent(before: Machine, after: Machine) -> float:
    """Return the busy share of all cores between two readings [%]."""
    return 100.0 * (1.0 - (after.idle_s - before.idle_s) / (after.total_s - before.total_s))


_averages = [os.getloadavg()[0]]
"""The load average before the benchmark, and those that `look` has noted during it."""


def look() -> None:
    """Note the load average of the machine."""
    _averages.append(os.getloadavg()[0])


def averages() -> tuple[float, float]:
    """Return the load average of the machine before the benchmark, and the greatest one that was seen during it."""
    look()
    return _averages[0], max(_averages[1:])
