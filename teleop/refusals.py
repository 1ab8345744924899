"""Whether the supervisor refuses everything that this program says, by the counts in its status. Pure.

An epoch that has ended for the supervisor counts never again (docs/decisions/0020): somebody spoke under this
name while this program was silent, or with a copy of its epoch. Then only a new epoch is heard, which begins
as any restarted program does: neutral.
"""

import math

from wire.messages import SourceStatus

LOCKED_OUT_S = 0.5
"""Ten heartbeats refused and none accepted."""


class Refusals:
    """What became of the commands under one name."""

    def __init__(self) -> None:
        self._accepted = self._refused = 0
        self._since_s = math.inf

    def all_refused(self, own: SourceStatus, now_s: float) -> bool:
        """Whether commands were refused and none was accepted for `LOCKED_OUT_S`; the count begins anew then.

        Args:
            own: what a status that just came says of this name.
            now_s: the time, by any one monotonic clock.
        """
        refused = own.refused_epoch + own.refused_sequence
        if own.accepted != self._accepted or refused == self._refused:
            self._since_s = now_s
        self._accepted, self._refused = own.accepted, refused
        if now_s - self._since_s < LOCKED_OUT_S:
            return False
        self._since_s = now_s
        return True
