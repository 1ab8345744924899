"""Where and when a campaign ran: a line in its file after its trials."""

import os
import platform
import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from deploy.stack.errors import DeployError
from faults.trial import Provenance

GIT_LIMIT_S = 10.0


def provenance_of(arguments: Sequence[str]) -> Provenance:
    """Return the provenance of a run that begins now.

    Args:
        arguments: the command line without the program; only the last part of absolute paths is kept.
    """
    words = [Path(word).name if word.startswith("/") else word for word in arguments]
    return Provenance(
        command=" ".join(("lifeline", *words)),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        machine=machine(),
        commit=commit(),
    )


def machine() -> str:
    """Return the relevant properties of this machine, without its name."""
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), load average {os.getloadavg()[0]:.1f}, "
        f"{platform.system()}, Python {platform.python_version()}, eclipse-zenoh {version('eclipse-zenoh')}"
    )


def commit() -> str:
    """Return the commit of the code, and whether files differ from it; empty if git does not know."""
    root = Path(__file__).parents[1]
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


@contextmanager
def signed(out: Path | None) -> Generator[None]:
    """Append a provenance line after the trials that the block adds to the file, even if the block is interrupted."""
    if out is None:
        yield
        return
    begun, before = provenance_of(sys.argv[1:]), _size(out)
    try:
        yield
    finally:
        if _size(out) > before:
            _sign(out, begun)


def _sign(out: Path, begun: Provenance) -> None:
    try:
        with out.open("a") as file:
            file.write(begun.line() + "\n")
    except OSError as error:
        raise DeployError(f"cannot write {out}: {error.strerror}") from error


def _size(out: Path) -> int:
    try:
        return out.stat().st_size
    except OSError:
        return 0
