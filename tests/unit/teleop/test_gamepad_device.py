"""The gamepad's device, read through evdev's own code from a socket in the place of its file, in a real loop."""

import asyncio
import errno
import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import evdev
import pytest

from teleop.gamepad import device as gamepad_device
from teleop.gamepad import pad as gamepad
from teleop.gamepad.device import Device, GamepadDevice, open_gamepad
from teleop.gamepad.find import GamepadError
from teleop.gamepad.pad import Gamepad, PadEvent, Phase
from teleop.pilots.config import GamepadSection, TeleopSection
from teleop.pilots.pilot import NEUTRAL
from tests.unit.teleop.pads import (
    DROPPED,
    DUALSHOCK4,
    LAYOUT,
    MOTION_SENSORS,
    REPORT,
    TL,
    XBOX360,
    FakeDevice,
    X,
    Y,
    button,
    load_pad,
    stick,
)

PATIENCE_S = 10.0
UP = -32768


class Watched(Gamepad):
    """Counts its calls."""

    taken = 0
    pulses = 0

    def take(self, event: PadEvent, now_s: float) -> None:
        self.taken += 1
        super().take(event, now_s)

    def pulse(self, now_s: float) -> None:
        self.pulses += 1
        super().pulse(now_s)


class Desk:
    """A sysfs with a pad in it, the devices that were opened, and a loop that reads them."""

    def __init__(self, root: Path, name: str = XBOX360) -> None:
        self.sysfs, self.name = root, name
        self.opened: dict[str, FakeDevice] = {}
        self.opener: Callable[[Path], Device] = self.open
        self.said: list[str] = []
        self.wake = asyncio.Event()
        self.pilot = Watched(LAYOUT)
        load_pad(name).put_in_sysfs(root, "event3", uniq="mine")
        self.device = GamepadDevice(self.pilot, self._open, sysfs=root)

    def forget(self) -> None:
        """The gamepad is also gone from sysfs and will not return."""
        (self.sysfs / "event3").rename(self.sysfs / "gone")

    def open(self, path: Path) -> Device:
        name = MOTION_SENSORS if path.name == "event9" else self.name
        self.opened[path.name] = FakeDevice(load_pad(name))
        return self.opened[path.name]

    def _open(self, path: Path) -> Device:
        return self.opener(path)

    def refuse(self, error: OSError) -> None:
        def refusing(_: Path) -> Device:
            raise error

        self.opener = refusing

    def give(self, device: Device) -> None:
        def giving(_: Path) -> Device:
            return device

        self.opener = giving

    @property
    def pad(self) -> FakeDevice:
        return self.opened["event3"]

    @contextmanager
    def reading(self) -> Generator[None]:
        self.device.open()
        with self.device.reading(wake=self.wake, say=self.said.append):
            yield
        assert all(device.is_closed for device in self.opened.values())

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                self.wake.clear()
                await self.wake.wait()

    async def phase(self, phase: Phase) -> None:
        await self.until(lambda: self.pilot.phase is phase)

    async def drive(self) -> None:
        self.pad.tell(stick(Y, 0), REPORT)
        self.pad.tell(button(TL, 1), REPORT)
        self.pad.tell(stick(Y, UP), REPORT)
        await self.until(self.is_moving)

    def is_moving(self) -> bool:
        return self.pilot.wanted() != NEUTRAL


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Desk:
    """Gamepads that settle immediately and are searched for continuously."""
    monkeypatch.setattr(gamepad, "SETTLE_S", 0.0)
    monkeypatch.setattr(gamepad_device, "RETRY_PERIOD_S", 0.01)
    return Desk(tmp_path)


async def test_what_the_pad_reports_reaches_the_pilot_and_wakes_the_loop(desk: Desk) -> None:
    with desk.reading():
        await desk.drive()
        assert desk.pilot.wanted() == (0.5, 0.0)
        desk.pad.tell(button(TL, 0), REPORT)
        await desk.phase(Phase.READY)
        assert not desk.is_moving()


