"""The Bus that the services speak to, and the inbox that carries samples from its threads into asyncio.

A service owns one `asyncio.Event`, passes it to every subscription as `wake`, and takes what arrived:

    wake = asyncio.Event()
    scans = bus.subscribe(topics.SCAN, wake=wake)
    while True:
        await wake.wait()
        wake.clear()
        for arrival in scans.take(): ...

Arrivals are stamped on the network's thread with the loop's own monotonic clock, so that a sample
which waited for a busy loop does not look fresh.
"""

import asyncio
import logging
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

from wire.messages import M, Message, TriggerResponse, UndecodableError, decode
from wire.newest import Kept, Newest, NewestOfEachWriter
from wire.stamp import Stamp, parse_stamp
from wire.topics import Service, Topic

_log = logging.getLogger(__name__)

REPORT_PERIOD_S = 1.0
"""At most one log line in this time for undecodable payloads of one key."""

SOURCES_DEPTH = 64
"""Names of command sources kept between two looks."""

ServiceHandler = Callable[[str], Awaitable[TriggerResponse]]
"""Told the query's text (empty where it has none); what it returns is the answer."""


class BusError(Exception):
    """The Bus cannot be opened or used; the message says what to do next."""


class NoReplyError(BusError):
    """Nobody answered a query in time."""


class RawArrival(NamedTuple):
    """One sample as it came, for whoever keeps bytes."""

    payload: bytes
    attachment: bytes | None
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Arrival(Generic[M]):
    """One sample, with when it came by the loop's clock [s] and what its sender says of it."""

    message: M | None
    """None: the payload was not a message of the topic's type."""
    arrival_s: float
    stamp: Stamp | None


@dataclass(frozen=True, slots=True)
class LivelinessChange:
    """A node's token appeared or went. Every change is told, also those that cancel out at once."""

    node: str
    alive: bool
    arrival_s: float


async def wait_until(wake: asyncio.Event, time_s: float) -> None:
    """Until something came, or the loop's time has come: a service owns its timer and waits for no message."""
    try:
        async with asyncio.timeout_at(time_s):
            await wake.wait()
    except TimeoutError:
        return


async def woken_by(wake: asyncio.Event, time_s: float) -> None:
    """As `wait_until`, for whoever waits many times a second: the time sets `wake` as well, and raises nothing inside."""
    timer = asyncio.get_running_loop().call_at(time_s, wake.set)
    try:
        await wake.wait()
    finally:
        timer.cancel()


T = TypeVar("T")


class Inbox(Generic[T]):
    """A bounded queue from any thread into one event loop.

    Args:
        depth: how many items it holds; of more, the oldest give way.
        wake: set when an item arrives.
        kept: what holds the items instead, and decides which give way.
    """

    def __init__(self, depth: int, wake: asyncio.Event | None, kept: Kept[T] | None = None) -> None:
        self._kept: Kept[T] = Newest(depth) if kept is None else kept
        self._wake = wake
        self._loop = asyncio.get_running_loop()
        self._woken = False
        self._lock = threading.Lock()
        self.overflowed = 0
        """How many items had to give way since the start."""

    def push(self, item: T, *, wakes: bool = True) -> None:
        """Hand an item over and wake the loop; never blocks, never raises, safe on any thread."""
        with self._lock:
            self.overflowed += self._kept.add(item)
            if self._wake is None or self._woken or not wakes:
                return
            self._woken = True
        with suppress(RuntimeError):  # the loop has closed: nobody is left to wake
            self._loop.call_soon_threadsafe(self._wake.set)

    def take(self) -> list[T]:
        """Everything since the last take, oldest first."""
        if not len(self._kept):
            return []
        with self._lock:
            items = self._kept.take()
            self._woken = False
        return items


