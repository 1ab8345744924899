"""The cells of a measurement: which faults, from which speeds, and the free area that each needs."""

from collections.abc import Collection, Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple

from commission.plan import Base, Drive
from commission.stopping import LEAST_SPEED_M_S
from deploy.stack.errors import DeployError
from passport.record import WITHOUT, speed_in_words
from supervisor.config import SupervisorSection
from supervisor.measured import MeasuredSection
from teleop.pilots.pilot import NEUTRAL, Velocity


class Fault(StrEnum):
    """What stops the robot; the value is its name on the command line."""

    ZERO = "zero"
    TURN = "turn"
    OPERATOR_KILLED = "operator-killed"
    OPERATOR_STOPPED = "operator-stopped"
    LINK_CUT = "link-cut"
    LINK_CUT_UP = "link-cut-up"
    LINK_CUT_DOWN = "link-cut-down"
    LIDAR_SILENT = "lidar-silent"
    ODOMETRY_SILENT = "odometry-silent"
    ESTOP = "estop"
    SUPERVISOR_KILLED = "supervisor-killed"
    SUPERVISOR_STOPPED = "supervisor-stopped"
    ROS2_KILLED = "ros2-killed"

    @property
    def words(self) -> str:
        return WORDS[self]

    @property
    def takes_recorder(self) -> bool:
        """Whether nothing can be recorded during the fault, because the recorder receives everything through the affected process."""
        return self in {Fault.SUPERVISOR_KILLED, Fault.SUPERVISOR_STOPPED, Fault.ROS2_KILLED}


WORDS = {
    Fault.ZERO: "plain zero",
    Fault.TURN: "plain zero in a turn",
    Fault.OPERATOR_KILLED: "operator's program killed",
    Fault.OPERATOR_STOPPED: "operator's program stopped",
    Fault.LINK_CUT: "operator's link cut",
    Fault.LINK_CUT_UP: "operator's link cut toward the robot",
    Fault.LINK_CUT_DOWN: "operator's link cut from the robot",
    Fault.LIDAR_SILENT: "lidar silent",
    Fault.ODOMETRY_SILENT: "odometry silent",
    Fault.ESTOP: "e-stop",
    Fault.SUPERVISOR_KILLED: "supervisor killed",
    Fault.SUPERVISOR_STOPPED: "supervisor stopped",
    Fault.ROS2_KILLED: "process ros2 killed",
}
SHARES = (0.33, 0.66, 1.0)
"""Of the top speed, for the plain zero; a fault is injected at the top speed only."""
LOADS_PERCENT = (0, 100)
NOT_TESTED = (WITHOUT,)
OF_LIFELINE = {Fault.ESTOP, *(one for one in Fault if one.takes_recorder)}
"""These need Lifeline: they are not measured without it."""


def faults_named(names: Iterable[str]) -> list[Fault]:
    """Return the faults with these names.

    Raises:
        DeployError: there is no such fault.
    """
    try:
        return [Fault(name) for name in names]
    except ValueError as error:
        raise DeployError(f"{error}; there are: {', '.join(Fault)}") from error


class Plan(NamedTuple):
    """One cell to measure, with one load."""

    fault: Fault
    speed: float
    """Speed at the fault [m/s]; for a turn, rate [rad/s]."""
    with_lifeline: bool = True

    @property
    def is_turn(self) -> bool:
        return self.fault is Fault.TURN

    @property
    def velocity(self) -> Velocity:
        return Velocity(0.0, self.speed) if self.is_turn else Velocity(self.speed, 0.0)

    @property
    def after(self) -> Velocity:
        """What the operator's program requests after the fault: zero if the fault is a plain zero, otherwise the same as before."""
        return NEUTRAL if self.fault in {Fault.ZERO, Fault.TURN} else self.velocity

    def __str__(self) -> str:
        without = "" if self.with_lifeline else f" {WITHOUT}"
        return f"{self.fault.words}{without} at {speed_in_words(self.speed, turn=self.is_turn)}"


def plans(
    top: Velocity, wanted: Collection[Fault] = (), *, has_ros2: bool = False, with_lifeline: bool = True
) -> Iterator[Plan]:
    """Yield the cells, the slowest first; those that take the recorder last.

    Args:
        top: the top speed, and the top rate of a turn.
        wanted: only these faults; empty: all that apply to the robot.
        has_ros2: whether it is a ROS 2 robot.
        with_lifeline: whether Lifeline is between the operator and the base.
    """
    for fault in Fault if with_lifeline else (one for one in Fault if one not in OF_LIFELINE):
        if fault in wanted or (not wanted and (has_ros2 or fault is not Fault.ROS2_KILLED)):
            for share in SHARES if fault is Fault.ZERO else SHARES[-1:]:
                most = top.angular_rad_s if fault is Fault.TURN else top.linear_m_s
                yield Plan(fault, round(share * most, 3), with_lifeline)


