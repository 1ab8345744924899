"""A Zenoh session that sends and receives bytes; connect.py opens it.

Callbacks run on Zenoh's threads: they stamp the arrival, pass the bytes on, and return. They are declared with
`indirect=False`, so they are called directly when a sample arrives, without an intermediate queue that could fill up.
"""

import asyncio
import itertools
import logging
import threading
import time
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import Future
from typing import Any, TypeVar

import zenoh

from wire import topics
from wire.access import ADMIN_SPACE, HUB_ENTRY, NODE_TOKENS
from wire.inbox import (
    FOREIGN_DEPTH,
    SOURCES_DEPTH,
    BusError,
    Inbox,
    LivelinessChange,
    Newest,
    NoReplyError,
    Overheard,
    Wake,
)
from wire.runs import SESSION_BYTES, Reconnection, Runs, sessions_in
from wire.stamp import Stamp, Stamper
from wire.topics import Topic
from wire.zenoh.hub_proof import HubProof

_log = logging.getLogger(__name__)

SETTLE_S = 0.4
"""How long a client refuses samples after it has reconnected to the same hub: some are under wrong keys. Measured: for up to 0.07 s."""
CLOSE_LIMIT_S = 1.0
MAX_PENDING_QUERIES = 16
MAX_REPLIES = 4
"""Read of one query; a program can send as many as the link carries, and reading all of them would delay the loop."""
ASK_AGAIN_S = 0.02
DATAGRAM_BYTES = 1000
"""Maximum size of a payload that is sent as a datagram: a QUIC packet has 1,200 bytes at first, with all headers, key and stamp."""
OVERHEARD_BYTES = 32 << 20
"""Maximum size of the samples that wait in an inbox of `overhear`: a foreign payload may have any size."""
LIVELINESS_DEPTH = 256
MAX_SOURCE_NAME = 64
"""Names of command sources are cut at this length: a key may have 64 KiB, and the status repeats the names of unknown sources."""

Push = Callable[[bytes, bytes | None, float], None]
"""Called on Zenoh's thread with a sample's payload, its attachment and its arrival time [s]; it must not block."""
RawHandler = Callable[[bytes], Awaitable[bytes]]
"""Called with the payload of a query (empty if it has none); returns the payload of the reply."""
TokenChange = Callable[[str, bool], None]
"""Called on Zenoh's thread with the full key of a token, and whether it exists; it must not block."""
R = TypeVar("R")


async def in_thread(work: Callable[[], Any]) -> Any:  # noqa: ANN401 - any result of the work
    """Run blocking work on a daemon thread, which does not delay the end of the process, unlike an executor's."""
    future: Future[Any] = Future()
    future.set_running_or_notify_cancel()  # the waiting task may be cancelled; the work still runs to its end

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:  # noqa: BLE001 - passed to the waiting task
            future.set_exception(error)

    threading.Thread(target=run, daemon=True, name="zenoh-work").start()
    return await asyncio.wrap_future(future)


def direct(callback: Callable[[Any], None]) -> "zenoh.handlers.Callback[Any]":
    """Return a callback that Zenoh calls on its own thread, without a queue between."""
    return zenoh.handlers.Callback(callback, indirect=False)


def call_in(loop: asyncio.AbstractEventLoop, callback: Callable[[], None]) -> None:
    """Call it in the event loop; do nothing if the loop has closed, so that no reply is possible."""
    try:
        loop.call_soon_threadsafe(callback)
    except RuntimeError:
        return


def first_line(error: object) -> str:
    """Return the first line of a Zenoh error without the source location at its end."""
    return str(error).split(" at ")[0].splitlines()[0]


