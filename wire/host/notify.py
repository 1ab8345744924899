"""Reports to systemd that this service is ready, that its loop runs, and that it ends: the protocol of sd_notify(3).

systemd kills and restarts a service with `WatchdogSec` whose reports end. The loop that makes the decisions therefore
sends them itself, after each decision. A thread or task of its own would go on reporting while that loop hangs.

A report is one datagram. It never waits, and a failure has no effect on the loop: the next report follows after a
quarter of `WatchdogSec`, so that two in sequence may be lost.
"""

import logging
import math
import os
import socket
from collections.abc import MutableMapping
from contextlib import suppress

_log = logging.getLogger(__name__)

SOCKET, PERIOD, PID = VARIABLES = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")
"""What systemd sets for a service: the address, `WatchdogSec` [µs], and the process that must report."""
REPORTS_PER_LIMIT = 4
RETRY_S = 0.25
"""Time between two attempts to report that the service is ready: without this report, systemd ends it."""


class Notifier:
    """The reports of this process.

    Args:
        address: the socket's path, or its abstract name with a leading `@`; None sends nothing.
        period_s: time between two reports of a running loop [s]; infinity sends none.
    """

    def __init__(self, address: str | None = None, period_s: float = math.inf) -> None:
        self._period_s = period_s
        self._is_ready = False
        self._next_s = math.inf if address is None else -math.inf
        self._socket: socket.socket | None = None
        self._address = b""
        if address is not None:
            self._address = os.fsencode(f"\0{address[1:]}" if address.startswith("@") else address)
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)

    def running(self, now_s: float) -> None:
        """Report that the loop runs, if a report is due; call it in the loop, after each decision.

        The first report states that the service is ready.

        Args:
            now_s: the time by any monotonic clock [s].
        """
        if now_s < self._next_s:
            return
        is_sent = self._send(b"WATCHDOG=1" if self._is_ready else b"READY=1\nWATCHDOG=1")
        self._is_ready = self._is_ready or is_sent
        self._next_s = now_s + (self._period_s if self._is_ready else min(self._period_s, RETRY_S))

    def stopping(self) -> None:
        """Report that the service ends, as the last report."""
        self._next_s = math.inf
        self._send(b"STOPPING=1")
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: bytes) -> bool:
        """Send a message, and return whether systemd will read it."""
        if self._socket is not None:
            with suppress(OSError):
                # Not connected: after a restart of the receiver, a connected socket would fail for the rest of the run.
                return self._socket.sendto(message, self._address) == len(message)
        return False


def take_notifier(environment: MutableMapping[str, str]) -> Notifier:
    """Return the reports that the environment asks for; log a warning if its values cannot be used.

    The variables are removed, so that no child process reports in the name of this one.
    """
    address, limit_us, pid = (environment.pop(name, None) for name in VARIABLES)
    if not address:
        return Notifier()
    if address[0] not in "/@" or len(address) < 2:
        _log.warning("%s=%s is neither a path nor an abstract name: nothing is reported", SOCKET, address)
        return Notifier()
    if limit_us is None or pid not in {None, str(os.getpid())}:
        return Notifier(address)
    if not limit_us.isdecimal() or int(limit_us) == 0:
        _log.warning("%s=%s is no number of microseconds: the watchdog is not served", PERIOD, limit_us)
        return Notifier(address)
    return Notifier(address, int(limit_us) * 1e-6 / REPORTS_PER_LIMIT)
