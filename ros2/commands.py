"""Commands in both directions: those of one ROS 2 topic, as the supervisor receives them, and the robot's. Pure.

A program that publishes at a steady rate passes unchanged, with the stamp of the header of a TwistStamped, or else with the
time at which ROS published the message. Two kinds of program were not written for a watchdog, and their commands are
adapted (docs/decisions/0044):

* `hold_s`: it publishes only on key events. Each command is repeated for `hold_s`, then neutral is sent.
* `arm = "on_request"`: it never sends zero. A person's request becomes one neutral command, which arms it.

A ROS 2 base keeps its last command until its own timeout, or without a limit. The watchdog here is the same as that of
the simulated base: without a fresh command of a live supervisor, it commands zero, 50 times a second. Time is an
argument, in seconds of the local monotonic clock.
"""

import math
from typing import NamedTuple

from ros2.config import Ros2Section
from ros2.header_age import HeaderAge
from ros2.samples import Sample, Writers
from wire import cdr
from wire.freshness import Sent, Track, Verdict, judge
from wire.stamp import parse_stamp
from wire.watchdog import BaseReason, Watchdog

PERIOD_S = 0.05
NEUTRAL = cdr.twist(cdr.STANDSTILL)


class Command(NamedTuple):
    """A command for the wire."""

    twist: bytes
    """A `geometry_msgs/msg/Twist`; any other bytes if the message was not a Twist, so that it is refused as invalid."""
    true_at_s: float
    """When it was requested, or repeated, by the local monotonic clock."""
    sent: Sent | None = None
    """The stamp of its writer; None if the adapter made or repeated the command."""