class RawPublisher:
    """Publishes bytes on one key, without batching, at real-time priority; drops samples instead of waiting.

    Args:
        session: the session.
        key: the full key.
        fresh_only: whether a sample is useful only until the next one. Over QUIC, it is then a datagram, which a lost
            packet does not delay; over TCP, nothing changes. A sample that does not fit in a datagram remains reliable:
            the loss or the delay of one of its fragments would lose it.
    """

    def __init__(self, session: zenoh.Session, key: str, *, fresh_only: bool) -> None:
        self._session, self._full_key = session, key
        self._small = self._declared(is_reliable=not fresh_only)
        self._large: zenoh.Publisher | None = None if fresh_only else self._small
        self._mark = _id_bytes(session.info.zid())[:SESSION_BYTES]
        self._stamper = Stamper(self._mark)

    def _declared(self, *, is_reliable: bool) -> zenoh.Publisher:
        return self._session.declare_publisher(
            self._full_key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
            reliability=zenoh.Reliability.RELIABLE if is_reliable else zenoh.Reliability.BEST_EFFORT,
        )

    @property
    def epoch(self) -> bytes:
        """The epoch in the stamps of this run; it begins as the id of the session (runs.py)."""
        return self._stamper.gid

    def next_stamp(self, true_at_s: float | None = None) -> Stamp:
        """Return the next stamp of this run.

        Args:
            true_at_s: the time of the sample's content by the loop's clock; None: now.
        """
        return self._stamper.next(true_at_s)

    def put_bytes(self, payload: bytes, attachment: bytes | None = None) -> None:
        """Send a payload.

        Args:
            payload: the encoded message.
            attachment: its stamp; None: the next stamp of this run.
        """
        stamp = self.next_stamp().pack() if attachment is None else attachment
        if len(payload) <= DATAGRAM_BYTES:
            self._small.put(payload, attachment=stamp)
            return
        if self._large is None:
            self._large = self._declared(is_reliable=True)
        self._large.put(payload, attachment=stamp)

    def begin_anew(self) -> None:
        """Begin a new epoch, as after a restart of the process."""
        self._stamper = Stamper(self._mark)


class ZenohToken:
    """A liveliness token; Zenoh also withdraws it when the process dies."""

    def __init__(self, token: zenoh.LivelinessToken, declared: list[object]) -> None:
        self._token, self._declared = token, declared
        declared.append(token)

    def withdraw(self) -> None:
        self._token.undeclare()
        self._declared.remove(self._token)


