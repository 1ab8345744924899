"""The ROS 2 node for a robot with rmw_zenoh: its keys and tokens on a Zenoh session, without rclpy.

The session is a client of the robot's router. A token disappears within milliseconds after its process was killed, so
it also detects the death of a source. Callbacks run on Zenoh's threads; an exception in one ends the process (`on_failure`).
"""

import asyncio
import logging
import math
import threading
import time
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import ParamSpec

from ros2 import ros
from ros2.rmw_keys import (
    ANY_HASH,
    TRIGGER,
    TYPE_HASHES,
    Announced,
    Kind,
    announced_by,
    data_key,
    endpoint_token,
    gid_of,
    is_of,
    node_token,
    stamp_of,
    tokens_on,
    with_hash,
)
from ros2.ros import Endpoint
from ros2.samples import Sample
from wire import cdr
from wire.host.pauses import wall_ahead_ns
from wire.inbox import Overheard
from wire.stamp import Stamp, parse_stamp
from wire.zenoh.session import ZenohSession

_log = logging.getLogger(__name__)

P = ParamSpec("P")

NODE = "/lifeline"
RECENT_S = 2.0
"""How long a report names a problem after the last refused message."""


class RmwZenoh:
    """Lifeline's node in a ROS 2 domain over Zenoh.

    Args:
        session: a session with the domain as its namespace, as a client of the robot's router; `close` closes it.
        domain_id: the ROS domain.
        on_failure: called on any thread with an exception of a callback; it must end the process.
    """

    discovery = "rmw_zenoh's token"
    name = NODE

    def __init__(
        self, session: ZenohSession, domain_id: int, on_failure: Callable[[BaseException], None]
    ) -> None:
        self._session, self._domain_id, self._on_failure = session, domain_id, on_failure
        self._loop = asyncio.get_running_loop()
        self._numbers = count(1)
        self._at_start: list[Callable[[], object]] = [
            partial(session.declare_token, node_token(domain_id, session.session_id, NODE))
        ]
        self._watched: dict[str, list[Callable[[], None]]] = {}
        self._lock = threading.Lock()
        self._live: dict[str, Announced] = {}
        """By token."""
        self._refused_s: dict[str, float] = {}
        """When the last message without rmw_zenoh's attachment arrived, by topic."""

    def start(self) -> None:
        """Begin to receive; call it after all declarations."""
        for topic in self._watched:
            self._session.watch_tokens(tokens_on(self._domain_id, topic), self._on_token)
        for declare in self._at_start:
            declare()

    def subscribe(
        self,
        topic: str,
        type_name: str,
        heard: Callable[[Sample], None],
        matched: Callable[[], None],
        *,
        quality: ros.Quality = ros.Quality.BEST_EFFORT,
    ) -> None:
        """Call `heard` for each stamped message, and `matched` when a publisher appears or disappears.

        The hash of the type is not compared, because a robot of another ROS 2 release has another one for the same message.
        A Bool needs no stamp, because its age is not used: an e-stop works without it.
        """
        expression = f"{self._domain_id}/{data_key(topic, type_name, ANY_HASH)}"
        self._watch(topic, matched)
        self._announce(
            Kind.SUBSCRIPTION, topic, type_name, is_reliable=quality is not ros.Quality.BEST_EFFORT
        )

        def on_sample(overheard: Overheard) -> None:
            if overheard.payload and is_of(overheard.key, expression):
                self._take(topic, overheard, heard, needs_stamp=type_name != ros.BOOL)

        self._at_start.append(partial(self._session.hear, expression, self._guarded(on_sample)))

    def publisher(self, topic: str, type_name: str, matched: Callable[[], None]) -> Callable[[bytes], None]:
        """Return a function that publishes CDR bytes without waiting.

        `matched` is called when a subscription appears or disappears.
        """
        self._watch(topic, matched)
        gid = gid_of(self._announce(Kind.PUBLISHER, topic, type_name, depth=1))
        out = self._session.publisher_on(data_key(topic, type_name, TYPE_HASHES[type_name]))
        sequence = count(1)

        def publish(payload: bytes) -> None:
            out.put_bytes(payload, Stamp(next(sequence), time.time_ns(), gid).pack())

        return publish

    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None:
        """Answer a `std_srvs/srv/Trigger` service; the handler may wait, on a thread of its own."""

        async def answer(_: bytes) -> bytes:
            success, message = await asyncio.to_thread(handler)
            return cdr.trigger_response(success=success, message=message)

        self._announce(Kind.SERVICE, name, TRIGGER)
        key = data_key(name, TRIGGER, TYPE_HASHES[TRIGGER])
        self._at_start.append(
            partial(self._session.serve_raw, key, answer, stamp_reply=_stamp_reply, is_complete=True)
        )

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return all publishers of a topic, this node's included."""
        return [one.endpoint for one in self._announced(Kind.PUBLISHER, topic)]

    def subscriptions(self, topic: str) -> list[Endpoint]:
        """Return all subscriptions of a topic, this node's included."""
        return [with_hash(one) for one in self._announced(Kind.SUBSCRIPTION, topic)]

    def problem(self, topic: str) -> str | None:
        """Return a sentence if messages of a topic were refused lately; None if none was."""
        if time.monotonic() - self._refused_s.get(topic, -math.inf) > RECENT_S:
            return None
        return (
            f"messages on {topic} have no attachment of rmw_zenoh, so their age is unknown and they are refused: "
            "publish them with rmw_zenoh, or correct the topic in [ros2]"
        )

    def close(self) -> None:
        """Leave the domain: close the session; call it on another thread than the event loop's."""
        asyncio.run_coroutine_threadsafe(self._session.close(), self._loop).result()

    def _watch(self, topic: str, matched: Callable[[], None]) -> None:
        self._watched.setdefault(topic, []).append(matched)

    def _announce(
        self, kind: Kind, topic: str, type_name: str, *, is_reliable: bool = True, depth: int = 10
    ) -> str:
        """Declare the token of one of this node's endpoints at the start, and return it."""
        token = endpoint_token(
            self._domain_id,
            self._session.session_id,
            NODE,
            next(self._numbers),
            kind,
            topic,
            type_name,
            TYPE_HASHES[type_name],
            is_reliable=is_reliable,
            depth=depth,
        )
        self._at_start.append(partial(self._session.declare_token, token))
        announced = announced_by(token)
        if announced is not None:
            self._live[token] = announced
        return token

    def _announced(self, kind: Kind, topic: str) -> list[Announced]:
        with self._lock:
            return [one for one in self._live.values() if one.kind is kind and one.topic == topic]

    def _on_token(self, token: str, alive: bool) -> None:  # noqa: FBT001 - as wire.zenoh.session.TokenChange
        announced = announced_by(token)
        if announced is None:
            return
        with self._lock:
            if not alive:
                self._live.pop(token, None)
            else:
                self._live[token] = announced
        for matched in self._watched.get(announced.topic, ()):
            self._guarded(matched)()

    def _take(
        self, topic: str, overheard: Overheard, heard: Callable[[Sample], None], *, needs_stamp: bool
    ) -> None:
        payload, arrival_s = overheard.payload, overheard.arrival_s
        stamp = stamp_of(overheard.attachment)
        if stamp is not None:
            ahead_ns = wall_ahead_ns()
            source_time_ns = stamp.source_time_ns - ahead_ns
            heard(Sample(payload, arrival_s, source_time_ns, stamp.sequence, stamp.gid, ahead_ns))
            return
        if not needs_stamp:
            heard(Sample(payload, arrival_s, 0, 0))
            return
        if topic not in self._refused_s:
            _log.warning("a message on %s without an attachment of rmw_zenoh was refused", topic)
        self._refused_s[topic] = arrival_s

    def _guarded(self, callback: Callable[P, None]) -> Callable[P, None]:
        """Return a callback for Zenoh's threads, on which an exception would only be printed."""

        def call(*args: P.args, **kwargs: P.kwargs) -> None:
            try:
                callback(*args, **kwargs)
            except BaseException as error:  # noqa: BLE001 - on_failure ends the process
                self._on_failure(error)

        return call


def _stamp_reply(asked: bytes | None) -> bytes | None:
    """Return the attachment of a reply: the number and the identity of its request, by which a client recognizes it."""
    request = parse_stamp(asked)
    return None if request is None else Stamp(request.sequence, time.time_ns(), request.gid).pack()
