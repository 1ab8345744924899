"""Stamps of a LaserScan's header that do not run like real time, as of some bridges and simulations."""

import time
from collections.abc import Callable

BEGAN_NS = time.time_ns()
SECOND_NS = 1_000_000_000


def _slow_ns(now_ns: int) -> int:
    return BEGAN_NS + (now_ns - BEGAN_NS) * 9 // 10


def _whole_ns(now_ns: int) -> int:
    return now_ns // SECOND_NS * SECOND_NS


def _constant_ns(_: int) -> int:
    return 1_700_000_000_500_000_000


STAMPS: dict[str, Callable[[int], int]] = {"slow": _slow_ns, "whole": _whole_ns, "constant": _constant_ns}
"""By name: the stamp of a scan at a time by the wall clock, both in nanoseconds."""
PROBLEMS = {"slow": "run at 0.90 of real time", "whole": "are whole seconds", "constant": "do not change"}
"""By the same names: how reports describe the stamps."""
