"""The messages of a second writer on the lidar's key: plausible scans of free space. Pure."""

import random
from collections.abc import Iterator

import numpy as np

from wire.messages import LaserScan, laser_scan
from wire.stamp import GID_BYTES, Stamp

FREE_M = 5.0
"""Radius of an empty round room."""
NOISE_M = 0.002
PERIOD_S = 0.05


def free_scan(chance: random.Random, time_ns: int | None = None) -> LaserScan:
    """Return a plausible scan of an empty round room; no two are equal."""
    noise = np.random.default_rng(chance.randrange(1 << 31))
    ranges = noise.normal(FREE_M, NOISE_M, 360).astype(np.float32)
    return laser_scan(ranges, range_m=(0.1, 12.0), period_s=PERIOD_S, time_ns=time_ns)


def attachments(chance: random.Random, rate_hz: float) -> Iterator[bytes | None]:
    """Yield the attachments of one writer: none, or valid stamps in order, at random."""
    if chance.random() < 0.5:
        while True:
            yield None
    gid, period_ns = chance.randbytes(GID_BYTES), round(1e9 / rate_hz)
    number = 0
    while True:
        number += 1
        yield Stamp(number, number * period_ns, gid).pack()
