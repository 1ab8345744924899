"""Attacks the hub with bare sockets and bare Zenoh sessions, without the project's code.

    python hub_attacker.py ENDPOINT ATTACK COUNT RATE_HZ

It makes COUNT attempts (0: any number) at a rate, prints "under way" after the last (with 0: after the first), and stays
until its stdin ends. It connects again when the hub closes its connection.
"""

import contextlib
import itertools
import os
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator

import zenoh
from rogue import open_rogue
from zenoh_wire import (
    KEY_EXPRESSION,
    QUERYABLE,
    SUBSCRIBER,
    TOKEN,
    WireSession,
    connect,
    declaration,
    introduction,
    send,
)

TWIST = bytes([0, 1, 0, 0]) + struct.pack("<6d", 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
LONG = "x" * 1024
HUGE = bytes(16 << 20)
PART = bytes(40_000)
CRUMB = b"x"
FLOOD = bytes(30_000)
DEAF_SESSIONS = 200
MIXED = (KEY_EXPRESSION, SUBSCRIBER, QUERYABLE, TOKEN)

kept: list[object] = []
"""What was opened stays open."""
Attempt = Callable[[int], object]


def silent(endpoint: str) -> Attempt:
    """Connect, and send nothing."""
    return lambda _: kept.append(connect(endpoint))


def half_open(endpoint: str) -> Attempt:
    """Connect, introduce itself, and send nothing more."""

    def attempt(_: int) -> None:
        link = connect(endpoint)
        send(link, introduction())
        kept.append(link)

    return attempt


def broken(endpoint: str) -> Attempt:
    """Break the rules after the introduction, so that the hub ends the connection."""

    def attempt(_: int) -> None:
        link = connect(endpoint)
        send(link, introduction())
        link.recv(2)
        send(link, b"\0\0\0\0")
        kept.append(link)

    return attempt


def sessions(endpoint: str) -> Attempt:
    return lambda _: kept.append(open_rogue(endpoint))


def deaf(endpoint: str) -> Attempt:
    """Subscribe to everything in many sessions that read nothing, and fill them by samples of another one."""
    for _ in range(DEAF_SESSIONS):
        listener = WireSession(endpoint)
        listener.frame(declaration(SUBSCRIBER, 1, "robot/**"))
        kept.append(listener)
    session = open_rogue(endpoint)

    def attempt(_: int) -> None:
        session.put("robot/scan", FLOOD, priority=zenoh.Priority.REAL_TIME)

    return attempt


def declarations(endpoint: str, kinds: tuple[int, ...], key: str) -> Attempt:
    session = WireSession(endpoint)
    return lambda n: session.frame(declaration(kinds[n % len(kinds)], n + 1, f"robot/{key.format(n)}"))


def samples(endpoint: str, key: str, payload: bytes) -> Attempt:
    session = open_rogue(endpoint)

    def attempt(number: int) -> None:
        session.put(f"robot/{key.format(number)}", payload)

    return attempt


def fragments(endpoint: str, part: bytes) -> Attempt:
    """Begin messages that never end."""
    session = WireSession(endpoint)
    return lambda _: session.fragment(part)


ATTACKS: dict[str, Callable[[str], Attempt]] = {
    "silent": silent,
    "half_open": half_open,
    "broken": broken,
    "sessions": sessions,
    "deaf": deaf,
    "tokens": lambda e: declarations(e, (TOKEN,), "alive/x{}"),
    "declarations": lambda e: declarations(e, MIXED, "x{}/cmd_vel"),
    "unknown_sources": lambda e: samples(e, "x{}/cmd_vel", TWIST),
    "long_keys": lambda e: samples(e, LONG + "{}/cmd_vel", TWIST),
    "huge_payloads": lambda e: samples(e, "teleop/cmd_vel", HUGE),
    "fragments": lambda e: fragments(e, PART),
    "crumbs": lambda e: fragments(e, CRUMB),
}


def paced(rate_hz: float, over: threading.Event) -> Iterator[int]:
    """Yield numbers from 0 at a rate, until `over` is set."""
    began_s = time.monotonic()
    for number in itertools.count():
        while number > (time.monotonic() - began_s) * rate_hz:
            if over.wait(0.002):
                return
        yield number
        if over.is_set():
            return


def main() -> None:
    endpoint, name, count, rate_hz = sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
    over = threading.Event()

    def watch() -> None:
        sys.stdin.read()
        over.set()

    threading.Thread(target=watch, daemon=True).start()
    attempt = ATTACKS[name](endpoint)
    for number in itertools.islice(paced(rate_hz, over), count or None):
        try:
            attempt(number)
        except OSError:  # the hub has closed the connection
            with contextlib.suppress(OSError):
                attempt = ATTACKS[name](endpoint)
        if number + 1 == (count or 1):
            print("under way", flush=True)
    over.wait()
    os._exit(0)  # without a goodbye, as an attacker ends


main()
