"""The inbox that passes samples from the network's threads to asyncio, and the types of its items."""

import asyncio
import threading
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

from wire.newest import Kept, Newest

SOURCES_DEPTH = 64
"""Maximum number of command source names kept between two takes."""
FOREIGN_DEPTH = 1024
"""Maximum number of changes of foreign nodes' tokens kept between two statuses; a large ROS 2 system starts with hundreds."""


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


T = TypeVar("T")


class Inbox(Generic[T]):
    """A bounded queue from any thread into one event loop.

    Args:
        depth: the maximum number of items; beyond it, the oldest are dropped.
        wake: set when an item arrives.
        kept: storage that is used instead of one of `depth` items, and that decides which items are dropped.
    """

    def __init__(self, depth: int, wake: Wake | None, kept: Kept[T] | None = None) -> None:
        self._kept: Kept[T] = Newest(depth) if kept is None else kept
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
