"""The cells of a measurement: which faults, from which speeds, and the free area that each needs."""

from collections.abc import Collection, Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple

from commission.plan import MARGIN_M, Base
from commission.stopping import LEAST_SPEED_M_S
from deploy.stack.errors import DeployError
from supervisor.config import SupervisorSection
from supervisor.measured import MeasuredSection


class Fault(StrEnum):
    """What stops the robot; the value is its name on the command line."""

    ZERO = "zero"
    OPERATOR_KILLED = "operator-killed"
    OPERATOR_STOPPED = "operator-stopped"
    LINK_CUT = "link-cut"
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
        """Whether nothing of the robot can be recorded while it lasts, because the recorder hears it through what is struck."""
        return self in {Fault.SUPERVISOR_KILLED, Fault.SUPERVISOR_STOPPED, Fault.ROS2_KILLED}


WORDS = {
    Fault.ZERO: "plain zero",
    Fault.OPERATOR_KILLED: "operator's program killed",
    Fault.OPERATOR_STOPPED: "operator's program stopped",
    Fault.LINK_CUT: "operator's link cut",
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
NOT_TESTED = (
    "a turn on the spot",
    "the operator's link cut in one direction only",
    "without Lifeline",
)


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
    speed_m_s: float


def plans(top_m_s: float, wanted: Collection[Fault] = (), *, has_ros2: bool = False) -> Iterator[Plan]:
    """Yield the cells, the slowest first; those that take the recorder last.

    Args:
        top_m_s: the top speed.
        wanted: only these faults; empty: all that the robot can have.
        has_ros2: whether it is a ROS 2 robot.
    """
    for fault in Fault:
        if fault in wanted or (not wanted and (has_ros2 or fault is not Fault.ROS2_KILLED)):
            for share in SHARES if fault is Fault.ZERO else SHARES[-1:]:
                yield Plan(fault, round(share * top_m_s, 3))


def trusted_base(config: SupervisorSection, measured: MeasuredSection | None) -> Base:
    """Return what is assumed of the base: the configured numbers, or the limits that were measured if they are worse.

    Its reaction contains the longest time until any fault is detected.
    """
    deceleration_m_s2, dead_s = config.deceleration_m_s2, config.base_dead_time_s
    timeout_s = config.base_timeout_s
    if measured is not None:
        if measured.deceleration_m_s2 is not None:
            deceleration_m_s2 = min(deceleration_m_s2, measured.deceleration_m_s2.limit)
        if measured.dead_time_s is not None:
            dead_s = max(dead_s, measured.dead_time_s.limit)
        if measured.base_timeout_s is not None:
            timeout_s = max(timeout_s, measured.base_timeout_s.limit)
    detected_s = max(
        timeout_s,
        config.command_timeout_s,
        config.odom_timeout_s,
        *(config.scan_timeout_of(lidar) for lidar in config.all_lidars()),
    )
    return Base(
        config.base_acceleration_m_s2,
        max(LEAST_DECELERATION_M_S2, deceleration_m_s2),
        detected_s + dead_s + config.transport_s,
    )


LEAST_DECELERATION_M_S2 = 0.05
"""The least that can be configured; a measured limit may be lower, even negative."""


def needs_m(plan: Plan, base: Base) -> float:
    """Return the free distance ahead of the hull that a run needs: run-up, longest stop and margin.

    While a fault takes the recorder, nothing can be done about a base that drives on: this distance is needed too.
    """
    unseen_s = standing_s(plan, base) if plan.fault.takes_recorder else 0.0
    speed_m_s = plan.speed_m_s
    return base.run_up_m(speed_m_s) + speed_m_s * unseen_s + base.stop_m(speed_m_s) + MARGIN_M


def problem(plan: Plan, base: Base, ahead_m: float) -> str | None:
    """Return why a cell cannot be measured with the free distance ahead of the hull; None if it can."""
    if plan.speed_m_s < LEAST_SPEED_M_S:
        return f"stops are measured from {LEAST_SPEED_M_S:g} m/s on"
    needed_m = needs_m(plan, base)
    if needed_m > ahead_m:
        return f"it needs {needed_m:.2f} m ahead of the hull, and the wall is {ahead_m:.2f} m away"
    return None


def standing_s(plan: Plan, base: Base) -> float:
    """Return the time from the fault after which the base stands [s], also if its numbers are a little worse."""
    return base.reaction_s + plan.speed_m_s / base.deceleration_m_s2 + LATER_S


LATER_S = 0.3
SIDE_M = 0.5
"""How far the robot may stand from the place that was confirmed, to the side and back."""
