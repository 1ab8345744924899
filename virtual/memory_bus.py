"""The Bus inside one event loop: real bytes, real stamps, no network. For component tests on a fake clock.

Several `MemoryBus` nodes on one `MemoryNetwork` are the processes; `MemoryBus.die()` is a SIGKILL as the
others see it.
"""

import asyncio
from dataclasses import dataclass, field
from typing import Any

from wire.bus import SOURCES_DEPTH, Inbox, LivelinessChange, NoReplyError, ServiceHandler, Subscription
from wire.messages import M, TriggerResponse, encode
from wire.stamp import Stamper
from wire.topics import Service, Topic, source_of


@dataclass
class MemoryNetwork:
    """What joins the nodes: samples are delivered at once, in order."""

    subscriptions: list[tuple["MemoryBus", Subscription[Any]]] = field(
        default_factory=list[tuple["MemoryBus", Subscription[Any]]]
    )
    watchers: list[tuple["MemoryBus", Inbox[LivelinessChange]]] = field(
        default_factory=list[tuple["MemoryBus", Inbox[LivelinessChange]]]
    )
    ears: list[Inbox[str]] = field(default_factory=list[Inbox[str]])
    services: dict[str, ServiceHandler] = field(default_factory=dict[str, ServiceHandler])
    tokens: list["MemoryToken"] = field(default_factory=list["MemoryToken"])

    def deliver(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Put raw bytes on a key, as any client of a real network could."""
        now_s = asyncio.get_running_loop().time()
        for _, subscription in self.subscriptions:
            if subscription.key == key:
                subscription.push(payload, attachment, now_s)
        source = source_of(key)
        if source is not None:
            for ear in self.ears:
                ear.push(source)

    def announce(self, node: str, *, alive: bool) -> None:
        now_s = asyncio.get_running_loop().time()
        for _, watcher in self.watchers:
            watcher.push(LivelinessChange(node, alive, now_s))


class MemoryToken:
    """A token on the memory network."""

    def __init__(self, bus: "MemoryBus", node: str) -> None:
        self.bus, self.node = bus, node
        bus.network.tokens.append(self)
        bus.network.announce(node, alive=True)

    def withdraw(self) -> None:
        if self in self.bus.network.tokens:
            self.bus.network.tokens.remove(self)
            self.bus.network.announce(self.node, alive=False)


class MemoryPublisher:
    """Encodes, stamps with the loop's (virtual) clock, delivers."""

    def __init__(self, bus: "MemoryBus", key: str) -> None:
        self._bus, self._key = bus, key
        self._stamper = Stamper(bus.gid)

    def put(self, message: Any, true_at_s: float | None = None) -> None:  # noqa: ANN401 - as Publisher[M] for its topic's M
        if self._bus.dead:
            return
        time_s = asyncio.get_running_loop().time() if true_at_s is None else true_at_s
        self._bus.network.deliver(self._key, encode(message), self._stamper.next(time_s).pack())

    def begin_anew(self) -> None:
        self._stamper = Stamper(MemoryBus.new_gid())


class MemoryBus:
    """One node on a `MemoryNetwork`."""

    _gids = 0

    def __init__(self, network: MemoryNetwork) -> None:
        self.network = network
        self.gid = MemoryBus.new_gid()
        self.dead = False

    @classmethod
    def new_gid(cls) -> bytes:
        cls._gids += 1
        return cls._gids.to_bytes(16, "little")

    def publisher(self, topic: Topic[M]) -> MemoryPublisher:
        return MemoryPublisher(self, topic.key)

    def subscribe(
        self,
        topic: Topic[M],
        *,
        depth: int = 1,
        wake: asyncio.Event | None = None,
        repeats_wake: bool = True,
        per_writer: bool = False,
    ) -> Subscription[M]:
        subscription = Subscription(
            topic.key, topic.type, depth=depth, wake=wake, repeats_wake=repeats_wake, per_writer=per_writer
        )
        self.network.subscriptions.append((self, subscription))
        return subscription

    def hear_sources(self) -> Inbox[str]:
        ear: Inbox[str] = Inbox(SOURCES_DEPTH, None)
        self.network.ears.append(ear)
        return ear

    def declare_alive(self, node: str) -> MemoryToken:
        return MemoryToken(self, node)

    def watch_alive(self, wake: asyncio.Event | None = None) -> Inbox[LivelinessChange]:
        watcher: Inbox[LivelinessChange] = Inbox(64, wake)
        self.network.watchers.append((self, watcher))
        now_s = asyncio.get_running_loop().time()
        for token in self.network.tokens:
            watcher.push(LivelinessChange(token.node, alive=True, arrival_s=now_s))
        return watcher

    def serve(self, service: Service, handler: ServiceHandler) -> None:
        self.network.services[service.key] = handler

    async def call(self, service: Service, text: str = "", *, timeout_s: float = 1.0) -> TriggerResponse:
        handler = self.network.services.get(service.key)
        if handler is None:
            raise NoReplyError(f"nobody answered {service.key} within {timeout_s:g} s")
        return await handler(text)

    async def close(self) -> None:
        self.die()

    def die(self) -> None:
        """Go as a killed process goes: the tokens fall, nothing more is heard or said."""
        self.dead = True
        for token in [t for t in self.network.tokens if t.bus is self]:
            token.withdraw()
        self.network.subscriptions[:] = [s for s in self.network.subscriptions if s[0] is not self]
        self.network.watchers[:] = [w for w in self.network.watchers if w[0] is not self]
