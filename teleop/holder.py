"""Who speaks as a command source: at most one program at a time, however many start at once.

A holder has the source's token and answers the service `<source>/holder` with a sentence about itself. Whoever
wants the name declares itself a candidate first, by a token `<source>.<mark>` of its own, and looks then:

    the holder answers                        give way
    there is a candidate of a smaller mark    give way: both are about to begin
    there are others, or a silent holder      look again; they give way, begin, or are found not to answer
    there is nobody                           begin, and be a candidate no more

Of two candidates the one that looks later is certain to see the other, or the holder that it has become: it serves
before it is a candidate no more. Nothing is commanded before that: who gives way has disturbed nobody.
"""

import asyncio
import getpass
import math
import os
import secrets
import socket
import time
from contextlib import suppress

from wire import topics
from wire.bus import Bus, Inbox, LivelinessChange, NoReplyError, Token
from wire.messages import TriggerResponse

ASK_LIMIT_S = 1.0
SILENT_LIMIT_S = 1.0
"""How long others may stand in the way without an answer: longer than the link of a dead program is trusted."""
POLL_S = 0.02


class HeldError(Exception):
    """Somebody else speaks as this source; the message says who."""


class Holder:
    """This program as the holder of a source's name; it holds it from `claim` to `release`."""

    def __init__(self, bus: Bus, source: str, about: str) -> None:
        self._bus, self._source, self._about = bus, source, about
        self._candidate = f"{source}.{secrets.token_hex(8)}"
        self._token: Token | None = None
        self._serves = False
        self._changes: Inbox[LivelinessChange] = bus.watch_alive()
        self._alive: set[str] = set()

    @property
    def holds(self) -> bool:
        return self._token is not None

    async def claim(self) -> None:
        """Take the name, and declare its token.

        Raises:
            HeldError: somebody else has it.
        """
        candidacy = self._bus.declare_alive(self._candidate)
        try:
            await self._until_nobody_else()
            if not self._serves:
                self._serves = True
                self._bus.serve(topics.source_holder(self._source), self._answer)
            self._token = self._bus.declare_alive(self._source)
        finally:
            candidacy.withdraw()

    def release(self) -> None:
        """Withdraw the token; without one, nothing."""
        if self._token is not None:
            self._token.withdraw()
            self._token = None

    async def _until_nobody_else(self) -> None:
        clock = asyncio.get_running_loop().time
        deadline_s = math.inf
        while True:
            await self._ask()
            others = self._others()
            if not others:
                return
            if any(self._source < other < self._candidate for other in others):
                raise HeldError("another program that starts at this very moment")
            deadline_s = min(deadline_s, clock() + SILENT_LIMIT_S)
            if clock() >= deadline_s:
                raise HeldError(f"a {self._source} that does not answer")
            await asyncio.sleep(POLL_S)

    async def _ask(self) -> None:
        with suppress(NoReplyError):
            answer = await self._bus.call(topics.source_holder(self._source), timeout_s=ASK_LIMIT_S)
            if answer.success:
                raise HeldError(answer.message)

    def _others(self) -> set[str]:
        """The holder and the candidates that there are."""
        for change in self._changes.take():
            (self._alive.add if change.alive else self._alive.discard)(change.node)
        candidates = f"{self._source}."
        return {
            node
            for node in self._alive
            if (node == self._source or node.startswith(candidates)) and node != self._candidate
        }

    async def _answer(self, _: str) -> TriggerResponse:
        return TriggerResponse(success=self.holds, message=self._about)


def about_this_process(source: str) -> str:
    """A sentence about this program, for whoever finds the name held."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a user id without a name
        user = f"user {os.getuid()}"
    try:
        place = f", on {os.ttyname(0).removeprefix('/dev/')}"
    except OSError:
        place = ""
    since = time.strftime("%H:%M:%S")
    return f"the {source} of {user}@{socket.gethostname()}, pid {os.getpid()}{place}, since {since}"
