"""Reports that the loop of this service runs: to the kernel, which ends a service that hangs, and to systemd.

The loop that makes the decisions sends the reports itself, after each decision. A thread or task of its own would go on
reporting while that loop hangs.

To the kernel, a report sets a timer. When it expires, SIGALRM ends the process, even if its threads hold or wait for
locks: the signal has no handler. The program that started the service then starts it again.

To systemd, a report is one datagram of sd_notify(3), which also says that the service is ready and that it ends. systemd
kills a service with `WatchdogSec` whose reports end, also one that is stopped by a signal. A report never waits, and a
failure has no effect on the loop: the next one follows after a quarter of `WatchdogSec`, so that two in sequence may be lost.
"""

import logging
import math
import os
import signal
import socket
from collections.abc import MutableMapping
from contextlib import suppress

from wire.host.process import STOP_LIMIT_S

_log = logging.getLogger(__name__)

SOCKET, PERIOD, PID = VARIABLES = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")
"""What systemd sets for a service: the address, `WatchdogSec` [µs], and the process that must report."""
REPORTS_PER_LIMIT = 4
TURN_LIMIT_S = 2.0
"""Maximum time between two reports of a service [s]; docs/decisions/0064 has the reasons.

It counts while the process is stopped by a signal, but not while the machine is suspended.
"""
RETRY_S = 0.25
"""Time between two attempts to report that the service is ready: without this report, systemd ends it."""


class Notifier:
    """The reports of this process.

    Args:
        address: the socket's path, or its abstract name with a leading `@`; None sends nothing.
        period_s: time between two reports of a running loop to systemd [s]; infinity sends none.
        turn_limit_s: time after a report at which the kernel ends this process, from the first report on [s]; infinity: never.
            Only the main thread may then create the notifier.
    """

    def __init__(
        self, address: str | None = None, period_s: float = math.inf, turn_limit_s: float = math.inf
    ) -> None:
        self._turn_limit_s = turn_limit_s
        if self._turn_limit_s < math.inf:
            # The process inherits from the one that started it whether a signal is ignored or blocked.
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
        self._period_s = period_s
        self._is_ready = False
        self._next_s = math.inf if address is None else -math.inf
        self._socket: socket.socket | None = None
        self._address = b""
        if address is not None:
            self._address = os.fsencode(f"\0{address[1:]}" if address.startswith("@") else address)
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)

    def running(self, now_s: float) -> None:
        """Report that the loop runs; call it in the loop, after each decision.

        systemd gets a report if one is due. The first one states that the service is ready.

        Args:
            now_s: the time by any monotonic clock [s].
        """
        if self._turn_limit_s < math.inf:
            signal.setitimer(signal.ITIMER_REAL, self._turn_limit_s)
        if now_s < self._next_s:
            return
        is_sent = self._send(b"WATCHDOG=1" if self._is_ready else b"READY=1\nWATCHDOG=1")
        self._is_ready = self._is_ready or is_sent
        self._next_s = now_s + (self._period_s if self._is_ready else min(self._period_s, RETRY_S))

    def stopping(self) -> None:
        """Report that the service ends, as the last report; the kernel allows `STOP_LIMIT_S` for it."""
        if self._turn_limit_s < math.inf:
            signal.setitimer(signal.ITIMER_REAL, STOP_LIMIT_S)
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


def take_notifier(environment: MutableMapping[str, str], turn_limit_s: float = math.inf) -> Notifier:
    """Return the notifier that the environment asks for; log a warning if its values cannot be used.

    The variables are removed, so that no child process reports in the name of this one.
    """
    address, period_s = _take_systemd(environment)
    return Notifier(address, period_s, turn_limit_s)


def _take_systemd(environment: MutableMapping[str, str]) -> tuple[str | None, float]:
    """Return systemd's address and the time between two reports to it [s], as for `Notifier`."""
    address, limit_us, pid = (environment.pop(name, None) for name in VARIABLES)
    if not address:
        return None, math.inf
    if address[0] not in "/@" or len(address) < 2:
        _log.warning("%s=%s is neither a path nor an abstract name: nothing is reported", SOCKET, address)
        return None, math.inf
    if limit_us is None or pid not in {None, str(os.getpid())}:
        return address, math.inf
    if not limit_us.isdecimal() or int(limit_us) == 0:
        _log.warning("%s=%s is no number of microseconds: the watchdog is not served", PERIOD, limit_us)
        return address, math.inf
    return address, int(limit_us) * 1e-6 / REPORTS_PER_LIMIT
