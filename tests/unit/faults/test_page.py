"""The page without a browser: what it sends, and that its garbage is no message of a page."""

import asyncio
import json
import re
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path
from random import Random
from typing import Any

import pytest

from faults.page import BEAT_S, Page, PageFault, garbage
from station.messages import BadMessageError, read_drawn, read_lease, read_wanted
from virtual.loop import VirtualLoop

DRIVE_JS = Path(__file__).parents[3] / "station/page/drive.js"
READ = {"lease": read_lease, "picture": read_drawn, "drive": read_wanted}
"""How the station's server reads each message of a connection but the first."""


class Server:
    """Takes everything that a page sends, and shows it pictures with the numbers of `number`."""

    def __init__(self) -> None:
        self.heard: dict[str, list[dict[str, Any]]] = {"lease": [], "picture": [], "drive": []}
        self.opened: list[str] = []
        self.texts: dict[str, asyncio.Queue[str | None]] = {}
        self.page = Page(self.open, "the code")

    @asynccontextmanager
    async def open(self, name: str) -> AsyncGenerator["Socket"]:
        self.opened.append(name)
        self.texts[name] = asyncio.Queue()
        if name == "lease":
            self.say(name, {"token": "the token"})
        elif name == "drive":
            self.say(name, {"kind": "turn", "sentence": "", "drives": True, "asker": ""})
        yield Socket(self, name)

    def say(self, name: str, message: dict[str, Any]) -> None:
        self.texts[name].put_nowait(json.dumps(message))

    @property
    def newest(self) -> tuple[float, float, int]:
        """The shares, and the number of the picture, of the last command."""
        command = self.heard["drive"][-1]
        return command["linear"], command["angular"], command["picture"]


class Socket:
    def __init__(self, server: Server, name: str) -> None:
        self._server, self._name = server, name

    async def send(self, text: str) -> None:
        if self._server.heard[self._name] and "token" not in text:
            READ[self._name](text)
        self._server.heard[self._name].append(json.loads(text))

    async def recv(self) -> str:
        text = await self._server.texts[self._name].get()
        if text is None:
            raise ConnectionResetError
        return text


def play(scene: Any) -> None:  # noqa: ANN401 - a coroutine function of a server
    """Run a scene with a page that drives, on a virtual clock."""

    async def run() -> None:
        server = Server()
        running = asyncio.ensure_future(server.page.run())
        await asyncio.sleep(0.1)
        await scene(server)
        running.cancel()
        await asyncio.sleep(0.1)

    loop = VirtualLoop()
    loop.run_until_complete(run())
    loop.close()


def test_its_commands_are_as_often_as_those_of_the_page_in_a_browser() -> None:
    found = re.search(r"const BEAT_S = ([\d.]+);", DRIVE_JS.read_text())
    assert found is not None
    assert float(found[1]) == BEAT_S


def test_it_pairs_once_and_every_connection_names_the_session() -> None:
    async def scene(server: Server) -> None:
        assert server.opened == ["lease", "picture", "drive"]
        assert server.heard["lease"][0] == {"code": "the code"}
        assert server.heard["picture"][0] == server.heard["drive"][0] == {"token": "the token"}
        server.texts["lease"].put_nowait(None)
        await asyncio.sleep(0.5)
        assert server.opened[3:] == ["lease", "picture", "drive"]
        assert server.heard["lease"][-1] != {"code": "the code"}

    play(scene)


def test_keys_change_what_is_held_until_it_is_released_or_refused() -> None:
    async def scene(server: Server) -> None:
        assert server.newest == (0.0, 0.0, 0)
        await server.page.press("wwwd")
        assert server.newest == (0.3, -0.1, 0)
        await server.page.press(["enter", "x"])
        assert server.newest == (0.2, -0.1, 0)
        await server.page.press("s")
        assert server.newest == (0.0, 0.0, 0)
        await server.page.press("w" * 20)
        assert server.newest == (1.0, 0.0, 0)
        server.say("drive", {"kind": "answer", "sentence": "The robot is not seen."})
        await asyncio.sleep(0.001)
        assert server.newest == (0.0, 0.0, 0)
        await server.page.press("wr")
        assert server.heard["drive"][-1] == {"request": "reset"}
        assert server.heard["drive"][-2]["linear"] == 0.0

    play(scene)


def test_a_frozen_page_names_the_same_picture_and_holds_on() -> None:
    async def scene(server: Server) -> None:
        server.say("picture", {"kind": "robot"})
        for number in (1, 2):
            server.say("picture", {"kind": "picture", "number": number})
            await asyncio.sleep(0.1)
            assert server.heard["picture"][-1] == {"drawn": number}
        await server.page.press("w")
        server.page.set_fault(PageFault(frozen=True))
        server.say("picture", {"kind": "picture", "number": 3})
        server.say("drive", {"kind": "answer", "sentence": "The picture is 0.4 s old."})
        await asyncio.sleep(0.1)
        assert server.newest == (0.1, 0.0, 2)
        server.page.set_fault(PageFault())
        await asyncio.sleep(0.1)
        assert server.newest == (0.1, 0.0, 3)

    play(scene)


def test_what_is_held_is_released_with_the_connection() -> None:
    async def scene(server: Server) -> None:
        await server.page.press("w")
        server.texts["drive"].put_nowait(None)
        await asyncio.sleep(0.1)
        await server.page.press("w")
        await asyncio.sleep(0.5)
        assert server.newest == (0.0, 0.0, 0)

    play(scene)


@pytest.mark.parametrize("seed", range(200))
def test_garbage_is_no_message_of_a_page(seed: int) -> None:
    text = garbage(Random(seed))
    for read in READ.values():
        with pytest.raises(BadMessageError):
            read(text)
