"""The e-stop record: a pressed e-stop outlives the supervisor that heard it.

`EstopRecord` keeps a record on a disk as it was last asked to, on threads of its own: asking never blocks, whatever
the disk does. One thread marks a press, which takes microseconds and survives SIGKILL, also while the other one waits
for the disk. That one makes the record survive a power failure too, and carries out resets; `problem` is empty only
after that. A crash in between leaves the e-stop latched, or, if it was never shown as recorded, as it was before the
press.
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
"""How often the disk is looked at: what failed is tried again, and what was deleted is written again."""
READ_LIMIT_S = 1.0
CLOSE_LIMIT_S = 0.5

PRESS_PENDING = "the e-stop is not on disk yet"
RESET_PENDING = "the reset is not on disk yet"
PREPARE_PENDING = "not yet known whether a pressed e-stop could be recorded"
NO_DISK = "this supervisor keeps no record of the e-stop on a disk"


class Record(Protocol):
    """What the supervisor's service needs. No call blocks, except `close` for `CLOSE_LIMIT_S`."""

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
        """Why a pressed e-stop would not outlive this process, or a reset would be lost; empty: neither is so."""
        ...

    def watch(self, on_change: Callable[[], None]) -> None:
        """Call `on_change`, on any thread, when `problem` or `is_pending` has changed."""
        ...

    def keep(self, *, latched: bool) -> None:
        """Ask for the e-stop to be recorded as latched, or as reset; the newest request wins."""
        ...

    def close(self) -> None:
        """Let the threads finish the newest request."""
        ...


class Disk(Protocol):
    """Where a record lies; `RecordFiles` says what each call does. All of them may block, and raise."""

    def read(self) -> bool: ...

    def mark(self, is_wanted: Callable[[], bool]) -> None: ...

    def latch(self) -> None: ...

    def clear(self, is_wanted: Callable[[], bool]) -> None: ...

    def prepare(self) -> None: ...

    def holds(self, *, latched: bool) -> bool: ...

    def close(self) -> None: ...


class _Wish(Enum):
    """What the disk is asked for."""

    PREPARED = auto()
    """Nothing is latched. This clears no record: only a reset does."""
    LATCHED = auto()
    RESET = auto()


_PENDING = {
    _Wish.PREPARED: PREPARE_PENDING,
    _Wish.LATCHED: PRESS_PENDING,
    _Wish.RESET: RESET_PENDING,
}


class _Request(NamedTuple):
    number: int
    wish: _Wish


class _Done(NamedTuple):
    """What became of a request."""

    number: int
    problem: str


class EstopRecord:
    """A record on a disk, kept by two threads.

    The first thread marks presses. The second one carries out the requests, and of several only the newest: a reset
    cannot overtake a later press. The loop and the threads exchange immutable values without a lock, so the loop
    waits for neither.
    """

    def __init__(self, disk: Disk, *, period_s: float = PERIOD_S, read_limit_s: float = READ_LIMIT_S) -> None:
        """Read the record, for `read_limit_s` at most: after that it counts as one that cannot be read.

        Args:
            disk: where the record lies.
            period_s: how often the disk is looked at.
            read_limit_s: how long this may block.
        """
        self._disk = disk
        self._period_s = period_s
        # Its `put` never blocks: it takes no lock that a descheduled thread could hold.
        self._requests: queue.SimpleQueue[_Request | None] = queue.SimpleQueue()
        self._presses: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self._marked = 0
        """The number of the last press that was marked, or could not be."""
        self._on_change: Callable[[], None] | None = None
        self._found = True
        self._was_read, self._ended = threading.Event(), threading.Event()
        self._done = _Done(0, "")
        threading.Thread(target=self._run, name="e-stop record", daemon=True).start()
        threading.Thread(target=self._mark, name="e-stop mark", daemon=True).start()
        if not self._was_read.wait(read_limit_s):
            _log.warning("the e-stop record was not read within %g s, so the e-stop is latched", read_limit_s)
        self._latched_at_start = self._latched = self._found
        self._asked = _Request(0, _Wish.PREPARED)
        self._ask(_Wish.LATCHED if self._latched else _Wish.PREPARED)

    @property
    def latched_at_start(self) -> bool:
        return self._latched_at_start

    @property
    def is_pending(self) -> bool:
        return self._done.number != self._asked.number

    @property
    def is_marked(self) -> bool:
        asked = self._asked
        return asked.wish is not _Wish.LATCHED or self._marked >= asked.number or not self.is_pending

    @property
    def problem(self) -> str:
        done = self._done
        return done.problem if done.number == self._asked.number else _PENDING[self._asked.wish]

    def watch(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change

    def keep(self, *, latched: bool) -> None:
        if latched is not self._latched:
            self._latched = latched
            self._ask(_Wish.LATCHED if latched else _Wish.RESET)

    def close(self) -> None:
        self._presses.put(None)
        self._requests.put(None)
        self._ended.wait(CLOSE_LIMIT_S)

    def _ask(self, wish: _Wish) -> None:
        self._asked = _Request(self._asked.number + 1, wish)
        if wish is _Wish.LATCHED:
            self._presses.put(self._asked.number)
        self._requests.put(self._asked)

    # --- on the threads

    def _mark(self) -> None:
        """Mark each press at once, also while the other thread waits for the disk."""
        while (number := self._presses.get()) is not None:
            with suppress(Exception):  # the other thread finds the same, and reports it
                self._disk.mark(self._wants_latched)
            self._marked = number
            self._announce()

    def _run(self) -> None:
        try:
            self._found = self._disk.read()
        except Exception as error:  # noqa: BLE001 - whatever it is, nothing is proven
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
        """Whether the newest request is a press: it is known before either thread acts on it."""
        return self._asked.wish is _Wish.LATCHED

    def _next(self, limit_s: float | None) -> tuple[_Request | None, bool]:
        """The newest request, None if there is none within `limit_s`, and whether `close` was called."""
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
        """Whether the last attempt succeeded and the disk has not changed since."""
        try:
            return not self._done.problem and self._disk.holds(latched=request.wish is _Wish.LATCHED)
        except OSError:
            return False

    def _carry_out(self, request: _Request) -> _Request:
        """Try a request; returns what is left to do should it have to be done again."""
        problem = ""
        try:
            if request.wish is _Wish.LATCHED:
                self._disk.latch()
            else:
                if request.wish is _Wish.RESET:
                    self._disk.clear(lambda: not self._wants_latched())
                    # A record that appears from now on was not reset.
                    request = request._replace(wish=_Wish.PREPARED)
                self._disk.prepare()
        except Exception as error:  # noqa: BLE001 - supervision goes on, and the status names it
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
    """A record without a disk, for as long as the object lives: for a supervisor in a test or a simulation."""

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
        """There is nothing to finish."""
