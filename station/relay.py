"""Carries leases between the pages and the supervisor.

Each page is a run of the station, with its own epoch and token, as a second `lifeline estop --name` would be: the supervisor
gives the lease to one of them, and the press of each counts. The relay answers no challenge itself and repeats nothing, so
the lease ends with the answers of the page, and at once when its connection ends.
"""

import asyncio
import math
from dataclasses import dataclass
from typing import Protocol

from station import messages
from station.messages import Fields
from wire import topics
from wire.bus import Bus, Publisher, Token, woken_by
from wire.message_types import EstopLease, SafetyStatus
from wire.messages import Bool

MAX_PAGES = 4
"""Of one station, at the same time."""
STATUS_LIMIT_S = 1.0
"""A status that is older is not shown."""
SHOW_PERIOD_S = 0.5


class Page(Protocol):
    """The connection to a page."""

    def show(self, kind: str, fields: Fields) -> None:
        """Send a message as soon as the page accepts it, instead of an older one of its kind; never block."""
        ...


@dataclass(eq=False, slots=True)
class Run:
    """One connected page."""

    page: Page
    presence: Publisher[EstopLease] | None = None
    """None before the relay has joined the bus."""
    token: Token | None = None
    is_pressed: bool = False
    unseen_s: float = math.inf
    """When it was pressed, until a later status shows the e-stop."""

    @property
    def is_seen(self) -> bool:
        """Whether it is pressed, and a later status has shown the e-stop."""
        return self.is_pressed and self.unseen_s == math.inf


class Relay:
    """All pages of one station.

    Args:
        name: the station's name in the supervisor's configuration.
        endpoint: of the supervisor, for the page.
    """

    def __init__(self, name: str, endpoint: str) -> None:
        self._name, self._endpoint = name, endpoint
        self._wake = asyncio.Event()
        self._runs: list[Run] = []
        self._epochs: set[bytes] = set()
        """Of all runs of this station that are alive, also those of other programs."""
        self._bus: Bus | None = None
        self._newest: tuple[float, SafetyStatus] | None = None
        self._next_show_s = 0.0
        self.driver = ""
        """The name of the person who drives, for the pages."""

    @property
    def is_full(self) -> bool:
        """Whether there are as many pages as permitted."""
        return len(self._runs) >= MAX_PAGES

    def join(self, bus: Bus) -> None:
        """Use an open bus from now on; the caller closes it."""
        node = topics.estop_node(self._name)
        self._estop = bus.publisher(topics.ESTOP)
        self._challenges = bus.subscribe(topics.estop_challenge(self._name), wake=self._wake)
        self._statuses = bus.subscribe(topics.STATUS, wake=self._wake)
        self._others = bus.watch_alive(self._wake, [node])
        self._token = bus.declare_alive(node)
        self._bus = bus
        for run in self._runs:
            self._begin(run, bus)

    def enter(self, page: Page) -> Run:
        """Begin a run for a page; the caller checks `is_full` before."""
        run = Run(page)
        self._runs.append(run)
        if self._bus is not None:
            self._begin(run, self._bus)
        self._next_show_s = 0.0
        self._wake.set()
        return run

    def _begin(self, run: Run, bus: Bus) -> None:
        run.presence = bus.publisher(topics.estop_presence(self._name))
        # Before the first message: the supervisor then notices the end of each run that it accepts.
        run.token = bus.declare_alive(topics.estop_node(self._name), run.presence.epoch)

    def hear(self, run: Run, message: EstopLease) -> bool:
        """Pass on a message of a page; return whether its run goes on.

        A press is also sent as an e-stop, until a status shows it: one message can get lost.
        """
        if run in self._runs and run.presence is not None:
            run.presence.put(message)
            if message.stop and not run.is_pressed:
                run.unseen_s = asyncio.get_running_loop().time()
            run.is_pressed = message.stop
            if (
                self._newest is not None
                and self._newest[0] > run.unseen_s
                and messages.is_latched(self._newest[1])
            ):
                run.unseen_s = math.inf
                self._next_show_s = 0.0  # the page may be released now
                self._wake.set()
            if run.is_pressed and run.unseen_s < math.inf:
                self._estop.put(Bool(data=True))
        return run in self._runs

    def press(self, run: Run) -> None:
        """Let the next message of a page that is pressed already be sent as an e-stop again: its person has touched it again."""
        if run.is_pressed:
            run.unseen_s = asyncio.get_running_loop().time()

    def leave(self, run: Run) -> None:
        """End the run of a page, unless it has ended before: the lease ends with its token."""
        if run in self._runs:
            self._runs.remove(run)
            if run.token is not None:
                run.token.withdraw()

    async def run(self, stop: asyncio.Event) -> None:
        """Pass on the supervisor's messages until `stop`."""
        loop = asyncio.get_running_loop()
        stopping = loop.create_task(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            while not stop.is_set():
                self._turn(loop.time())
                await woken_by(self._wake, self._next_show_s)
                self._wake.clear()
        finally:
            stopping.cancel()

    def _turn(self, now_s: float) -> None:
        is_due = now_s >= self._next_show_s
        if self._bus is not None:
            challenge, newest = self._challenges.latest(), self._statuses.latest()
            if challenge is not None and challenge.message is not None:
                for run in self._runs:
                    run.page.show("lease", messages.lease(challenge.message))
            if newest is not None and newest.message is not None:
                self._newest, is_due = (newest.arrival_s, newest.message), True
            for change in self._others.take():
                if change.epoch:
                    (self._epochs.add if change.alive else self._epochs.discard)(change.epoch)
        if is_due:
            self._next_show_s = now_s + SHOW_PERIOD_S
            arrival_s, status = self._newest or (-math.inf, None)
            known = status if now_s - arrival_s <= STATUS_LIMIT_S else None
            for run in self._runs:
                rivals = self._epochs - (set() if run.presence is None else {run.presence.epoch})
                view = messages.view(
                    self._name,
                    self._endpoint,
                    known,
                    self.driver,
                    has_rival=bool(rivals),
                    is_seen=run.is_seen,
                )
                run.page.show("view", view)
