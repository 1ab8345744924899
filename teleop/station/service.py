"""The loop of an e-stop station: keys and challenges in, presence out.

One loop reads the keys and proves the presence, so a hung station is not heard. The screen is written without waiting:
a terminal that accepts no output changes nothing else.
"""

import asyncio
import secrets
from collections.abc import Callable

from teleop.pilots.keys import CTRL_C, FOCUS_OUT, KeySource
from teleop.pilots.pilot import KeyEvent, KeyKind
from teleop.station.state import Lease, Look, Word, farewell, pressed, received, released, sent
from wire import topics
from wire.bus import Bus, Token, woken_by
from wire.messages import Bool, EstopStationStatus, SafetyStatus

CTRL_R = "\x12"
LEAVING_KEYS = frozenset({"q", CTRL_C})
STATUS_LIMIT_S = 1.0
"""A status that is older is not shown."""
SHOW_PERIOD_S = 0.5
LEAVING_LIMIT_S = 0.5
"""Time for the supervisor's confirmation that the station has left."""


class Station:
    """One station, from its first key to its end; it joins the bus as soon as there is one.

    Args:
        name: its name in the supervisor's configuration.
        endpoint: of the supervisor, for the screen.
        keys: the terminal's keys.
        show: shows the state on the screen; never blocks.
        wake: set when a key or a message has arrived.
    """

    def __init__(
        self,
        name: str,
        endpoint: str,
        *,
        keys: KeySource,
        show: Callable[[Look], object],
        wake: asyncio.Event,
    ) -> None:
        self._name, self._endpoint = name, endpoint
        self._keys, self._show, self._wake = keys, show, wake
        self._lease = Lease()
        self._bus: Bus | None = None
        self._tokens: list[Token] = []
        self._rivals: set[bytes] = set()
        self._status: tuple[float, SafetyStatus] | None = None
        self._shown = Look(name, endpoint, Word.NOT_HEARD)
        self._next_show_s = 0.0
        self._is_leaving = False
        self._pressed_s: float | None = None
        """Time of the last press, until a status shows the e-stop: a single sample can get lost."""

    @property
    def farewell(self) -> str:
        """What its end means, by the last look."""
        return farewell(self._shown)

    def join(self, bus: Bus) -> None:
        """Begin to prove the presence on an open bus; the caller closes it."""
        node = topics.estop_node(self._name)
        self._presence = bus.publisher(topics.estop_presence(self._name))
        self._estop = bus.publisher(topics.ESTOP)
        self._challenges = bus.subscribe(topics.estop_challenge(self._name), wake=self._wake)
        self._statuses = bus.subscribe(topics.STATUS, wake=self._wake)
        self._others = bus.watch_alive(nodes=[node])
        # Before the first message: the supervisor then notices the end of each run that it accepts.
        self._tokens = [bus.declare_alive(node, self._presence.epoch), bus.declare_alive(node)]
        self._bus = bus
        if self._lease.is_pressed:
            self._estop.put(Bool(data=True))
        self._wake.set()

    async def run(self, stop: asyncio.Event) -> None:
        """Run until `stop`, a key that leaves, or the end of the terminal; then leave.

        A closed terminal ends the station without a last message: no person can press it any more, or has decided to leave.
        """
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            while not (stop.is_set() or self._is_leaving or self._keys.ended):
                self._turn(loop.time())
                await woken_by(self._wake, self._lease.due_s)
                self._wake.clear()
            if not self._keys.ended:
                await self._leave()
        finally:
            stopping.cancel()
            for token in self._tokens:
                token.withdraw()

    async def _leave(self) -> None:
        """Report that the station leaves until a status shows it: on a busy machine, the token's end overtakes the report."""
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        end_s = began_s + LEAVING_LIMIT_S
        self._send(began_s, leaves=True)
        while self._bus is not None and not self._has_left(began_s) and loop.time() < end_s:
            await woken_by(self._wake, end_s)
            self._wake.clear()
            if self._is_challenged():
                self._send(loop.time(), leaves=True)
            self._observe()

    def _has_left(self, since_s: float) -> bool:
        """Return whether a status since then shows that the station has left; an earlier one is about an earlier run."""
        if self._status is None or self._status[0] < since_s:
            return False
        stations = self._status[1].estop_stations
        return any(one.name == self._name and one.state == EstopStationStatus.LEFT for one in stations)

    def _is_challenged(self) -> bool:
        """Receive the supervisor's newest challenge, if there is one."""
        challenge = self._challenges.latest()
        if challenge is None or challenge.message is None:
            return False
        self._lease = received(self._lease, challenge.message)
        return True

    def _turn(self, now_s: float) -> None:
        was_pressed, is_challenged = self._lease.is_pressed, False
        for event in self._keys.take():
            self._on_key(event, now_s)
        if self._bus is not None:
            is_challenged = self._is_challenged()
            self._observe()
        if is_challenged or now_s >= self._lease.due_s or self._lease.is_pressed is not was_pressed:
            self._send(now_s)
        self._draw(now_s)

    def _on_key(self, event: KeyEvent, now_s: float) -> None:
        if event.kind is KeyKind.RELEASE or event.key == FOCUS_OUT:
            return
        if event.key in LEAVING_KEYS:
            self._is_leaving = True
            self._wake.set()
        elif event.key == CTRL_R and self._lease.is_pressed:
            self._lease = released(self._lease)
            if not self._lease.is_pressed:
                self._pressed_s = None
        else:
            self._lease, self._pressed_s = pressed(self._lease, now_s), now_s
            if self._bus is not None:
                self._estop.put(Bool(data=True))

    def _observe(self) -> None:
        for change in self._others.take():
            if change.epoch not in (b"", self._presence.epoch):
                (self._rivals.add if change.alive else self._rivals.discard)(change.epoch)
        status = self._statuses.latest()
        if status is not None and status.message is not None:
            self._status = status.arrival_s, status.message
            if (
                self._pressed_s is not None
                and status.arrival_s > self._pressed_s
                and "ESTOP" in status.message.reasons
            ):
                self._pressed_s = None

    def _send(self, now_s: float, *, leaves: bool = False) -> None:
        self._lease, message = sent(self._lease, secrets.randbits(63) + 1, now_s, leaves=leaves)
        if self._bus is not None:
            self._presence.put(message)
            if self._pressed_s is not None:
                self._estop.put(Bool(data=True))

    def _draw(self, now_s: float) -> None:
        status = self._status
        look = Look(
            name=self._name,
            endpoint=self._endpoint,
            word=self._lease.word(now_s),
            is_connected=self._bus is not None,
            is_pressed=self._lease.is_pressed,
            is_confirmed=self._lease.is_confirmed,
            has_rival=bool(self._rivals),
            status=status[1] if status is not None and now_s - status[0] <= STATUS_LIMIT_S else None,
        )
        if look != self._shown or now_s >= self._next_show_s:
            self._shown, self._next_show_s = look, now_s + SHOW_PERIOD_S
            self._show(look)
