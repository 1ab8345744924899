"""Teleop with a gamepad on a perfect network: from the bytes of a device file to the messages on the wire.

A file descriptor cannot be watched in virtual time: these tests run in a real loop, and wait for conditions.
"""

import asyncio
import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from teleop import service
from teleop.gamepad import device as gamepad_device
from teleop.gamepad import pad as gamepad
from teleop.gamepad.device import Device, GamepadDevice
from teleop.gamepad.pad import Gamepad
from teleop.pilots.config import GamepadSection
from teleop.screen.display import render
from teleop.screen.view import Control, Line, View
from teleop.service import HANG_S, Setup, Teleop
from tests.component.test_teleop_service import Keys, PaperScreen
from tests.unit.teleop.pads import LAYOUT, REPORT, TL, XBOX360, FakeDevice, Y, button, load_pad, stick
from virtual.network import VirtualNetwork
from wire import topics
from wire.bus import Subscription
from wire.messages import Bool, SafetyStatus, Twist, header

SOURCE = "joy"
PATIENCE_S = 10.0
UP = -32768
ZERO, HALF = (0.0, 0.0), (0.5, 0.0)


class Bench:
    """A running Teleop, its gamepad, and a subscriber."""

    def __init__(self, sysfs: Path) -> None:
        self.sysfs = sysfs
        self.network = VirtualNetwork()
        self.sees_a_status = False
        self.outsider = outsider = self.network.open_hub("outsider")
        self.cmd_vel: Subscription[Twist] = outsider.subscribe(topics.source_cmd_vel(SOURCE), depth=10_000)
        self.estop: Subscription[Bool] = outsider.subscribe(topics.ESTOP)
        self.wake = asyncio.Event()
        self.keys, self.screen = Keys(self.wake), PaperScreen()
        self.pilot = Gamepad(LAYOUT)
        load_pad(XBOX360).put_in_sysfs(sysfs, "event3")
        self.device = GamepadDevice(self.pilot, self._open, sysfs=sysfs)
        self.commands: list[tuple[float, float]] = []

    def _open(self, _: Path) -> Device:
        self.pad = FakeDevice(load_pad(XBOX360))
        return self.pad

    def heard(self) -> tuple[float, float]:
        """The newest command."""
        for arrival in self.cmd_vel.take():
            assert arrival.message is not None
            self.commands.append((arrival.message.linear.x, arrival.message.angular.z))
        return self.commands[-1] if self.commands else (float("nan"), float("nan"))

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():  # noqa: ASYNC110 - what is waited for is said on a bus, and sets no event
                await asyncio.sleep(0.002)

    def render(self, view: View, columns: int, _: int) -> list[Line]:
        self.sees_a_status = view.status is not None
        return [render(view, columns)]

    async def until_heard(self, velocity: tuple[float, float]) -> None:
        await self.until(lambda: self.heard() == velocity)

    async def drive(self) -> None:
        self.pad.tell(stick(Y, 0), button(TL, 0), REPORT)
        self.pad.tell(button(TL, 1), REPORT)
        self.pad.tell(stick(Y, UP), REPORT)
        await self.until_heard(HALF)

    async def stays_zero(self, beats: int = 4) -> None:
        """Only zeros are sent."""
        self.heard()
        count = len(self.commands)
        await self.until(lambda: self.heard() != ZERO or len(self.commands) >= count + beats)
        assert set(self.commands[count:]) == {ZERO}


@asynccontextmanager
async def bench(sysfs: Path) -> AsyncGenerator[Bench]:
    made = Bench(sysfs)
    made.device.open()
    teleop = Teleop(
        made.network.open_joined(SOURCE),
        Setup(SOURCE, "tcp/127.0.0.1:7447", Control.GAMEPAD),
        pilot=made.pilot,
        keys=made.keys,
        screen=made.screen,
        render=made.render,
        wake=made.wake,
    )
    stop = asyncio.Event()
    with made.device.reading(wake=made.wake, say=teleop.note):
        running = asyncio.create_task(teleop.run(stop))
        try:
            await made.until_heard(ZERO)
            made.outsider.publisher(topics.STATUS).put(SafetyStatus(header("")))
            await made.until(lambda: made.sees_a_status)
            yield made
        finally:
            stop.set()
            await running
    await made.until(lambda: made.outsider.alive == [])
    assert made.heard() == ZERO


