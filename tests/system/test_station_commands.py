"""Commands over the page's connections, without a browser: old pictures, old times, garbage, and who may drive."""

import asyncio
import json
import signal
import tempfile
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidStatus

from deploy.stack import processes
from tests.system.harness import PATIENCE_S, Robot, patiently
from tests.system.operators import until
from tests.system.pages import Beside, Page, Server, served
from tests.system.ports import free_endpoint
from tests.system.test_estop_stations import ESTOP, LOST
from tests.system.test_station_picture import closing_code
from wire import topics

pytestmark = pytest.mark.timeout(180)

BAD_MESSAGE, NOT_PAIRED, NO_NAME, NO_DRIVING, SILENT, HELD = 4400, 4401, 4403, 4405, 4408, 4423
BEAT_S = 0.03
SLOW_M_S = 0.1


class Hands:
    """A page that watches and drives: it sends what is wanted now, with the newest picture that it has drawn."""

    def __init__(self, pictures: ClientConnection, commands: ClientConnection) -> None:
        self._pictures, self.commands = pictures, commands
        self.linear, self.beats, self.told, self.draws = 0.0, True, list[str](), asyncio.Event()
        self.draws.set()
        self._number = self._sent = 0
        self.robot, self.picture = dict[str, Any](), dict[str, Any]()
        """What is constant, and the newest picture."""

    async def rest(self) -> None:
        """Request zero, and wait until it was sent."""
        self.linear, before = 0.0, self._sent
        await until(lambda: self._sent > before + 1)

    async def draw(self) -> None:
        with suppress(ConnectionClosed):
            async for text in self._pictures:
                message = json.loads(text)
                if message["kind"] == "robot":
                    self.robot = message
                elif message["kind"] == "picture":
                    await self.draws.wait()
                    self._number, self.picture = message["number"], message
                    await self._pictures.send(json.dumps({"drawn": self._number}))

    async def hear(self) -> None:
        with suppress(ConnectionClosed):
            async for text in self.commands:
                self.told.append(json.loads(text)["sentence"])

    async def beat(self) -> None:
        with suppress(ConnectionClosed):
            while self.beats:
                time_s = asyncio.get_running_loop().time()
                wanted = {"linear": self.linear, "angular": 0.0, "time_s": time_s, "picture": self._number}
                await self.commands.send(json.dumps(wanted))
                self._sent += 1
                await asyncio.sleep(BEAT_S)

    async def closed(self) -> int | None:
        """Wait until the server ends the driving, and return the code."""
        await self.commands.wait_closed()
        return self.commands.close_code


@asynccontextmanager
async def hands(server: Server, page: Page, *, watches: bool = True) -> AsyncGenerator[Hands]:
    async with server.socket(path="picture") as pictures, server.socket(path="drive") as commands:
        for socket in (pictures, commands)[not watches :]:
            await socket.send(json.dumps({"token": page.token}))
        one = Hands(pictures, commands)
        tasks = [asyncio.ensure_future(part) for part in (one.draw(), one.hear(), one.beat())]
        try:
            yield one
        finally:
            for task in tasks:
                task.cancel()


@asynccontextmanager
async def driver(tmp_path: Path) -> AsyncGenerator[tuple[Robot, Server, Page, Hands]]:
    """A robot, and a page at its wheel."""
    async with (
        served(tmp_path, topics.SUPERVISOR, topics.SIM, drives=True) as (subject, server),
        server.heard_page(subject) as page,
        hands(server, page) as one,
    ):
        yield subject, server, page, one


async def drives(subject: Robot, one: Hands) -> None:
    """Reset, arm and drive; on a busy machine, again."""

    async def attempt() -> None:
        await one.rest()
        if {ESTOP, LOST} & set(subject.status.reasons):
            await one.commands.send(json.dumps({"request": "reset"}))
        await subject.ready(PATIENCE_S / 4)
        one.linear = 0.4
        await subject.until(lambda: subject.status.permitted.linear.x > SLOW_M_S, "motion", PATIENCE_S / 4)

    await patiently(attempt)


async def stands(subject: Robot) -> None:
    await subject.until(lambda: subject.status.permitted.linear.x == 0.0, "zero")


async def stays(subject: Robot) -> None:
    await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion", 0.5)


@pytest.mark.smoke
async def test_a_page_that_draws_nothing_new_is_stopped_and_drives_again_only_after_its_own_zero(
    tmp_path: Path,
) -> None:
    async with driver(tmp_path) as (subject, _, _, one):
        await drives(subject, one)
        one.draws.clear()
        await stands(subject)
        await until(lambda: any(told.startswith("The picture is") for told in one.told))
        one.draws.set()
        await until(lambda: one.told[-1] == "Let go first.")
        await stays(subject)
        await drives(subject, one)


async def test_a_page_that_has_never_drawn_a_picture_does_not_drive(tmp_path: Path) -> None:
    async with (
        served(tmp_path, drives=True) as (subject, server),
        server.heard_page(subject) as page,
        server.socket(path="drive") as commands,
    ):
        await commands.send(json.dumps({"token": page.token}))
        wanted = {"linear": 0.4, "angular": 0.0, "time_s": 1.0, "picture": 1}
        told = ""
        while told != "The robot is not seen.":
            await commands.send(json.dumps(wanted))
            told = json.loads(await asyncio.wait_for(commands.recv(), PATIENCE_S))["sentence"]
        await stays(subject)


