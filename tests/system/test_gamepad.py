"""A virtual gamepad of the kernel (uinput), from its events to the wheels; and a teleop without a gamepad."""

import asyncio
import os
import sys
import time
from collections.abc import AsyncGenerator, Callable, Generator, Sequence
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import evdev
import pexpect
import pytest
from evdev import ecodes

from teleop.gamepad import device as gamepad_device
from teleop.gamepad import pad as gamepad
from teleop.gamepad.device import GamepadDevice, open_gamepad
from teleop.gamepad.find import GamepadError, Needed, describe, find_gamepad, find_sensors
from teleop.gamepad.pad import Gamepad, Phase
from teleop.pilots.config import GamepadSection, TeleopSection
from tests.system.harness import PATIENCE_S, robot
from tests.unit.teleop.pads import (
    DUALSHOCK4,
    LAYOUT,
    MOTION_SENSORS,
    TL,
    TR,
    XBOX360,
    Sample,
    Y,
    button,
    load_pad,
    stick,
)

EXIT_USAGE = 2
LOOKED_FOR_S = 4 * gamepad_device.RETRY_PERIOD_S
UP = {XBOX360: -32768, DUALSHOCK4: 0}
CENTRE = {XBOX360: -314, DUALSHOCK4: 127}


def _why_no_uinput() -> str:
    try:
        os.close(os.open("/dev/uinput", os.O_WRONLY | os.O_NONBLOCK))
    except OSError as error:
        return f"this kernel makes no input devices: /dev/uinput: {error.strerror}"
    return ""


needs_uinput = pytest.mark.skipif(bool(_why_no_uinput()), reason=_why_no_uinput())


class VirtualPad:
    """A gamepad that exists in the kernel only."""

    def __init__(self, name: str) -> None:
        self.name = name
        pad = load_pad(name)
        codes: dict[int, Any] = {ecodes.EV_ABS: list(pad.axes.items())}
        for kind in (ecodes.EV_KEY, ecodes.EV_MSC):
            if pad.codes(kind):
                codes[kind] = pad.codes(kind)
        bus, vendor, product, version = pad.identity
        self._device = evdev.UInput(
            codes,
            name=pad.name,
            vendor=vendor,
            product=product,
            version=version,
            bustype=bus,
            phys="lifeline-test",
            input_props=[code for code in range(8) if pad.properties >> code & 1],
        )
        assert self._device.device is not None
        self.path = str(self._device.device.path)

    def tell(self, *samples: Sample) -> None:
        """One report."""
        for sample in samples:
            self._device.write(*sample)
        self._device.syn()

    def push(self) -> None:
        self.tell(stick(Y, UP[self.name]))

    def centre(self) -> None:
        """Move the stick and centre it: the kernel reports no position that it assumes already."""
        self.push()
        self.tell(stick(Y, CENTRE[self.name]), stick(ecodes.ABS_X, CENTRE[self.name]))

    def unplug(self) -> None:
        self._device.close()


@contextmanager
def virtual_pad(name: str = XBOX360) -> Generator[VirtualPad]:
    pad = VirtualPad(name)
    try:
        yield pad
    finally:
        pad.unplug()


# --- the device alone


class Reading:
    """A gamepad that is read in this loop."""

    def __init__(self, device: GamepadDevice, wake: asyncio.Event, said: Sequence[str]) -> None:
        self.device, self.wake, self.said = device, wake, said
        self.pilot: Gamepad = device.pilot

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                self.wake.clear()
                await self.wake.wait()

    async def drive(self, pad: VirtualPad) -> None:
        pad.centre()
        pad.tell(button(TL, 0))
        pad.tell(button(TL, 1))
        pad.push()
        await self.until(lambda: self.pilot.wanted() == (0.5, 0.0))


@asynccontextmanager
async def reading(pad: VirtualPad, monkeypatch: pytest.MonkeyPatch) -> AsyncGenerator[Reading]:
    monkeypatch.setattr(gamepad, "SETTLE_S", 0.0)
    device = open_gamepad(TeleopSection(gamepad=GamepadSection(device=pad.path)))
    wake, said = asyncio.Event(), list[str]()
    with device.reading(wake=wake, say=said.append):
        yield Reading(device, wake, said)


@needs_uinput
@pytest.mark.parametrize("name", [XBOX360, DUALSHOCK4])
async def test_a_pad_of_the_kernel_drives_and_is_missed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_pad(name) as pad:
        async with reading(pad, monkeypatch) as desk:
            await desk.drive(pad)
            pad.tell(button(TR, 1))
            await desk.until(lambda: desk.pilot.wanted() == (1.0, 0.0))
            pad.tell(button(TR, 0), button(TL, 0))
            await desk.until(lambda: desk.pilot.phase is Phase.READY)
            await desk.drive(pad)
            pad.unplug()
            await desk.until(lambda: desk.pilot.phase is Phase.ABSENT)
            assert desk.said == ["gamepad unplugged: stopped; plug it in again"]


@needs_uinput
async def test_a_button_held_at_the_start_is_reported_by_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_pad() as pad:
        pad.tell(button(TL, 1))
        pad.push()
        async with reading(pad, monkeypatch) as desk:
            assert desk.pilot.phase is Phase.LET_GO
            await desk.drive(pad)


