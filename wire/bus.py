"""The Bus that the services use: it sends and receives messages.

A service owns one `Wake`, such as an `asyncio.Event`, passes it to every subscription as `wake`, and takes the arrivals:

    wake = asyncio.Event()
    scans = bus.subscribe(topics.SCAN, wake=wake)
    while True:
        await wake.wait()
        wake.clear()
        for arrival in scans.take(): ...

Arrivals are stamped on the network's thread with the loop's monotonic clock, so that a sample
that waited for a busy loop does not look fresh.
"""

import logging
from collections.abc import Awaitable, Callable, Collection
from operator import attrgetter
from typing import Generic, NamedTuple, Protocol, TypeVar

from wire.inbox import (
    BusError,
    Inbox,
    LivelinessChange,
    NewestOfEachWriter,
    NoReplyError,
    Overheard,
    RawArrival,
    Token,
    Wake,
    wait_until,
    woken_by,
)
from wire.messages import M, Message, TriggerResponse, Twist, UndecodableError, decode
from wire.stamp import Stamp, parse_stamp
from wire.topics import Service, Topic

__all__ = [
    "Arrival",
    "Bus",
    "BusError",
    "Inbox",
    "LivelinessChange",
    "NoReplyError",
    "Overheard",
    "Publisher",
    "RawArrival",
    "ServiceHandler",
    "Subscription",
    "Token",
    "Wake",
    "wait_until",
    "woken_by",
]

_log = logging.getLogger(__name__)

REPORT_PERIOD_S = 1.0
"""Minimum time between two log lines about undecodable payloads of one key."""

R = TypeVar("R")

ServiceHandler = Callable[[str], Awaitable[TriggerResponse]]
"""Called with the text of the query (empty if it has none); returns the response."""


class Arrival(NamedTuple, Generic[R]):
    """One decoded sample, with its arrival time by the loop's clock [s] and its sender's stamp."""

    message: R | None
    """None if the payload was not a message of the topic's type."""
    arrival_s: float
    stamp: Stamp | None


