"""A ROS 2 program whose messages pass a `Source` to the real law, over time."""

import itertools
import math
from dataclasses import dataclass, field, replace

from ros2 import commands as adapter
from ros2.commands import Source
from ros2.header_age import HeaderAge
from ros2.samples import Sample, Writers
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, Liveliness
from supervisor.law.reckoning import Velocity
from tests.unit.supervisor.law.law_harness import NEUTRAL, TICK_S, Law
from wire import cdr
from wire.freshness import Sent
from wire.stamp import Stamp

TIMEOUT_S = 0.2
WALL_S = 1_700_000_000.0
"""The programs stamp by the wall clock."""
BRIDGE = b"bridge"
PROGRAM = b"program"


def new_source(
    *,
    hold_s: float | None = None,
    on_request: bool = False,
    headers: HeaderAge | None = None,
    timeout_s: float = TIMEOUT_S,
) -> Source:
    count = itertools.count()
    return Source(
        Writers(lambda: next(count).to_bytes(16, "little")),
        headers=headers,
        hold_s=hold_s,
        on_request=on_request,
        timeout_s=timeout_s,
    )


def velocity_of(twist: bytes) -> Velocity | None:
    planar = cdr.planar_of(twist)
    return None if planar is None else Velocity(*planar)


@dataclass
class Program:
    """One run of a program: a DDS writer."""

    sequence: int = 0
    clock_s: float = WALL_S

    def sample(self, payload: bytes, arrival_s: float, late_s: float = 0.0) -> Sample:
        """Return a message that was `late_s` on its way."""
        self.sequence += 1
        return Sample(payload, arrival_s, round((arrival_s - late_s + self.clock_s) * 1e9), self.sequence)


@dataclass
class Robot:
    """A program, the ROS 2 process's source, and the law at 50 Hz."""

    source: Source
    law: Law = field(default_factory=Law)
    program: Program = field(default_factory=Program)
    sequence: int = 0
    pending: list[Command] = field(default_factory=list[Command])
    is_here: bool = True
    """Whether the program is known to run on this host."""
    neutrals: int = 0
    """Number of zero velocities that reached the supervisor."""

    def __post_init__(self) -> None:
        self.source.attend(PROGRAM + bytes([0]), self.now_s, is_here=self.is_here)
        self._runs = 0
        self._liveliness: list[Liveliness] = [Liveliness("teleop", alive=True)]

    @property
    def now_s(self) -> float:
        return self.law.now_s

    @property
    def decision(self) -> Decision:
        return self.law.decision

    @property
    def moves(self) -> bool:
        return self.decision.output != NEUTRAL

    @property
    def reasons(self) -> list[str]:
        return [reason.value for reason in self.decision.reasons]

    def pass_on(self, commands: list[adapter.Command]) -> list[adapter.Command]:
        """Put commands on the wire, with the stamps that the ROS 2 process gives them."""
        for command in commands:
            self.sequence += 1
            sent = command.sent or Sent(BRIDGE, self.sequence, command.true_at_s)
            stamp = Stamp(sent.sequence, round(sent.source_time_s * 1e9), sent.epoch.ljust(16, b"\0"))
            velocity = velocity_of(command.twist)
            self.neutrals += velocity == NEUTRAL
            self.pending.append(Command("teleop", velocity, self.now_s, stamp.sent()))
        return commands

    def say(self, linear_m_s: float, late_s: float = 0.0) -> list[adapter.Command]:
        return self.say_bytes(cdr.twist(cdr.Planar(linear_m_s, 0.0)), late_s)

    def say_bytes(self, payload: bytes, late_s: float = 0.0) -> list[adapter.Command]:
        return self.pass_on(self.source.heard(self.program.sample(payload, self.now_s, late_s)))

    def arm(self) -> list[adapter.Command]:
        return self.pass_on(self.source.arm(self.now_s))

    def begin(self, program: Program | None = None) -> None:
        """Serve a program from now on, as when its token appears."""
        self._runs += program is not self.program
        self.program = program or Program()
        self.source.attend(PROGRAM + bytes([self._runs]), self.now_s, is_here=self.is_here)
        self._liveliness.append(Liveliness("teleop", alive=True))

    def end(self) -> None:
        """End the program, as when its process dies."""
        self.source.leave()
        self._liveliness.append(Liveliness("teleop", alive=False))

    def tick(self) -> Decision:
        """Let 20 ms pass, and take one step of the law."""
        self.law.now_s += TICK_S
        if self.now_s >= self.source.due_s():
            self.pass_on(self.source.repeat(self.now_s))
        arrived = tuple(replace(c, arrival_s=self.now_s) for c in self.pending)
        inputs = Inputs(commands=arrived, liveliness=tuple(self._liveliness))
        self.pending.clear()
        self._liveliness.clear()
        return self.law.step(inputs)

    def wait(self, seconds: float) -> Decision:
        for _ in range(round(seconds / TICK_S)):
            self.tick()
        return self.decision

    def stream(
        self, linear_m_s: float, seconds: float, every_ticks: int = 2, late_s: float = 0.0
    ) -> Decision:
        """Publish at a steady rate, by default 25 Hz."""
        for tick in range(round(seconds / TICK_S)):
            if tick % every_ticks == 0:
                self.say(linear_m_s, late_s)
            self.tick()
        return self.decision

    def moved_within(self, seconds: float) -> float:
        """Let time pass; return when the robot last moved, from now; -inf if it never did."""
        began_s, last_s = self.now_s, -math.inf
        for _ in range(round(seconds / TICK_S)):
            self.tick()
            if self.moves:
                last_s = self.now_s - began_s
        return last_s
