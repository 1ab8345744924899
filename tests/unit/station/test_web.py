"""The server of the page keeps nothing of a page that it has refused."""

import gc
import weakref

from starlette.types import Message

from station.admission import Address
from station.pairing import Pairing
from station.relay import Relay
from station.web import Application

HEADERS = [(b"host", b"page:8470"), (b"origin", b"http://page:8470")]


class Stranger:
    """One end of a websocket, which sends a wrong code."""

    def __init__(self) -> None:
        self.sends: list[Message] = [
            {"type": "websocket.connect"},
            {"type": "websocket.receive", "text": '{"code": "wrong"}'},
        ]
        self.got: list[Message] = []

    async def receive(self) -> Message:
        return self.sends.pop(0)

    async def send(self, message: Message) -> None:
        self.got.append(message)


async def test_nothing_of_a_page_that_was_refused_stays_in_memory() -> None:
    address = Address("http", ("page",), 8470)
    application = Application(
        "phone", address, Relay("phone", "tcp/x:1"), Pairing(), lambda: 0.0, print, None, None
    )
    stranger = Stranger()
    scope = {"type": "websocket", "path": "/lease", "headers": HEADERS, "state": {"visitor": None}}
    await application(scope, stranger.receive, stranger.send)
    assert stranger.got[-1]["code"] == 4401
    kept = weakref.ref(stranger)
    del stranger
    gc.collect()
    assert kept() is None
