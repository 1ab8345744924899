"""A network that can fail, in virtual time: one hub, clients, and links with conditions that may change at any moment.

It behaves as measured for Zenoh over TCP in our topology: every client is connected to the hub only. A link keeps the order of
messages, and delivers the messages that a cut held in one burst. The death of a process is detected after 2 ms, and silence
after the lease. Then the session ends, its tokens are deleted, and the client reconnects by itself.
Only the supervisor may write its keys. It is the hub, or, if the hub is only a router, the client of that name.

A bus belongs to one run of one process. A process can be blocked in three ways:

    hold     its loop runs no callback; arriving messages are stamped with their true time of arrival
    deaf     arriving messages are stamped when it continues (a thread holds the interpreter's lock)
    stopped  like deaf, but it also sends no keep-alive (SIGSTOP): the leases of the others expire
"""

import asyncio
import contextvars
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from random import Random
from typing import Any

from virtual.loop import VirtualProcess
from wire import topics
from wire.bus import (
    Inbox,
    LivelinessChange,
    NoReplyError,
    ServiceHandler,
    Subscription,
    Wake,
)
from wire.inbox import FOREIGN_DEPTH, SOURCES_DEPTH
from wire.messages import M, TriggerResponse, Twist, encode
from wire.stamp import Stamp, Stamper
from wire.topics import Service, Topic

HOP_S = 0.000_15
"""Time of a message over loopback."""
DEATH_NOTICE_S = 0.002
"""From SIGKILL to the end of the process's connections."""
LEASE_S = 0.4
RETRY_S = (0.05, 0.2)
"""Range of the time between two attempts of a client to reconnect."""
RESEND_S = (0.0, 0.2)
"""Range of the time from the end of a cut to TCP's next transmission."""
BACKLOG = 512
"""Maximum number of messages that a cut link holds; the sender drops later ones."""
LIVELINESS_DEPTH = 256

Action = Callable[[], None]


@dataclass(slots=True)
class Conditions:
    """The conditions of one direction of a client's link."""

    delay_s: float = 0.0
    """Delay in addition to the hop."""
    jitter_s: float = 0.0
    """Maximum of an additional, uniformly distributed delay."""
    loss: float = 0.0
    """The share of messages that is dropped."""
    in_order: bool = True
    is_cut: bool = False


class _Pipe:
    """One direction of one session."""

    def __init__(self, session: "_Session", receiver: "VirtualBus", conditions: Conditions) -> None:
        self.session, self.receiver, self.conditions = session, receiver, conditions
        self._network = session.network
        self._last_due_s = 0.0
        self._held: list[Action] = []
        self._unheard: list[Action] = []
        self._silent_since_s: float | None = None

    def send(self, action: Action) -> None:
        """Run `action` at the receiver when the message arrives; a lossy link may drop it."""
        loss = self.conditions.loss
        if not loss or self._network.random.random() >= loss:
            self._send(action, in_order=self.conditions.in_order)

    def send_surely(self, action: Action) -> None:
        """Like `send`, for messages that a connection never drops or reorders: tokens, queries, the end of the session."""
        self._send(action, in_order=True)

    def _send(self, action: Action, *, in_order: bool) -> None:
        conditions, network = self.conditions, self._network
        if conditions.is_cut:
            self._hold(action)
            return
        due_s = network.loop.time() + HOP_S + conditions.delay_s
        if conditions.jitter_s:
            due_s += network.random.uniform(0.0, conditions.jitter_s)
        if in_order:
            self._last_due_s = due_s = max(due_s, self._last_due_s)
        network.at(due_s, self._arrive, action)

    def _hold(self, action: Action) -> None:
        if len(self._held) < BACKLOG:
            self._held.append(action)

    def _arrive(self, action: Action) -> None:
        if self.session.is_over or self.receiver.is_dead:
            return
        if self.conditions.is_cut:
            self._hold(action)
        elif self.receiver.is_deaf:
            self._unheard.append(action)
        else:
            action()

    def hear(self) -> None:
        """Deliver the messages that arrived while the receiver was deaf."""
        unheard, self._unheard = self._unheard, []
        for action in unheard:
            action()

    def resend(self) -> None:
        """Deliver all messages that the cut held, in one burst."""
        held, self._held = self._held, []
        if held:
            due_s = self._network.loop.time() + self._network.random.uniform(*RESEND_S)
            self._last_due_s = max(self._last_due_s, due_s)
            for action in held:
                self._network.at(self._last_due_s, self._arrive, action)

    def look_for_silence(self, sender: "VirtualBus") -> None:
        """Check whether the sender is silent; after one lease of silence, the receiver ends the session."""
        is_silent = self.conditions.is_cut or sender.is_stopped or sender.is_dead
        if not is_silent:
            self._silent_since_s = None
        elif self._silent_since_s is None:
            self._silent_since_s = self._network.loop.time()
            self._network.after(self._network.lease_s, self._lapse, self._silent_since_s)

    def _lapse(self, since_s: float) -> None:
        if self._silent_since_s == since_s and not self.receiver.is_dead:
            self.session.give_up(self.receiver)


