"""A page that drives, without a browser: it sends the messages of station/page over connections that the campaign opens.

It pairs, holds the lease, confirms pictures, and drives while keys are held. After each loss of a connection, it asks to drive
again.
"""

import asyncio
import json
from collections.abc import Awaitable, Callable, Collection, Coroutine
from contextlib import AbstractAsyncContextManager, suppress
from random import Random
from typing import Any, NamedTuple, NoReturn, Protocol

from wire.lease import PRESENCE_PERIOD_S

BEAT_S = 0.03
"""Period of the commands, as in station/page/drive.js."""
FRAME_S = 1.0 / 60.0
AGAIN_S = 0.3
"""From the loss of a connection to the next one."""
STEP = 0.1
KEYS = {"w": (STEP, 0.0), "x": (-STEP, 0.0), "a": (0.0, STEP), "d": (0.0, -STEP)}
RELEASING_KEYS = ("s", "r")
NOTHING = (0.0, 0.0)
NAME = json.dumps({"name": "operator"})
"""Of the person: the server lets nobody drive without a name."""
LEASE = json.dumps({"challenge": "1", "response": "0", "stop": False})
"""The station is not in the configuration, so the supervisor sends no challenges."""
CONNECTIONS = ("lease", "picture", "drive")
"""The websockets of a page."""
MAX_GARBAGE = 600
"""Characters: longer than the server accepts."""


class Connection(Protocol):
    """A websocket."""

    async def send(self, text: str, /) -> None: ...

    async def recv(self) -> Any: ...  # noqa: ANN401 - a text


Connect = Callable[[str], AbstractAsyncContextManager[Connection]]
"""Opens one of `CONNECTIONS`."""


class PageFault(NamedTuple):
    """The faulty behaviour of a page; by default none."""

    frozen: bool = False
    """It sends the number of one picture with all its commands, and ignores the answers of the server."""
    garbage_on: str = ""
    """The connection on which it sends no valid message; empty: none."""
    seed: int = 0
    """Of the garbage."""


class Page:
    """One page.

    Args:
        connect: opens its connections.
        code: the code that pairs it.
        ends: the errors that a connection raises if it cannot be opened, or has ended.
    """

    def __init__(
        self, connect: Connect, code: str, ends: tuple[type[Exception], ...] = (ConnectionError,)
    ) -> None:
        self._connect, self._hello, self._ends = connect, {"code": code}, ends
        self._held = NOTHING
        """Shares of the largest velocities, ahead and to the left."""
        self._number = 0
        """Of the newest picture that was drawn; 0: none is shown."""
        self.set_fault(PageFault())
        self._wheel: Connection | None = None
        self._drives = False
        """Whether the server lets it drive; until then, keys have no effect."""

    # --- inputs

    async def press(self, keys: Collection[str]) -> None:
        """Press keys of teleop: w, x, a and d change what is held, s and r release it, and r resets the e-stop; others do nothing."""
        for key in keys:
            linear, angular = KEYS.get(key, NOTHING)
            held = (_share(self._held[0] + linear), _share(self._held[1] + angular))
            self._held = held if self._drives and key not in RELEASING_KEYS else NOTHING
        with suppress(*self._ends):  # the tasks of the page handle it
            await self._command()
            if "r" in keys:
                await self._send({"request": "reset"})

    def set_fault(self, fault: PageFault) -> None:
        """Replace the faulty behaviour of the page."""
        self._stale_number = self._number if fault.frozen else None
        self._garbage_on = fault.garbage_on
        self._random = Random(fault.seed)  # noqa: S311 - the garbage must be repeatable

    # --- behaviour

    async def run(self) -> NoReturn:
        """Hold the lease, confirm pictures and drive."""
        while True:
            with suppress(*self._ends):
                async with self._connect("lease") as socket:
                    await socket.send(json.dumps(self._hello))
                    self._hello = {"token": json.loads(await socket.recv())["token"]}
                    await socket.send(NAME)
                    beat = self._beat(PRESENCE_PERIOD_S, lambda: self._put(socket, "lease", LEASE))
                    await _until_one_ends(
                        beat, _ignore(socket), self._again(self._draw), self._again(self._drive)
                    )
            await asyncio.sleep(AGAIN_S)

    async def _again(self, work: Callable[[], Coroutine[Any, Any, None]]) -> NoReturn:
        while True:
            with suppress(*self._ends):
                await work()
            await asyncio.sleep(AGAIN_S)

    async def _draw(self) -> None:
        async with self._connect("picture") as socket:
            try:
                await socket.send(json.dumps(self._hello))
                while True:
                    message = json.loads(await socket.recv())
                    if message["kind"] == "picture":
                        await asyncio.sleep(FRAME_S)
                        self._number = message["number"]
                        await self._put(socket, "picture", json.dumps({"drawn": self._number}))
            finally:
                self._number = 0

    async def _drive(self) -> None:
        async with self._connect("drive") as socket:
            try:
                await socket.send(json.dumps(self._hello))
                self._wheel, self._held = socket, NOTHING
                await _until_one_ends(self._listen(socket), self._beat(BEAT_S, self._command))
            finally:
                self._wheel, self._drives = None, False

    async def _listen(self, socket: Connection) -> NoReturn:
        """Release what is held when the server refuses it, unless the picture is frozen."""
        while True:
            message = json.loads(await socket.recv())
            if message["kind"] == "turn":
                self._drives = message["drives"]
            elif self._stale_number is None:
                self._held = NOTHING
                await self._command()

    async def _beat(self, period_s: float, send: Callable[[], Awaitable[None]]) -> NoReturn:
        while True:
            await send()
            await asyncio.sleep(period_s)

    async def _command(self) -> None:
        linear, angular = self._held
        number = self._number if self._stale_number is None else self._stale_number
        now_s = asyncio.get_running_loop().time()
        await self._send({"linear": linear, "angular": angular, "time_s": now_s, "picture": number})

    async def _send(self, message: dict[str, Any]) -> None:
        if self._wheel is not None:
            await self._put(self._wheel, "drive", json.dumps(message))

    async def _put(self, socket: Connection, name: str, text: str) -> None:
        await socket.send(garbage(self._random) if name == self._garbage_on else text)


def garbage(chance: Random) -> str:
    """Return a text that is none of the messages of a page."""
    number = chance.choice(("NaN", "Infinity", "1e999", "-1e9", "null", '"1"', "[]", "true"))
    return chance.choice(
        (
            "",
            "null",
            "{}",
            "[" * chance.randint(1, MAX_GARBAGE),
            "".join(chr(chance.randrange(1, 0xD800)) for _ in range(chance.randint(1, 40))),
            f'{{"linear": {number}, "angular": 0, "time_s": 0, "picture": 1}}',
            f'{{"linear": 1, "angular": 0, "time_s": {number}, "picture": 1}}',
            f'{{"drawn": {number}}}',
            f'{{"challenge": {number}, "response": "0", "stop": 0}}',
            '{"request": false}',
        )
    )


def _share(value: float) -> float:
    return round(max(-1.0, min(1.0, value)), 3)


async def _ignore(socket: Connection) -> NoReturn:
    while True:
        await socket.recv()


async def _until_one_ends(*works: Coroutine[Any, Any, NoReturn]) -> None:
    """Run works together until one raises an error; raise it."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
