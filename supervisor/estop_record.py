"""The e-stop record: a pressed e-stop survives the end of the supervisor.

`EstopRecord` carries out the newest request for a record on disk, on two threads, so that a request never blocks.
The first thread marks a press within microseconds, even while the second thread waits for the disk; a marked press
survives SIGKILL. The second thread makes the record survive a power failure as well, and carries out resets; `problem`
is empty only after that. A crash in between leaves the e-stop latched. Only a press that was never shown as
recorded may be lost.
"""

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from enum import Enum, auto
from typing import NamedTuple, Protocol

_log = logging.getLogger(__name__)

PERIOD_S = 1.0
"""Period of the disk check: a failed request is retried, and a deleted file is written again."""
READ_LIMIT_S = 1.0
CLOSE_LIMIT_S = 0.5

PRESS_PENDING = "the e-stop is not on disk yet"
RESET_PENDING = "the reset is not on disk yet"
PREPARE_PENDING = "not yet known whether a pressed e-stop could be recorded"
NO_DISK = "this supervisor keeps no record of the e-stop on a disk"


class Record(Protocol):
    """Interface to the supervisor's service. No call blocks, except `close` for `CLOSE_LIMIT_S`."""

    @property
    def latched_at_start(self) -> bool:
        """Whether a record was found, or could not be read."""
        ...

    @property
    def is_pending(self) -> bool:
        """Whether the last request has neither succeeded nor failed yet."""
        ...

    @property
    def is_marked(self) -> bool:
        """Whether the last press survives SIGKILL, or cannot be recorded; true if a reset came last."""
        ...

    @property
    def problem(self) -> str:
        """Why a press or a reset would not survive the end of this process; empty if both would."""
        ...

    def watch(self, on_change: Callable[[], None]) -> None:
        """Call `on_change`, on any thread, whenever `problem` or `is_pending` has changed."""
        ...

    def keep(self, *, latched: bool) -> None:
        """Ask for the e-stop to be recorded as latched, or as reset; the newest request wins."""
        ...

    def close(self) -> None:
        """Let the threads finish the newest request."""
        ...


class Disk(Protocol):
    """Interface to the storage of a record, documented in `RecordFiles`. Every call may block and may raise."""

    def read(self) -> bool: ...

    def mark(self, is_wanted: Callable[[], bool]) -> None: ...

    def latch(self) -> None: ...

    def clear(self, is_wanted: Callable[[], bool]) -> None: ...

    def prepare(self) -> None: ...

    def holds(self, *, latched: bool) -> bool: ...

    def close(self) -> None: ...


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
    waits for a thread.
    """

    def __init__(self, disk: Disk, *, period_s: float = PERIOD_S, read_limit_s: float = READ_LIMIT_S) -> None:
        """Read the record for `read_limit_s` at most; after that, the record counts as unreadable.

        Args:
            disk: the storage of the record.
            period_s: the period of the disk check.
            read_limit_s: the maximum time for which this call blocks.
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
        self._was_read, self._ended = threading.Event(), threading.Event()
        self._done = _Done(0, "")
        threading.Thread(target=self._run, name="e-stop record", daemon=True).start()
        threading.Thread(target=self._mark, name="e-stop mark", daemon=True).start()
        if not self._was_read.wait(read_limit_s):
            _log.warning("the e-stop record was not read within %g s, so the e-stop is latched", read_limit_s)
        self._latched_at_start = self._latched = self._found
        self._asked = _Request(0, _Goal.PREPARED)
        self._ask(_Goal.LATCHED if self._latched else _Goal.PREPARED)

    @property
    def latched_at_start(self) -> bool:
        return self._latched_at_start

    @property
    def is_pending(self) -> bool:
        return self._done.number != self._asked.number

    @property
    def is_marked(self) -> bool:
        asked = self._asked
        return asked.goal is not _Goal.LATCHED or self._marked >= asked.number or not self.is_pending

    @property
    def problem(self) -> str:
        done = self._done
        return done.problem if done.number == self._asked.number else _PENDING[self._asked.goal]

    def watch(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change

    def keep(self, *, latched: bool) -> None:
        if latched is not self._latched:
            self._latched = latched
            self._ask(_Goal.LATCHED if latched else _Goal.RESET)

    def close(self) -> None:
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
            _log.warning("the e-stop record cannot be read, so the e-stop is latched: %s", error)
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
        except OSError:
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
            problem = str(error) or type(error).__name__
        if problem and problem != self._done.problem:
            _log.warning("%s", problem)
        self._done = _Done(request.number, problem)
        self._announce()
        return request

    def _announce(self) -> None:
        if self._on_change is not None:
            self._on_change()


class MemoryRecord:
    """A record in memory, for a supervisor in a test or a simulation."""

    def __init__(self, *, latched: bool = False, problem: str = NO_DISK) -> None:
        self.latched = latched
        self.problem = problem
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
