"""What the kernel says that a process is doing."""

from pathlib import Path


def state_of(pid: int) -> str:
    """One letter, as ps shows it: S sleeps, T is stopped."""
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
