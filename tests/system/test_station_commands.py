"""Commands over the page's connections, without a browser: old pictures, old times, garbage, and who may drive."""

import asyncio
import json
import math
import signal
import tempfile
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from deploy.stack import processes
from faults.page import AGAIN_S, BEAT_S
from tests.system.harness import DRIVE_TRIES, PATIENCE_S, Robot, patiently
from tests.system.operators import until
from tests.system.pages import Beside, Code, Page, Server, closing_code, served
from tests.system.ports import free_endpoint
from tests.system.test_estop_stations import ESTOP, LOST
from wire import topics

pytestmark = pytest.mark.timeout(180)

SLOW_M_S = 0.1
NEVER_NS = 10**15
"""Later than any command of a page that keeps its own time."""


class Hands:
    """A page that watches and drives: it sends what is wanted now, with the newest picture that it has drawn."""

    def __init__(self, page: Page, commands: ClientConnection) -> None:
        self.page, self.commands = page, commands
        self.linear, self.beats, self.draws = 0.0, True, asyncio.Event()
        self.draws.set()
        self.refusals, self.turns = list[str](), list[dict[str, Any]]()
        self.sockets = [page.socket, commands]
        """Those that the server must not end as silent."""
        self._number = self._sent = 0
        self.robot, self.picture = dict[str, Any](), dict[str, Any]()
        """What is constant, and the newest picture."""

    @property
    def drives(self) -> bool:
        """Whether the server lets this page drive."""
        return self.turns != [] and self.turns[-1]["drives"]

    @property
    def is_cut_off(self) -> bool:
        """Whether the server has ended a connection as silent although the page did not stop sending."""
        return self.beats and any(socket.close_code == Code.SILENT for socket in self.sockets)

    async def rest(self) -> None:
        """Request zero, and wait until it was sent."""
        self.linear, before = 0.0, self._sent
        await until(lambda: self._sent > before + 1)

    async def draw(self, server: Server) -> None:
        """Draw pictures; when their connection ends, open it again, as the page in JavaScript does."""
        while True:
            with suppress(ConnectionClosed):
                async with server.socket(path="picture") as socket:
                    await socket.send(json.dumps({"token": self.page.token}))
                    async for text in socket:
                        message = json.loads(text)
                        if message["kind"] == "robot":
                            self.robot = message
                        elif message["kind"] == "picture":
                            await self.draws.wait()
                            self._number, self.picture = message["number"], message
                            await socket.send(json.dumps({"drawn": self._number}))
            await asyncio.sleep(AGAIN_S)

    async def hear(self) -> None:
        with suppress(ConnectionClosed):
            async for text in self.commands:
                message = json.loads(text)
                if message["kind"] == "turn":
                    self.turns.append(message)
                else:
                    self.refusals.append(message["sentence"])

    async def beat(self) -> None:
        with suppress(ConnectionClosed):
            while self.beats:
                time_s = asyncio.get_running_loop().time()
                wanted = {"linear": self.linear, "angular": 0.0, "time_s": time_s, "picture": self._number}
                await self.commands.send(json.dumps(wanted))
                self._sent += 1
                await asyncio.sleep(BEAT_S)


@asynccontextmanager
async def hands(server: Server, page: Page, *, watches: bool = True) -> AsyncGenerator[Hands]:
    async with server.socket(path="drive") as commands:
        await commands.send(json.dumps({"token": page.token}))
        one = Hands(page, commands)
        parts = [one.hear(), one.beat(), *([one.draw(server)] if watches else [])]
        tasks = [asyncio.ensure_future(part) for part in parts]
        try:
            yield one
        finally:
            for task in tasks:
                task.cancel()


async def with_a_driver(
    subject: Robot, server: Server, act: Callable[[Hands], Coroutine[Any, Any, object]]
) -> None:
    """Let a page take the wheel, and act; again with another page if a busy machine kept this one, or its server, from working."""
    for _ in range(DRIVE_TRIES):
        async with server.heard_page(subject) as page, hands(server, page) as one:
            acting = asyncio.ensure_future(act(one))
            cut_off = asyncio.ensure_future(until(lambda one=one: one.is_cut_off, math.inf))
            await asyncio.wait({acting, cut_off}, return_when=asyncio.FIRST_COMPLETED)
            for task in (acting, cut_off):
                task.cancel()
            result, _ = await asyncio.gather(acting, cut_off, return_exceptions=True)
            if not isinstance(result, BaseException):
                return
            if not one.is_cut_off:
                raise result
            print(f"again: the server ended a connection as silent; {result}")
    raise AssertionError("the server ended a connection of each page as silent")


async def driven(tmp_path: Path, act: Callable[[Robot, Server, Hands], Coroutine[Any, Any, object]]) -> None:
    """Let a page take the wheel of a robot, and act, as `with_a_driver`."""
    async with served(tmp_path, topics.SUPERVISOR, topics.SIM, drives=True) as (subject, server):
        await with_a_driver(subject, server, lambda one: act(subject, server, one))


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
    async def act(subject: Robot, _: Server, one: Hands) -> None:
        await drives(subject, one)
        one.draws.clear()
        await stands(subject)
        await until(lambda: any(refusal.startswith("The picture is") for refusal in one.refusals))
        one.draws.set()
        await until(lambda: one.refusals[-1] == "Let go first.")
        await stays(subject)
        await drives(subject, one)

    await driven(tmp_path, act)