class _Session:
    """One connection of a client with the hub, from its opening until both sides have ended it."""

    def __init__(self, network: "VirtualNetwork", client: "VirtualBus", hub: "VirtualBus") -> None:
        self.network, self.client, self.hub = network, client, hub
        up, down = network.link(client.node)
        self.up, self.down = _Pipe(self, hub, up), _Pipe(self, client, down)
        self.tokens: list[str] = []
        """The client's tokens that the hub knows."""
        self.is_over = False
        self._left: set[bool] = set()
        """The sides that have ended the session; True is the hub."""

    @property
    def is_done(self) -> bool:
        """Whether each side has ended the session or is dead."""
        return self.is_over and all(
            bus.is_dead or side in self._left for side, bus in ((True, self.hub), (False, self.client))
        )

    def look_for_silence(self) -> None:
        if not self.is_over:
            self.up.look_for_silence(self.client)
            self.down.look_for_silence(self.hub)

    def give_up(self, who: "VirtualBus") -> None:
        """End the session on one side; the other side detects this by a message, by its lease, or when it resumes."""
        self.is_over = True
        self.let_go(who)
        other = self.hub if who is self.client else self.client
        towards = self.up.conditions if other is self.hub else self.down.conditions
        later_s = self.network.lease_s if towards.is_cut else HOP_S + towards.delay_s
        self.network.after(later_s, self.let_go, other)

    def let_go(self, who: "VirtualBus") -> None:
        """End the session on a side that has detected its end."""
        self.is_over = True
        side = who is self.hub
        if side in self._left or who.is_dead:
            return
        if who.is_stopped:
            return  # it detects the end when it resumes
        self._left.add(side)
        if side:
            self.network.forget(self)
        else:
            self.client.lose_hub(self)


class VirtualToken:
    """A liveliness token of one bus."""

    def __init__(self, bus: "VirtualBus", node: str) -> None:
        self._bus, self._node = bus, node

    def withdraw(self) -> None:
        self._bus.withdraw(self, self._node)


class VirtualPublisher:
    """Stamps messages with the sender's clock, and sends them if there is a subscriber."""

    def __init__(self, bus: "VirtualBus", key: str) -> None:
        self._bus, self._key = bus, key
        self.begin_anew()

    def put(self, message: Any, true_at_s: float | None = None) -> Stamp:  # noqa: ANN401 - as Publisher[M] for its topic's M
        bus, network = self._bus, self._bus.network
        time_s = network.loop.time() if true_at_s is None else true_at_s
        stamp = self._stamper.next(time_s + bus.clock_offset_s)
        if bus.is_dead:
            return stamp
        if network.tap is not None:
            network.tap(bus.node, self._key, message, stamp)
        if network.is_heard(self._key):
            bus.send(self._key, encode(message), stamp.pack())
        return stamp

    @property
    def epoch(self) -> bytes:
        return self._stamper.gid

    def begin_anew(self) -> None:
        self._stamper = Stamper(self._bus.network.new_gid())


