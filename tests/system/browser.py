"""Debian's Chromium without a window, driven over its DevTools protocol: it shows real pages, and dies as a real browser does."""

import asyncio
import itertools
import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from tests.system.operators import LIMIT_S, until

CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs Debian's package chromium")
OPTIONS = (
    "--headless=new",
    "--no-sandbox",  # Chromium refuses its sandbox to root
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-gpu",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--remote-debugging-port=0",
)
SHOWN = """["word", "sentence"].map((id) => document.getElementById(id)?.textContent).join("|")"""


class Tab:
    """One page of the browser."""

    def __init__(self, browser: "Browser", target: str, session: str) -> None:
        self._browser, self.target, self._session = browser, target, session

    async def do(self, method: str, **parameters: object) -> dict[str, Any]:
        """Run a command of the DevTools protocol."""
        return await self._browser.do(method, self._session, **parameters)

    async def evaluate(self, expression: str) -> Any:  # noqa: ANN401 - any JSON value
        """Return the value of an expression in the page."""
        result = await self.do(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    async def begin(self, expression: str) -> None:
        """Run an expression that does not return."""
        await self._browser.send("Runtime.evaluate", self._session, expression=expression)

    async def shows(self, word: str, sentence: str = "") -> None:
        """Wait until the page shows a word, and a part of a sentence."""
        started_s, shown = time.monotonic(), ""
        while not (shown.startswith(f"{word}|") and sentence in shown):
            assert time.monotonic() - started_s < LIMIT_S, f"the page shows {shown!r}"
            shown = await self.evaluate(SHOWN)

    async def waits_for(self, condition: str, within_s: float = LIMIT_S) -> None:
        """Wait until an expression is true in the page."""
        started_s = time.monotonic()
        while not await self.evaluate(condition):
            assert time.monotonic() - started_s < within_s, condition

    async def is_heard(self) -> None:
        """Wait until the supervisor hears the page; a busy machine may have stopped the robot already."""
        await self.waits_for("document.body?.dataset.word !== 'NOT HEARD'")

    async def click(self, x: float, y: float) -> None:
        """Press and release the left button at a place of the page [CSS pixels]."""
        await self.mouse("mousePressed", x, y)
        await self.mouse("mouseReleased", x, y)

    async def mouse(self, kind: str, x: float, y: float) -> None:
        await self.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    async def touch(self, kind: str, *places: tuple[float, float]) -> None:
        """Touch with as many fingers as there are places [CSS pixels]; `touchEnd` has none."""
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(places)]
        await self.do("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    async def press_key(self, key: str) -> None:
        await self.do("Input.dispatchKeyEvent", type="keyDown", key=key)
        await self.do("Input.dispatchKeyEvent", type="keyUp", key=key)

    async def middle_of(self, selector: str) -> tuple[float, float]:
        """Return the middle of an element [CSS pixels]."""
        place = await self.evaluate(
            f"(() => {{ const box = document.querySelector({selector!r}).getBoundingClientRect();"
            " return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        assert place != [0, 0], f"{selector} is hidden"
        return place[0], place[1]

    async def close(self) -> None:
        await self._browser.do("Target.closeTarget", targetId=self.target)


class Browser:
    """A Chromium with an empty profile, as a group of processes of its own."""

    def __init__(self, profile: Path, *options: str) -> None:
        assert CHROMIUM is not None
        profile.mkdir()
        self._profile = profile
        with (profile / "log").open("wb") as log:
            self._process = subprocess.Popen(
                [CHROMIUM, *OPTIONS, *options, f"--user-data-dir={profile}", "about:blank"],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._numbers = itertools.count(1)
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}

    async def join(self) -> ClientConnection:
        """Connect to its DevTools, as soon as it runs."""
        port_file = self._profile / "DevToolsActivePort"
        await until(lambda: port_file.exists() and len(port_file.read_text().splitlines()) == 2)
        port, path = port_file.read_text().splitlines()
        self._connection = await connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        return self._connection

    async def listen(self) -> None:
        async for text in self._connection:
            message = json.loads(text)
            answer = self._answers.pop(message.get("id", 0), None)
            if answer is not None and not answer.done():
                answer.set_result(message)

    async def send(self, method: str, session: str, **parameters: object) -> asyncio.Future[dict[str, Any]]:
        """Send a command, and return its future answer."""
        number = next(self._numbers)
        answer = self._answers[number] = asyncio.get_running_loop().create_future()
        command = {"id": number, "method": method, "params": parameters}
        await self._connection.send(json.dumps(command | ({"sessionId": session} if session else {})))
        return answer

    async def do(self, method: str, session: str = "", **parameters: object) -> dict[str, Any]:
        async with asyncio.timeout(LIMIT_S):
            message = await (await self.send(method, session, **parameters))
        assert "error" not in message, message
        return message["result"]

    async def open(self, url: str, *, any_server: bool = False) -> Tab:
        """Open a page in a new tab, in front of the others; its content security policy may be ignored, so that it can reach any server."""
        target = (await self.do("Target.createTarget", url="about:blank"))["targetId"]
        attached = await self.do("Target.attachToTarget", targetId=target, flatten=True)
        tab = Tab(self, target, attached["sessionId"])
        if any_server:
            await tab.do("Page.setBypassCSP", enabled=True)
        await tab.do("Page.navigate", url=url)  # answers when the new document is there
        return tab

    def stop_part(self, option: str) -> None:
        """SIGSTOP to its processes with an option, such as `--type=renderer`; without one, to that which receives touches and keys."""
        found = 0
        for process in Path("/proc").iterdir():
            with suppress(OSError, ValueError):
                arguments = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                is_wanted = option in arguments if option else "--type=" not in arguments
                if is_wanted and os.getpgid(int(process.name)) == self._process.pid:
                    os.kill(int(process.name), signal.SIGSTOP)
                    found += 1
        assert found, f"no process has {option}"

    def kill(self) -> None:
        """SIGKILL to all its processes."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


@asynccontextmanager
async def browser(profile: Path, *options: str) -> AsyncGenerator[Browser]:
    made = Browser(profile, *options)
    listening: asyncio.Future[None] | None = None
    try:
        await made.join()
        listening = asyncio.ensure_future(made.listen())
        yield made
    finally:
        made.kill()  # also if a part of it is stopped, which would not end its connection
        if listening is not None:
            with suppress(ConnectionClosed):
                await listening
