"""The robot's command topic: the supervisor's commands, with the base's own watchdog (pure).

A ROS 2 base keeps its last command until its own timeout, or without a limit. The watchdog here is the same as that of
the simulated base: without a fresh command of a live supervisor, it commands zero, 50 times a second.
"""

import math

from ros2.config import Ros2Section
from wire import cdr
from wire.freshness import Sent
from wire.stamp import parse_stamp
from wire.watchdog import BaseReason, Watchdog

PERIOD_S = 0.02
PATIENCE_S = 0.03
"""How long to wait for the supervisor's next command, which comes every 20 ms, before the last one is repeated."""


def message(velocity: cdr.Planar, config: Ros2Section, time_ns: int) -> bytes:
    """Return a command in the type of the robot's command topic.

    Args:
        velocity: the velocity of the robot.
        config: `[ros2]`.
        time_ns: the stamp of a TwistStamped, by the wall clock.
    """
    if config.stamped:
        return cdr.twist_stamped(velocity, time_ns, config.frame_id)
    return cdr.twist(velocity)


class Base:
    """Decides what is published on the robot's command topic.

    Args:
        command_timeout_s: maximum age of the supervisor's command.
    """

    def __init__(self, command_timeout_s: float) -> None:
        self._watchdog = Watchdog(command_timeout_s)
        self._changed_s = 0.0
        self.due_s = 0.0
        """When the next command must be published."""
        self.reason = BaseReason.NO_COMMAND

    def supervisor_alive(self, alive: bool, arrival_s: float) -> None:  # noqa: FBT001 - as Watchdog's
        self._changed_s = arrival_s
        self._watchdog.supervisor_alive(alive)
        self.due_s = 0.0

    def resumed(self, now_s: float) -> None:
        self._watchdog.resumed(now_s)
        self.due_s = 0.0

    def command(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        """Process a command of the supervisor; the next `target` is due immediately."""
        if arrival_s < self._changed_s:
            return
        velocity = cdr.planar_of(payload) or cdr.Planar(math.nan, math.nan)
        stamp = parse_stamp(attachment)
        sent: Sent | None = None if stamp is None else stamp.sent()
        self._watchdog.command(arrival_s, velocity.linear_m_s, velocity.angular_rad_s, sent)
        self.due_s = 0.0

    def target(self, now_s: float, *, repeated: bool) -> cdr.Planar:
        """Return the velocity to publish now.

        Args:
            now_s: the local monotonic clock.
            repeated: whether no new command caused this call.
        """
        target = self._watchdog.target(now_s)
        self.reason = target.reason
        self.due_s = now_s + (PERIOD_S if repeated else PATIENCE_S)
        return cdr.Planar(target.linear_m_s, target.angular_rad_s)
