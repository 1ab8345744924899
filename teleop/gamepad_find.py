"""Which input device is the gamepad: read from sysfs, which tells what each one has without opening any.

Opening wakes some devices up and takes them many milliseconds, and needs a permission; both would be in the way
while the robot's heartbeat goes on. What sysfs shows is the driver's own description.
"""

import re
import struct
from pathlib import Path
from typing import NamedTuple

from teleop.view import plain

DEVICES = Path("/dev/input")
SYSFS = Path("/sys/class/input")
INPUT_PROP_ACCELEROMETER = 0x06
WORD_BITS = 8 * struct.calcsize("l")
"""sysfs writes bits in the kernel's words, the highest first."""


class GamepadError(Exception):
    """No gamepad can be had; the message says in one sentence why, and what to do."""


class Needed(NamedTuple):
    """What makes a device the gamepad: the codes of axes and buttons, and their names for whoever lacks them."""

    axes: tuple[int, ...]
    buttons: tuple[int, ...]
    names: tuple[str, ...]


class Described(NamedTuple):
    """An input device by its driver's description."""

    path: Path
    name: str
    unit: tuple[str, str]
    """Address and plug: the same for every part of one pad."""
    axes: int
    buttons: int
    properties: int
    """Bit n: code n is there."""

    def has(self, needed: Needed) -> bool:
        return _covers(self.axes, needed.axes) and _covers(self.buttons, needed.buttons)

    def __str__(self) -> str:
        return f"{self.path} ({self.name})"


def find_gamepad(
    needed: Needed, wanted: str | None, *, devices: Path = DEVICES, sysfs: Path = SYSFS
) -> Described:
    """The device at the path `wanted`; without one, the only device that has what is needed.

    Raises:
        GamepadError: there is none, or more than one, or it lacks something.
    """
    names = ", ".join(needed.names)
    if wanted is not None:
        try:
            found = describe(Path(wanted).resolve(strict=True), sysfs)
        except OSError:
            raise GamepadError(
                f"there is no input device {wanted}: plug the gamepad in, or name another as [teleop.gamepad] device"
            ) from None
        if not found.has(needed):
            raise GamepadError(f"{found} has not all of {names}: name its own in [teleop.gamepad]")
        return found
    everything = list_devices(devices, sysfs)
    pads = [device for device in everything if device.has(needed)]
    if not pads:
        others = "; ".join(str(device) for device in everything) or "none"
        raise GamepadError(
            f"there is no gamepad (a device with {names}): plug it in; input devices found: {others}"
        )
    if len(pads) > 1:
        raise GamepadError(
            f"there are {len(pads)} gamepads: name one as [teleop.gamepad] device, "
            + " or ".join(str(pad) for pad in pads)
        )
    return pads[0]


def find_sensors(pad: Described, *, devices: Path = DEVICES, sysfs: Path = SYSFS) -> Described | None:
    """The motion sensors of that very pad, which most drivers give a device of their own; None: it has none."""
    for device in list_devices(devices, sysfs):
        is_sensor = bool(device.properties >> INPUT_PROP_ACCELEROMETER & 1)
        if is_sensor and device.path != pad.path and device.unit == pad.unit and any(pad.unit):
            return device
    return None


def list_devices(devices: Path = DEVICES, sysfs: Path = SYSFS) -> list[Described]:
    """Every input device, by number; one that goes away meanwhile is left out."""
    found: list[Described] = []
    for path in sorted(sysfs.glob("event*"), key=_number):
        try:
            found.append(describe(devices / path.name, sysfs))
        except OSError:
            continue
    return found


def describe(path: Path, sysfs: Path = SYSFS) -> Described:
    """What sysfs says of the device at `path`, in plain ASCII: a name comes from the device and is shown.

    Raises:
        OSError: there is no such device.
    """
    about = sysfs / path.name / "device"

    def text(name: str) -> str:
        return plain((about / name).read_text(errors="replace").strip())

    return Described(
        path,
        text("name"),
        (text("uniq"), text("phys")),
        bits(text("capabilities/abs")),
        bits(text("capabilities/key")),
        bits(text("properties")),
    )


def bits(text: str) -> int:
    """A bitmap as sysfs writes it -> a number whose bit n is bit n."""
    value = 0
    for word in text.split():
        value = value << WORD_BITS | int(word, 16)
    return value


def _covers(bitmap: int, codes: tuple[int, ...]) -> bool:
    return all(bitmap >> code & 1 for code in codes)


def _number(path: Path) -> int:
    digits = re.search(r"\d+$", path.name)
    return int(digits[0]) if digits else 0
