"""Detect two supervisors in one namespace: two robots that would both obey this program. Pure.

Behind a router, two robots with one namespace, such as copies of one disk, look like one. A supervisor that was restarted
speaks as a new run, and its earlier run never speaks again; if it does, there are two.
"""

import math
from collections import deque

HOLD_S = 1.0
"""How long a conflict holds after its last evidence: ten statuses."""
KEPT_RUNS = 8


class Supervisors:
    """Tracks which runs of supervisors speak."""

    def __init__(self) -> None:
        self._runs: deque[bytes] = deque(maxlen=KEPT_RUNS)
        """The last run that spoke is at the end."""
        self._evidence_s = -math.inf

    def heard(self, run: bytes, now_s: float) -> None:
        """Take the run of a status, which its stamp contains, and its arrival time [s]."""
        if run in self._runs:
            if run != self._runs[-1]:
                self._evidence_s = now_s
            self._runs.remove(run)
        self._runs.append(run)

    def are_several(self, now_s: float) -> bool:
        """Return whether two supervisors spoke within `HOLD_S`."""
        return now_s - self._evidence_s < HOLD_S
