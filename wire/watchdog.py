"""The base's own command watchdog: the base brakes when no fresh command of a live supervisor arrives.

The age of a command counts from its decision, not from its arrival: a suspended supervisor or a stalled link may deliver
an outdated command (docs/decisions/0022).

Pure: time is an argument, in seconds of any monotonic clock. The watchdog does not require a neutral command to re-arm,
because all commands first pass the supervisor, which requires it.
"""

import math
from enum import StrEnum
from typing import NamedTuple

from wire.freshness import Sent, Track, Verdict, judge

COMMAND_TIMEOUT_S = 0.150


class BaseReason(StrEnum):
    """Result of the watchdog; of several reasons, the last in this order wins."""

    OK = "OK"
    COMMAND_STALE = "COMMAND_STALE"
    COMMAND_INVALID = "COMMAND_INVALID"
    COMMAND_TIMEOUT = "COMMAND_TIMEOUT"
    NO_COMMAND = "NO_COMMAND"
    SUPERVISOR_LOST = "SUPERVISOR_LOST"


class Target(NamedTuple):
    """Target twist of the drive and its reason; zero for any reason but OK."""

    linear_m_s: float
    angular_rad_s: float
    reason: BaseReason


class Watchdog:
    """Holds the last command as long as it is valid.

    Raises:
        ValueError: The timeout is not positive and finite.
    """

    def __init__(self, command_timeout_s: float = COMMAND_TIMEOUT_S) -> None:
        if not (math.isfinite(command_timeout_s) and command_timeout_s > 0.0):
            raise ValueError(f"command_timeout_s must be positive and finite, not {command_timeout_s}.")
        self.command_timeout_s = command_timeout_s
        self._supervisor_alive = False
        self._track = Track()
        self._decided_at_s: float | None = None
        self._v_m_s = 0.0
        self._omega_rad_s = 0.0
        self._refused: BaseReason | None = None
        """Why the last command was refused; None if it was accepted."""
        self._resumed_s = -math.inf

    def resumed(self, now_s: float) -> None:
        """Handle a suspend of the machine that ended at `now_s`; monotonic ages do not include it.

        The last command ends. Other commands from before the suspend may still be in transit, so no command is accepted
        for one timeout.
        """
        self._resumed_s = now_s
        self._decided_at_s = self._refused = None

    def supervisor_alive(self, alive: bool) -> None:  # noqa: FBT001 - the call reads as the sentence it is
        """Process a change of the supervisor's liveliness token.

        A lost token also ends the last command, so that the return of the token alone does not move the robot.
        """
        self._supervisor_alive = alive
        if not alive:
            self._decided_at_s = self._refused = None

    def command(
        self, arrival_s: float, linear_m_s: float, angular_rad_s: float, sent: Sent | None = None
    ) -> bool:
        """Process a command; return False if it is refused.

        A command that is not finite, late, out of order or of an unproven epoch stops the base until a good command
        arrives, and does not refresh the age. A command without the supervisor's token, or just after a suspend, is
        not kept.

        Args:
            arrival_s: its arrival time.
            linear_m_s: the forward velocity.
            angular_rad_s: the turn rate, counter-clockwise.
            sent: its stamp, with the time of its decision; None, as from a plain ROS 2 writer: it counts from its
                arrival, after such commands have arrived for one timeout without a longer gap, and unless stamped
                commands arrive.
        """
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s)):
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
        """Return the present target of the drive and its reason."""
        reason = self._reason(now_s)
        if reason is not BaseReason.OK:
            return Target(0.0, 0.0, reason)
        return Target(self._v_m_s, self._omega_rad_s, reason)

    def _reason(self, now_s: float) -> BaseReason:
        if not self._supervisor_alive:
            return BaseReason.SUPERVISOR_LOST
        if self._decided_at_s is None:
            return BaseReason.NO_COMMAND
        # This form treats an age of NaN as too old.
        if not now_s - self._decided_at_s <= self.command_timeout_s:
            return BaseReason.COMMAND_TIMEOUT
        return self._refused or BaseReason.OK
