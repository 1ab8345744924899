"""Exclusive use of a command source's name by one program, even if several start simultaneously.

A holder has the source's token, that of its own run, and answers the service `<source>/holder` with a sentence about
itself. Anyone may hold the source's token; it proves nothing about a holder. A program that serves this service and does not
hold the name answers in time only while nobody holds it. A program that wants the name first becomes a candidate, by
declaring a token `<source>.<mark>`, and then checks the other tokens:

    the holder answers                            give up
    there is a candidate with a smaller mark      give up: both are starting
    there are other candidates or a silent holder check again, until they give up, start, or do not answer
    there is no other                             start, and withdraw the candidate's token

Of two candidates, the one that checks later always sees the other as a candidate or as the holder, because a holder
serves its service before it withdraws its candidate's token. No command is sent before that, so a program that gives up
has had no effect.
"""

import asyncio
import getpass
import math
import os
import re
import secrets
import socket
import time
from contextlib import suppress

from wire import topics
from wire.bus import Bus, Inbox, LivelinessChange, NoReplyError, Publisher, Token
from wire.messages import TriggerResponse, Twist
from wire.runs import SESSION_BYTES

ASK_LIMIT_S = 1.0
SILENT_LIMIT_S = 1.0
"""How long to wait for others that do not answer; longer than the lease of a dead program's link."""
POLL_S = 0.02
SENDING_S = 0.05
"""Time for sending a sample or the end of a token. Zenoh sends the end of a token before samples that still wait."""


class HeldError(Exception):
    """Another program holds this source; the message says which."""


class Holder:
    """Holds a source's name for this program, from `claim` to `leave`.

    Args:
        bus: its bus.
        source: the name.
        commands: publishes the source's commands.
        about: a sentence about this program.
    """

    def __init__(self, bus: Bus, source: str, commands: Publisher[Twist], about: str) -> None:
        self._bus, self._source, self._commands, self.about = bus, source, commands, about
        self._candidate = f"{source}.{bus.run_id[:SESSION_BYTES].hex()}{secrets.token_hex(4)}"
        self._tokens: list[Token] = []
        self._serves = False
        self._changes: Inbox[LivelinessChange] = bus.watch_alive(nodes=[source, f"{source}.$*"])
        self._alive: set[tuple[str, bytes]] = set()
        self._before: set[tuple[str, bytes]] = set()
        """The tokens that existed when this program acquired the name: some may outlive their session."""

    @property
    def holds(self) -> bool:
        return bool(self._tokens)

    async def claim(self) -> None:
        """Acquire the name, and declare its tokens.

        Raises:
            HeldError: another program holds the name.
        """
        candidacy = self._bus.declare_alive(self._candidate)
        try:
            await self._until_nobody_else()
            self.serve()
            # The run's token first: where it exists, the source's token never stands alone for a holder.
            self._tokens = [self._declare_run(), self._bus.declare_alive(self._source)]
            self._before = set(self._seen())
        finally:
            candidacy.withdraw()

    def serve(self) -> None:
        """Answer who asks for the holder from now on, also before and after this program holds the name."""
        if not self._serves:
            self._serves = True
            self._bus.serve(topics.source_holder(self._source), self._answer)

    def begin_anew(self) -> None:
        """Begin a new run: its commands have a new epoch, and so has its token."""
        self._commands.begin_anew()
        if self._tokens:
            self._tokens[0].withdraw()
            self._tokens[0] = self._declare_run()

    def _declare_run(self) -> Token:
        return self._bus.declare_alive(self._source, self._commands.epoch)

    async def leave(self) -> None:
        """Withdraw the token after the zero that was just sent, so that the source is not reported as lost."""
        try:
            if self.holds:
                await asyncio.sleep(SENDING_S)
        finally:
            self.drop()

    def drop(self) -> None:
        """Withdraw the token at once: a robot that drives stops because its source is lost."""
        for token in self._tokens:
            token.withdraw()
        self._tokens.clear()

    async def _until_nobody_else(self) -> None:
        clock = asyncio.get_running_loop().time
        deadline_s = math.inf
        while True:
            await self._ask()
            others = await self._others()
            if not others:
                return
            if any(self._source < node < self._candidate for node, _ in others):
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

    async def _others(self) -> set[tuple[str, bytes]]:
        """Return the tokens of the holder's run and of the other candidates, except for copies that outlive their session."""
        others = {
            (node, epoch)
            for node, epoch in self._seen()
            if (epoch if node == self._source else node != self._candidate)
        }
        sessions = await self._bus.connected() if others else None
        if sessions is None:
            return others
        marks = {session[:SESSION_BYTES] for session in sessions}
        return {(node, epoch) for node, epoch in others if _session_of(node, epoch) in marks}

    def _seen(self) -> set[tuple[str, bytes]]:
        """Return the tokens of all runs and candidates, and of the source, each with its epoch."""
        for change in self._changes.take():
            (self._alive.add if change.alive else self._alive.discard)((change.node, change.epoch))
        return self._alive

    @property
    def is_contested(self) -> bool:
        """Whether another run of the source has begun since this program acquired the name: its link was lost meanwhile."""
        own = (b"", self._commands.epoch)
        return any(node == self._source and epoch not in own for node, epoch in self._seen() - self._before)

    async def _answer(self, _: str) -> TriggerResponse:
        """Return what this program is; while another one holds the name, too late: the first answer counts."""
        clock = asyncio.get_running_loop().time
        end_s = clock() + ASK_LIMIT_S
        while clock() < end_s:
            if self.holds or all(node != self._source for node, _ in await self._others()):
                break
            await asyncio.sleep(POLL_S)
        return TriggerResponse(success=self.holds, message=self.about)


def _session_of(node: str, epoch: bytes) -> bytes:
    """Return the beginning of the id of a token's session, which both the epoch of a run and the mark of a candidate contain."""
    if epoch:
        return epoch[:SESSION_BYTES]
    mark = node.rpartition(".")[2][: 2 * SESSION_BYTES]
    return bytes.fromhex(mark) if re.fullmatch("([0-9a-f]{2})+", mark) else b""


def about_this_process(source: str) -> str:
    """Return a sentence about this program, for other programs that want the name."""
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