Story = Callable[[Bench], Awaitable[None]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Story], None]:
    """Run a test with a gamepad that settles immediately and is searched for continuously."""
    monkeypatch.setattr(gamepad, "SETTLE_S", 0.0)
    monkeypatch.setattr(gamepad_device, "RETRY_PERIOD_S", 0.01)
    monkeypatch.setattr(service, "HANG_S", PATIENCE_S)  # a busy machine may hold this loop up for 0.15 s

    def play(story: Story) -> None:
        async def staged() -> None:
            async with bench(tmp_path) as made:
                await story(made)

        asyncio.run(staged())

    return play


def test_the_stick_drives_while_the_button_is_held(run: Callable[[Story], None]) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        count = len(bench.commands)
        bench.pad.tell(button(TL, 0), REPORT)
        await bench.until_heard(ZERO)
        assert set(bench.commands[count:]) <= {HALF, ZERO}  # no ramp on the way down
        await bench.stays_zero()

    run(story)


def test_an_unplugged_pad_is_zeros_and_the_source_stays(run: Callable[[Story], None]) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        (bench.sysfs / "event3").rename(bench.sysfs / "gone")
        bench.pad.unplug()
        await bench.until_heard(ZERO)
        await bench.stays_zero()
        assert bench.outsider.alive == [SOURCE]
        assert bench.screen.notes[-1] == "gamepad unplugged: stopped; plug it in again"

    run(story)


def test_a_pad_plugged_in_again_moves_nothing_before_it_is_pressed_anew(run: Callable[[Story], None]) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        old = bench.pad
        old.unplug()
        await bench.until(lambda: bench.pad is not old)
        bench.pad.tell(stick(Y, UP), REPORT)
        await bench.until_heard(ZERO)
        await bench.stays_zero()
        await bench.drive()

    run(story)


@pytest.mark.parametrize("key", ["s", " "])
def test_a_key_that_stops_ends_the_hold(run: Callable[[Story], None], key: str) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        bench.keys.press(key)
        await bench.until_heard(ZERO)
        bench.pad.tell(stick(Y, 0), REPORT, stick(Y, UP), REPORT)
        await bench.stays_zero()
        assert (bench.estop.latest() is not None) == (key == " ")
        await bench.drive()

    run(story)


def test_after_a_hang_the_button_must_be_pressed_anew(
    run: Callable[[Story], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        monkeypatch.setattr(service, "HANG_S", HANG_S)
        time.sleep(2 * HANG_S)  # noqa: ASYNC251 - the loop is to hang
        await bench.until_heard(ZERO)
        monkeypatch.setattr(service, "HANG_S", PATIENCE_S)
        await bench.stays_zero()
        await bench.drive()

    run(story)


def test_a_pad_that_falls_silent_while_it_drives_is_stopped(run: Callable[[Story], None]) -> None:
    """An empty battery leaves the last state indefinitely without an event, so motion must not continue."""

    async def story(bench: Bench) -> None:
        bench.pilot.layout = replace(LAYOUT, section=GamepadSection(silence_limit_s=1.0))
        await bench.drive()
        await bench.until_heard(ZERO)
        await bench.stays_zero()
        assert "nothing heard from it" in bench.pilot.note
        await bench.drive()

    run(story)


def test_q_ends_it_with_a_zero_and_without_a_token(run: Callable[[Story], None]) -> None:
    async def story(bench: Bench) -> None:
        await bench.drive()
        bench.keys.press("q")
        await bench.until(lambda: bench.outsider.alive == [])
        assert bench.heard() == ZERO

    run(story)
