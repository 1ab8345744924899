"""The motion of the simulated base, reported through a pipe instead of the network, so also while the hub is dead.

The campaign's sim writes a sample to a named pipe 100 times per second, and whenever the base's own stop reason or
the drive's state changes. Its times are `time.monotonic` of the same machine, so they need no correction.
"""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_LAYOUT = struct.Struct("<9dBBBq")
READ_BYTES = 64 * _LAYOUT.size


class WheelSample(NamedTuple):
    """One sample of the base."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    clearance_m: float
    """Distance from the hull to the nearest object."""
    own_approach_m: float
    """Decrease of the clearance since the previous sample by the robot's own motion."""
    lost_s: float
    """Time without samples before this one; a stopped process writes none."""
    is_touching: bool
    is_driven: bool
    """Whether the drive's target is not zero."""
    reason: int
    """Index of the base's own stop reason in `wire.watchdog.BaseReason`."""
    collisions: int
    """Number since the last reset."""


def pack(sample: WheelSample) -> bytes:
    return _LAYOUT.pack(*sample)


def unpack(data: bytes) -> Iterator[WheelSample]:
    """Decode the samples of complete records."""
    for values in _LAYOUT.iter_unpack(data):
        sample = WheelSample._make(values)
        yield sample._replace(is_touching=bool(sample.is_touching), is_driven=bool(sample.is_driven))


class WheelPipe:
    """The reader's end; writers may start and end."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        # Opened for both directions, so that it does not end when a writer dies.
        self.descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self._rest = b""

    def take(self) -> list[WheelSample]:
        """Return all samples since the last call; a write is complete or absent."""
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
    """The sim's end; it never blocks, and drops samples that are not read."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)

    def tell(self, sample: WheelSample) -> None:
        try:
            os.write(self._descriptor, pack(sample))
        except (BlockingIOError, BrokenPipeError):
            return
