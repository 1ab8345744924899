"""The motion of the simulated base, reported through a pipe instead of the network, so also while the hub is dead.

The campaign's sim writes a sample to a named pipe 100 times per second, and whenever the base's own stop reason or
the drive's state changes. Its times are `time.monotonic` of the same machine, so they need no correction.
"""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from faults.seen import Motion

_LAYOUT = struct.Struct("<7d?d?B")
READ_BYTES = 64 * _LAYOUT.size


class WheelSample(NamedTuple):
    """One sample of the base."""

    motion: Motion
    is_driven: bool
    """Whether the drive's target is not zero."""
    reason: int
    """Index of the base's own stop reason in `wire.watchdog.BaseReason`."""


def pack(sample: WheelSample) -> bytes:
    return _LAYOUT.pack(*sample.motion, sample.is_driven, sample.reason)


def unpack(data: bytes) -> Iterator[WheelSample]:
    """Decode the samples of complete records."""
    for *motion, is_driven, reason in _LAYOUT.iter_unpack(data):
        yield WheelSample(Motion._make(motion), is_driven, reason)


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
