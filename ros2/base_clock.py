"""The clock of the base, from the stamps of its odometry, and the time that is written into a TwistStamped. Pure.

A base such as diff_drive_controller compares the stamp of a command with its own clock. If its clock is ahead of this
computer's by more than its timeout, it ignores each command; if it is behind, and everything above the base dies, the last
command holds for longer by the difference. Commands are therefore stamped in the base's clock: the offset is the
smallest (arrival − stamp) of its odometry, judged like the age of a command (`wire/freshness.py`). After a step, or while
it does not run like real time, the clock is unproven until its offset has been stable again.

| `[ros2] stamp` | stamp of a command |
|---|---|
| `base` | the time by the base's clock; while this is unproven, only zero velocity |
| `zero` | zero: the base's controller takes its own time at arrival |
| `now` | the time by this computer's clock |
| not set | `base` once stamped odometry was heard, before `now` |
"""

import math

from ros2.config import StampChoice
from ros2.samples import Sample
from wire import cdr
from wire.freshness import Sent, Track, Verdict, judge
from wire.header_clock import HeaderClock, in_words

STABLE_S = 0.2
"""Time for which the offset must be stable, and the largest delay of odometry that confirms it."""
SILENT_S = 0.5
"""Without odometry that confirms the offset for this long, the offset is unproven. Longer than a pause of DDS (0.35 s)."""
OFFSET_LIMIT_S = 0.1
"""With `now`, a larger offset is reported: it is a large part of the timeout of a usual base (0.25 to 0.5 s)."""
REPORTED_S = 30.0
"""How long a change of the offset is reported: long enough to find it after the stop that it caused."""
ODOM_DEPTH = 64
"""Number of messages of odometry that wait for `BaseClock.hear`."""
EPOCH = b"odom"


class BaseClock:
    """Follows the base's clock, and decides which stamp its commands get.

    Args:
        choice: `[ros2] stamp`.
    """

    def __init__(self, choice: StampChoice | None) -> None:
        self._choice: StampChoice | None = choice
        self._track = Track()
        self._header = HeaderClock()
        self._heard = 0
        """Number of stamped messages of odometry."""
        self._proven_s = self._confirmed_s = -math.inf
        """When the offset was last proven anew, and confirmed."""
        self._lost_s = -math.inf
        """When a proven offset was last lost."""
        self._lost_ahead_s = 0.0
        """The offset that was lost."""

    def hear(self, odometry: Sample) -> None:
        """Process a message of the base's odometry; one without a stamp shows nothing."""
        stamp_ns, arrival_s = cdr.header_ns_of(odometry.payload), odometry.arrival_s
        if stamp_ns == 0:
            return
        self._header.hear(stamp_ns, arrival_s)
        was_proven, ahead_s = self._track.proven, self.ahead_s
        if was_proven and arrival_s - max(self._proven_s, self._confirmed_s) > SILENT_S:
            self._track = Track()
        self._heard += 1
        sent = Sent(EPOCH, self._heard, (stamp_ns - odometry.clock_ns) * 1e-9)
        self._track, verdict, _ = judge(self._track, sent, arrival_s, STABLE_S)
        if verdict is Verdict.FRESH:
            self._confirmed_s = arrival_s
        if self._track.proven and not was_proven:
            self._proven_s = arrival_s
        if was_proven and not self._track.proven:
            self._lost_s, self._lost_ahead_s = arrival_s, ahead_s

    @property
    def choice(self) -> StampChoice:
        """Which time is written."""
        return self._choice or ("base" if self._heard else "now")

    @property
    def ahead_s(self) -> float:
        """The base's clock less this computer's; a delay of its odometry makes it smaller. 0 before any stamped odometry."""
        return -self._track.baseline_s

    def is_proven(self, now_s: float) -> bool:
        """Return whether the base's clock is known."""
        confirmed = self._track.proven and now_s - self._confirmed_s <= SILENT_S
        return confirmed and not self._header.problem

    def may_move(self, now_s: float) -> bool:
        """Return whether a command other than zero can get a stamp that the base understands."""
        return self.choice != "base" or self.is_proven(now_s)

    def stamp_ns(self, wall_ns: int) -> int:
        """Return the stamp of a command.

        Args:
            wall_ns: the present time by this computer's wall clock.
        """
        match self.choice:
            case "zero":
                return 0
            case "now":
                return wall_ns
            case "base":
                return min(max(0, wall_ns + round(self.ahead_s * 1e9)), cdr.MAX_TIME_NS)

    def shown(self, now_s: float) -> str:
        """Return the state of the base's clock, for the report."""
        if not self._heard:
            return "unknown: no stamped odometry"
        return f"{in_words(self.ahead_s)}{'' if self.is_proven(now_s) else ', unproven'}"

    def problem(self, now_s: float) -> str | None:
        """Return a sentence if commands cannot be stamped as the base expects; None if they can."""
        if self.choice == "zero":
            return None
        if self._header.problem:
            return (
                f"the stamps of the base's odometry {self._header.problem}, so they do not show the base's clock"
                f"{'' if self.may_move(now_s) else ' and only zero is commanded'}: let its driver stamp with real time, or "
                'set stamp = "zero" in [ros2] if its controller then takes its own time'
            )
        if not self.may_move(now_s):
            return (
                "the base's clock is unknown (no stamped odometry, a step, or odometry that is late), so only zero is "
                'commanded: if this persists, synchronise the clocks with NTP, or set stamp = "zero" or "now" in [ros2]'
            )
        if self.choice == "base" and now_s - self._lost_s <= REPORTED_S:
            change_s = self.ahead_s - self._lost_ahead_s
            # A clock that runs slow falls behind by STABLE_S each time.
            slow = "; if this repeats, its clock runs slow: synchronise it with NTP"
            return (
                "the base's clock was unknown for a moment, and since then it has changed by "
                f"{change_s:+.2f} s: zero was commanded, so send zero velocity before the robot can move again"
                f"{slow if -2.0 * STABLE_S < change_s < 0.0 else ''}"
            )
        if self.choice == "now" and abs(self.ahead_s) > OFFSET_LIMIT_S:
            effect = "ignores each command" if self.ahead_s > 0.0 else "keeps its last command for longer"
            return (
                f"the base's clock is {in_words(self.ahead_s)}, so a base that checks stamps {effect}: set "
                'stamp = "base" in [ros2], or synchronise the clocks with NTP'
            )
        return None
