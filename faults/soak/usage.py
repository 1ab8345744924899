"""The resources of a process, from /proc."""

from dataclasses import dataclass
from pathlib import Path

KIB = 1024


@dataclass(frozen=True, slots=True)
class Usage:
    """The resources of one process at one moment."""

    pid: int
    rss_bytes: int
    """Resident memory, including shared pages."""
    uss_bytes: int
    """Private resident memory."""
    descriptors: int
    threads: int


def usage(pid: int) -> Usage | None:
    """Return the resources of one of our processes; None if it has ended."""
    process = Path("/proc") / str(pid)
    try:
        status = _fields(process / "status")
        rollup = _fields(process / "smaps_rollup")
        descriptors = sum(1 for _ in (process / "fd").iterdir())
    except OSError:
        return None
    if "VmRSS" not in status:  # it has ended and was not reaped yet
        return None
    return Usage(
        pid=pid,
        rss_bytes=status["VmRSS"] * KIB,
        uss_bytes=(rollup.get("Private_Clean", 0) + rollup.get("Private_Dirty", 0)) * KIB,
        descriptors=descriptors,
        threads=status["Threads"],
    )


def _fields(path: Path) -> dict[str, int]:
    pairs = (line.split(":", 1) for line in path.read_text().splitlines() if ":" in line)
    return {name: int(words[0]) for name, value in pairs if (words := value.split()) and words[0].isdecimal()}
