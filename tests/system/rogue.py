"""A client that ignores the protocol: a bare Zenoh session."""

import json
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager

import zenoh

from tests.system.ports import participants

UNANSWERED_S = 1.0


def open_rogue(endpoint: str) -> zenoh.Session:
    settings = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
    }.items():
        settings.insert_json5(key, json.dumps(value))
    return zenoh.open(settings)


def answer(session: zenoh.Session, key: str, payload: bytes) -> zenoh.Queryable[None]:
    """Answer all queries that match a key with a payload."""

    def reply(query: zenoh.Query) -> None:
        query.reply(key, payload)

    return session.declare_queryable(key, reply)


@contextmanager
def freezing(endpoint: str) -> Generator[None]:
    """Let two programs of this user declare, and ask for what is declared, until the hub's routing is deadlocked.

    Zenoh answers such a query while it holds the read lock of its tables. A declaration that arrives meanwhile blocks its
    routing (pull request 2619 of eclipse-zenoh/zenoh).
    """
    over = threading.Event()
    there = participants(endpoint)

    def declare() -> None:
        writer = open_rogue(there)
        while not over.is_set():
            writer.declare_subscriber("robot/2/scan", lambda _: None).undeclare()  # pyright: ignore[reportUnknownMemberType]

    def ask() -> None:
        reader = open_rogue(there)
        while not over.is_set():
            asked_s = time.monotonic()
            list(reader.get("@/*/peer/subscriber/**", timeout=UNANSWERED_S))
            if time.monotonic() >= asked_s + UNANSWERED_S:
                over.set()  # before the hub is started again

    threads = [threading.Thread(target=work, daemon=True) for work in (declare, ask)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        over.set()