@pytest.mark.parametrize(
    "text",
    [
        "garbage",
        "{}",
        '{"linear": 1.01, "angular": 0, "time_s": 1e6, "picture": 1}',
        '{"linear": NaN, "angular": 0, "time_s": 1e6, "picture": 1}',
        '{"linear": true, "angular": 0, "time_s": 1e6, "picture": 1}',
        '{"linear": "1", "angular": 0, "time_s": 1e6, "picture": 1}',
        '{"linear": 0.1, "angular": 0, "time_s": 1e6}',
        '{"linear": 0.1, "angular": 0, "time_s": -1, "picture": 1}',
        '{"request": 1}',
    ],
)
async def test_a_message_that_is_no_command_ends_the_driving(tmp_path: Path, text: str) -> None:
    async with driver(tmp_path) as (subject, _, _, one):
        await drives(subject, one)
        await one.commands.send(text)
        assert await asyncio.wait_for(one.closed(), PATIENCE_S) == BAD_MESSAGE
        await stands(subject)
        await stays(subject)


async def test_a_page_that_falls_silent_loses_the_wheel_and_another_one_may_take_it(tmp_path: Path) -> None:
    async with driver(tmp_path) as (subject, server, page, one):
        await drives(subject, one)
        one.beats = False
        await stands(subject)
        assert await asyncio.wait_for(one.closed(), PATIENCE_S) == SILENT
        async with hands(server, page, watches=False) as again:
            await until(lambda: again.told == [""])


async def test_no_command_is_sent_on_after_the_end_of_the_pages_lease(tmp_path: Path) -> None:
    async with driver(tmp_path) as (subject, server, page, one):
        assert subject.bus is not None
        await drives(subject, one)
        heard = subject.bus.subscribe(topics.source_cmd_vel("teleop"), depth=100)
        await until(lambda: heard.take() != [])
        one.beats = False
        await page.socket.close()
        await until(lambda: "the connection to a page has ended" in server.output)
        heard.take()
        with suppress(ConnectionClosed):  # a busy machine may have been silent for too long
            await one.commands.send('{"linear": 0.4, "angular": 0, "time_s": 9e8, "picture": 1}')
        await one.closed()
        await subject.never(lambda: heard.take() != [], "a command", 0.3)


async def test_a_second_page_waits_until_the_first_one_ends_driving(tmp_path: Path) -> None:
    async with driver(tmp_path) as (_, server, _, one), server.page() as other:
        await until(lambda: one.told == [""] and other.token != "")
        await other.rename("Ben")
        async with hands(server, other, watches=False) as asking:
            await until(lambda: any(told.startswith("You asked Anna") for told in asking.told))
            assert one.commands.close_code is None
            assert one.told[-1].startswith("Ben asks to drive.")
            await one.commands.close()
            await until(lambda: asking.told[-1] == "")


async def test_only_a_paired_page_with_a_name_and_of_its_own_server_drives_and_only_with_drive(
    tmp_path: Path,
) -> None:
    async with served(tmp_path, drives=True) as (subject, server), server.heard_page(subject) as page:
        await page.rename("")
        for token, code in (("guessed", NOT_PAIRED), (page.token, NO_NAME)):
            async with server.socket(path="drive") as guest:
                await guest.send(json.dumps({"token": token}))
                assert await closing_code(guest) == code
        with pytest.raises(InvalidStatus):
            async with server.socket(origin="http://elsewhere:1", path="drive"):
                pass
    async with (
        served(tmp_path) as (subject, server),
        server.heard_page(subject) as page,
        server.socket(path="drive") as commands,
    ):
        await commands.send(json.dumps({"token": page.token}))
        assert await closing_code(commands) == NO_DRIVING


async def test_a_page_does_not_drive_beside_a_teleop_and_says_who_drives(tmp_path: Path) -> None:
    async with (
        served(tmp_path, teleop=True, drives=True) as (subject, server),
        server.heard_page(subject) as page,
    ):
        await subject.connected()
        async with hands(server, page, watches=False) as one:
            assert await asyncio.wait_for(one.closed(), PATIENCE_S) == HELD
            assert one.commands.close_reason is not None
            assert one.commands.close_reason.startswith("The robot is driven by the teleop of")


async def test_beside_a_robot_whose_configuration_names_no_station_a_page_drives_and_ctrl_c_stops_everything() -> (
    None
):
    # pytest's own directory has too long a path for a socket on some machines.
    with tempfile.TemporaryDirectory(prefix="lifeline-test-") as directory:
        state = Path(directory)
        subject = Robot(free_endpoint(), state)
        server = Beside(subject.endpoint, state)
        try:
            await server.address()
            await subject.observe()
            async with server.heard_page(subject) as page, hands(server, page) as one:
                assert [station.required for station in subject.status.estop_stations] == [True]
                await drives(subject, one)
            await stands(subject)
            await subject.until(lambda: LOST in subject.status.causes, "the loss of the page")
            server.type(b"\x03")
            await until(lambda: server.process.poll() is not None)
            assert server.process.returncode == 128 + signal.SIGINT
            assert processes.of(state) == []
        finally:
            server.close()
            await subject.close()
