"""The state of a process by the kernel."""

from pathlib import Path


def state_of(pid: int) -> str:
    """Return the state as one letter, as ps shows it: S sleeps, T is stopped."""
    return _fields_after_name(pid)[0]


def children_of(pid: int) -> list[int]:
    """Return the states of all its threads."""
    everyone = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal()]
    return [child for child in everyone if _parent_of(child) == pid]


def _parent_of(pid: int) -> int | None:
    """Return the status; None if the process has ended."""
    try:
        return int(_fields_after_name(pid)[1])
    except (FileNotFoundError, ProcessLookupError):
        return None


def _fields_after_name(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