async def test_what_was_pressed_before_it_is_read_does_not_count(desk: Desk) -> None:
    desk.device.open()
    desk.pad.tell(button(TL, 1), REPORT, stick(Y, UP), REPORT)
    with desk.device.reading(wake=desk.wake, say=desk.said.append):
        assert desk.pilot.phase is Phase.LET_GO
        desk.pad.tell(stick(Y, 0), REPORT)
        await desk.wake.wait()
        assert desk.pilot.phase is Phase.LET_GO


async def test_a_flood_of_events_leaves_the_loop_its_turns(desk: Desk) -> None:
    with desk.reading():
        count = 4 * 64 * gamepad_device.MAX_READS
        desk.pad.tell(*[stick(X, 1)] * count)
        turns = 0
        while desk.pilot.taken < count:
            await asyncio.sleep(0)
            turns += 1
            assert desk.pilot.taken <= turns * 64 * gamepad_device.MAX_READS
        assert turns >= 4


async def test_an_unplugged_pad_is_neutral_and_said_and_looked_for(desk: Desk) -> None:
    with desk.reading():
        await desk.drive()
        desk.forget()
        desk.pad.unplug()
        await desk.phase(Phase.ABSENT)
        assert not desk.is_moving()
        assert desk.said == ["gamepad unplugged: stopped; plug it in again"]
        assert desk.pad.is_closed
        await desk.until(lambda: "there is no gamepad" in desk.pilot.note)


async def test_a_file_that_ends_is_an_unplugged_pad(desk: Desk) -> None:
    with desk.reading():
        await desk.drive()
        desk.pad.end()
        await desk.phase(Phase.ABSENT)
        assert not desk.is_moving()


