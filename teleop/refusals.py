"""Whether the supervisor refuses everything that this program says, by the counts in its status. Pure.

An epoch that has ended for the supervisor counts never again (docs/decisions/0020): somebody spoke under this
name while this program was silent, or with a copy of its epoch. Then only a new epoch is heard, which begins
as any restarted program does: neutral.
"""

from wire.messages import SourceStatus

LOCKED_OUT_S = 0.5
"""Ten heartbeats refused and none accepted."""


class Refusals:
    """What became of the commands under one name, from status to status."""

    def __init__(self) -> None:
        self._before: SourceStatus | None = None
        self._since_s = 0.0
        """When some were accepted, or none were refused, last."""

    def another_speaks(self, own: SourceStatus) -> bool:
        """Whether commands of another epoch than the one that is heard came since the status before."""
        return self._before is not None and own.refused_epoch > self._before.refused_epoch

    def all_refused(self, own: SourceStatus, now_s: float) -> bool:
        """Whether commands were refused and none was accepted for `LOCKED_OUT_S`; the count begins anew then.

        Args:
            own: what a status that just came says of this name; it is the one before from now on.
            now_s: the time, by any one monotonic clock.
        """
        before, self._before = self._before, own
        if before is None or own.accepted != before.accepted or _refused(own) == _refused(before):
            self._since_s = now_s
        if now_s - self._since_s < LOCKED_OUT_S:
            return False
        self._since_s = now_s
        return True


def _refused(own: SourceStatus) -> int:
    return own.refused_epoch + own.refused_sequence
