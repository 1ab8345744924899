"""The e-stop record: a pressed e-stop survives the end of the supervisor.

`EstopRecord` carries out the newest request for a record on disk, on two threads, so that a request never blocks.
The first thread marks a press within microseconds, even while the second thread waits for the disk; a marked press
survives SIGKILL. The second thread makes the record survive a power failure as well, and carries out resets; `problem`
is empty only after that, and the robot does not move until it is. A crash in between leaves the e-stop latched. Only a press
that was never shown as recorded may be lost.

`RecordFiles` stores the record as files in the state directory:

    estop-robot.latched   the record of the namespace `robot`: the next supervisor starts latched while it exists
    estop-robot.ready     the same file before a press; recording a press renames it, which needs no free space
    estop-robot.lock      held by the one supervisor that may clear the record

The directory must be one that no other user can change (wire/ownership.py). Only the absence of the record in a directory that
could hold one proves that no e-stop was latched. The supervisor starts latched if anything else has the record's name, or if a
record cannot be looked up or written. The content is only for people; damage to it has no effect. Its last line says who pressed
and when; it is written after the record, and a failure to write it is no problem.
"""

import fcntl
import logging
import os
import queue
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from enum import Enum, auto
from pathlib import Path
from typing import NamedTuple

from wire.foreign import open_file
from wire.ownership import make_directory, open_lock, open_own, refusal, synchronise
from wire.text import printable

_log = logging.getLogger(__name__)

# --- the files

CONTENT = """\
The e-stop of {namespace} was pressed. While this file exists, the supervisor starts with the e-stop latched.
To clear it, start the robot, release the controls, and reset the e-stop: key r in teleop, or the service
{namespace}/supervisor/reset.
"""

PRESSED = "pressed by"
"""Begins the last line: who pressed and when."""
MAX_BYTES = 1024
"""How much of a record is read: the status repeats its last line, and damage may make the file of any size."""

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


def pressed_by(directory: Path, namespace: str) -> str:
    """Return who pressed the recorded e-stop and when, such as "pressed by teleop, 2026-11-26 14:20:05"; empty if unknown."""
    path = record_path(directory, namespace)
    with suppress(OSError), open_file(path) as file:
        lines = file.read(MAX_BYTES).decode(errors="replace").splitlines()
        return printable(lines[-1]) if lines and lines[-1].startswith(PRESSED) else ""
    return ""


class RecordFiles:
    """The record of one namespace in one directory. All calls except `mark` may block on the disk.

    Args:
        directory: created if it is missing.
        namespace: the robot's namespace; each has its own record.
    """

    def __init__(self, directory: Path, namespace: str) -> None:
        self._directory, self._namespace = directory, namespace
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
            OSError: it cannot be looked up, or an earlier press could not have been recorded either.
        """
        self._own()
        try:
            self._latched.lstat()
        except FileNotFoundError:
            self._write(self._ready)
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
            except OSError:  # the file is missing, or only the rename is refused: an append-only directory, a mount on the file
                if not os.path.lexists(self._latched):
                    self._write(self._latched)

    def latch(self) -> None:
        """Create the record durably; an existing record may not be on disk yet.

        Raises:
            RecordError: it cannot be written, or another supervisor may clear it.
        """
        with _saying(NOT_RECORDED):
            self._make_directory()
            self.mark(lambda: True)
            synchronise(self._directory)
        # Check the lock last: a superfluous record is safe.
        with _saying(NOT_RECORDED):
            self._own()

    def description(self) -> str:
        """Return who pressed the recorded e-stop and when; empty if unknown."""
        return pressed_by(self._directory, self._namespace)

    def describe(self, by: str) -> None:
        """Write who pressed into the existing record.

        Raises:
            OSError: it cannot be written; the record itself is unchanged.
        """
        content = self._content + f"{by}\n".encode()
        file = open_own(self._latched, os.O_WRONLY | os.O_NONBLOCK)
        try:
            if os.fstat(file).st_nlink == 1:  # with a second hard link, it may be another user's file
                os.ftruncate(file, os.pwrite(file, content, 0))
                os.fsync(file)
        finally:
            os.close(file)

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
            synchronise(self._directory)

    def prepare(self) -> None:
        """Write the file that recording a press only renames.

        Raises:
            RecordError: a press could not be recorded either.
        """
        with _saying(NOT_PREPARED):
            self._own()
            self._write(self._ready, synchronised=True)
            synchronise(self._directory)

    def holds(self, *, latched: bool) -> bool:
        """Return whether the files are still as this object left them.

        Args:
            latched: if true, check that the record exists as `latch` created it; else, that a press could still be
                recorded.

        Raises:
            OSError: the files cannot be looked up.
        """
        if not self._is_own() or refusal(self._directory) is not None:
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
        path.unlink(missing_ok=True)  # what has its name may be a link, or a pipe that blocks
        file = open_own(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        try:
            os.write(file, self._content)
            if synchronised:
                os.fsync(file)
        finally:
            os.close(file)

    def _make_directory(self) -> None:
        for made in make_directory(self._directory):
            synchronise(made.parent)

    def _own(self) -> None:
        """Acquire the lock, so that no other supervisor's reset clears the record, in a directory of this user alone."""
        self._make_directory()
        refused = refusal(self._directory)
        if refused is not None:
            raise RecordError(refused)
        if self._is_own():
            return
        self.close()
        file = open_lock(self._lock)
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
            return os.path.samestat(os.fstat(self._lock_file), os.lstat(self._lock))
        except FileNotFoundError:
            return False


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


