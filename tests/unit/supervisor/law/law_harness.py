"""A harness of the law: calls it at 50 Hz with scans and commands, and reads the decision."""

import math
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from supervisor.config import SupervisorSection
from supervisor.law.certificate import certify, foreseen
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from supervisor.law.state import State
from wire.freshness import Sent, Track

TICK_S = 0.02
BEAMS = 360

CONFIG = SupervisorSection().law()
ANY_AGE = replace(CONFIG, blind_budget_m=math.inf)
"""The permitted speed does not fall with the age of a command."""
SCAN_TIMEOUT_S = CONFIG.lidars[0].timeout_s

CONFIRMED_S = 2 * TICK_S
"""Two scans: the second confirms what the first one showed."""

STANDING_S = 0.4
"""From the speed of these tests, the base has come to rest by then."""

UNSEEN_S = SCAN_TIMEOUT_S + 2 * TICK_S
"""After this time without an explained reading, a direction is no longer filled from earlier scans."""


def with_lidar(config: LawConfig, **changes: object) -> LawConfig:
    """The same law with another first lidar."""
    first, *others = config.lidars
    return replace(config, lidars=(replace(first, **changes), *others))  # type: ignore[arg-type]


FORWARD = Velocity(0.5, 0.0)
BACK = Velocity(-0.5, 0.0)
SPIN = Velocity(0.0, 1.0)
NEUTRAL = Velocity(0.0, 0.0)


def ring(distance_m: float = 3.0, *, ahead_m: float | None = None) -> np.ndarray:
    """360 readings at one distance from the lidar; with `ahead_m`, the 21 middle beams at that one."""
    ranges = np.full(BEAMS, distance_m, dtype=np.float32)
    if ahead_m is not None:
        ranges[BEAMS // 2 - 10 : BEAMS // 2 + 11] = ahead_m
    return ranges


def laser_scan(ranges: np.ndarray, arrival_s: float) -> LaserScan:
    return LaserScan(
        ranges=ranges,
        angle_min=-math.pi,
        angle_increment=2 * math.pi / BEAMS,
        range_min=0.05,
        range_max=12.0,
        arrival_s=arrival_s,
    )


def is_foreseen(state: State, decision: Decision, now_s: float, inputs: Inputs) -> bool:
    """Return whether the certificate of a step foresees the next one, and check that this one decides the same.

    Args:
        state: the state after the step.
        decision: the decision of the step.
        now_s: the time of the next step.
        inputs: the inputs of the next step.
    """
    early = foreseen(certify(state, decision), now_s, inputs)
    if early is None:
        return False
    _, decided = step(state, now_s, inputs)
    assert decided.output == early
    assert (decided.reasons, decided.causes, decided.scale) == ((), (), 1.0)
    assert decided.owner == decision.owner
    return True


_sequences = count(1)


def proven_state(config: LawConfig, *, now_s: float = 1000.0) -> State:
    """The initial state, except that the run of each source that `on_time` stamps is proven already."""
    state = initial_state(config)
    sources = (
        source._replace(
            track=Track(
                Sent(source.config.name.encode(), next(_sequences), now_s - 1.0), now_s - 1.0, proven=True
            )
        )
        for source in state.interlock.sources
    )
    return state._replace(interlock=state.interlock._replace(sources=tuple(sources)))


def on_time(source: str, velocity: Velocity | None, arrival_s: float) -> Command:
    """A command that was sent as it arrives, of the run that `proven_state` proves."""
    return Command(source, velocity, arrival_s, Sent(source.encode(), next(_sequences), arrival_s))


@dataclass
class Law:
    """The law over time. Scans arrive at every tick unless `scanning` is off; sources send on request."""

    config: LawConfig = CONFIG
    now_s: float = 1000.0
    scanning: bool = True
    room_m: float = 3.0

    def __post_init__(self) -> None:
        self.state: State = proven_state(self.config, now_s=self.now_s)
        self.ranges = ring(self.room_m)
        self.sequence = 0
        self.noise_m = 0.0
        self.asked = NEUTRAL
        self.decision: Decision = self.step()

    def step(self, inputs: Inputs | None = None) -> Decision:
        """One step at the present time."""
        inputs = inputs or Inputs()
        if self.scanning and not inputs.scans:
            self.noise_m = 1e-4 - self.noise_m  # no real scan repeats itself
            noisy = self.ranges + np.float32(self.noise_m)
            inputs = replace(inputs, scans=(laser_scan(noisy, self.now_s),))
        self.state, self.decision = step(self.state, self.now_s, inputs)
        return self.decision

    def tick(self, *commands: tuple[str, Velocity | None], **inputs: object) -> Decision:
        """The step 20 ms later, with commands that arrive now without delay, and other inputs."""
        self.now_s += TICK_S
        arrived = tuple(on_time(source, velocity, self.now_s) for source, velocity in commands)
        return self.step(Inputs(commands=arrived, **inputs))  # type: ignore[arg-type]

    def tick_unstamped(self, *velocities: Velocity | None) -> Decision:
        """The step 20 ms later, with commands of teleop that arrive now and bear no stamp."""
        self.now_s += TICK_S
        return self.step(Inputs(commands=tuple(Command("teleop", v, self.now_s) for v in velocities)))

    def hold(self, seconds: float, *commands: tuple[str, Velocity | None]) -> Decision:
        """The same commands at every tick for a while."""
        for _ in range(round(seconds / TICK_S)):
            self.tick(*commands)
        return self.decision

    def drive(self, velocity: Velocity = FORWARD, source: str = "teleop") -> Decision:
        """Neutral, then this motion, like an operator who starts to drive."""
        self.tick((source, NEUTRAL))
        return self.tick((source, velocity))

    def stamped(
        self, velocity: Velocity, *, sent_s: float, epoch: bytes = b"A", sequence: int = 0
    ) -> Command:
        self.sequence = sequence or self.sequence + 1
        return Command("teleop", velocity, self.now_s, Sent(epoch, self.sequence, sent_s))


def lost(source: str = "teleop", epoch: bytes = b"") -> tuple[Liveliness, ...]:
    return (Liveliness(source, alive=False, epoch=epoch),)


def back(source: str = "teleop", epoch: bytes = b"") -> tuple[Liveliness, ...]:
    return (Liveliness(source, alive=True, epoch=epoch),)


def odometry(linear_m_s: float, arrival_s: float) -> Odometry:
    return Odometry(Velocity(linear_m_s, 0.0), arrival_s)