class ZenohSession:
    """The declarations of one process in a robot's namespace. Each exists until the session is closed, or a token is withdrawn.

    Args:
        session: of `open_session`.
        namespace: of the robot.
        is_hub: whether the session is the hub; it may have links to routers, as a client has to its hub.
        proof: of a client that takes part: samples, replies and queries count only while it holds.
    """

    def __init__(
        self, session: zenoh.Session, namespace: str, *, is_hub: bool = False, proof: HubProof | None = None
    ) -> None:
        self._session = session
        self._is_hub = is_hub
        self._proof = proof
        self._namespace = namespace
        self._loop = asyncio.get_running_loop()
        self._pending_queries = 0
        # A declaration exists only as long as it is referenced.
        self._declared: list[object] = []
        self._reconnection = Reconnection(SETTLE_S)
        self._runs = Runs()
        self._watched: list[Callable[[str, bytes, bool], None]] = []
        """Called for each run that ends or returns with its session."""
        self._lock = threading.Lock()  # Zenoh's callbacks run on several threads
        self._declared.append(
            session.info.declare_transport_events_listener(direct(self._on_transport), history=True)
        )
        if proof is not None:
            proof.start(session)

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        # A hub refuses no sample of its clients and its routers, since one of them may be an e-stop.
        is_to_server = event.transport.whatami != zenoh.WhatAmI.CLIENT
        is_open = event.kind == zenoh.SampleKind.PUT
        if is_to_server and self._proof is not None:
            self._proof.changed()
        if is_to_server and is_open and not self._is_hub:
            self._reconnection.opened(str(event.transport.zid), time.monotonic())
        elif not is_to_server:
            with self._lock:
                runs = self._runs.of(_id_bytes(event.transport.zid))
            for (node, epoch), tell in itertools.product(runs, self._watched):
                tell(node, epoch, is_open)

    def publisher_raw(self, topic: Topic[Any], *, namespace: str | None = None) -> RawPublisher:
        """Return a publisher of encoded messages of a topic of the robot, or of another robot behind the same router."""
        key = self._key(topic.key) if namespace is None else f"{namespace}/{topic.key}"
        return RawPublisher(self._session, key, fresh_only=topic.fresh_only)

    def publisher_on(self, key: str) -> RawPublisher:
        """Return a publisher on a key that the table of topics does not have; no sample of it may be lost."""
        return RawPublisher(self._session, self._key(key), fresh_only=False)

    def subscribe_raw(self, key: str, push: Push) -> None:
        """Call `push` for each sample on exactly this key of the robot."""
        full_key = self._key(key)
        # A put on a wildcard reaches all matching subscribers and passes the hub's access control.
        # Therefore only a sample on exactly this key is accepted.
        self._subscribe(full_key, lambda heard_on: push if heard_on == full_key else None)

    def subscribe_sources_raw(self, pushes: Mapping[str, Push], other: Callable[[str], None]) -> None:
        """Subscribe to the commands of all sources; everything is called on Zenoh's thread.

        Args:
            pushes: by the name of a source, what is called for each of its commands.
            other: called with the name of any other source for each of its commands, cut at `MAX_SOURCE_NAME`.
        """
        by_key = {self._key(topics.source_cmd_vel(name).key): push for name, push in pushes.items()}
        prefix = self._key("")

        def push_of(heard_on: str) -> Push | None:
            push = by_key.get(heard_on)
            if push is None:
                source = topics.source_of(heard_on.removeprefix(prefix))
                if source is not None:
                    other(source[:MAX_SOURCE_NAME])
            return push

        self._subscribe(self._key(topics.source_cmd_vel("*").key), push_of)

    def _subscribe(self, expression: str, push_of: Callable[[str], Push | None]) -> None:
        """Pass each sample that an expression matches to the `Push` for its full key, if there is one."""

        def on_sample(sample: zenoh.Sample) -> None:
            arrival_s = time.monotonic()
            if not (self._reconnection.is_settled(arrival_s) and self._is_proven):
                return
            push = push_of(str(sample.key_expr))
            if push is None or sample.kind != zenoh.SampleKind.PUT:
                return
            attachment = sample.attachment
            push(sample.payload.to_bytes(), None if attachment is None else attachment.to_bytes(), arrival_s)

        self._declared.append(
            self._session.declare_subscriber(
                expression, direct(on_sample), allowed_origin=zenoh.Locality.REMOTE
            )
        )

    @property
    def _is_proven(self) -> bool:
        return self._proof is None or self._proof.holds

    def hear_sources(self) -> Inbox[str]:
        """Return an inbox for the name of a command source, one for each of its commands."""
        inbox: Inbox[str] = Inbox(SOURCES_DEPTH, None)
        self.subscribe_sources_raw({}, inbox.push)
        return inbox

    def declare_alive(self, node: str, epoch: bytes = b"") -> ZenohToken:
        """Declare the liveliness token of a node or a command source of the robot, or of one run of it."""
        return self.declare_token(self._key(topics.alive(node, epoch)))

    def declare_token(self, key: str) -> ZenohToken:
        """Declare a liveliness token on any key.

        Args:
            key: the full key, including the namespace.
        """
        return ZenohToken(self._session.liveliness().declare_token(key), self._declared)

    def watch_alive(
        self, wake: Wake | None = None, nodes: Collection[str] | None = None
    ) -> Inbox[LivelinessChange]:
        """Return an inbox for the changes of the robot's liveliness tokens, with the tokens that exist already.

        Args:
            wake: set at a change.
            nodes: whose tokens are watched, with those of their runs; `$*` stands for any characters. A process that
                must notice a death watches nothing else, because a flood of other tokens would delay it. None: the
                tokens of all nodes, without those of their runs.

        At the hub, the end of a session also ends its runs, even if others hold their tokens.
        """
        inbox: Inbox[LivelinessChange] = Inbox(LIVELINESS_DEPTH, wake)
        prefix = self._key(topics.alive(""))

        def on_change(key: str, alive: bool) -> None:  # noqa: FBT001 - as TokenChange
            token = topics.token_of(key.removeprefix(prefix))
            if token is not None:
                node, epoch = token
                if epoch:
                    with self._lock:
                        self._runs.token(node, epoch, exists=alive)
                changed(node, epoch, alive)

        def changed(node: str, epoch: bytes, alive: bool) -> None:  # noqa: FBT001 - as on_change
            inbox.push(LivelinessChange(node, alive, time.monotonic(), epoch))

        self._watched.append(changed)
        for expression in ["*"] if nodes is None else [f"{node}/**" for node in nodes]:
            self.watch_tokens(f"{prefix}{expression}", on_change)
        return inbox

    def watch_foreign_nodes(self) -> Inbox[LivelinessChange]:
        """Return an inbox for the changes of the tokens of ROS 2 nodes with rmw_zenoh."""
        inbox: Inbox[LivelinessChange] = Inbox(FOREIGN_DEPTH, None)
        self.watch_tokens(
            NODE_TOKENS, lambda key, alive: inbox.push(LivelinessChange(key, alive, time.monotonic()))
        )
        return inbox

    def watch_tokens(self, expression: str, changed: TokenChange) -> None:
        """Call `changed` for each token that an expression matches: for those that exist, and at each change.

        Args:
            expression: a full key expression, including the namespace.
            changed: called on Zenoh's thread; it must not block.
        """

        def on_change(sample: zenoh.Sample) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(
            self._session.liveliness().declare_subscriber(expression, direct(on_change), history=True)
        )

    def serve_raw(
        self,
        key: str,
        handler: RawHandler,
        *,
        stamp_reply: Callable[[bytes | None], bytes | None] = lambda _: None,
        is_complete: bool = False,
    ) -> None:
        """Answer queries on a key of the robot.

        Args:
            key: the key, relative to the robot's namespace.
            handler: runs in this event loop.
            stamp_reply: returns the attachment of a reply from that of its query; called in this event loop.
            is_complete: whether a query for complete answers is also answered, as ROS 2 clients send it.
        """
        full_key = self._key(key)

        async def answer(query: zenoh.Query) -> None:
            try:
                payload, asked = query.payload, query.attachment
                response = await handler(b"" if payload is None else payload.to_bytes())
                attachment = stamp_reply(None if asked is None else asked.to_bytes())
                # A reply may wait for a stopped peer: it runs on a separate thread, never in the loop.
                await in_thread(lambda: _reply(query, full_key, response, attachment))
            finally:
                self._pending_queries -= 1

        def accept(query: zenoh.Query) -> None:
            if self._pending_queries >= MAX_PENDING_QUERIES or not self._is_proven:
                query.drop()
                return
            self._pending_queries += 1
            task = self._loop.create_task(answer(query))
            answers.add(task)
            task.add_done_callback(answers.discard)

        answers: set[asyncio.Task[None]] = set()
        self._declared.append(
            self._session.declare_queryable(
                full_key,
                direct(lambda query: call_in(self._loop, lambda: accept(query))),
                complete=is_complete,
            )
        )

    async def call_raw(
        self, key: str, request: bytes | None, read: Callable[[bytes], R | None], *, timeout_s: float
    ) -> R:
        """Query a key of the robot, and return the first reply that `read` accepts.

        Any client can answer a query whose key its queryable matches. A reply for the supervisor therefore counts only if
        it comes from the session that holds the token of the supervisor's run, which the hub refuses to all others. Of other
        replies, at most `MAX_REPLIES` are read.

        Args:
            key: the key, relative to the robot's namespace.
            request: the payload; None: no payload.
            read: returns None for a reply that is not valid; called on another thread.
            timeout_s: how long to wait.

        A cancelled call sends no query that it has not sent yet.

        Raises:
            NoReplyError: no such reply arrived in time.
        """
        full_key = self._key(key)
        is_supervisors = key == topics.SUPERVISOR_RESET.key
        abandoned = threading.Event()

        def ask() -> R | None:
            supervisors = self._holders(topics.SUPERVISOR, timeout_s) if is_supervisors else set[bytes]()
            if abandoned.is_set() or not (self._proof is None or self._proof.holds_within(timeout_s)):
                return None
            # Take each reply as it arrives: otherwise Zenoh would wait for the last of several replies.
            replies = self._session.get(
                full_key, payload=request, timeout=timeout_s, consolidation=zenoh.ConsolidationMode.NONE
            )
            for reply in replies if is_supervisors else itertools.islice(replies, MAX_REPLIES):
                if is_supervisors and _replier(reply) not in supervisors:
                    continue
                answer = None if reply.ok is None else read(reply.ok.payload.to_bytes())
                if answer is not None and self._is_proven:
                    return answer
            return None

        try:
            answer = await in_thread(ask)
        except asyncio.CancelledError:
            abandoned.set()
            raise
        if answer is None:
            raise NoReplyError(f"nobody answered {full_key} within {timeout_s:g} s")
        return answer

    async def holders(self, node: str, *, timeout_s: float = 1.0) -> set[bytes]:
        """Return the epochs of the runs of a node; empty only if there was none until the time limit."""
        return await in_thread(lambda: self._holders(node, timeout_s))

    def _holders(self, node: str, timeout_s: float) -> set[bytes]:
        """Return the epochs of the runs of a node; blocks for a round trip.

        On a busy machine, Zenoh sometimes reports no token although there is one; it is asked again until the time limit.
        """
        prefix = self._key(topics.alive(""))
        expression = f"{prefix}{node}/*"
        deadline_s = time.monotonic() + timeout_s
        while True:
            tokens = [
                topics.token_of(str(reply.ok.key_expr).removeprefix(prefix))
                for reply in self._session.liveliness().get(expression, timeout=timeout_s)
                if reply.ok is not None
            ]
            found = {token[1] for token in tokens if token is not None}
            if found or time.monotonic() >= deadline_s:
                return found
            time.sleep(ASK_AGAIN_S)

    async def connected(self, *, timeout_s: float = 1.0) -> frozenset[bytes] | None:
        """Return the ids of the sessions that are connected to the hub; None if others may be behind a router."""
        entry = await self.hub_entry(timeout_s=timeout_s)
        return next((sessions_in(payload) for payload in entry.values()), None)

    def put_raw(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Put any bytes on any key, as an attacker on the network can; for tests and the fault campaign.

        Args:
            key: the full key, including the namespace; it may contain wildcards.
            payload: any bytes; they are not checked.
            attachment: any bytes; None: no attachment.
        """
        self._session.put(key, payload, attachment=attachment)

    @property
    def session_id(self) -> str:
        """Zenoh's id of this session."""
        return str(self._session.info.zid())

    @property
    def run_id(self) -> bytes:
        """The same id as the epoch of this session's token, by which its replies are known."""
        return _id_bytes(self._session.info.zid())

    def overhear(self, expression: str, *, depth: int, wake: Wake | None = None) -> Inbox[Overheard]:
        """Return an inbox for the samples of all keys that an expression matches, such as `robot/**`.

        At most `OVERHEARD_BYTES` of them wait, and at most `depth` samples.

        Raises:
            BusError: it is not a key expression.
        """
        kept = Newest[Overheard](depth, OVERHEARD_BYTES, lambda one: len(one.payload))
        inbox: Inbox[Overheard] = Inbox(depth, wake, kept)
        self.hear(expression, inbox.push)
        return inbox

    def hear(self, expression: str, heard: Callable[[Overheard], None]) -> None:
        """Call `heard` on Zenoh's thread for the samples of all keys that an expression matches; it must not block.

        A put on a wildcard also matches, and a delete has an empty payload. After a reconnection, samples may come under
        a wrong key (wire/runs.py): none is refused for that, because one of them may be an e-stop.

        Raises:
            BusError: it is not a key expression.
        """

        def on_sample(sample: zenoh.Sample) -> None:
            arrival_s = time.monotonic()
            if not self._is_proven:
                return
            attachment = sample.attachment
            heard(
                Overheard(
                    str(sample.key_expr),
                    sample.payload.to_bytes(),
                    None if attachment is None else attachment.to_bytes(),
                    arrival_s,
                )
            )

        try:
            subscriber = self._session.declare_subscriber(
                expression, direct(on_sample), allowed_origin=zenoh.Locality.REMOTE
            )
        except zenoh.ZError as error:
            raise BusError(f"{expression!r} is not a key: {first_line(error)}") from error
        self._declared.append(subscriber)

    async def hub_entry(self, *, timeout_s: float = 1.0) -> dict[str, bytes]:
        """Return the hub's report of its sessions and their links, by key of Zenoh's admin space; empty: no answer."""
        return await in_thread(lambda: _by_key(itertools.islice(self._reports(HUB_ENTRY, timeout_s), 1)))

    async def declarations(self, *, timeout_s: float = 3.0) -> dict[str, bytes]:
        """Return the hub's report of all sessions and their declarations, by key of Zenoh's admin space.

        It is empty for a program that may not read it (wire/access.py).
        """
        return await in_thread(lambda: _by_key(self._reports(ADMIN_SPACE, timeout_s)))

    def _reports(self, expression: str, timeout_s: float) -> Iterator[zenoh.Sample]:
        """Yield the hub's replies to a query of Zenoh's admin space; blocks.

        Any program can answer such a query, also with the hub's keys. Therefore only replies of the hub itself are used, and
        Zenoh must not consolidate replies of equal keys.
        """
        hubs = {str(hub) for hub in self._session.info.peers_zid()}
        replies = self._session.get(expression, timeout=timeout_s, consolidation=zenoh.ConsolidationMode.NONE)
        for reply in replies:
            if reply.ok is not None and reply.replier_id is not None and str(reply.replier_id.zid) in hubs:
                yield reply.ok

    async def close(self) -> None:
        """Close the session; abandon the close after `CLOSE_LIMIT_S` if a stopped peer blocks it."""
        try:
            await asyncio.wait_for(in_thread(self._session.close), CLOSE_LIMIT_S)  # pyright: ignore[reportUnknownArgumentType]
        except (TimeoutError, zenoh.ZError):
            _log.info("the session did not close within %.0f s and was abandoned", CLOSE_LIMIT_S)

    def _key(self, relative: str) -> str:
        return f"{self._namespace}/{relative}"


def _id_bytes(zid: zenoh.ZenohId) -> bytes:
    """Return the id of a session as 16 bytes; its text has no leading zeros."""
    return bytes.fromhex(str(zid).zfill(32))


def _replier(reply: zenoh.Reply) -> bytes | None:
    return None if reply.replier_id is None else _id_bytes(reply.replier_id.zid)


def _by_key(reports: Iterable[zenoh.Sample]) -> dict[str, bytes]:
    return {str(report.key_expr): report.payload.to_bytes() for report in reports}


def _reply(query: zenoh.Query, key: str, response: bytes, attachment: bytes | None) -> None:
    with query:
        query.reply(key, response, attachment=attachment)