class VirtualBus:
    """One run of one process on the network; the module's docstring lists its possible states."""

    def __init__(self, network: "VirtualNetwork", node: str, process: VirtualProcess | None) -> None:
        self.network, self.node, self.process = network, node, process
        self.is_dead = self.is_deaf = self.is_stopped = False
        self.clock_offset_s = 0.0
        """Its clock minus the true time; a step of its clock changes this."""
        self.subscriptions: dict[str, list[Subscription[Any]]] = {}
        self.services: dict[str, ServiceHandler] = {}
        self.own: list[str] = []
        """The nodes for which it holds tokens."""
        self.session: _Session | None = None
        self._opened: asyncio.Future[None] | None = None
        self._watchers: list[tuple[Inbox[LivelinessChange], tuple[str, ...]]] = []
        """With the patterns of the tokens that each watches; none: all tokens of nodes."""
        self._ears: list[tuple[Inbox[str], frozenset[str]]] = []
        self._sees: Counter[str] = Counter()
        self.foreign_nodes: Inbox[LivelinessChange] | None = None
        """Tokens of rmw_zenoh; the network has none of its own. None: nobody watches them."""

    @property
    def is_hub(self) -> bool:
        return self.network.hub is self

    @property
    def alive(self) -> list[str]:
        """The nodes whose tokens it sees."""
        return [node for node in self._tokens if "/" not in node]

    @property
    def _tokens(self) -> list[str]:
        return [token for token, count in self._sees.items() if count > 0]

    # --- Bus

    def publisher(self, topic: Topic[M]) -> VirtualPublisher:
        return VirtualPublisher(self, topic.key)

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
            topic.key, topic.type, depth=depth, wake=wake, repeats_wake=repeats_wake, per_writer=per_writer
        )
        self.subscriptions.setdefault(topic.key, []).append(subscription)
        self.network.listened.add(topic.key)
        return subscription

    def subscribe_sources(
        self, names: Collection[str], *, depth: int, wake: Wake
    ) -> tuple[dict[str, Subscription[Twist]], Inbox[str]]:
        subscriptions = {
            name: self.subscribe(topics.source_cmd_vel(name), depth=depth, wake=wake, repeats_wake=False)
            for name in names
        }
        return subscriptions, self._ear(frozenset(names))

    def hear_sources(self) -> Inbox[str]:
        return self._ear(frozenset())

    def _ear(self, except_for: frozenset[str]) -> Inbox[str]:
        ear: Inbox[str] = Inbox(SOURCES_DEPTH, None)
        self._ears.append((ear, except_for))
        self.network.has_ears = True
        return ear

    @property
    def run_id(self) -> bytes:
        return b"virtual session!"

    async def connected(self) -> None:
        """Report nothing: nobody copies a token here."""

    def declare_alive(self, node: str, epoch: bytes = b"") -> VirtualToken:
        node = topics.alive(node, epoch).removeprefix(topics.alive(""))
        self.own.append(node)
        self.see(node, 1)
        self.network.tell_token(self, node, 1)
        return VirtualToken(self, node)

    def watch_alive(
        self, wake: Wake | None = None, nodes: Collection[str] | None = None
    ) -> Inbox[LivelinessChange]:
        watcher: Inbox[LivelinessChange] = Inbox(LIVELINESS_DEPTH, wake)
        named = () if nodes is None else [node.replace("$*", "*") for node in nodes]
        patterns = tuple(pattern for node in named for pattern in (node, f"{node}/*"))
        self._watchers.append((watcher, patterns))
        for node in self._tokens:
            self._tell(watcher, patterns, node, alive=True)
        return watcher

    def watch_foreign_nodes(self) -> Inbox[LivelinessChange]:
        self.foreign_nodes = Inbox(FOREIGN_DEPTH, None)
        return self.foreign_nodes

    def serve(self, service: Service, handler: ServiceHandler) -> None:
        self.services[service.key] = handler

    async def call(self, service: Service, text: str = "", *, timeout_s: float = 1.0) -> TriggerResponse:
        answered: asyncio.Future[TriggerResponse] = asyncio.get_running_loop().create_future()

        def resolve(response: TriggerResponse) -> None:
            if not answered.done():
                answered.set_result(response)

        self.network.ask(self, service.key, text, resolve)
        try:
            async with asyncio.timeout(timeout_s):
                return await answered
        except TimeoutError as error:
            raise NoReplyError(f"nobody answered {service.key} within {timeout_s:g} s") from error

    async def close(self) -> None:
        """Disconnect in order: the others are notified immediately."""
        self.leave(0.0)

    # --- faults

    def die(self) -> None:
        """End as by SIGKILL: nothing more is sent or run, and the connections end after `DEATH_NOTICE_S`."""
        if self.process is not None:
            self.process.is_dead = True
        self.leave(DEATH_NOTICE_S)

    def leave(self, noticed_s: float) -> None:
        """End every session; the others detect this after `noticed_s`, or by their leases if a link is cut."""
        if self.is_dead:
            return
        self.is_dead = True
        for session in self.network.sessions_of(self):
            other = session.client if self.is_hub else session.hub
            towards = session.down if self.is_hub else session.up
            self.network.after(noticed_s, towards.send_surely, partial(session.let_go, other))
        self.network.look_for_silence()
        self.network.remove(self)

    def set_deaf(self, *, deaf: bool) -> None:
        """Hold arriving messages while deaf, then deliver all of them."""
        self.is_deaf = deaf
        if not deaf:
            for session in self.network.sessions_of(self):
                (session.up if self.is_hub else session.down).hear()

    def set_stopped(self, *, stopped: bool) -> None:
        """Apply the effect of SIGSTOP or SIGCONT on the network."""
        self.is_stopped = stopped
        self.set_deaf(deaf=stopped)
        if not stopped:
            for session in self.network.sessions_of(self):
                if session.is_over:
                    session.let_go(self)
        self.network.look_for_silence()

    # --- for the network

    def send(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Put any bytes on a key."""
        if self.is_hub:
            self.network.route(None, key, payload, attachment)
        elif self.session is not None:
            session = self.session
            session.up.send(partial(self.network.route, session, key, payload, attachment))

    def hears(self, key: str) -> bool:
        """Return whether it subscribes to a key."""
        return key in self.subscriptions or (bool(self._ears) and topics.source_of(key) is not None)

    def receive(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        now_s = self.network.loop.time()
        for subscription in self.subscriptions.get(key, ()):
            subscription.push(payload, attachment, now_s)
        if self._ears and (source := topics.source_of(key)) is not None:
            for ear, except_for in self._ears:
                if source not in except_for:
                    ear.push(source)

    def see(self, node: str, change: int) -> None:
        """Count one token of a node more or less; report the first and the last one to the watchers."""
        before = self._sees[node]
        self._sees[node] = after = before + change
        if (before > 0) != (after > 0):
            self.tell_alive(node, alive=after > 0)

    def tell_alive(self, node: str, *, alive: bool) -> None:
        """Report a change of liveliness to the watchers of this bus."""
        for watcher, patterns in self._watchers:
            self._tell(watcher, patterns, node, alive=alive)

    def _tell(
        self, watcher: Inbox[LivelinessChange], patterns: tuple[str, ...], node: str, *, alive: bool
    ) -> None:
        token = topics.token_of(node)
        matches = any(fnmatchcase(node, pattern) for pattern in patterns) if patterns else "/" not in node
        if token is not None and matches:
            watcher.push(LivelinessChange(token[0], alive, self.network.loop.time(), token[1]))

    def withdraw(self, token: VirtualToken, node: str) -> None:  # noqa: ARG002 - each token once
        if self.is_dead or node not in self.own:
            return
        self.own.remove(node)
        self.see(node, -1)
        self.network.tell_token(self, node, -1)

    def lose_hub(self, session: _Session) -> None:
        """Forget the tokens of all other buses, and begin to reconnect."""
        if self.session is not session:
            return
        self.session = None
        for node, count in list(self._sees.items()):
            remote = count - self.own.count(node)
            if remote > 0:
                self.see(node, -remote)
        self._retry()

    def connect(self) -> asyncio.Future[None]:
        """Connect to the hub, and reconnect whenever it is lost; return a future of the first connection."""
        self._opened = self.network.loop.create_future()
        self.network.after(self.network.random.uniform(0.001, 0.005), self.find_hub)
        return self._opened

    def _retry(self) -> None:
        self.network.after(self.network.random.uniform(*RETRY_S), self.find_hub)

    def find_hub(self) -> None:
        """Connect to the hub now, or try again later."""
        if self.is_dead or self.session is not None:
            return
        hub = self.network.hub
        up, down = self.network.link(self.node)
        if hub is None or hub.is_stopped or self.is_stopped or up.is_cut or down.is_cut:
            self._retry()
            return
        self.session = self.network.join(self, hub)
        if self._opened is not None and not self._opened.done():
            self._opened.set_result(None)


class VirtualNetwork:
    """All buses, and the links between them.

    Args:
        loop: the event loop whose clock is used; None for the running loop.
        random: source of random delays and losses; perfect links use only those of connecting.
        lease_s: time after which a silent link counts as lost.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop | None = None,
        random: Random | None = None,
        lease_s: float = LEASE_S,
    ) -> None:
        self.loop = loop or asyncio.get_running_loop()
        self.random = random or Random(0)  # noqa: S311 - a simulation
        self.lease_s = lease_s
        self.hub: VirtualBus | None = None
        self.listened: set[str] = set()
        """The keys that have had a subscriber."""
        self.has_ears = False
        """Whether a bus subscribes to the commands of all sources."""
        self.tap: Callable[[str, str, Any, Stamp], object] | None = None
        """Called for every message when it is sent: node, key, message, stamp."""
        self.refused = 0
        """Number of messages that the hub's access control refused."""
        self._sessions: list[_Session] = []
        self._links: dict[str, tuple[Conditions, Conditions]] = {}
        self._context = contextvars.Context()
        self._gids = 0
        self._tasks: set[asyncio.Task[None]] = set()

    # --- for a campaign

    def open_hub(self, node: str, process: VirtualProcess | None = None) -> VirtualBus:
        self.hub = VirtualBus(self, node, process)
        return self.hub

    def open_client(self, node: str, process: VirtualProcess | None = None) -> VirtualBus:
        """Return a new client; `connect` connects it to the hub."""
        return VirtualBus(self, node, process)

    def open_joined(self, node: str) -> VirtualBus:
        """Return a new client that is already connected to the hub."""
        client = self.open_client(node)
        client.find_hub()
        return client

    def link(self, node: str) -> tuple[Conditions, Conditions]:
        """Return the conditions of a client's link, to the hub and from it. They may be changed, except `is_cut`: use `cut`."""
        return self._links.setdefault(node, (Conditions(), Conditions()))

    def cut(self, node: str, *, up: bool = True, down: bool = True) -> None:
        """Cut a client's link, or one direction of it."""
        for conditions, wanted in zip(self.link(node), (up, down), strict=True):
            conditions.is_cut = conditions.is_cut or wanted
        self.look_for_silence()

    def heal(self, node: str) -> None:
        """End a cut of both directions, and deliver the held messages in one burst."""
        for conditions in self.link(node):
            conditions.is_cut = False
        self.look_for_silence()
        for session in self._sessions:
            if session.client.node == node and not session.is_over:
                session.up.resend()
                session.down.resend()

    def flap(self, node: str) -> None:
        """Delete a token and restore it after 2 ms at all buses, as a reconnect can do."""
        buses = [bus for bus in (self.hub, *(s.client for s in self._sessions)) if bus is not None]
        for bus in buses:
            bus.tell_alive(node, alive=False)
            self.after(0.002, partial(bus.tell_alive, node, alive=True))

    # --- for the classes of this module

    def is_heard(self, key: str) -> bool:
        """Return whether a key has ever had a subscriber."""
        return key in self.listened or (self.has_ears and topics.source_of(key) is not None)

    def new_gid(self) -> bytes:
        self._gids += 1
        return self._gids.to_bytes(16, "little")

    def at(self, time_s: float, callback: Callable[..., None], *args: object) -> None:
        """Run a callback at a time, even if the calling process has died by then."""
        self.loop.call_at(time_s, callback, *args, context=self._context)

    def after(self, delay_s: float, callback: Callable[..., None], *args: object) -> None:
        self.at(self.loop.time() + delay_s, callback, *args)

    def sessions_of(self, bus: VirtualBus) -> list[_Session]:
        return [s for s in self._sessions if bus in (s.client, s.hub)]

    def look_for_silence(self) -> None:
        for session in self._sessions:
            session.look_for_silence()

    def join(self, client: VirtualBus, hub: VirtualBus) -> _Session:
        session = _Session(self, client, hub)
        self._sessions = [s for s in self._sessions if not s.is_done]
        known = [*hub.own, *(node for other in self._joined(hub) for node in other.tokens)]
        self._sessions.append(session)
        for node in known:
            session.down.send_surely(partial(client.see, node, 1))
        for node in client.own:
            session.up.send_surely(partial(self._token, session, node, 1))
        return session

    def forget(self, session: _Session) -> None:
        """Delete the tokens of a client whose session the hub has ended."""
        for node in list(session.tokens):
            self._token(session, node, -1)

    def remove(self, bus: VirtualBus) -> None:
        """Remove a bus that has ended."""
        if self.hub is bus:
            self.hub = None

    def tell_token(self, bus: VirtualBus, node: str, change: int) -> None:
        """Report a change of a bus's token to the network."""
        if bus.is_hub:
            for session in self._joined(bus):
                session.down.send_surely(partial(session.client.see, node, change))
        elif bus.session is not None:
            bus.session.up.send_surely(partial(self._token, bus.session, node, change))

    def _token(self, session: _Session, node: str, change: int) -> None:
        """Process a change of a client's token at the hub; only the supervisor may hold the supervisor's token."""
        if node == topics.SUPERVISOR != session.client.node:
            self.refused += 1
            return
        if change > 0:
            session.tokens.append(node)
        elif node in session.tokens:
            session.tokens.remove(node)
        else:
            return
        session.hub.see(node, change)
        for other in self._joined(session.hub):
            if other is not session:
                other.down.send_surely(partial(other.client.see, node, change))

    def _joined(self, hub: VirtualBus) -> list[_Session]:
        return [s for s in self._sessions if s.hub is hub and not s.is_over and not s.client.is_dead]

    def route(self, sender: _Session | None, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Deliver a message at the hub: to the hub itself, and to all subscribers except the sender."""
        hub = self.hub
        if hub is None or (sender is not None and sender.hub is not hub):
            return
        if sender is not None:
            if topics.is_supervisors(key) and sender.client.node != topics.SUPERVISOR:
                self.refused += 1
                return
            hub.receive(key, payload, attachment)
        for session in self._joined(hub):
            if session is not sender and session.client.hears(key):
                session.down.send(partial(session.client.receive, key, payload, attachment))

    def ask(self, asker: VirtualBus, key: str, text: str, resolve: Callable[[TriggerResponse], None]) -> None:
        """Send a query to all servers, including the asker; the first answer counts."""
        if key in asker.services:
            self._serve(asker, key, text, resolve)
        if asker.is_hub:
            self._spread(asker, None, key, text, resolve)
        elif (session := asker.session) is not None:

            def back(response: TriggerResponse) -> None:
                session.down.send_surely(partial(resolve, response))

            session.up.send_surely(partial(self._spread, session.hub, session, key, text, back))

    def _spread(
        self,
        hub: VirtualBus,
        sender: _Session | None,
        key: str,
        text: str,
        back: Callable[[TriggerResponse], None],
    ) -> None:
        if sender is not None and key in hub.services:
            self._serve(hub, key, text, back)
        for session in self._joined(hub):
            if session is not sender and key in session.client.services:

                def answer(response: TriggerResponse, session: _Session = session) -> None:
                    session.up.send_surely(partial(back, response))

                session.down.send_surely(partial(self._serve, session.client, key, text, answer))

    def _serve(
        self, server: VirtualBus, key: str, text: str, back: Callable[[TriggerResponse], None]
    ) -> None:
        """Run a handler in its own process."""

        async def run() -> None:
            back(await server.services[key](text))

        context = self._context if server.process is None else server.process.context
        self.loop.call_soon(lambda: self._keep(self.loop.create_task(run())), context=context)

    def _keep(self, task: asyncio.Task[None]) -> None:
        """Keep a reference to a running answer; an error in it is reported to the loop, with its process."""

        def on_end(_: asyncio.Task[None]) -> None:
            self._tasks.discard(task)
            if not task.cancelled():
                task.result()

        self._tasks.add(task)
        task.add_done_callback(on_end)
