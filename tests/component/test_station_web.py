"""The server of the page: how long a page may take to pair, and that nothing of a refused page stays in memory."""

import asyncio
import gc
import json
import socket
import weakref
from typing import Any

import pytest
from starlette.types import Message

from station.admission import Address
from station.pairing import Pairing
from station.relay import Relay
from station.visitors import VISIT_S, Visitor
from station.web import SILENCE_S, Application

HEADERS = [(b"host", b"page:8470"), (b"origin", b"http://page:8470")]


class Page:
    """One end of a websocket, which sends a code after some time, and nothing more."""

    def __init__(self, code: str, after_s: float = 0.0) -> None:
        self._sends: list[tuple[float, Message]] = [
            (0.0, {"type": "websocket.connect"}),
            (after_s, {"type": "websocket.receive", "text": json.dumps({"code": code})}),
        ]
        self.got: list[Message] = []

    async def receive(self) -> Message:
        if not self._sends:
            await asyncio.Event().wait()
        after_s, message = self._sends.pop(0)
        await asyncio.sleep(after_s)
        return message

    async def send(self, message: Message) -> None:
        self.got.append(message)


async def served(page: Page) -> None:
    """Serve a page until the server closes its websocket; the valid code is `right`."""
    pairing = Pairing()
    pairing.offer("right", 0.0)
    application = Application(
        "phone",
        Address("http", ("page",), 8470),
        Relay("phone", "tcp/x:1"),
        pairing,
        lambda: 0.0,
        print,
        None,
        None,
    )
    with socket.socket() as connection:
        visitor = Visitor(connection, "page", VISIT_S)
        scope: dict[str, Any] = {
            "type": "websocket",
            "path": "/lease",
            "headers": HEADERS,
            "state": {"visitor": visitor},
        }
        await application(scope, page.receive, page.send)


async def test_nothing_of_a_page_that_was_refused_stays_in_memory() -> None:
    page = Page("wrong")
    await served(page)
    assert page.got[-1]["code"] == 4401
    kept = weakref.ref(page)
    del page
    gc.collect()
    assert kept() is None


async def test_a_slow_page_may_take_as_long_to_pair_as_its_connection_lasts_and_must_then_answer() -> None:
    loop = asyncio.get_running_loop()
    page, began_s = Page("right", 0.9 * VISIT_S), loop.time()
    await served(page)
    welcome, closing = page.got[-2:]
    assert json.loads(welcome["text"])["kind"] == "welcome"
    assert closing["code"] == 4408
    assert loop.time() - began_s == pytest.approx(0.9 * VISIT_S + SILENCE_S)
