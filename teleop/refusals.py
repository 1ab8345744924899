"""Detect from the status counters that the supervisor refuses all commands of this program. Pure.

The supervisor never accepts an epoch again that has ended (docs/decisions/0020). This happens if another program used
this name while this program was silent, or a copy of its epoch. Then only a new epoch is accepted, which begins neutral
like a restarted program.
"""

from wire.messages import SourceStatus

LOCKED_OUT_S = 0.5
"""Time without an accepted command after which a program is locked out: ten heartbeats."""


class Refusals:
    """Tracks accepted and refused commands of one source between statuses."""

    def __init__(self) -> None:
        self._before: SourceStatus | None = None
        self._since_s = 0.0
        """Time of the last status with accepted commands, or without refused ones."""

    def another_speaks(self, own: SourceStatus) -> bool:
        """Return whether commands of another epoch arrived since the previous status."""
        return self._before is not None and own.refused_epoch > self._before.refused_epoch

    def all_refused(self, own: SourceStatus, now_s: float) -> bool:
        """Return whether commands were refused and none accepted for `LOCKED_OUT_S`; then the time starts again.

        Args:
            own: this source in a new status; it becomes the previous one.
            now_s: the time of any monotonic clock.
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