# --- the threads

PERIOD_S = 1.0
"""Period of the disk check: a failed request is retried, and a deleted file is written again."""
READ_LIMIT_S = 1.0
CLOSE_LIMIT_S = 0.5

PRESS_PENDING = "the e-stop is not on disk yet"
RESET_PENDING = "the reset is not on disk yet"
PREPARE_PENDING = "not yet known whether a pressed e-stop could be recorded"
NO_DISK = "this supervisor keeps no record of the e-stop on a disk"


class _Goal(Enum):
    """The wanted state of the record on disk."""

    PREPARED = auto()
    """A press can be recorded. This does not clear an existing record; only a reset does."""
    LATCHED = auto()
    RESET = auto()


_PENDING = {
    _Goal.PREPARED: PREPARE_PENDING,
    _Goal.LATCHED: PRESS_PENDING,
    _Goal.RESET: RESET_PENDING,
}


class _Request(NamedTuple):
    number: int
    goal: _Goal


class _Done(NamedTuple):
    """The result of a request."""

    number: int
    problem: str


class EstopRecord:
    """A record on a disk, kept by two threads.

    The first thread marks presses. The second thread carries out only the newest request, so that a reset cannot
    overtake a later press. The event loop and the threads exchange immutable values without a lock, so the loop never
    waits for a thread. No call blocks, except `close` for `CLOSE_LIMIT_S`.
    """

    def __init__(
        self, disk: RecordFiles, *, period_s: float = PERIOD_S, read_limit_s: float = READ_LIMIT_S
    ) -> None:
        """Read the record and prepare the next press.

        Args:
            disk: the storage of the record.
            period_s: the period of the disk check.
            read_limit_s: the maximum time for each of both; after it, the record counts as unreadable or not prepared.
        """
        self._disk = disk
        self._period_s = period_s
        # Its `put` never blocks: it takes no lock that a descheduled thread could hold.
        self._requests: queue.SimpleQueue[_Request | None] = queue.SimpleQueue()
        self._presses: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self._marked = 0
        """The number of the last press that was marked, or could not be marked."""
        self._on_change: Callable[[], None] | None = None
        self._found = True
        self.by = ""
        """Who pressed and when, for people: at first what the record says; to be set before `keep`."""
        self._was_read, self._was_tried, self._ended = (threading.Event() for _ in range(3))
        self._done = _Done(0, "")
        threading.Thread(target=self._run, name="e-stop record", daemon=True).start()
        threading.Thread(target=self._mark, name="e-stop mark", daemon=True).start()
        if not self._was_read.wait(read_limit_s):
            _log.warning("the e-stop record was not read within %g s, so the e-stop is latched", read_limit_s)
        self.latched_at_start = self._latched = self._found
        """Whether a record was found, or could not be read."""
        self._asked = _Request(0, _Goal.PREPARED)
        self._ask(_Goal.LATCHED if self._latched else _Goal.PREPARED)
        self._was_tried.wait(read_limit_s)

    @property
    def is_pending(self) -> bool:
        """Whether the last request has neither succeeded nor failed yet."""
        return self._done.number != self._asked.number

    @property
    def is_marked(self) -> bool:
        """Whether the last press survives SIGKILL, or cannot be recorded; true if a reset came last."""
        asked = self._asked
        return asked.goal is not _Goal.LATCHED or self._marked >= asked.number or not self.is_pending

    @property
    def problem(self) -> str:
        """Why a press or a reset would not survive the end of this process; empty if both would."""
        done = self._done
        return done.problem if done.number == self._asked.number else _PENDING[self._asked.goal]

    def watch(self, on_change: Callable[[], None]) -> None:
        """Call `on_change`, on any thread, whenever `problem` or `is_pending` has changed."""
        self._on_change = on_change

    def keep(self, *, latched: bool) -> None:
        """Ask for the e-stop to be recorded as latched, or as reset; the newest request wins."""
        if latched is not self._latched:
            self._latched = latched
            self._ask(_Goal.LATCHED if latched else _Goal.RESET)

    def close(self) -> None:
        """Let the threads finish the newest request."""
        self._presses.put(None)
        self._requests.put(None)
        self._ended.wait(CLOSE_LIMIT_S)

    def _ask(self, goal: _Goal) -> None:
        self._asked = _Request(self._asked.number + 1, goal)
        if goal is _Goal.LATCHED:
            self._presses.put(self._asked.number)
        self._requests.put(self._asked)

    # --- called on the threads

    def _mark(self) -> None:
        """Mark each press immediately, even while the other thread waits for the disk."""
        while (number := self._presses.get()) is not None:
            with suppress(Exception):  # the other thread gets the same error and reports it
                self._disk.mark(self._wants_latched)
            self._marked = number
            self._announce()

    def _run(self) -> None:
        try:
            self._found = self._disk.read()
        except Exception as error:  # noqa: BLE001 - after any error, nothing is proven
            _log.warning(
                "the e-stop record cannot be read or written, so the e-stop is latched: %s",
                printable(str(error)),
            )
        if self._found:
            with suppress(Exception):  # only for people
                self.by = self._disk.description()
        self._was_read.set()
        request: _Request | None = None
        is_closing = False
        while not is_closing:
            newer, is_closing = self._next(None if request is None else self._period_s)
            if newer is not None:
                request = self._carry_out(newer)
            elif request is not None and not is_closing and not self._is_well(request):
                request = self._carry_out(request)
        with suppress(OSError):
            self._disk.close()
        self._ended.set()

    def _wants_latched(self) -> bool:
        """Return whether the newest request is a press, even if no thread has handled it yet."""
        return self._asked.goal is _Goal.LATCHED

    def _next(self, limit_s: float | None) -> tuple[_Request | None, bool]:
        """Wait for requests; return the newest (None if none arrives within `limit_s`) and whether `close` was called."""
        newest, is_closing = None, False
        try:
            request = self._requests.get(timeout=limit_s)
            while True:
                if request is None:
                    is_closing = True
                else:
                    newest = request
                request = self._requests.get_nowait()
        except queue.Empty:
            return newest, is_closing

    def _is_well(self, request: _Request) -> bool:
        """Return whether the last attempt succeeded and the disk has not changed since."""
        try:
            return not self._done.problem and self._disk.holds(latched=request.goal is _Goal.LATCHED)
        except Exception:  # noqa: BLE001 - after any error, nothing is proven
            return False

    def _carry_out(self, request: _Request) -> _Request:
        """Try a request, and return the request that a later retry must carry out."""
        problem = ""
        try:
            if request.goal is _Goal.LATCHED:
                self._disk.latch()
            else:
                if request.goal is _Goal.RESET:
                    self._disk.clear(lambda: not self._wants_latched())
                    # A record that appears after this was not reset.
                    request = request._replace(goal=_Goal.PREPARED)
                self._disk.prepare()
        except Exception as error:  # noqa: BLE001 - supervision continues, and the status reports the error
            problem = printable(str(error)) or type(error).__name__
        if problem and problem != self._done.problem:
            _log.warning("%s", problem)
        self._done = _Done(request.number, problem)
        self._was_tried.set()
        self._announce()
        if request.goal is _Goal.LATCHED and not problem and self.by:
            with suppress(Exception):  # only for people, so after the record is reported as written
                self._disk.describe(self.by)
        return request

    def _announce(self) -> None:
        if self._on_change is not None:
            self._on_change()


class MemoryRecord:
    """A record in memory, for a supervisor in a test or a simulation."""

    def __init__(self, *, latched: bool = False, problem: str = "") -> None:
        self.latched = latched
        self.problem = problem
        self.by = ""
        self.is_pending = False
        self.is_marked = True
        self._on_change: Callable[[], None] | None = None

    @property
    def latched_at_start(self) -> bool:
        return self.latched

    def watch(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change

    def keep(self, *, latched: bool) -> None:
        self.latched = latched

    def close(self) -> None:
        """Do nothing: there is no pending request."""


Record = EstopRecord | MemoryRecord
