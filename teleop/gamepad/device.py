"""The gamepad device with evdev: open it, read it in the event loop, and reopen it after it was unplugged.

The package `evdev` is optional (`lifeline[gamepad]`) and imported only when a gamepad is requested.
"""

import asyncio
import os
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol, cast

from teleop.gamepad.find import DEVICES, SYSFS, Described, GamepadError, Needed, find_gamepad, find_sensors
from teleop.gamepad.pad import Axis, Gamepad, Layout, PadEvent, PadState
from teleop.pilots.config import TeleopSection
from wire.host.installation import how_to_install

RETRY_PERIOD_S = 0.5
"""Period of the search for an unplugged pad."""
PULSE_PERIOD_S = 0.1
"""Period for reading the motion sensors as a sign of life; they send thousands of events per second."""
PULSE_BYTES = 1 << 14
MAX_READS = 16
"""Maximum number of reads per loop iteration, with 64 events each, so that a flood does not delay the heartbeat."""


class InputEvent(Protocol):
    """The attributes of `evdev.InputEvent` in use."""

    type: int
    code: int
    value: int


class AbsInfo(Protocol):
    """The attributes of `evdev.AbsInfo` in use."""

    @property
    def value(self) -> int: ...
    @property
    def min(self) -> int: ...
    @property
    def max(self) -> int: ...
    @property
    def flat(self) -> int: ...


class Device(Protocol):
    """The members of `evdev.InputDevice` in use; any of them may raise OSError after the pad was unplugged."""

    @property
    def fd(self) -> int: ...
    def active_keys(self) -> Iterable[int]: ...
    def absinfo(self, axis_num: int) -> AbsInfo: ...
    def read(self) -> Iterable[InputEvent]: ...
    def close(self) -> None: ...


Opener = Callable[[Path], Device]
"""Opens a device for non-blocking reads; raises OSError."""


def open_gamepad(config: TeleopSection) -> "GamepadDevice":
    """Find and open the gamepad of a configuration. It does not need an event loop.

    The result has the pilot (`.pilot`, a `teleop.pilots.pilot.Pilot`) that the gamepad controls; it is neutral until the pad is
    read:

        pad = open_gamepad(config)
        ...
        with pad.reading(wake=wake, say=terminal.note):  # in the loop; closes the pad at the end
            await Teleop(..., pilot=pad.pilot).run(stop)

    Each event sets `wake`, so that a change is sent immediately. `say` is called with a sentence when the pad is
    unplugged or returns. An unplugged pad makes the pilot neutral immediately and is searched for until it returns,
    without an exception. Other events that must end a hold (stop keys, a hang, a stuck terminal) call
    `pilot.let_go()`: the dead-man button must then be released and pressed again.

    Raises:
        GamepadError: the package is missing, a name in `[teleop.gamepad]` is unknown to Linux, or there is no gamepad, no
            permission to read it, or more than one; the message says what to do.
    """
    opener, codes = _evdev()
    pad = GamepadDevice(Gamepad(layout_of(config, codes), config.level), opener)
    pad.open()
    return pad


