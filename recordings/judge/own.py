"""Converts what a supervised robot recorded, in its black box or on the wire, to events for the monitors and moments. Pure."""

from collections.abc import Iterator

from recordings.judge.findings import BARRIER, Moment
from recordings.judge.monitors import Event, Pressed, Released, Request, Step
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from wire.message_types import SafetyStatus
from wire.reasons import StopReason
from wire.ros import Twist

ESTOPS = frozenset({StopReason.ESTOP.value, StopReason.ESTOP_STATION_LOST.value})


def events_of_step(now_s: float, inputs: Inputs, decision: Decision) -> Iterator[Event]:
    """Yield the events of a step of the law, in order.

    Args:
        now_s: the time of the step.
        inputs: what was received since the last step.
        decision: the decision of the step.
    """
    for command in inputs.commands:
        if command.velocity is not None:
            is_neutral = command.velocity == STANDSTILL
            yield Request(command.arrival_s, command.source, is_neutral)
    if inputs.estop or any(presence.stop for presence in inputs.presences):
        yield Pressed(now_s)
    moves = decision.output != STANDSTILL
    causes, reasons = frozenset(map(str, decision.causes)), frozenset(map(str, decision.reasons))
    yield Step(now_s, moves, causes, reasons, decision.owner)
    if decision.reset_reply is not None and decision.reset_reply.success:
        yield Released(now_s)


def events_of_status(time_s: float, status: SafetyStatus, *, was_estopped: bool) -> Iterator[Event]:
    """Yield the events of a status: one step, and a reset if it ends an e-stop: a reset itself is not recorded.

    Args:
        time_s: when it was recorded.
        status: the status.
        was_estopped: whether the status before it named an e-stop; one that never named it has ignored it.
    """
    causes, reasons = frozenset(status.causes_and_latched()[0]), frozenset(status.reasons)
    yield Step(time_s, velocity_of(status.permitted) != STANDSTILL, causes, reasons, status.owner)
    if was_estopped and not is_estopped(status):
        yield Released(time_s)


def is_estopped(status: SafetyStatus) -> bool:
    return not ESTOPS.isdisjoint(status.causes_and_latched()[0])


def velocity_of(twist: Twist) -> Velocity:
    return Velocity(twist.linear.x, twist.angular.z)


def moment_of_status(time_s: float, status: SafetyStatus) -> Moment:
    return Moment(
        time_s,
        velocity_of(status.commanded),
        tuple(status.reasons),
        tuple(status.causes) or (BARRIER,),
        status.scale,
        status.nearest_m,
        status.nearest_bearing_rad,
        status.detail,
    )
