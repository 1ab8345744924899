"""When, where and with which code a measurement is made: the date, the machine, and the commit."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

GIT_LIMIT_S = 10.0


def now() -> str:
    """Return the date and time of day in UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def machine() -> str:
    """Return the relevant properties of this machine, without its name."""
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), load average {os.getloadavg()[0]:.1f}, "
        f"{platform.system()}, Python {platform.python_version()}, eclipse-zenoh {version('eclipse-zenoh')}"
    )


def commit() -> str:
    """Return the commit of the code, and whether files differ from it; empty if git does not know."""
    root = Path(__file__).parents[2]
    try:
        found, changes = (
            subprocess.run(
                ["git", "-C", str(root), *words],  # noqa: S607 - whichever git there is
                capture_output=True,
                text=True,
                check=True,
                timeout=GIT_LIMIT_S,
            ).stdout.strip()
            for words in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return f"{found}, with changes that are not committed" if changes else found