class Source:
    """One command source.

    Args:
        writers: finds the writer of each message.
        headers: finds the source times in the headers of a TwistStamped; None: the topic's type is Twist.
        hold_s: how long a command is repeated; None: it is not.
        on_request: whether a person arms the source.
        timeout_s: maximum age of a command.
    """

    def __init__(
        self,
        writers: Writers,
        *,
        headers: HeaderAge | None,
        hold_s: float | None,
        on_request: bool,
        timeout_s: float,
    ) -> None:
        self._writers = writers
        self.headers = headers
        self._hold_s = hold_s
        self._adapts = hold_s is not None or on_request
        self._timeout_s = timeout_s
        self._track = Track()
        self._program = b""
        self._sequence: int | None = None
        """Number of the program's last message."""
        self._held = NEUTRAL
        self._held_until_s = -math.inf
        self._released = True
        """With `hold_s`: whether the program has been neutral or silent since it was last interrupted."""
        self._next_s = math.inf
        self._true_at_s = -math.inf
        self.present = False
        """Whether exactly one live program publishes."""
        self.accepted = 0
        self.refused = 0

    def attend(self, program: bytes, now_s: float, *, is_here: bool) -> None:
        """Begin to pass commands on: from now on, exactly one live program publishes.

        Args:
            program: the identity of its publisher.
            now_s: the present time.
            is_here: whether it is known to run on this host.
        """
        self.present = True
        if self.headers is not None:
            self.headers.attend(is_here=is_here)
        if program != self._program:
            self._program = program
            self._writers.forget()
        self._sequence = None
        self._wait_for_release(now_s)

    def leave(self) -> None:
        """Stop passing commands on: no program publishes, or more than one."""
        self.present = False
        self._next_s = math.inf

    def heard(self, sample: Sample) -> list[Command]:
        """Return the commands to send for a message; empty if it is refused."""
        gid = self._writers.gid_of(sample)
        commands = self._commands(sample, gid) if self.present else []
        if commands:
            self.accepted += 1
        else:
            self.refused += 1
        return commands

    def _commands(self, sample: Sample, gid: bytes) -> list[Command]:
        headers = self.headers
        twist = cdr.twist_of(sample.payload, stamped=headers is not None) or b""
        source_time_ns = sample.source_time_ns if headers is None else headers.source_time_ns(sample)
        if source_time_ns is None:  # an old command is not silence
            self._sequence = sample.sequence
            self._wait_for_release(sample.arrival_s)
            return []
        sent = Sent(gid, sample.sequence, source_time_ns * 1e-9)
        if not self._adapts:
            return [Command(twist, sample.arrival_s, sent)]
        is_next = self._sequence is None or sample.sequence == self._sequence + 1
        self._sequence = sample.sequence
        if not is_next and sample.arrival_s > self._held_until_s:
            # Messages were lost, so the silence before this one was not the program's.
            self._wait_for_release(sample.arrival_s)
        self._track, verdict, on_way_s = judge(self._track, sent, sample.arrival_s, self._timeout_s)
        if verdict is not Verdict.FRESH:
            # A message with such a delay shows that the program was not silent meanwhile.
            if not self._released or on_way_s > self._timeout_s:
                self._wait_for_release(sample.arrival_s)
            return []
        if self._hold_s is not None and not self._hold(twist, sample.arrival_s, on_way_s, self._hold_s):
            return []
        return self._adapted(twist, sample.arrival_s - on_way_s)

    def _hold(self, twist: bytes, arrival_s: float, on_way_s: float, hold_s: float) -> bool:
        """Hold a command from now on; return whether the message itself is passed on."""
        velocity = cdr.planar_of(twist)
        if velocity is None:  # passed on, so that the supervisor refuses it as invalid, and never repeated
            self._wait_for_release(arrival_s)
            return True
        if velocity == cdr.STANDSTILL:
            self._released = True
        if not self._released:
            self._wait_for_release(arrival_s)
            return False
        self._held = twist
        self._held_until_s = arrival_s - on_way_s + hold_s
        self._next_s = arrival_s + PERIOD_S
        return True

    def _wait_for_release(self, now_s: float) -> None:
        """With `hold_s`: pass nothing until the program sends zero, or has been silent for `hold_s` from now on.

        A held key of a program that starts, that returns from a stop, or whose messages were delayed must first be
        released. Without this, a program that streams its commands would start to move the robot by itself.
        """
        self._held, self._held_until_s = NEUTRAL, -math.inf
        if self._hold_s is not None:
            self._released = False
            self._next_s = now_s + self._hold_s

    def due_s(self) -> float:
        """Return when `repeat` must be called next; infinite if it need not."""
        return self._next_s

    def repeat(self, now_s: float) -> list[Command]:
        """Return the repeated command that is due: the held one, or neutral once it is no longer held."""
        if self._hold_s is None or now_s < self._next_s:
            return []
        if now_s - self._next_s > min(self._hold_s, self._timeout_s):
            # This process was stopped, so it does not know whether the program was silent.
            self._wait_for_release(now_s)
            return []
        self._released = True
        self._next_s = max(self._next_s + PERIOD_S, now_s)
        return self._adapted(self._held if now_s < self._held_until_s else NEUTRAL, now_s)

    def arm(self, now_s: float) -> list[Command]:
        """Return the neutral command that a person requests; empty if no program publishes."""
        if not self.present:
            return []
        self._released = True
        return self._adapted(NEUTRAL, now_s)

    def _adapted(self, twist: bytes, true_at_s: float) -> list[Command]:
        """Return a command with a time that never decreases: a decrease would look like a step of this clock."""
        self._true_at_s = max(self._true_at_s, true_at_s)
        return [Command(twist, self._true_at_s)]


# --- the robot's command topic

REPEAT_S = 0.02
PATIENCE_S = 0.03
"""How long to wait for the supervisor's next command, which comes every 20 ms, before the last one is repeated."""


def message(velocity: cdr.Planar, config: Ros2Section, time_ns: int) -> bytes:
    """Return a command in the type of the robot's command topic.

    Args:
        velocity: the velocity of the robot.
        config: `[ros2]`.
        time_ns: the stamp of a TwistStamped; 0: none.
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
        self._waits_for_zero = False
        """Whether the base's clock was unproven, and the supervisor has not commanded zero since."""

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

    def target(self, now_s: float, *, repeated: bool, may_move: bool = True) -> cdr.Planar:
        """Return the velocity to publish now.

        Args:
            now_s: the local monotonic clock.
            repeated: whether no new command caused this call.
            may_move: whether the base's clock is known. Otherwise zero is published, until the supervisor has commanded
                zero with a known clock: it notices that the base does not follow, and then requires a neutral command.
        """
        target = self._watchdog.target(now_s)
        velocity = cdr.Planar(target.linear_m_s, target.angular_rad_s)
        self.due_s = now_s + (REPEAT_S if repeated else PATIENCE_S)
        self._waits_for_zero = not may_move or (self._waits_for_zero and velocity != cdr.STANDSTILL)
        if not self._waits_for_zero:
            self.reason = target.reason
            return velocity
        self.reason = BaseReason.COMMAND_STALE if target.reason is BaseReason.OK else target.reason
        return cdr.STANDSTILL
