"""The inbox that passes samples from the network's threads to asyncio, what it keeps, and the types of its items."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Hashable
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

SOURCES_DEPTH = 64
"""Maximum number of command source names kept between two takes."""
FOREIGN_DEPTH = 1024
"""Maximum number of changes of foreign nodes' tokens kept between two statuses; a large ROS 2 system starts with hundreds."""
PLACES = 8
"""Maximum number of writers of one key with a place of their own."""
KEEPS_PLACE_S = 2.0
"""How long a silent writer keeps its place; longer than the pauses of a real sensor."""

T = TypeVar("T")


class BusError(Exception):
    """The Bus cannot be opened or used; the message says what to do next."""


class NoReplyError(BusError):
    """No reply to a query arrived in time."""


class RawArrival(NamedTuple):
    """One sample of a known key, as received bytes."""

    payload: bytes
    attachment: bytes | None
    arrival_s: float


class Overheard(NamedTuple):
    """One sample of any key, as received bytes, for inspection tools."""

    key: str
    """The full key, including the namespace."""
    payload: bytes
    attachment: bytes | None
    arrival_s: float


class Wake(Protocol):
    """Wakes a service: an `asyncio.Event`, or an object that runs the service at once (`wire.host.turns.Turns`)."""

    def set(self) -> None:
        """Wake the service; called in its event loop after an item has arrived."""
        ...


class Token(Protocol):
    """A liveliness token; it exists until it is withdrawn or its process ends."""

    def withdraw(self) -> None: ...


@dataclass(frozen=True, slots=True)
class LivelinessChange:
    """A node's liveliness token appeared or disappeared. All changes are reported, even those that cancel each other."""

    node: str
    alive: bool
    arrival_s: float
    epoch: bytes = b""
    """Of the token of one run of the node (`topics.alive`); empty for the node's token."""


async def wait_until(wake: asyncio.Event, time_s: float) -> None:
    """Wait until `wake` is set or the loop's clock reaches `time_s`, so that a service never depends on a message."""
    try:
        async with asyncio.timeout_at(time_s):
            await wake.wait()
    except TimeoutError:
        return


async def woken_by(wake: asyncio.Event, time_s: float) -> None:
    """Wait like `wait_until`, but cheaper: at `time_s` a timer sets `wake`, so no timeout exception is raised."""
    timer = asyncio.get_running_loop().call_at(time_s, wake.set)
    try:
        await wake.wait()
    finally:
        timer.cancel()


class Newest(Generic[T]):
    """The newest items of all writers together, bounded by number, and by size if a limit is given.

    Args:
        depth: the maximum number of items.
        size_limit: the maximum size of all items together; a larger single item is dropped.
        size_of: returns the size of an item.
    """

    def __init__(self, depth: int, size_limit: int = 0, size_of: Callable[[T], int] = lambda _: 0) -> None:
        self._depth, self._size_limit, self._size_of = depth, size_limit, size_of
        self._items: deque[T] = deque()
        self._size = 0

    def __len__(self) -> int:
        return len(self._items)

    def add(self, item: T) -> int:
        """Keep an item; return how many items were dropped, this one included."""
        self._items.append(item)
        self._size += self._size_of(item)
        dropped = 0
        while len(self._items) > self._depth or self._size > self._size_limit:
            self._size -= self._size_of(self._items.popleft())
            dropped += 1
        return dropped

    def take(self) -> list[T]:
        """Remove and return all items, oldest first."""
        items = list(self._items)
        self._items.clear()
        self._size = 0
        return items


class NewestOfEachWriter(Generic[T]):
    """The newest item of each of `PLACES` writers, added and taken as those of `Newest`.

    If all writers of a key share one place, a flood by one of them displaces every other writer's sample. If each writer
    has a place, a flood displaces only its own samples. The number of places is bounded, and a flood may use a new writer
    name in every sample. Therefore a writer whose sample was taken before keeps its place while it is heard, and samples
    of unknown writers are dropped. A writer that copies another writer's name shares its place.

    Args:
        writer_of: returns the writer of an item.
        arrival_s_of: returns the arrival time of an item [s]; it never decreases.
    """

    def __init__(self, writer_of: Callable[[T], Hashable], arrival_s_of: Callable[[T], float]) -> None:
        self._writer_of = writer_of
        self._arrival_s_of = arrival_s_of
        self._items: dict[Hashable, T] = {}
        """Items by writer, in the order of arrival."""
        self._known: dict[Hashable, float] = {}
        """The writers with a place, and when each was last heard; at most `PLACES`."""

    def __len__(self) -> int:
        return len(self._items)

    def add(self, item: T) -> int:
        writer, now_s = self._writer_of(item), self._arrival_s_of(item)
        if writer in self._known:
            self._known[writer] = now_s
        if self._items.pop(writer, None) is not None:
            self._items[writer] = item
            return 1
        if len(self._items) < PLACES:
            self._items[writer] = item
            return 0
        if writer in self._known:
            # There are at most as many known writers as places, so one of the stored writers is unknown.
            del self._items[next(other for other in reversed(self._items) if other not in self._known)]
            self._items[writer] = item
        return 1

    def take(self) -> list[T]:
        items = list(self._items.values())
        if items:
            self._give_places(self._arrival_s_of(items[-1]))
        self._items.clear()
        return items

    def _give_places(self, now_s: float) -> None:
        """Give free places to the writers of this take, in the order of arrival."""
        self._known = {w: heard_s for w, heard_s in self._known.items() if now_s - heard_s <= KEEPS_PLACE_S}
        for writer, item in self._items.items():
            if len(self._known) < PLACES:
                self._known.setdefault(writer, self._arrival_s_of(item))


class Inbox(Generic[T]):
    """A bounded queue from any thread into one event loop.

    Args:
        depth: the maximum number of items; beyond it, the oldest are dropped.
        wake: set when an item arrives.
        kept: storage that is used instead of one of `depth` items, and that decides which items are dropped.
    """

    def __init__(
        self, depth: int, wake: Wake | None, kept: Newest[T] | NewestOfEachWriter[T] | None = None
    ) -> None:
        self._kept = Newest[T](depth) if kept is None else kept  # not thread-safe: every call holds the lock
        self._wake = wake
        self._loop = asyncio.get_running_loop()
        self._context = copy_context()
        """Context of the receiver, in which `wake` is set; what it schedules then also runs in it, not in the sender's."""
        self._woken = False
        self._lock = threading.Lock()
        self.overflowed = 0
        """Number of items dropped since the start."""

    def push(self, item: T, *, wakes: bool = True) -> None:
        """Add an item and wake the loop; never blocks, never raises, safe on any thread."""
        with self._lock:
            self.overflowed += self._kept.add(item)
            if self._wake is None or self._woken or not wakes:
                return
            self._woken = True
        with suppress(RuntimeError):  # the loop has closed
            self._loop.call_soon_threadsafe(self._wake.set, context=self._context)

    @property
    def is_empty(self) -> bool:
        return not len(self._kept)

    def take(self) -> list[T]:
        """Remove and return all items since the last take, oldest first."""
        if not len(self._kept) and not self._woken:
            return []
        with self._lock:
            items = self._kept.take()
            self._woken = False
        return items
