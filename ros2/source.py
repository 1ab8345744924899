"""The commands of one ROS 2 topic, as the supervisor receives them.

A program that publishes at a steady rate passes unchanged, with the time at which ROS published each message. Two kinds
of program were not written for a watchdog, and their commands are adapted (docs/decisions/0044):

* `hold_s`: it publishes only on key events. Each command is repeated for `hold_s`, then neutral is sent.
* `arm = "on_request"`: it never sends zero. A person's request becomes one neutral command, which arms it.

Pure: time is an argument, in seconds of the local monotonic clock.
"""

import math
from typing import NamedTuple

from ros2 import cdr
from ros2.samples import Sample, Writers
from wire.freshness import Sent, Track, Verdict, judge

PERIOD_S = 0.05
NEUTRAL = cdr.twist(cdr.STANDSTILL)


class Command(NamedTuple):
    """A command for the wire."""

    twist: bytes
    """A `geometry_msgs/msg/Twist`; any other bytes if the message was not a Twist, so that it is refused as invalid."""
    true_at_s: float
    """When it was true."""
    sent: Sent | None = None
    """The stamp of its writer; None if the adapter made or repeated the command."""


class Source:
    """One command source.

    Args:
        writers: finds the writer of each message.
        stamped: whether the topic's type is TwistStamped.
        hold_s: how long a command is repeated; None: it is not.
        on_request: whether a person arms the source.
        timeout_s: maximum age of a command.
    """

    def __init__(
        self, writers: Writers, *, stamped: bool, hold_s: float | None, on_request: bool, timeout_s: float
    ) -> None:
        self._writers = writers
        self._stamped = stamped
        self._hold_s = hold_s
        self._adapts = hold_s is not None or on_request
        self._timeout_s = timeout_s
        self._track = Track()
        self._program = b""
        self._held = NEUTRAL
        self._held_until_s = -math.inf
        self._next_s = math.inf
        self._quiet_from_s = math.inf
        self.present = False
        """Whether exactly one live program publishes."""
        self.accepted = 0
        self.refused = 0

    def attend(self, program: bytes, now_s: float) -> None:
        """Begin to serve: from now on, exactly one live program publishes.

        Args:
            program: its DDS identity, or any other.
            now_s: the present time.

        A held key of a program that starts, or that returns from a stop, must first be released: until the program has
        been silent for `hold_s`, no neutral is sent for it. Without this, a program that streams its commands would
        start to move the robot by itself.
        """
        self.present = True
        if program != self._program:
            self._program = program
            self._writers.forget()
        self._held, self._held_until_s = NEUTRAL, -math.inf
        if self._hold_s is not None:
            self._quiet_from_s = now_s + self._hold_s
            self._next_s = self._quiet_from_s

    def leave(self) -> None:
        """Stop to serve: no program publishes, or more than one."""
        self.present = False
        self._next_s = self._quiet_from_s = math.inf

    def heard(self, sample: Sample) -> list[Command]:
        """Return the commands that follow from a message."""
        gid = self._writers.gid_of(sample)
        if not self.present:
            self.refused += 1
            return []
        twist = cdr.twist_of(sample.payload, stamped=self._stamped) or b""
        sent = Sent(gid, sample.sequence, sample.source_time_ns * 1e-9)
        if not self._adapts:
            self.accepted += 1
            return [Command(twist, sample.arrival_s, sent)]
        self._track, verdict, on_way_s = judge(self._track, sent, sample.arrival_s, self._timeout_s)
        if verdict is not Verdict.FRESH:
            self.refused += 1
            if self._hold_s is not None:
                self._not_yet_quiet(sample.arrival_s)
            return []
        self.accepted += 1
        if self._hold_s is None:
            return [Command(twist, sample.arrival_s - on_way_s)]
        return self._hold(twist, sample.arrival_s, on_way_s)

    def _hold(self, twist: bytes, arrival_s: float, on_way_s: float) -> list[Command]:
        assert self._hold_s is not None
        is_neutral = cdr.planar_of(twist) == cdr.STANDSTILL
        if not is_neutral and arrival_s < self._quiet_from_s:
            self._not_yet_quiet(arrival_s)
        if cdr.planar_of(twist) is None:  # refused once as invalid, and never repeated
            self._held, self._held_until_s = NEUTRAL, -math.inf
            return [Command(twist, arrival_s - on_way_s)]
        self._held = twist
        self._held_until_s = arrival_s - on_way_s + self._hold_s
        self._next_s = arrival_s + PERIOD_S
        return [Command(twist, arrival_s - on_way_s)]

    def _not_yet_quiet(self, arrival_s: float) -> None:
        """Restart the wait for silence, if it is not over."""
        assert self._hold_s is not None
        if arrival_s < self._quiet_from_s:
            self._quiet_from_s = arrival_s + self._hold_s

    def due_s(self) -> float:
        """Return when `repeat` must be called next; infinite if it need not."""
        return self._next_s

    def repeat(self, now_s: float) -> list[Command]:
        """Return the repeated command that is due: the held one, or neutral once it is no longer held."""
        if now_s < self._next_s:
            return []
        self._next_s = max(self._next_s + PERIOD_S, now_s)
        if now_s < self._held_until_s:
            return [Command(self._held, now_s)]
        return [Command(NEUTRAL, now_s)] if now_s >= self._quiet_from_s else []

    def arm(self, now_s: float) -> list[Command]:
        """Return the neutral command of a person's request; empty if no program publishes."""
        return [Command(NEUTRAL, now_s)] if self.present else []