async def test_a_page_that_has_never_drawn_a_picture_does_not_drive(tmp_path: Path) -> None:
    async with (
        served(tmp_path, drives=True) as (subject, server),
        server.heard_page(subject) as page,
        server.socket(path="drive") as commands,
    ):
        await commands.send(json.dumps({"token": page.token}))
        wanted = {"linear": 0.4, "angular": 0.0, "time_s": 1.0, "picture": 1}
        sentence = ""
        while not sentence.startswith("The robot is not seen:"):
            await commands.send(json.dumps(wanted))
            sentence = json.loads(await asyncio.wait_for(commands.recv(), PATIENCE_S))["sentence"]


@pytest.mark.parametrize(
    "text",
    [
        "garbage",
        '{"linear": 1.01, "angular": 0, "time_s": 1e6, "picture": 1}',
        '{"linear": 0.1, "angular": 0, "time_s": -1, "picture": 1}',
    ],
)
async def test_a_message_that_is_no_command_ends_the_driving(tmp_path: Path, text: str) -> None:
    async def act(subject: Robot, _: Server, one: Hands) -> None:
        await drives(subject, one)
        await one.commands.send(text)
        assert await closing_code(one.commands) == Code.BAD_MESSAGE
        await stands(subject)
        await stays(subject)

    await driven(tmp_path, act)


async def test_a_page_that_falls_silent_loses_the_wheel_and_another_one_may_take_it(tmp_path: Path) -> None:
    async def act(subject: Robot, server: Server, one: Hands) -> None:
        await drives(subject, one)
        one.beats = False
        await stands(subject)
        assert await closing_code(one.commands) == Code.SILENT
        await with_a_driver(subject, server, lambda other: until(lambda: other.drives))

    await driven(tmp_path, act)


async def test_no_command_is_sent_on_after_the_end_of_the_pages_lease(tmp_path: Path) -> None:
    async def act(subject: Robot, server: Server, one: Hands) -> None:
        assert subject.bus is not None
        await drives(subject, one)
        heard = subject.bus.subscribe(topics.source_cmd_vel("teleop"), depth=100)
        sent_ns = list[int]()

        def hear() -> list[int]:
            sent_ns.extend(arrival.stamp.source_time_ns for arrival in heard.take() if arrival.stamp)
            return sent_ns

        await until(hear)
        one.beats = False
        ended = "the connection to a page has ended"
        before = server.output.count(ended)
        await one.page.socket.close()
        await until(lambda: server.output.count(ended) > before)
        late_ns = hear()[-1] + NEVER_NS  # commands that were sent on before may still arrive
        with suppress(ConnectionClosed):  # a busy machine may have been silent for too long
            await one.commands.send('{"linear": 0.4, "angular": 0, "time_s": 9e8, "picture": 1}')
        await closing_code(one.commands)
        await subject.never(lambda: max(hear()) > late_ns, "a command", 0.3)

    await driven(tmp_path, act)


async def test_a_second_page_waits_until_the_driver_hands_over_to_this_person_and_to_nobody_else(
    tmp_path: Path,
) -> None:
    async def act(_: Robot, server: Server, one: Hands) -> None:
        async with server.page() as other:
            one.sockets.append(other.socket)
            await until(lambda: one.drives and other.token != "")
            await other.rename("Ben")
            async with hands(server, other, watches=False) as asking:
                one.sockets.append(asking.commands)
                await until(
                    lambda: any(turn["sentence"].startswith("Wait for Anna") for turn in asking.turns)
                )
                # The driver's page learns it with its own next message.
                await until(lambda: one.turns[-1]["asker"] == "Ben")
                assert one.commands.close_code is None
                await one.commands.send(json.dumps({"hand_over": "Cleo"}))
                await until(lambda: any("look who asks now" in refusal for refusal in one.refusals))
                assert one.drives
                await one.commands.send(json.dumps({"hand_over": "Ben"}))
                await until(lambda: asking.drives)
                assert await closing_code(one.commands) == Code.HANDED_OVER

    await driven(tmp_path, act)


async def test_only_a_paired_page_drives_and_only_with_drive(tmp_path: Path) -> None:
    async with served(tmp_path, drives=True) as (_, server), server.socket(path="drive") as guest:
        await guest.send(json.dumps({"token": "guessed"}))
        assert await closing_code(guest) == Code.NOT_PAIRED
    async with (
        served(tmp_path) as (subject, server),
        server.heard_page(subject) as page,
        server.socket(path="drive") as commands,
    ):
        await commands.send(json.dumps({"token": page.token}))
        assert await closing_code(commands) == Code.NO_DRIVING


async def test_a_page_does_not_drive_beside_a_teleop_and_says_who_drives(tmp_path: Path) -> None:
    async with (
        served(tmp_path, teleop=True, drives=True) as (subject, server),
        server.heard_page(subject) as page,
    ):
        await subject.connected()
        async with hands(server, page, watches=False) as one:
            assert await closing_code(one.commands) == Code.HELD
            assert one.commands.close_reason is not None
            assert one.commands.close_reason.startswith(
                "End the program that drives the robot: the teleop of"
            )


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
            await with_a_driver(subject, server, lambda one: drives(subject, one))
            assert [station.required for station in subject.status.estop_stations] == [True]
            await stands(subject)
            await subject.until(lambda: LOST in subject.status.causes, "the loss of the page")
            server.type(b"\x03")
            await until(lambda: server.process.poll() is not None)
            assert server.process.returncode == 128 + signal.SIGINT
            assert processes.of(state) == []
        finally:
            server.close()
            await subject.close()