class Subscription(Generic[M]):
    """What arrived on one topic. Payloads are decoded here, in the loop, not on the network's thread."""

    def __init__(
        self,
        key: str,
        message_type: type[M],
        *,
        depth: int,
        wake: asyncio.Event | None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> None:
        self.key = key
        self._type = message_type
        self._repeats_wake = repeats_wake
        self._last_payload: bytes | None = None
        kept = NewestOfEachWriter(_writer, _arrival_s) if per_writer else None
        self._inbox: Inbox[RawArrival] = Inbox(depth, wake, kept)
        self._next_report_s = 0.0
        self.undecodable = 0

    @property
    def overflowed(self) -> int:
        """How many samples gave way to newer ones before they were taken."""
        return self._inbox.overflowed

    def push(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        """For the Bus: a sample arrived."""
        wakes = self._repeats_wake or payload != self._last_payload
        self._last_payload = payload
        self._inbox.push(RawArrival(payload, attachment, arrival_s), wakes=wakes)

    def take(self) -> list[Arrival[M]]:
        """Every sample since the last take that is kept, oldest first."""
        return [self._decode(*item) for item in self._inbox.take()]

    def take_raw(self) -> list[RawArrival]:
        """As `take`, but the bytes as they came."""
        return self._inbox.take()

    def latest(self) -> Arrival[M] | None:
        """The newest decodable sample since the last take; None where there is none."""
        return next((a for a in reversed(self.take()) if a.message is not None), None)

    def _decode(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> Arrival[M]:
        try:
            message = decode(payload, self._type)
        except UndecodableError as error:
            self.undecodable += 1
            if arrival_s >= self._next_report_s:
                self._next_report_s = arrival_s + REPORT_PERIOD_S
                _log.warning(
                    "%s: not a %s, ignored (%d so far): %s",
                    self.key,
                    self._type.__msgtype__,
                    self.undecodable,
                    error,
                )
            message = None
        return Arrival(message, arrival_s, parse_stamp(attachment))


def _writer(arrival: RawArrival) -> bytes | None:
    """The run of a writer that sent a sample; all that send no stamp count as one."""
    stamp = parse_stamp(arrival.attachment)
    return None if stamp is None else stamp.gid


def _arrival_s(arrival: RawArrival) -> float:
    return arrival.arrival_s


M_contra = TypeVar("M_contra", bound=Message, contravariant=True)


class Publisher(Protocol[M_contra]):
    """Sends one topic's messages, each with the next stamp of this run. Never blocks, never raises on a dead link."""

    def put(self, message: M_contra, true_at_s: float | None = None) -> None:
        """Send a message.

        Args:
            message: what to say.
            true_at_s: when it was true, by the loop's clock; None: now. Who is held up between deciding and saying
                so says something old, and its stamp has to show that.
        """
        ...

    def begin_anew(self) -> None:
        """Speak as a new run of the source from now on: with a new epoch."""
        ...


class Token(Protocol):
    """A liveliness token: it stands until it is withdrawn or its process ends."""

    def withdraw(self) -> None: ...


class Bus(Protocol):
    """One process's access to the wire."""

    def publisher(self, topic: Topic[M]) -> Publisher[M]: ...

    def subscribe(
        self,
        topic: Topic[M],
        *,
        depth: int = 1,
        wake: asyncio.Event | None = None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> Subscription[M]:
        """Take part in a topic.

        Args:
            topic: what to hear.
            depth: how many samples are kept until they are taken; of more, the oldest give way.
            wake: set when a sample arrives.
            repeats_wake: whether also a sample with the same payload as the one before it sets `wake`.
            per_writer: keep the newest sample of each writer instead (wire/newest.py), whatever `depth` is, so that a
                flood displaces no other writer's sample. A writer is the epoch in its samples' stamps.
        """
        ...

    def hear_sources(self) -> Inbox[str]:
        """The name of every command source that speaks, each time that it does."""
        ...

    def declare_alive(self, node: str) -> Token: ...

    def watch_alive(self, wake: asyncio.Event | None = None) -> Inbox[LivelinessChange]:
        """Every change of any node's token, from those that stand now."""
        ...

    def serve(self, service: Service, handler: ServiceHandler) -> None:
        """Answer a service's queries with what the handler, run in this loop, returns."""
        ...

    async def call(self, service: Service, text: str = "", *, timeout_s: float = 1.0) -> TriggerResponse:
        """Ask a service, with a text where it takes one.

        Raises:
            NoReplyError: nobody answered within `timeout_s`.
        """
        ...

    async def close(self) -> None:
        """Withdraw everything and leave; ends within about a second whatever the peers do."""
        ...
