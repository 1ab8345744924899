"""Proves to a client whose hub it is connected to: on this machine, one of the expected user (docs/decisions/0060).

Any user can listen at the port of a supervisor that does not run, and nothing on the wire tells such a hub from the supervisor.
Therefore the kernel is asked who has the other end of the client's own connection, after each connection. Certificates
prove the hubs of other machines; at `tcp/` of another machine, nothing does.
"""

import asyncio
import logging
import os
import pwd
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import zenoh

from wire import tls
from wire.bus_config import BusConfig
from wire.host.connections import ROOT, is_here, tcp_user, unix_users
from wire.zenoh import local_socket

_log = logging.getLogger(__name__)

ASK_AGAIN_S = 0.02
ATTEMPTS = 10
"""How often the kernel is asked about a connection that it does not show yet."""
ASK_LATER_S = 0.2
"""Pause before the kernel is asked about an unproven connection again, although no transport has opened or ended."""


class HubProof:
    """Decides whether the hub of one client session is believed.

    Args:
        config: the endpoint, and the user who may run the hub beside this process's user and root. A user whom this
            machine does not have is nobody's: the same configuration is also used on other machines.
        say: called in this event loop with a sentence about a hub that is refused.
        must_connect: whether the client also connects to a refused hub; it hears nothing of it.
    """

    def __init__(self, config: BusConfig, say: Callable[[str], None], *, must_connect: bool = False) -> None:
        self.say, self.must_connect = say, must_connect
        self._endpoint = config.endpoint
        self._is_needed = not tls.is_secure(config.endpoint)
        self._user = config.hub_user
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._connection = 0
        self._proven, self._news = threading.Event(), threading.Event()
        if not self._is_needed:
            self._proven.set()
        self._said: str | None = None

    @property
    def holds(self) -> bool:
        """Whether the present connection leads to a hub of the expected user."""
        return self._proven.is_set()

    def holds_within(self, timeout_s: float) -> bool:
        """Wait until it holds; return whether it does. Blocks."""
        return self._proven.wait(timeout_s)

    def check(self, session: zenoh.Session) -> bool:
        """Return whether the session is connected to a hub of the expected user; if it is refused, say why. Blocks."""
        if not self._is_needed:
            return True
        links, users = list[zenoh.Link](), list[int | None]()
        for _ in range(ATTEMPTS):
            links = session.info.links()
            users = [user for link in links for user in _users_of(link)]
            if links and None not in users:
                break
            time.sleep(ASK_AGAIN_S)
        strangers = [user for user in users if not self._is_believed(user)]
        if strangers:
            self._refuse(strangers[0])
        elif links:
            self._said = None
        return bool(links) and not strangers

    def start(self, session: zenoh.Session) -> None:
        """Prove the connections of an open session until it closes, on a thread of its own."""
        if self._is_needed:
            threading.Thread(target=self._prove, args=(session,), daemon=True, name="hub-proof").start()

    def changed(self) -> None:
        """Believe nothing until the present connection is proven.

        Called on Zenoh's thread at each transport that opens, before its first message is read, and at each one that ends.
        """
        if not self._is_needed:
            return
        with self._lock:
            self._connection += 1
            self._proven.clear()
        self._news.set()

    def _prove(self, session: zenoh.Session) -> None:
        # The events alone are no cause to ask: on a busy machine, the end of an old transport is reported after its successor.
        while not session.is_closed():
            number = self._connection
            is_proven = self._is_proven(session)
            with self._lock:
                if is_proven and number == self._connection:
                    self._proven.set()
            self._news.wait(None if self.holds else ASK_LATER_S)
            self._news.clear()

    def _is_proven(self, session: zenoh.Session) -> bool:
        try:
            return self.check(session)
        except Exception as error:  # noqa: BLE001 - whatever it is, the hub is unproven, and this thread goes on
            _log.debug("cannot ask whose hub it is: %s", error)
            return False

    def _is_believed(self, user: int | None) -> bool:
        return user in {ROOT, os.getuid()} or (user is not None and self._user in {str(user), _name_of(user)})

    def _refuse(self, user: int | None) -> None:
        reason = (
            "the kernel does not show whose program it is, as of another network namespace: use certificates (docs/keys.md)"
            if user is None
            else f"it is a program of the user {_name_of(user)} ({user}), not of this user: end it, or name the supervisor's user in [bus] "
            "hub_user (docs/access.md)"
        )
        sentence = f"refused the hub at {self._endpoint}: {reason}"
        if sentence != self._said:
            self._said = sentence
            with suppress(RuntimeError):  # the loop has closed
                self._loop.call_soon_threadsafe(self.say, sentence)


def _users_of(link: zenoh.Link) -> list[int | None]:
    """Return the user at the other end of a link to this machine; None: it is not shown; nothing for another machine."""
    there, here = str(link.dst), str(link.src)
    protocol, _, address = there.partition("/")
    if protocol == local_socket.PROTOCOL:
        return unix_users(address) or [None]
    user = tcp_user(here.partition("/")[2], address)
    return [user] if user is not None or is_here(tls.host_of(there)) else []


def _name_of(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)
