"""The base's own last line of defence: it brakes by itself when nobody proves that somebody drives.

A command counts from when it was decided, not from when it came: a supervisor that was stopped before it could say
so, and a link that was held up, deliver what was right long ago (docs/decisions/0022).

Pure: time is an argument, in seconds of any one monotonic clock. It does not re-arm with a neutral command; that is the
supervisor's duty, and what arrives here has passed it.
"""

import math
from enum import StrEnum
from typing import NamedTuple

from wire.freshness import Sent, Track, Verdict, judge

COMMAND_TIMEOUT_S = 0.150


class BaseReason(StrEnum):
    """Why the base drives as it does; the most restrictive reason wins, in this order from the bottom."""

    OK = "OK"
    COMMAND_STALE = "COMMAND_STALE"
    COMMAND_INVALID = "COMMAND_INVALID"
    COMMAND_TIMEOUT = "COMMAND_TIMEOUT"
    NO_COMMAND = "NO_COMMAND"
    SUPERVISOR_LOST = "SUPERVISOR_LOST"


class Target(NamedTuple):
    """What the drive is to aim at; zero for any reason but OK."""

    linear_m_s: float
    angular_rad_s: float
    reason: BaseReason


class Watchdog:
    """Holds the last command for as long as it may be obeyed.

    Raises:
        ValueError: The timeout is not positive and finite.
    """

    def __init__(self, command_timeout_s: float = COMMAND_TIMEOUT_S) -> None:
        if not (math.isfinite(command_timeout_s) and command_timeout_s > 0.0):
            raise ValueError(f"command_timeout_s must be positive and finite, not {command_timeout_s}.")
        self.command_timeout_s = command_timeout_s
        self.refused_count = 0
        """Commands that were not finite."""
        self._supervisor_alive = False
        self._track = Track()
        self._decided_at_s: float | None = None
        self._v_m_s = 0.0
        self._omega_rad_s = 0.0
        self._refused: BaseReason | None = None
        """Why the last command was not taken; None: it was."""
        self._resumed_s = -math.inf

    def resumed(self, now_s: float) -> None:
        """Takes note that the machine was suspended before `now_s`, which no clock of an age shows.

        The command from before ends. Others from before may still be on their way: none counts for one timeout.
        """
        self._resumed_s = now_s
        self._decided_at_s = self._refused = None

    def supervisor_alive(self, alive: bool) -> None:  # noqa: FBT001 - the call reads as the sentence it is
        """Takes a change of the supervisor's liveliness token.

        A lost token ends the last command as well, so that its return alone moves nothing.
        """
        self._supervisor_alive = alive
        if not alive:
            self._decided_at_s = self._refused = None

    def command(
        self, arrival_s: float, linear_m_s: float, angular_rad_s: float, sent: Sent | None = None
    ) -> bool:
        """Takes a command; false if it is refused.

        One that is not finite, late, out of order or of an unproven epoch stops the base until a good one comes, and
        never refreshes the age. One that comes without the supervisor's token, or just after a suspend, is not kept.

        Args:
            arrival_s: when it came.
            linear_m_s: forward.
            angular_rad_s: to the left.
            sent: when it was decided, by its attachment; None, as from a plain ROS 2 writer: as it came, unless somebody
                who stamps is heard.
        """
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s)):
            self.refused_count += 1
            self._refused = BaseReason.COMMAND_INVALID
            return False
        if not self._supervisor_alive:
            return False
        self._track, verdict, on_way_s = judge(self._track, sent, arrival_s, self.command_timeout_s)
        if arrival_s - self._resumed_s <= self.command_timeout_s:
            return False
        if verdict is not Verdict.FRESH:
            self._refused = BaseReason.COMMAND_STALE
            return False
        self._decided_at_s = arrival_s - on_way_s
        self._v_m_s = linear_m_s
        self._omega_rad_s = angular_rad_s
        self._refused = None
        return True

    def target(self, now_s: float) -> Target:
        """What to aim at now, and why."""
        reason = self._reason(now_s)
        if reason is not BaseReason.OK:
            return Target(0.0, 0.0, reason)
        return Target(self._v_m_s, self._omega_rad_s, reason)

    def _reason(self, now_s: float) -> BaseReason:
        if not self._supervisor_alive:
            return BaseReason.SUPERVISOR_LOST
        if self._decided_at_s is None:
            return BaseReason.NO_COMMAND
        # Written so that an age that is not a number counts as too old.
        if not now_s - self._decided_at_s <= self.command_timeout_s:
            return BaseReason.COMMAND_TIMEOUT
        return self._refused or BaseReason.OK
