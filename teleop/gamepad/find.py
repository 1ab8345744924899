"""Find the gamepad among the input devices from their driver's descriptions in sysfs, without opening them.

Opening a device needs permission, wakes up some devices, and takes many milliseconds. This would delay the heartbeat.
"""

import re
import struct
from pathlib import Path
from typing import NamedTuple

from teleop.screen.view import plain

DEVICES = Path("/dev/input")
SYSFS = Path("/sys/class/input")
INPUT_PROP_ACCELEROMETER = 0x06
WORD_BITS = 8 * struct.calcsize("l")
"""Bits per word of a bitmap in sysfs; the highest word comes first."""


class GamepadError(Exception):
    """No gamepad can be used; the message says why, and what to do."""


class Needed(NamedTuple):
    """Codes of the axes and buttons that a gamepad needs, and their names for error messages."""

    axes: tuple[int, ...]
    buttons: tuple[int, ...]
    names: tuple[str, ...]


class Described(NamedTuple):
    """An input device as described by its driver."""

    path: Path
    name: str
    unit: tuple[str, str]
    """Address and port; the same for all devices of one pad."""
    axes: int
    buttons: int
    properties: int
    """Like `axes` and `buttons` a bitmap: bit n is set if the device has code n."""

    def has(self, needed: Needed) -> bool:
        return _covers(self.axes, needed.axes) and _covers(self.buttons, needed.buttons)

    def __str__(self) -> str:
        return f"{self.path} ({self.name})"


def find_gamepad(
    needed: Needed, wanted: str | None, *, devices: Path = DEVICES, sysfs: Path = SYSFS
) -> Described:
    """Return the device at the path `wanted`; if that is None, the only device with the needed axes and buttons.

    Raises:
        GamepadError: there is no such device, or more than one, or it lacks an axis or button.
    """
    names = ", ".join(needed.names)
    if wanted is not None:
        try:
            found = describe(Path(wanted).resolve(strict=True), sysfs)
        except (OSError, RuntimeError):  # a link to itself
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
    """Return the device of the pad's motion sensors; None if it has none. Most drivers create a separate device."""
    for device in list_devices(devices, sysfs):
        is_sensor = bool(device.properties >> INPUT_PROP_ACCELEROMETER & 1)
        if is_sensor and device.path != pad.path and device.unit == pad.unit and any(pad.unit):
            return device
    return None


def list_devices(devices: Path = DEVICES, sysfs: Path = SYSFS) -> list[Described]:
    """Return all input devices, ordered by number; devices that disappear meanwhile are omitted."""
    found: list[Described] = []
    for path in sorted(sysfs.glob("event*"), key=_number):
        try:
            found.append(describe(devices / path.name, sysfs))
        except OSError:
            continue
    return found


def describe(path: Path, sysfs: Path = SYSFS) -> Described:
    """Return the description of a device in sysfs, in plain ASCII, because the name from the device is displayed.

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
    """Convert a bitmap in the format of sysfs to an integer with the same bits."""
    value = 0
    for word in text.split():
        value = value << WORD_BITS | int(word, 16)
    return value


def _covers(bitmap: int, codes: tuple[int, ...]) -> bool:
    return all(bitmap >> code & 1 for code in codes)


def _number(path: Path) -> int:
    digits = re.search(r"\d+$", path.name)
    return int(digits[0]) if digits else 0
