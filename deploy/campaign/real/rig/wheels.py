"""What the simulated base does at its wheels, told past the network: also while the hub is dead.

The sim of the campaign writes a sample into a named pipe, 100 times a second and whenever the base's own
reason changes, or whether it drives at all. Its times are `time.monotonic` of the same machine, so they need no correction.
"""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_LAYOUT = struct.Struct("<9dBBBq")
READ_BYTES = 64 * _LAYOUT.size


class WheelSample(NamedTuple):
    """One moment of the base."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    clearance_m: float
    """Hull to the nearest thing."""
    own_approach_m: float
    """How much of it was lost since the sample before by the robot's own motion."""
    lost_s: float
    """For how long nothing was told before this one; a stopped process tells nothing."""
    is_touching: bool
    is_driven: bool
    """Whether the drive is asked for anything but zero."""
    reason: int
    """The index of the base's own reason in `sim.watchdog.BaseReason`."""
    collisions: int
    """Since the last reset."""


def pack(sample: WheelSample) -> bytes:
    return _LAYOUT.pack(*sample)


def unpack(data: bytes) -> Iterator[WheelSample]:
    """The samples of a whole number of records."""
    for values in _LAYOUT.iter_unpack(data):
        sample = WheelSample._make(values)
        yield sample._replace(is_touching=bool(sample.is_touching), is_driven=bool(sample.is_driven))


class WheelPipe:
    """The reader's end; writers may come and go."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        # Opened for both, so that it never ends when a writer dies.
        self.descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self._rest = b""

    def take(self) -> list[WheelSample]:
        """Everything that was written since the last time; a write is whole or not at all."""
        data = self._rest
        while True:
            try:
                data += os.read(self.descriptor, READ_BYTES)
            except BlockingIOError:
                break
        whole = len(data) - len(data) % _LAYOUT.size
        self._rest = data[whole:]
        return list(unpack(data[:whole]))

    def close(self) -> None:
        os.close(self.descriptor)


class WheelWriter:
    """The sim's end. Never blocks; what nobody reads is left out."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)

    def tell(self, sample: WheelSample) -> None:
        try:
            os.write(self._descriptor, pack(sample))
        except (BlockingIOError, BrokenPipeError):
            return