async def test_a_pad_plugged_in_again_moves_nothing_until_it_is_pressed_anew(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with desk.reading():
        await desk.drive()
        monkeypatch.setattr(gamepad, "SETTLE_S", 1000.0)
        desk.pad.unplug()
        await desk.phase(Phase.ABSENT)
        await desk.phase(Phase.READY)
        assert desk.said[-1] == "gamepad is back: Microsoft X-Box 360 pad"
        desk.pad.tell(
            button(TL, 1), stick(Y, UP), REPORT
        )  # a driver knows what is held from the first report on
        await desk.phase(Phase.LET_GO)
        desk.pad.tell(stick(Y, 0), REPORT, stick(Y, UP), REPORT)
        desk.pad.tell(button(TL, 0), REPORT)
        await desk.phase(Phase.READY)


async def test_a_pad_that_comes_back_and_goes_again_is_looked_for_again(desk: Desk) -> None:
    openings: list[Path] = []

    def shaky(path: Path) -> Device:
        openings.append(path)
        device = desk.open(path)
        desk.pad.is_broken = len(openings) < 3
        return device

    with desk.reading():
        desk.opener = shaky
        desk.pad.unplug()
        await desk.phase(Phase.ABSENT)
        await desk.phase(Phase.READY)
        assert len(openings) == 3


async def test_a_pad_that_went_before_it_was_read_is_looked_for(desk: Desk) -> None:
    desk.device.open()
    desk.pad.unplug()
    with desk.device.reading(wake=desk.wake, say=desk.said.append):
        assert desk.pilot.phase is Phase.ABSENT
        await desk.phase(Phase.READY)


async def test_lost_events_stop_it_until_the_device_has_been_asked(desk: Desk) -> None:
    with desk.reading():
        await desk.drive()
        desk.pad.tell(button(TL, 0), button(TL, 1), silently=True)
        desk.pad.tell(DROPPED, REPORT)
        await desk.phase(Phase.LET_GO)
        assert desk.said == ["gamepad: events were lost; stopped"]


async def test_events_queued_behind_lost_ones_do_not_undo_the_state(desk: Desk) -> None:
    """The press is older than the state; its release is known to the device alone."""
    with desk.reading():
        await desk.drive()
        desk.pad.tell(DROPPED, REPORT, button(TL, 0), button(TL, 1), REPORT)
        desk.pad.tell(button(TL, 0), silently=True)
        await desk.phase(Phase.READY)


async def test_a_pad_that_goes_while_it_is_asked_is_unplugged(desk: Desk) -> None:
    with desk.reading():
        await desk.drive()
        desk.forget()
        desk.pad.is_broken = True
        desk.pad.tell(DROPPED, REPORT)
        await desk.phase(Phase.ABSENT)


# --- motion sensors


@pytest.fixture
def desk_with_sensors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Desk:
    monkeypatch.setattr(gamepad_device, "PULSE_PERIOD_S", 0.01)
    load_pad(MOTION_SENSORS).put_in_sysfs(tmp_path, "event9", uniq="mine")
    return Desk(tmp_path, DUALSHOCK4)


async def looks_at_the_sensors(desk: Desk) -> int:
    """How many pulses come of three looks."""
    before = desk.pilot.pulses
    loop = asyncio.get_running_loop()
    looked = asyncio.Event()
    loop.call_later(3.5 * gamepad_device.PULSE_PERIOD_S, looked.set)
    await looked.wait()
    return desk.pilot.pulses - before


async def test_motion_sensors_are_a_pulse_while_they_say_anything(desk_with_sensors: Desk) -> None:
    desk = desk_with_sensors
    with desk.reading():
        sensors = desk.opened["event9"]
        assert await looks_at_the_sensors(desk) == 0
        sensors.tell((4, 5, 1000), REPORT)
        assert await looks_at_the_sensors(desk) == 1
        sensors.unplug()
        assert await looks_at_the_sensors(desk) == 0
        assert desk.said == []  # the gamepad's own file shows whether it is gone


async def test_motion_sensors_that_may_not_be_read_are_done_without(desk_with_sensors: Desk) -> None:
    desk = desk_with_sensors

    def pads_only(path: Path) -> Device:
        if path.name == "event9":
            raise PermissionError
        return desk.open(path)

    desk.opener = pads_only
    with desk.reading():
        assert list(desk.opened) == ["event3"]


# --- errors


def test_without_permission_the_sentence_names_the_group(desk: Desk) -> None:
    desk.refuse(PermissionError(errno.EACCES, os.strerror(errno.EACCES)))
    with pytest.raises(GamepadError, match=r"event3 \(Microsoft.*\) may not be read: .*group input"):
        desk.device.open()


def test_a_device_that_cannot_be_opened_is_said(desk: Desk) -> None:
    desk.refuse(OSError(errno.ENODEV, os.strerror(errno.ENODEV)))
    with pytest.raises(GamepadError, match=r"event3 .* cannot be opened: No such device; plug it in again"):
        desk.device.open()


def test_a_device_that_does_not_answer_is_said_and_closed(desk: Desk) -> None:
    device = FakeDevice(load_pad(XBOX360), is_broken=True)
    desk.give(device)
    with pytest.raises(GamepadError, match=r"event3 .* cannot be read: No such device"):
        desk.device.open()
    assert device.is_closed


def test_an_axis_without_a_range_is_refused(desk: Desk) -> None:
    device = FakeDevice(load_pad(XBOX360))
    device.pad.axes[X] = device.pad.axes[X]._replace(min=0, max=0)
    desk.give(device)
    with pytest.raises(GamepadError, match=r"event3 .* gives ABS_X no range: name another axis"):
        desk.device.open()
    assert device.is_closed


def test_without_the_package_the_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "evdev", None)
    with pytest.raises(GamepadError, match=r"install lifeline\[gamepad\], with `make setup`"):
        open_gamepad(TeleopSection())


@pytest.mark.parametrize(
    ("key", "name"),
    [("turn_axis", "ABS_SIDEWAYS"), ("dead_man_button", "BTN_HEAVEN"), ("turbo_button", "KEY_NO")],
)
def test_a_name_that_linux_does_not_know_is_refused(key: str, name: str) -> None:
    section = GamepadSection.model_validate({key: name})
    with pytest.raises(GamepadError, match=rf"teleop\.gamepad\.{key} = '{name}': Linux has no such name"):
        open_gamepad(TeleopSection(gamepad=section))


def test_the_names_of_the_defaults_are_those_of_the_kernel() -> None:
    codes = evdev.ecodes.ecodes
    layout = gamepad_device.layout_of(TeleopSection(), codes)
    assert layout == LAYOUT


def test_a_device_that_is_not_there_is_refused_by_the_real_package() -> None:
    with pytest.raises(GamepadError, match="no input device /dev/input/no-such-pad"):
        open_gamepad(TeleopSection(gamepad=GamepadSection(device="/dev/input/no-such-pad")))