class Bases(NamedTuple):
    """Assumptions about the base, for straight drives and for turns."""

    straight: Base
    turning: Base
    """On the spot; each m means rad."""
    unheard: Base
    """Straight, while the operator's program does not hear the supervisor: only the end of its link stops the robot."""
    unheard_alone: Base
    """The same without Lifeline: the timeout of the base begins only when the link ends."""

    def of(self, plan: Plan) -> Base:
        if plan.fault is Fault.LINK_CUT_DOWN:
            return self.unheard if plan.with_lifeline else self.unheard_alone
        return self.turning if plan.is_turn else self.straight


def trusted_bases(config: SupervisorSection, measured: MeasuredSection | None, lease_s: float) -> Bases:
    """Return what is assumed of the base: the configured numbers, or the limits that were measured if they are worse.

    The reaction time includes the longest time until any fault is detected. In a turn, the outermost point of the hull is assumed to decelerate
    as much as the hull does when it drives straight.

    Args:
        config: of the supervisor.
        measured: what was measured; None: nothing.
        lease_s: after this silence, the operator's program ends its link.
    """
    measured = measured or MeasuredSection()
    deceleration_m_s2, dead_s = measured.worse_braking(config.deceleration_m_s2, config.base_dead_time_s)
    timeout_s = config.base_timeout_s
    if measured.base_timeout_s is not None:
        timeout_s = max(timeout_s, measured.base_timeout_s.limit)
    detected_s = max(
        timeout_s,
        config.command_timeout_s,
        config.odom_timeout_s,
        *(config.scan_timeout_of(lidar) for lidar in config.all_lidars()),
    )
    later_s = dead_s + config.transport_s
    reaction_s = detected_s + later_s
    deceleration_rad_s2 = deceleration_m_s2 / config.footprint.hull().radius_m
    return Bases(
        Base(config.base_acceleration_m_s2, deceleration_m_s2, reaction_s),
        Base(config.base_angular_acceleration_rad_s2, deceleration_rad_s2, reaction_s),
        Base(config.base_acceleration_m_s2, deceleration_m_s2, max(detected_s, lease_s) + later_s),
        Base(config.base_acceleration_m_s2, deceleration_m_s2, lease_s + timeout_s + later_s),
    )


def drive_of(plan: Plan, base: Base) -> Drive:
    """Return the motion until the fault."""
    if plan.is_turn:
        return Drive(turn_rad=base.run_up_m(plan.speed, TURN_STEADY_S), speed=plan.speed)
    return Drive(base.run_up_m(plan.speed), speed=plan.speed)


def needs_m(plan: Plan, base: Base) -> float:
    """Return the free distance ahead of the hull that a run needs: run-up, longest stop and margin.

    While a fault takes the recorder, nothing can be done about a base that drives on: this distance is needed too. So it is without Lifeline, where the e-stop
    ends such a run; if the lidar is silent, only once the robot counts as one that does not stop.
    """
    on_s = standing_s(plan, base) if plan.fault.takes_recorder or not plan.with_lifeline else 0.0
    if plan.fault is Fault.LIDAR_SILENT and not plan.with_lifeline:
        on_s += STOP_LIMIT_S
    on_m = 0.0 if plan.is_turn else plan.speed * on_s
    return drive_of(plan, base).needs_m(base) + on_m


def problem(plan: Plan, base: Base, ahead_m: float) -> str | None:
    """Return why a cell cannot be measured with the free distance ahead of the hull; None if it can."""
    if plan.speed < LEAST_SPEED_M_S:
        return f"stops are measured from {speed_in_words(LEAST_SPEED_M_S, turn=plan.is_turn)} on"
    if (turn_rad := drive_of(plan, base).turn_rad) > MOST_RAD:
        return f"it needs a turn of {turn_rad:.1f} rad, and more than {MOST_RAD:g} rad are not followed"
    needed_m = needs_m(plan, base)
    if needed_m > ahead_m:
        return f"it needs {needed_m:.2f} m ahead of the hull, and the wall is {ahead_m:.2f} m away"
    return None


def standing_s(plan: Plan, base: Base) -> float:
    """Return the time from the fault after which the base stands [s], also if its numbers are a little worse."""
    return base.reaction_s + plan.speed / base.deceleration_m_s2 + LATER_S


def standing_m(plan: Plan, base: Base) -> float:
    """Return the longest distance from the fault of a base that stands after `standing_s` [m]: it brakes at the latest time that permits this."""
    return plan.speed * LATER_S + base.stop_m(plan.speed)


LATER_S = 0.3
STOP_LIMIT_S = 3.0
"""A robot that still moves this long after it should stand does not stop."""
TURN_STEADY_S = 0.6
"""Time for which the robot turns at the full rate before the fault; in a longer time, it could turn by more than half a circle."""
MOST_RAD = 3.0
SIDE_M = 0.5
"""How far the robot may stand from the place that was confirmed, to the side and back."""
