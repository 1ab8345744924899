"""Gamepads for the tests: their descriptions, and stand-ins for their device files that the real code reads."""

import errno
import os
import socket
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from evdev import AbsInfo, ecodes
from evdev.eventio import EventIO

from teleop.gamepad.pad import Axis, Layout, PadEvent, PadState
from teleop.pilots.config import GamepadSection
from teleop.pilots.pilot import Velocity

XBOX360, DUALSHOCK4, MOTION_SENSORS = "xbox360", "dualshock4", "dualshock4_motion_sensors"

MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 1.0, 2.0
X, Y, TL, TR = ecodes.ABS_X, ecodes.ABS_Y, ecodes.BTN_TL, ecodes.BTN_TR
LAYOUT = Layout(GamepadSection(), Y, X, TL, TR, Velocity(MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S))

Sample = tuple[int, int, int]
"""Type, code, value."""
REPORT: Sample = (ecodes.EV_SYN, ecodes.SYN_REPORT, 0)
DROPPED: Sample = (ecodes.EV_SYN, ecodes.SYN_DROPPED, 0)


def button(code: int, value: int) -> Sample:
    return (ecodes.EV_KEY, code, value)


def stick(code: int, value: int) -> Sample:
    return (ecodes.EV_ABS, code, value)


@dataclass(frozen=True)
class Pad:
    """A file of gamepads/: the properties of a device, and its recorded events."""

    name: str
    identity: tuple[int, int, int, int]
    properties: int
    bitmaps: dict[int, int]
    """By type; bit n: code n is there."""
    axes: dict[int, AbsInfo]
    events: list[tuple[float, PadEvent]]

    def codes(self, kind: int) -> list[int]:
        bitmap = self.bitmaps.get(kind, 0)
        return [code for code in range(bitmap.bit_length()) if bitmap >> code & 1]

    def state(self) -> PadState:
        """The kernel's state before the first report: nothing pressed, every axis at 0."""
        return PadState(frozenset(), {code: _axis(info) for code, info in self.axes.items()})

    def put_in_sysfs(self, sysfs: Path, event: str, *, uniq: str = "", phys: str = "usb-1/input0") -> None:
        """Describe the device as the kernel does."""
        about = sysfs / event / "device"
        (about / "capabilities").mkdir(parents=True)
        texts = {
            "name": self.name,
            "uniq": uniq,
            "phys": phys,
            "properties": sysfs_bits(self.properties),
            "capabilities/abs": sysfs_bits(self.bitmaps.get(ecodes.EV_ABS, 0)),
            "capabilities/key": sysfs_bits(self.bitmaps.get(ecodes.EV_KEY, 0)),
        }
        for name, text in texts.items():
            (about / name).write_text(text + "\n")


def load_pad(name: str) -> Pad:
    """A description in evemu's format."""
    text = (Path(__file__).parent / "gamepads" / f"{name}.evemu").read_text()
    fields: dict[str, list[str]] = {}
    for line in text.splitlines():
        key, _, rest = line.partition("#")[0].partition(":")
        fields.setdefault(key, []).append(rest.strip())
    bytes_of: dict[int, bytes] = {}
    for kind, _, row in (line.partition(" ") for line in fields["B"]):
        bytes_of[int(kind, 16)] = bytes_of.get(int(kind, 16), b"") + bytes.fromhex(row)
    bus, vendor, product, version = (int(word, 16) for word in fields["I"][0].split())
    axes: dict[int, AbsInfo] = {}
    for line in fields["A"]:
        code, *numbers = line.split()
        axes[int(code, 16)] = AbsInfo(0, *(int(number) for number in numbers))
    events: list[tuple[float, PadEvent]] = []
    for line in fields.get("E", []):
        time_s, kind, code, value = line.split()
        events.append((float(time_s), PadEvent(int(kind, 16), int(code, 16), int(value))))
    return Pad(
        fields["N"][0],
        (bus, vendor, product, version),
        int.from_bytes(bytes.fromhex(fields["P"][0]), "little"),
        {kind: int.from_bytes(row, "little") for kind, row in bytes_of.items()},
        axes,
        events,
    )


def sysfs_bits(bitmap: int) -> str:
    """As the kernel prints a bitmap: words of a long, the highest first, without leading zeros."""
    size = 8 * struct.calcsize("l")
    words: list[str] = []
    while bitmap or not words:
        words.insert(0, f"{bitmap & (1 << size) - 1:x}")
        bitmap >>= size
    return " ".join(words)


@dataclass(eq=False)
class FakeDevice(EventIO):
    """A device file that is one end of a socket: `read` is evdev's own, on real bytes of `struct input_event`.

    The answers of ioctls on a real one (keys, axes) are kept here.
    """

    pad: Pad
    keys: set[int] = field(default_factory=set[int])
    values: dict[int, int] = field(default_factory=dict[int, int])
    is_broken: bool = False
    """The ioctls fail, as those of an unplugged device do."""

    def __post_init__(self) -> None:
        self._here, self._kernel = socket.socketpair()
        self._here.setblocking(False)  # noqa: FBT003 - the standard library's own
        self.fd = self._here.fileno()

    def tell(self, *samples: Sample, silently: bool = False) -> None:
        """Change the state and write the events, as a driver does; silently: they get lost on the way."""
        for kind, code, value in samples:
            if kind == ecodes.EV_ABS:
                self.values[code] = value
            elif kind == ecodes.EV_KEY:
                (self.keys.discard if value == 0 else self.keys.add)(code)
        if not silently:
            self._kernel.sendall(b"".join(struct.pack("llHHi", 0, 0, *sample) for sample in samples))

    def unplug(self) -> None:
        """Reading fails from now on: a peer that closes with unread bytes is a reset connection."""
        self.is_broken = True
        self._here.send(b"?")
        self._kernel.close()

    def end(self) -> None:
        """Reading gives the end of a file: no device does that, a pipe in its place does."""
        self._kernel.close()

    @property
    def is_closed(self) -> bool:
        return self._here.fileno() < 0

    # --- what the real one asks the kernel

    def active_keys(self) -> list[int]:
        self._ioctl()
        return sorted(self.keys)

    def absinfo(self, axis_num: int) -> AbsInfo:
        self._ioctl()
        return self.pad.axes[axis_num]._replace(value=self.values.get(axis_num, 0))

    def close(self) -> None:
        self._here.close()
        self._kernel.close()

    def _ioctl(self) -> None:
        if self.is_broken:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))


def _axis(info: AbsInfo) -> Axis:
    return Axis(info.value, info.min, info.max, info.flat)


def pad_events(samples: Iterable[Sample]) -> list[PadEvent]:
    return [PadEvent(*sample) for sample in samples]
