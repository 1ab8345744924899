"""Which beams without a return prove nothing, because returns that cannot have moved away vanished.

A beam without a return usually proves its ray free as far as `range_max`. But a lost packet, a merger of scans or a dirty
window also reads as silence. Motion takes time: between two scans, an object of at most `MOVER_M_S` and the robot's own motion
uncover only a narrow strip, and carry a return beyond `range_max` only from near it. A wider block of returns that vanishes at once
is the sensor's. Its beams are *lost*: their silence proves nothing until they return, or until another beam that has returned since
then finds the place of the lost return empty. Silence that turns with the robot is never confirmed.

Narrower blocks are not judged: on dark and slanted surfaces, real lidars lose 5° of returns in up to 20 % of the scans while
they move, and 10° in 0.25 %.
"""

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from supervisor.law.clearance import Floats, Mask

LEAST_RAD = math.radians(10.0)
MOVER_M_S = 2.0
"""Fastest object that may uncover or carry away a return."""

LONGEST_S = 0.1
"""Time for which such an object is assumed to have moved between two scans, at most: a gap in the scans explains no silence."""

FAR_SHARE = 0.8
"""Beyond this share of `range_max`, a return may also vanish because it is too weak."""


def vanished(
    silent: Mask, before: Mask, before_m: Floats, step_rad: float, strip_m: float, *, is_round: bool
) -> Mask:
    """Return which beams (n,) belong to a block whose returns vanished and cannot have moved away.

    Args:
        silent: (n,): beams without a return.
        before: (n,): whether the previous scan had a return in the same direction, which motion cannot have carried beyond
            `range_max`.
        before_m: (n,) [m]: its distance.
        step_rad: angle between two beams.
        strip_m: width of the strip that motion may have uncovered since then.
        is_round: whether the last beam is the first beam's neighbour.
    """
    gone = silent & before
    lost = np.zeros(len(gone), dtype=np.bool_)
    if np.count_nonzero(gone) * step_rad < LEAST_RAD:
        return lost
    for row in rows(gone, is_round=is_round):
        arc_m = step_rad * float(before_m[row].sum())
        lost[row] = len(row) * step_rad >= LEAST_RAD and arc_m > strip_m
    return lost


def rows(marked: Mask, *, is_round: bool) -> Iterator[npt.NDArray[np.intp]]:
    """Yield the indices of each row of marked beams (n,); in a full turn, a row may pass over the end.

    Args:
        marked: the marked beams; in a full turn, at least one is not marked, or the row begins with the first.
        is_round: whether the last beam is the first beam's neighbour.
    """
    start = int(np.argmin(marked)) if is_round else 0  # a beam that is not marked: no row passes over it
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.roll(marked, -start), [False]))))
    for first, end in edges.reshape(-1, 2).tolist():
        yield np.arange(start + first, start + end) % len(marked)
