"""Which programs write on a sensor's key: two active writers contradict each other."""

import math
from collections.abc import Iterable
from operator import attrgetter
from typing import NamedTuple

WRITER_WINDOW_S = 0.5
"""A writer that was heard twice within this time is an active publisher; the window is longer for slow lidars."""

REMEMBERED_WRITERS = 8
GID_BYTES = 16


class Writer(NamedTuple):
    """A writer on one sensor's key, with the times at which it was last heard and heard before that."""

    gid: bytes
    heard_s: float
    before_s: float = -math.inf


class Sensor(NamedTuple):
    """A sensor and the writers on its key."""

    name: str
    writers: tuple[Writer, ...]
    timeout_s: float


def heard(writers: tuple[Writer, ...], gid: bytes, arrival_s: float) -> tuple[Writer, ...]:
    """Record that a writer was heard, and return the writers on a sensor's key, the latest first.

    Beyond `REMEMBERED_WRITERS`, writers that were heard only once are dropped first.
    """
    heard_s = next((w.heard_s for w in writers if w.gid == gid), -math.inf)
    others = [w for w in writers if w.gid != gid]
    others.sort(key=attrgetter("before_s"), reverse=True)
    return (Writer(gid, arrival_s, heard_s), *others[: REMEMBERED_WRITERS - 1])


def conflicts(sensors: Iterable[Sensor], now_s: float) -> tuple[str, ...]:
    """Return a text for each sensor with several active writers: its name and theirs."""
    return tuple(
        f"{sensor.name}: {' and '.join(sorted(_name_of(gid) for gid in active))}"
        for sensor in sensors
        if len(active := speaking(sensor.writers, sensor.timeout_s, now_s)) > 1
    )


def _name_of(gid: bytes) -> str:
    """Return a readable name of a writer: a short hexadecimal gid, or the frame id."""
    return gid.hex()[:8] if len(gid) == GID_BYTES else gid.decode(errors="replace") or "no name"


def speaking(writers: tuple[Writer, ...], timeout_s: float, now_s: float) -> list[bytes]:
    """Return the active writers on a sensor's key: those heard twice within the window, so not after a stray message."""
    since_s = now_s - max(WRITER_WINDOW_S, 2.5 * timeout_s)
    return [w.gid for w in writers if w.before_s >= since_s]
