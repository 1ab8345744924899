"""The file of a campaign: its trials are read from it, appended to it, and signed with where and when the campaign ran."""

import gzip
import sys
import zlib
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from deploy.stack.errors import DeployError
from deploy.stack.provenance import commit, machine, now
from faults.trial import PROVENANCE_BEGINS, Provenance, Trial, parse
from wire.foreign import open_file

MAX_LINE_BYTES = 64 << 20
"""Of one trial, with its timeline."""


def read_trials(path: Path) -> Iterator[Trial]:
    """Read the trials of a file and skip provenance lines; otherwise like `read_records`."""
    return (one for one in read_records(path) if isinstance(one, Trial))


def read_records(path: Path) -> Iterator[Trial | Provenance]:
    """Read the trials and provenances of a file, one by one; a name that ends with `.gz` means a compressed file.

    An incomplete last line, which a killed campaign leaves, is skipped.

    Raises:
        DeployError: the file cannot be read, or a line is neither; names file and line.
    """
    for number, line in enumerate(whole_lines(path, "the trials"), 1):
        try:
            is_trial = not line.startswith(PROVENANCE_BEGINS)
            record = parse(Trial, line) if is_trial else parse(Provenance, line)
        except DeployError as error:
            raise DeployError(
                f"{path}:{number}: {error}; choose another --out, or remove the line"
            ) from error
        yield record


def whole_lines(path: Path, what: str) -> Iterator[str]:
    """Yield the complete lines of a file, compressed or not.

    Args:
        path: the file.
        what: its content, for the error.

    Raises:
        DeployError: the file cannot be read.
    """
    try:
        with open_file(path) as raw, gzip.open(raw) if path.suffix == ".gz" else raw as file:
            while line := file.readline(MAX_LINE_BYTES):
                if line.endswith(b"\n"):
                    yield line.decode()
                elif len(line) == MAX_LINE_BYTES:
                    raise ValueError(f"a line is longer than {MAX_LINE_BYTES >> 20} MiB")  # noqa: TRY301 - ends the reading
    except (OSError, EOFError, zlib.error, ValueError) as error:
        raise DeployError(f"cannot read {what} in {path}: {error}") from error


def known_trials(out: Path | None, mode: str, revision: str) -> list[Trial]:
    """Return the trials of a file that were run in this mode by this revision; none if there is no file."""
    if out is None or not out.exists():
        return []
    return [trial for trial in read_trials(out) if trial.mode == mode and trial.revision == revision]


@contextmanager
def appending(out: Path | None, origin: Provenance | None = None) -> Generator[Callable[[str], None]]:
    """Open a file and yield a function that appends one line; without a file, it does nothing.

    An incomplete last line is cut off first. Each line is flushed. A provenance follows the lines, even if the block is
    interrupted.

    Args:
        out: the file.
        origin: the provenance; None: that of this command of `lifeline`.

    Raises:
        DeployError: the file cannot be written.
    """
    if out is None:
        yield lambda _: None
        return
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        file = out.open("a+b")
        _cut_incomplete_line(file)
    except OSError as error:
        why = error.strerror or "it is a pipe or a device, not a file"
        raise DeployError(f"cannot write {out}: {why}") from error
    begun, unsigned = origin or provenance_of_this_command(), False

    def append(line: str) -> None:
        nonlocal unsigned
        unsigned = True
        try:
            file.write(line.encode() + b"\n")
            file.flush()
        except OSError as error:
            raise DeployError(f"cannot write {out}: {error.strerror}") from error

    try:
        yield append
    finally:
        try:
            if unsigned:
                append(begun.line())
        finally:
            with suppress(OSError):  # what cannot be flushed has been reported
                file.close()


def _cut_incomplete_line(file: IO[bytes]) -> None:
    file.seek(0)
    data = file.read()
    if not data.endswith(b"\n"):
        file.truncate(data.rfind(b"\n") + 1)


# --- the provenance


def provenance(command: str) -> Provenance:
    """Return the provenance of a run of a command that begins now."""
    return Provenance(command=command, date=now(), machine=machine(), commit=commit())


def provenance_of_this_command() -> Provenance:
    """Return the provenance of a run that begins now; only the last part of absolute paths is kept."""
    words = [Path(word).name if word.startswith("/") else word for word in sys.argv[1:]]
    return provenance(" ".join(("lifeline", *words)))
