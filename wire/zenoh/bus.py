"""The Bus over Zenoh: messages on top of a session that sends and receives bytes (session.py)."""

import logging
import time
from collections.abc import Callable, Collection
from typing import Any

from wire import topics
from wire.bus import ServiceHandler, Subscription
from wire.bus_config import DEFAULT_ENDPOINT, BusConfig
from wire.inbox import SOURCES_DEPTH, Inbox, LivelinessChange, Overheard, Wake
from wire.messages import (
    M,
    Message,
    String,
    TriggerResponse,
    Twist,
    UndecodableError,
    decode,
    encode,
    request_text,
)
from wire.stamp import Stamp
from wire.topics import Service, Topic
from wire.zenoh.connect import Role, open_session
from wire.zenoh.hub_proof import HubProof
from wire.zenoh.session import RawPublisher, ZenohSession

__all__ = ["DEFAULT_ENDPOINT", "BusConfig", "Fleet", "ZenohBus", "open_bus", "open_fleet"]

_log = logging.getLogger(__name__)


async def open_bus(
    config: BusConfig,
    role: Role,
    *,
    on_wait: Callable[[], None] | None = None,
    say: Callable[[str], None] = _log.warning,
    proof: HubProof | None = None,
) -> "ZenohBus":
    """Open a session and return its Bus; a client waits for its hub without a time limit.

    Args:
        config: the endpoint and the namespace.
        role: `hub` listens, `client` connects.
        on_wait: called once if the hub does not run yet.
        say: called in this event loop with a sentence about a certificate that ends, now or later.
        proof: of a client that takes part.

    Raises:
        BusError: the hub cannot listen, the endpoint is invalid, or a certificate is refused.
    """
    session = await open_session(config, role, on_wait=on_wait, say=say, proof=proof)
    return ZenohBus(session, config.namespace, is_hub=role == "hub", proof=proof)


class ZenohPublisher(RawPublisher):
    """Publishes the messages of one topic."""

    def put(self, message: Any, true_at_s: float | None = None) -> Stamp:  # noqa: ANN401 - as Publisher[M] for its topic's M
        stamp = self.next_stamp(true_at_s)
        self.put_bytes(encode(message), stamp.pack())
        return stamp


class ZenohBus(ZenohSession):
    """A Bus over one Zenoh session."""

    def publisher(self, topic: Topic[M]) -> ZenohPublisher:
        return ZenohPublisher(self._session, self._key(topic.key), fresh_only=topic.fresh_only)

    def subscribe(
        self,
        topic: Topic[M],
        *,
        depth: int = 1,
        wake: Wake | None = None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> Subscription[M]:
        subscription = Subscription(
            self._key(topic.key),
            topic.type,
            depth=depth,
            wake=wake,
            repeats_wake=repeats_wake,
            per_writer=per_writer,
        )
        self.subscribe_raw(topic.key, subscription.push)
        return subscription

    def subscribe_sources(
        self, names: Collection[str], *, depth: int, wake: Wake
    ) -> tuple[dict[str, Subscription[Twist]], Inbox[str]]:
        subscriptions = {
            name: Subscription(
                self._key(topics.source_cmd_vel(name).key), Twist, depth=depth, wake=wake, repeats_wake=False
            )
            for name in names
        }
        others: Inbox[str] = Inbox(SOURCES_DEPTH, None)
        self.subscribe_sources_raw({name: one.push for name, one in subscriptions.items()}, others.push)
        return subscriptions, others

    def serve(self, service: Service, handler: ServiceHandler) -> None:
        async def answer(request: bytes) -> bytes:
            return encode(await _answer(request, handler))

        self.serve_raw(service.key, answer)

    async def call(self, service: Service, text: str = "", *, timeout_s: float = 1.0) -> TriggerResponse:
        def read(reply: bytes) -> TriggerResponse | None:
            try:
                return decode(reply, TriggerResponse)
            except UndecodableError as error:
                _log.warning("%s: ignored a reply that is not a Trigger response: %s", service.key, error)
                return None

        request = encode(String(text)) if text else None
        return await self.call_raw(service.key, request, read, timeout_s=timeout_s)


FLEET_DEPTH = 4096
"""Maximum number of statuses and token changes of all robots that wait."""


class Fleet:
    """The supervisors of all robots behind one endpoint: their tokens and statuses."""

    def __init__(self, session: ZenohSession) -> None:
        self._session = session
        self._publishers: dict[tuple[str, str], RawPublisher] = {}
        self.tokens: Inbox[LivelinessChange] = Inbox(FLEET_DEPTH, None)
        """Changes of the supervisors' tokens; the node is the robot's namespace."""
        session.watch_tokens(
            f"*/{topics.alive(topics.SUPERVISOR)}",
            lambda key, alive: self.tokens.push(
                LivelinessChange(key.partition("/")[0], alive, time.monotonic())
            ),
        )
        self.statuses: Inbox[Overheard] = session.overhear(f"*/{topics.STATUS.key}", depth=FLEET_DEPTH)

    def put(self, robot: str, topic: Topic[M], message: Message) -> None:
        """Send a message of a topic to one robot."""
        publisher = self._publishers.get((robot, topic.key))
        if publisher is None:
            publisher = self._session.publisher_raw(topic, namespace=robot)
            self._publishers[robot, topic.key] = publisher
        publisher.put_bytes(encode(message))

    async def close(self) -> None:
        await self._session.close()


async def open_fleet(config: BusConfig, proof: HubProof | None = None) -> Fleet:
    """Connect to a router, or to the hub of one robot, and watch all supervisors behind it.

    Args:
        config: the endpoint; the namespace is unused.
        proof: of a client that must not believe a status of another user's program.

    Raises:
        BusError: the endpoint is invalid, or a certificate is refused.
    """
    session = await open_session(config, "client", proof=proof)
    return Fleet(ZenohSession(session, config.namespace, proof=proof))


async def _answer(request: bytes, handler: ServiceHandler) -> TriggerResponse:
    try:
        text = request_text(request)
    except UndecodableError:
        return TriggerResponse(success=False, message="the request is not a std_msgs/msg/String")
    return await handler(text)
