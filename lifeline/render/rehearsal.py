"""Runs robot, law and operator in one process and in simulated time; every run is identical.

It uses the plant of `python -m sim` and the law of `python -m supervisor`, without a bus or a clock.
Messages arrive without delay.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from sim.overlay import Mode, Shown
from sim.pace import Every
from sim.plant import Plant
from supervisor.config import SupervisorSection
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, Liveliness, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from wire.reasons import StopReason

SOURCE = "teleop"
STANDSTILL = Velocity(0.0, 0.0)

FORWARD_M_S, BACK_M_S = 0.8, -0.4
WARM_UP_S = 0.3
"""Longer than a command timeout: until then, the operator's commands are unproven."""
READY_S = 0.5
"""How long the operator waits before driving."""
REST_S = 1.3
"""How long the operator keeps the forward command after an obstacle has stopped the robot."""
BACK_S = 1.6


class _Act(NamedTuple):
    """What the operator commands until a time has passed, or until an obstacle has stopped the robot."""

    velocity: Velocity
    longest_s: float
    ends_at_obstacle: bool = False


ACTS = (
    _Act(STANDSTILL, READY_S),
    _Act(Velocity(FORWARD_M_S, 0.0), math.inf, ends_at_obstacle=True),
    # At rest the key is still held, so that the picture shows why the robot is stopped.
    _Act(Velocity(FORWARD_M_S, 0.0), REST_S),
    _Act(Velocity(BACK_M_S, 0.0), BACK_S, ends_at_obstacle=True),
    _Act(STANDSTILL, math.inf),
)


class Operator:
    """Drives ahead until an obstacle stops the robot, waits, backs out, and then commands zero velocity.

    Args:
        drives: If false, the operator always commands zero velocity.
    """

    def __init__(self, *, drives: bool = True) -> None:
        self._act = 0 if drives else len(ACTS) - 1
        self._since_s = 0.0

    def wants(self, now_s: float, decision: Decision | None) -> Velocity:
        """Return the velocity commanded now, given the law's last decision."""
        act = ACTS[self._act]
        at_obstacle = decision is not None and StopReason.OBSTACLE in decision.reasons
        if now_s - self._since_s >= act.longest_s or (act.ends_at_obstacle and at_obstacle):
            self._act, self._since_s = self._act + 1, now_s
        return ACTS[self._act].velocity


class Rehearsal:
    """One robot under the law, driven by an operator.

    Args:
        plant: The robot in its world.
        operator: The source of its commands.
        config: `[supervisor]`; its footprint must be the plant's.
    """

    def __init__(self, plant: Plant, operator: Operator, config: SupervisorSection) -> None:
        self._plant, self._operator = plant, operator
        self._state = initial_state(config.law())
        self._decision: Decision | None = None
        self._steps = 0
        dt_s = plant.timestep_s
        self._ticks = Every(config.tick_hz, dt_s)
        self._scans, self._commands = Every(20.0, dt_s), Every(20.0, dt_s)
        self._ranges = plant.scan()
        self._came = Liveliness(SOURCE, alive=True)
        while self._decision is None or self.time_s < 0.0:
            self._step()

    @property
    def time_s(self) -> float:
        """Simulated time since the end of the warm-up."""
        return self._steps * self._plant.timestep_s - WARM_UP_S

    def play(self, times_s: Iterable[float]) -> Iterator[Shown]:
        """Advance to each time and yield the state to show."""
        for time_s in times_s:
            while self.time_s < time_s - 1e-9:
                self._step()
            yield self._shown()

    def _shown(self) -> Shown:
        decision, speed_m_s = self._decision, self._plant.true_velocity.linear_m_s
        assert decision is not None  # set during the warm-up
        reasons = tuple(reason.value for reason in decision.reasons)
        over = tuple(reason.value for reason in decision.latched)
        return Shown(Mode.of(decision.mode), reasons, speed_m_s, decision.nearest_m, (self._ranges,), over)

    def _step(self) -> None:
        plant, now_s = self._plant, self.time_s
        output = STANDSTILL if self._decision is None else self._decision.output
        plant.step((output.linear_m_s, output.angular_rad_s))
        self._steps += 1
        commands: tuple[Command, ...] = ()
        if self._commands.due(self._steps, 1.0):
            commands = (Command(SOURCE, self._operator.wants(now_s, self._decision), now_s),)
        scan = self._look(now_s) if self._scans.due(self._steps, 1.0) else None
        if commands or scan is not None or self._ticks.due(self._steps, 1.0):
            inputs = Inputs(
                commands=commands,
                liveliness=() if self._decision is not None else (self._came,),
                scans=() if scan is None else (scan,),
                odometry=Odometry(Velocity(*plant.wheel_twist), now_s),
            )
            self._state, self._decision = step(self._state, now_s, inputs)

    def _look(self, now_s: float) -> LaserScan:
        self._ranges, lidar = self._plant.scan(), self._plant.lidars[0]
        return LaserScan(
            self._ranges,
            lidar.angle_min_rad,
            lidar.angle_increment_rad,
            lidar.range_min_m,
            lidar.range_max_m,
            now_s,
        )