class GamepadDevice:
    """A gamepad on its file descriptor, and its pilot.

    Args:
        pilot: receives the events; its layout has the configuration of the device.
        opener: opens a device, with evdev or in a test.
        devices: the directory of the device files.
        sysfs: the directory of their descriptions.
    """

    def __init__(
        self,
        pilot: Gamepad,
        opener: Opener,
        *,
        devices: Path = DEVICES,
        sysfs: Path = SYSFS,
    ) -> None:
        self.pilot, self._opener = pilot, opener
        self._devices, self._sysfs = devices, sysfs
        self._name = ""
        self._pad: Device | None = None
        self._sensors: Device | None = None
        self._timer: asyncio.TimerHandle | None = None
        """Timer of the next reading of the motion sensors, or of the next search for the pad."""

    def open(self) -> None:
        """Open the gamepad, and its motion sensors if they can be read.

        Raises:
            GamepadError: the gamepad cannot be opened; the message is one sentence.
        """
        layout, section = self.pilot.layout, self.pilot.layout.section
        names = section.forward_axis, section.turn_axis, section.dead_man_button, section.turbo_button
        needed = Needed(layout.axes, layout.buttons, names)
        found = find_gamepad(needed, section.device, devices=self._devices, sysfs=self._sysfs)
        self._pad = self._opened(found)
        self._name = found.name
        sensors = find_sensors(found, devices=self._devices, sysfs=self._sysfs)
        if sensors is not None:
            with suppress(OSError):  # they are optional
                self._sensors = self._opener(sensors.path)

    def close(self) -> None:
        """Close the devices, if they are open."""
        for device in (self._pad, self._sensors):
            if device is not None:
                device.close()
        self._pad = self._sensors = None

    @contextmanager
    def reading(self, *, wake: asyncio.Event, say: Callable[[str], None]) -> Generator[None]:
        """Feed the pilot from the running loop; see `open_gamepad`."""
        self._loop, self._wake, self._say = asyncio.get_running_loop(), wake, say
        try:
            assert self._pad is not None
            self._start(self._pad)
            yield
        finally:
            self._stop()

    def _opened(self, found: Described) -> Device:
        try:
            device = self._opener(found.path)
        except PermissionError:
            raise GamepadError(
                f"{found} may not be read: add yourself to the group input "
                "(sudo usermod -aG input $USER), then log in again"
            ) from None
        except OSError as error:
            raise GamepadError(f"{found} cannot be opened: {error.strerror}; plug it in again") from None
        try:
            infos = [device.absinfo(code) for code in self.pilot.layout.axes]
        except OSError as error:
            device.close()
            raise GamepadError(f"{found} cannot be read: {error.strerror}; plug it in again") from None
        section = self.pilot.layout.section
        names = section.forward_axis, section.turn_axis
        fixed = [name for name, info in zip(names, infos, strict=True) if info.min >= info.max]
        if fixed:
            device.close()
            raise GamepadError(f"{found} gives {' and '.join(fixed)} no range: name another axis")
        return device

    # --- in the loop

    def _start(self, pad: Device) -> None:
        """Read the pad's state and watch its events; earlier events are discarded."""
        try:
            with suppress(BlockingIOError):
                for _ in range(MAX_READS):
                    list(pad.read())
            state = _state(pad, self.pilot.layout)
        except OSError:
            self._lose()
            return
        self.pilot.plug_in(self._name, state, self._loop.time())
        self._loop.add_reader(pad.fd, self._read, pad)
        if self._sensors is not None:
            self._feel(self._sensors)

    def _read(self, pad: Device) -> None:
        now_s = self._loop.time()
        self._wake.set()
        try:
            for _ in range(MAX_READS):
                events = list(pad.read())
                if not events:  # a device never reaches its end, but a pipe in a test does
                    self._lose()
                    return
                for event in events:
                    self.pilot.take(PadEvent(event.type, event.code, event.value), now_s)
        except BlockingIOError:
            self._catch_up(pad)
        except OSError:  # ENODEV: it was unplugged
            self._lose()

    def _catch_up(self, pad: Device) -> None:
        """After lost events, read the pad's state once the queue is empty.

        Queued events are older than the state and would overwrite it.
        """
        if not self.pilot.needs_state:
            return
        try:
            state = _state(pad, self.pilot.layout)
        except OSError:
            self._lose()
            return
        self.pilot.resync(state)
        self._say("gamepad: events were lost; stopped")

    def _feel(self, sensors: Device) -> None:
        """Take any data of the motion sensors as a sign of life."""
        self._timer = self._loop.call_later(PULSE_PERIOD_S, self._feel, sensors)
        with suppress(OSError):  # no data, or unplugged, which the pad's own descriptor reports
            if os.read(sensors.fd, PULSE_BYTES):
                self.pilot.pulse(self._loop.time())

    def _lose(self) -> None:
        self._stop()
        self.pilot.unplug("gamepad unplugged")
        self._say("gamepad unplugged: stopped; plug it in again")
        self._timer = self._loop.call_later(RETRY_PERIOD_S, self._look)
        self._wake.set()

    def _look(self) -> None:
        """Search for the pad; until it is back, the pilot's note says why it cannot be opened."""
        self._wake.set()
        try:
            self.open()
        except GamepadError as error:
            self.pilot.unplug(str(error))
            self._timer = self._loop.call_later(RETRY_PERIOD_S, self._look)
            return
        assert self._pad is not None
        self._say(f"gamepad is back: {self._name}")
        self._start(self._pad)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._pad is not None:
            self._loop.remove_reader(self._pad.fd)
        self.close()


def _state(pad: Device, layout: Layout) -> PadState:
    def axis(code: int) -> Axis:
        info = pad.absinfo(code)
        return Axis(info.value, info.min, info.max, info.flat)

    return PadState(frozenset(pad.active_keys()), {code: axis(code) for code in layout.axes})


def _evdev() -> tuple[Opener, dict[str, int]]:
    """Return evdev's function to open a device, and Linux's codes of axes and buttons by name."""
    try:
        import evdev  # noqa: PLC0415 - an optional package
    except ImportError:
        raise GamepadError(
            f"a gamepad needs Linux and the package evdev: {how_to_install('gamepad')}"
        ) from None

    def opener(path: Path) -> Device:
        return cast("Device", evdev.InputDevice(str(path), readonly=True))  # evdev's types are less precise

    return opener, evdev.ecodes.ecodes


def layout_of(config: TeleopSection, codes: dict[str, int]) -> Layout:
    """Return the layout of a configuration, with Linux's codes for the names.

    Raises:
        GamepadError: a name is unknown to Linux.
    """

    def code(key: str) -> int:
        name: str = getattr(config.gamepad, key)
        if name not in codes:
            raise GamepadError(
                f"teleop.gamepad.{key} = {name!r}: Linux has no such name; evtest shows those of a pad"
            )
        return codes[name]

    return Layout(
        config.gamepad,
        code("forward_axis"),
        code("turn_axis"),
        code("dead_man_button"),
        code("turbo_button"),
        config.most(),
    )
