"""The e-stop record as files in the state directory.

    estop-robot.latched   the record of the namespace `robot`: the next supervisor starts latched while it exists
    estop-robot.ready     the same file before a press; recording a press renames it, which needs no free space
    estop-robot.lock      held by the one supervisor that may clear the record

Only the absence of the record proves that no e-stop was latched. The supervisor starts latched if anything else has
the record's name, or if the record cannot be looked up. The content is only for people; damage to it has no effect.
"""

import fcntl
import os
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path

CONTENT = """\
The e-stop of {namespace} was pressed. While this file exists, the supervisor starts with the e-stop latched.
To clear it, start the robot, release the controls, and reset the e-stop: key r in teleop, or the service
{namespace}/supervisor/reset.
"""

NOT_RECORDED = "the e-stop cannot be recorded"
NOT_PREPARED = "a pressed e-stop could not be recorded"
NOT_CLEARED = "the reset cannot be recorded, so the next supervisor starts latched"


class RecordError(Exception):
    """The record cannot be read or written; the message says why."""


def record_path(directory: Path, namespace: str) -> Path:
    """Return the path of the file that exists while the e-stop of a namespace is latched."""
    return directory / f"estop-{namespace}.latched"


def is_recorded(directory: Path, namespace: str) -> bool:
    """Return whether a record exists or cannot be looked up."""
    try:
        record_path(directory, namespace).lstat()
    except FileNotFoundError:  # a link to a disk that is not mounted raises this too
        return directory.is_symlink() and not directory.is_dir()
    except OSError:
        return True
    return True


class RecordFiles:
    """The record of one namespace in one directory. All calls except `mark` may block on the disk.

    Args:
        directory: created if it is missing.
        namespace: the robot's namespace; each has its own record.
    """

    def __init__(self, directory: Path, namespace: str) -> None:
        self._directory = directory
        self._content = CONTENT.format(namespace=namespace).encode()
        self._latched = record_path(directory, namespace)
        self._ready = self._latched.with_suffix(".ready")
        self._lock = self._latched.with_suffix(".lock")
        self._lock_file: int | None = None
        self._naming = threading.Lock()
        """Held while the record is renamed or removed, and never while the disk is synchronised."""

    def read(self) -> bool:
        """Return whether the record exists.

        Raises:
            RecordError: another supervisor may be about to write it.
            OSError: it cannot be looked up.
        """
        with suppress(OSError):  # a directory in which no lock can be created can still be read
            self._own()
        try:
            self._latched.lstat()
        except FileNotFoundError:
            if not self._directory.is_dir():  # the disk may not be mounted
                raise
            return False
        return True

    def mark(self, is_wanted: Callable[[], bool]) -> None:
        """Create the record for all later processes of this machine, in microseconds, but not yet durably.

        It may be called on another thread while any other call waits for the disk.

        Args:
            is_wanted: called last: no `clear` can happen between this call and the creation.

        Raises:
            OSError: it cannot be written.
        """
        with self._naming:
            if not is_wanted() or os.path.lexists(self._latched):
                return
            try:
                self._ready.rename(self._latched)
            except FileNotFoundError:
                self._write(self._latched)

    def latch(self) -> None:
        """Create the record durably; an existing record may not be on disk yet.

        Raises:
            RecordError: it cannot be written, or another supervisor may clear it.
        """
        with _saying(NOT_RECORDED):
            self._make_directory()
            self.mark(lambda: True)
            _synchronise(self._directory)
        # Check the lock last: a superfluous record is safe.
        with _saying(NOT_RECORDED):
            self._own()

    def clear(self, is_wanted: Callable[[], bool]) -> None:
        """Remove the record durably, unless the removal is no longer wanted.

        Args:
            is_wanted: called last: no `mark` can happen between this call and the removal.

        Raises:
            RecordError: the record may still exist at the next start.
        """
        with _saying(NOT_CLEARED):
            self._own()
            with self._naming:
                if is_wanted():
                    self._latched.unlink(missing_ok=True)
            _synchronise(self._directory)

    def prepare(self) -> None:
        """Write the file that recording a press only renames.

        Raises:
            RecordError: a press could not be recorded either.
        """
        with _saying(NOT_PREPARED):
            self._own()
            self._write(self._ready, synchronised=True)
            _synchronise(self._directory)

    def holds(self, *, latched: bool) -> bool:
        """Return whether the files are still as this object left them.

        Args:
            latched: if true, check that the record exists as `latch` created it; else, that a press could still be
                recorded.

        Raises:
            OSError: the files cannot be looked up.
        """
        if not self._is_own():
            return False
        if latched:
            return os.path.lexists(self._latched)
        return os.path.lexists(self._ready) and os.access(self._directory, os.W_OK)

    def close(self) -> None:
        """Release the lock; the end of the process also releases it."""
        if self._lock_file is not None:
            os.close(self._lock_file)
            self._lock_file = None

    def _write(self, path: Path, *, synchronised: bool = False) -> None:
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        try:
            os.write(file, self._content)
            if synchronised:
                os.fsync(file)
        finally:
            os.close(file)

    def _make_directory(self) -> None:
        missing = [p for p in (self._directory, *self._directory.parents) if not p.exists()]
        self._directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        for made in missing:
            _synchronise(made.parent)

    def _own(self) -> None:
        """Acquire the lock, so that no other supervisor's reset clears the record."""
        if self._is_own():
            return
        self.close()
        self._make_directory()
        file = os.open(self._lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(file)
            if isinstance(error, BlockingIOError):
                raise RecordError(
                    f"another supervisor holds {self._lock}: give each robot a namespace or a state directory "
                    "of its own"
                ) from error
            raise
        self._lock_file = file

    def _is_own(self) -> bool:
        """Return whether the lock is held on the file that another supervisor would lock."""
        if self._lock_file is None:
            return False
        try:
            return os.path.samestat(os.fstat(self._lock_file), self._lock.stat())
        except FileNotFoundError:
            return False


def _synchronise(directory: Path) -> None:
    """Synchronise the entries of a directory to disk, so that they survive a power failure."""
    file = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(file)
    finally:
        os.close(file)


@contextmanager
def _saying(what: str) -> Generator[None]:
    """Convert an error of the system into a `RecordError` with a one-sentence message."""
    try:
        yield
    except OSError as error:
        where = f" ({error.filename})" if error.filename else ""
        raise RecordError(f"{what}: {error.strerror or error}{where}") from error
    except RecordError as error:
        raise RecordError(f"{what}: {error}") from error