class Subscription(Generic[M]):
    """The samples of one topic. Payloads are decoded here, in the event loop, not on the network's thread."""

    def __init__(
        self,
        key: str,
        message_type: type[M],
        *,
        depth: int,
        wake: Wake | None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> None:
        self.key = key
        self._type = message_type
        self._repeats_wake = repeats_wake
        self._last_payload: bytes | None = None
        kept = NewestOfEachWriter(_writer, attrgetter("arrival_s")) if per_writer else None
        self._inbox: Inbox[RawArrival] = Inbox(depth, wake, kept)
        self._next_report_s = 0.0
        self.undecodable = 0

    @property
    def overflowed(self) -> int:
        """Number of samples dropped before they were taken."""
        return self._inbox.overflowed

    @property
    def is_empty(self) -> bool:
        return self._inbox.is_empty

    def push(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        """Add a sample; called by the Bus."""
        wakes = self._repeats_wake or payload != self._last_payload
        self._last_payload = payload
        self._inbox.push(RawArrival(payload, attachment, arrival_s), wakes=wakes)

    def take(self) -> list[Arrival[M]]:
        """Remove and return the kept samples since the last take, oldest first."""
        return self.take_as(self._read)

    def take_as(self, read: Callable[[bytes], R]) -> "list[Arrival[R]]":
        """Like `take`, but decode with `read`, which raises UndecodableError for a payload that is not a valid message."""
        return [self._decode(*item, read) for item in self._inbox.take()]

    def take_raw(self) -> list[RawArrival]:
        """Like `take`, but return the received bytes."""
        return self._inbox.take()

    def latest(self) -> Arrival[M] | None:
        """Take all samples and return the newest decodable one; None if there is none."""
        return next((a for a in reversed(self.take()) if a.message is not None), None)

    def _read(self, payload: bytes) -> M:
        return decode(payload, self._type)

    def _decode(
        self, payload: bytes, attachment: bytes | None, arrival_s: float, read: Callable[[bytes], R]
    ) -> "Arrival[R]":
        try:
            message = read(payload)
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
    """Return the epoch of a sample's writer; all writers without stamps count as one."""
    stamp = parse_stamp(arrival.attachment)
    return None if stamp is None else stamp.gid


M_contra = TypeVar("M_contra", bound=Message, contravariant=True)


class Publisher(Protocol[M_contra]):
    """Publishes one topic's messages, each with the next stamp of this run; never blocks or raises on a dead link."""

    def put(self, message: M_contra, true_at_s: float | None = None) -> Stamp:
        """Send a message, and return its stamp.

        Args:
            message: the message.
            true_at_s: the time of its content by the loop's clock; None: now. If the sender is delayed between decision
                and sending, the stamp must show the age.
        """
        ...

    @property
    def epoch(self) -> bytes:
        """The epoch in the stamps of this run: 16 bytes."""
        ...

    def begin_anew(self) -> None:
        """Begin a new run of the source: later messages have a new epoch."""
        ...


class Bus(Protocol):
    """One process's access to the wire."""

    def publisher(self, topic: Topic[M]) -> Publisher[M]: ...

    def subscribe(
        self,
        topic: Topic[M],
        *,
        depth: int = 1,
        wake: Wake | None = None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> Subscription[M]:
        """Subscribe to a topic.

        Args:
            topic: the topic.
            depth: the maximum number of samples kept until they are taken; beyond it, the oldest are dropped.
            wake: set when a sample arrives.
            repeats_wake: whether a sample with the same payload as the previous one also sets `wake`.
            per_writer: ignore `depth` and keep the newest sample of each writer (wire/inbox.py), so that a flood does
                not displace other writers' samples. Writers are distinguished by the epoch in their stamps.
        """
        ...

    def subscribe_sources(
        self, names: Collection[str], *, depth: int, wake: Wake
    ) -> "tuple[dict[str, Subscription[Twist]], Inbox[str]]":
        """Subscribe to the commands of all sources, with one delivery for each command.

        An unchanged command does not set `wake`.

        Returns:
            the subscriptions by the name of their source, and an inbox that receives the name of any other source
            for each of its commands.
        """
        ...

    def hear_sources(self) -> Inbox[str]:
        """Return an inbox that receives the name of a command source for each of its commands."""
        ...

    @property
    def run_id(self) -> bytes:
        """Epoch of the token of a server: the id of its session, which Zenoh adds to each of its replies."""
        ...

    async def connected(self) -> frozenset[bytes] | None:
        """Return the ids of the sessions that are connected to the hub; None if the hub does not know all of them."""
        ...

    def declare_alive(self, node: str, epoch: bytes = b"") -> Token:
        """Declare the token of a node, or of one run of it (`topics.alive`)."""
        ...

    def watch_alive(
        self, wake: Wake | None = None, nodes: Collection[str] | None = None
    ) -> Inbox[LivelinessChange]:
        """Return an inbox for all changes of the nodes' tokens; existing tokens are reported first.

        Args:
            wake: set at a change.
            nodes: whose tokens are watched, with those of their runs; `$*` stands for any characters. None: the tokens
                of all nodes, without those of their runs.
        """
        ...

    def watch_foreign_nodes(self) -> Inbox[LivelinessChange]:
        """Return an inbox for the tokens (their full keys) of nodes that use the keys of rmw_zenoh."""
        ...

    def serve(self, service: Service, handler: ServiceHandler) -> None:
        """Answer a service's queries with the handler's responses; the handler runs in this event loop."""
        ...

    async def call(self, service: Service, text: str = "", *, timeout_s: float = 1.0) -> TriggerResponse:
        """Call a service, with a text if it takes one.

        Raises:
            NoReplyError: no reply arrived within `timeout_s`.
        """
        ...

    async def close(self) -> None:
        """Withdraw all declarations and close; takes about a second at most, whatever the peers do."""
        ...
