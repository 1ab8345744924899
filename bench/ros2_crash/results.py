"""The file of the trials: JSON lines, with a line after each run that says where and when it was measured."""

from collections.abc import Generator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from bench.ros2_crash.trial import Trial, parse
from deploy.stack.errors import DeployError
from faults.provenance import commit, machine
from faults.trial import PROVENANCE_BEGINS, Provenance, parse_provenance
from faults.trial_file import whole_lines


def read(path: Path) -> list[Trial]:
    """Return the trials of a file; none if there is no file.

    Raises:
        DeployError: a line is not a trial.
    """
    if not path.exists():
        return []
    try:
        return [
            parse(one) for one in whole_lines(path, "the trials") if not one.startswith(PROVENANCE_BEGINS)
        ]
    except ValueError as error:
        raise DeployError(f"{path}: {error}; choose another --out") from error


def read_origins(path: Path) -> list[Provenance]:
    """Return where and when the trials of a file were measured, in the order of the runs."""
    lines = whole_lines(path, "the trials")
    return sorted(
        (parse_provenance(line) for line in lines if line.startswith(PROVENANCE_BEGINS)), key=lambda o: o.date
    )


@contextmanager
def appending(path: Path) -> Generator[IO[str]]:
    """Open a file to append whole lines; at the end, a line says where and when they were measured."""
    whole = "".join(whole_lines(path, "the trials")) if path.exists() else ""
    path.write_text(whole)
    begun = Provenance(
        command="python -m bench.ros2_crash",
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        machine=machine(),
        commit=commit(),
    )
    with path.open("a") as file:
        try:
            yield file
        finally:
            if file.tell() > len(whole.encode()):
                file.write(begun.line() + "\n")