@needs_uinput
async def test_a_queue_of_the_kernel_that_overflows_stops_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The release and the press are lost in it: by the state alone, nothing has happened."""
    with virtual_pad() as pad:
        async with reading(pad, monkeypatch) as desk:
            await desk.drive(pad)
            pad.tell(button(TL, 0))
            pad.tell(button(TL, 1))
            for value in range(2000):  # this loop does not read meanwhile
                pad.tell(stick(ecodes.ABS_X, 20 * value))
            await desk.until(lambda: desk.pilot.phase is Phase.LET_GO)
            assert desk.said == ["gamepad: events were lost; stopped"]
            await desk.drive(pad)


@needs_uinput
@pytest.mark.timed
async def test_motion_sensors_of_the_kernel_are_a_pulse(monkeypatch: pytest.MonkeyPatch) -> None:
    """While they send, a stick may be held still; when they become silent, the robot stops within their limit."""
    monkeypatch.setattr(gamepad_device, "PULSE_PERIOD_S", 0.01)
    with virtual_pad(MOTION_SENSORS) as sensors, virtual_pad(DUALSHOCK4) as pad:
        async with reading(pad, monkeypatch) as desk:
            loop = asyncio.get_running_loop()
            await desk.drive(pad)
            began_s = loop.time()
            while loop.time() < began_s + 0.5:
                sensors.tell((ecodes.EV_MSC, ecodes.MSC_TIMESTAMP, 1))
                await asyncio.sleep(0.01)
            limit_s = desk.pilot.layout.section.pulse_limit_s
            assert desk.pilot.next_s == pytest.approx(loop.time() + limit_s, abs=0.2)
            assert desk.pilot.velocity(desk.pilot.next_s) == (0.0, 0.0)


@needs_uinput
def test_a_pad_is_distinguished_from_its_motion_sensors_by_what_the_kernel_says_of_it() -> None:
    needed = Needed(LAYOUT.axes, LAYOUT.buttons, ("ABS_Y", "ABS_X", "BTN_TL", "BTN_TR"))
    with virtual_pad(MOTION_SENSORS) as sensors, virtual_pad(DUALSHOCK4) as pad:
        found = find_gamepad(needed, pad.path)
        assert found.name == load_pad(DUALSHOCK4).name
        assert find_sensors(found) == describe(Path(sensors.path))
        with pytest.raises(GamepadError, match="has not all of ABS_Y, ABS_X, BTN_TL, BTN_TR"):
            find_gamepad(needed, sensors.path)


# --- to the wheels


@needs_uinput
@pytest.mark.timed
async def test_the_wheels_obey_the_stick_and_stop_for_the_button_and_the_plug(tmp_path: Path) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        with virtual_pad() as pad:
            config = tmp_path / "gamepad.toml"
            config.write_text(f'[teleop.gamepad]\ndevice = "{pad.path}"\n')
            subject.start_teleop("--mode", "gamepad", "--config", str(config))
            await subject.ready()
            settled_s = time.monotonic() + gamepad.SETTLE_S
            await subject.until(lambda: time.monotonic() > settled_s, "the pad to settle")
            pad.centre()
            pad.tell(button(TL, 1))
            pad.push()
            await subject.until(lambda: subject.speed_m_s > 0.45, "half a metre per second")

            released_s = time.monotonic()
            pad.tell(button(TL, 0))
            assert await subject.zero_after(released_s) < 0.2
            await subject.standstill_after(released_s)

            pad.centre()
            pad.tell(button(TL, 1))
            pad.push()
            await subject.until(lambda: subject.speed_m_s > 0.45, "half a metre per second again")
            unplugged_s = time.monotonic()
        assert await subject.zero_after(unplugged_s) < 0.2
        await subject.standstill_after(unplugged_s)

        with virtual_pad() as again:
            assert again.path == pad.path
            again.tell(button(TL, 1))
            again.push()
            await subject.never(
                lambda: abs(subject.speed_m_s) > 0.01, "it moved by itself", for_s=LOOKED_FOR_S
            )


# --- none


def sentence_of(arguments: list[str], env: dict[str, str] | None = None) -> tuple[str, int | None]:
    """Return the program's output in a terminal, and its exit code."""
    terminal: pexpect.spawn[bytes] = pexpect.spawn(
        sys.executable, ["-m", "teleop", *arguments], env=os.environ | (env or {}), dimensions=(24, 200)
    )
    said = terminal.read().decode()
    terminal.close()
    return said, terminal.exitstatus


def test_without_a_gamepad_one_sentence_says_so_before_anything_starts(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[teleop.gamepad]\ndevice = "/dev/input/no-such-pad"\n')
    said, code = sentence_of(["--mode", "gamepad", "--config", str(config)])
    assert said.startswith("teleop: there is no input device /dev/input/no-such-pad: plug the gamepad in")
    assert said.count("\n") == 1
    assert code == EXIT_USAGE


def test_without_the_package_one_sentence_says_how_to_get_it(tmp_path: Path) -> None:
    (tmp_path / "evdev.py").write_text("raise ImportError\n")
    said, code = sentence_of(["--mode", "gamepad"], {"PYTHONPATH": str(tmp_path)})
    assert said.startswith("teleop: a gamepad needs Linux and the package evdev: install lifeline[gamepad]")
    assert said.count("\n") == 1
    assert code == EXIT_USAGE


def test_a_wrong_key_is_refused_by_its_whole_name(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[teleop.gamepad]\ndead_man_button = "the left one"\n')
    said, code = sentence_of(["--mode", "gamepad", "--config", str(config)])
    assert "teleop.gamepad.dead_man_button = 'the left one'" in said
    assert code == EXIT_USAGE
