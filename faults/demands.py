"""Derive from the injected faults what must happen, with the limits of their classes. Pure."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from faults.classes import (
    BASE_TIMEOUT_S,
    BLIND_BOUND_S,
    BY_NAME,
    COMMAND_TIMEOUT_S,
    SCAN_TIMEOUT_S,
    SILENT_BOUND_S,
    TICK_S,
    Effect,
)
from faults.promises import KILL_MEDIAN_S, Demand, Kind
from wire import topics

LEEWAY_S = 0.005
"""For network hops and one physics step."""
SLOW_S = 1.0
"""Additional time for two simultaneous faults: delays, and a backlog that is sent again."""

TOLERANCE_M = 0.01
HELD_M = 0.03
"""Additional distance while the base holds its last command for 0.15 s, less the distance that the base saves by braking
harder than the trusted deceleration."""
BARRIER_M_S = 0.5
"""Highest speed that the barrier permits near an object, where 0.25 s of delay decides."""


class _Window(NamedTuple):
    """The demand of an effect: its kind holds from the time limit after the fault until the fault ends."""

    kind: Kind
    promise: int
    bound_s: float
    """Time limit, from the fault [s]."""


FOLLOWS = {
    Effect.BLIND: _Window(Kind.ZERO, 5, BLIND_BOUND_S),
    Effect.TELEOP_ENDS: _Window(Kind.ZERO, 2, KILL_MEDIAN_S),
    Effect.TELEOP_SILENT: _Window(Kind.ZERO, 3, SILENT_BOUND_S),
    Effect.SUPERVISOR_ENDS: _Window(Kind.BRAKE, 4, KILL_MEDIAN_S),
    Effect.SUPERVISOR_SILENT: _Window(Kind.BRAKE, 4, BASE_TIMEOUT_S + TICK_S),
}
"""The demand of each effect, unless another fault masks it."""


@dataclass(frozen=True, slots=True)
class Done:
    """An injected fault."""

    name: str
    at_s: float
    until_s: float
    """Time at which it ended: the process continued or was restarted, or the link was healed."""
    parameters: Mapping[str, float | str] = field(default_factory=dict[str, float | str])

    @property
    def effect(self) -> Effect:
        return BY_NAME[self.name].effect

    def touches(self, other: "Done") -> bool:
        """Return whether the two faults, or their consequences, may overlap in time."""
        return self.at_s < other.until_s + SLOW_S and other.at_s < self.until_s + SLOW_S


def demands(done: Sequence[Done], *, alone: bool) -> list[Demand]:
    """Return the demands of a run's faults.

    Args:
        done: all faults that were injected in the run.
        alone: whether there is only one command source.
    """
    found: list[Demand] = []
    for one in done:
        others = [other for other in done if other is not one and one.touches(other)]
        kind = BY_NAME[one.name].demands
        found += [_by_itself(one, kind)] if kind is not None else _of(one, others, alone=alone)
    return [demand for demand in found if demand.from_s < demand.until_s]


def may_be_locked_out(names: Collection[str]) -> bool:
    """Return whether another program may hold a source's name after these faults (docs/decisions/0020).

    A program that sends as teleop while another fault silences teleop, or with a copy of its epoch, may end that
    epoch. Teleop notices this and begins a new epoch; other sources must be restarted.
    """
    return len(names) > 1 and any(Effect.TAKES_OVER in BY_NAME[name].effect for name in names)


def _of(one: Done, others: Sequence[Done], *, alone: bool) -> Iterable[Demand]:
    beside = Effect.NONE
    for other in others:
        beside |= other.effect
    slow_s = LEEWAY_S + (SLOW_S if others else 0.0)
    # The end of another fault may end this one too, for example by restarting the same process.
    until_s = min((other.until_s for other in others if other.until_s > one.at_s), default=one.until_s)
    until_s = min(until_s, one.until_s)
    if Effect.SENSOR in one.effect:
        next_s = (other.at_s for other in others if Effect.SENSOR in other.effect and other.at_s >= one.at_s)
        until_s = min([until_s, *next_s])
    for effect in one.effect & _shown(beside, alone=alone):
        kind, promise, bound_s = FOLLOWS[effect]
        yield Demand(kind, promise, one.name, one.at_s + bound_s + slow_s, until_s)


def _shown(beside: Effect, *, alone: bool) -> Effect:
    """Return the effects that the simultaneous faults do not mask."""
    shown = Effect.NONE
    if Effect.STANDSTILL not in beside:
        shown |= Effect.BLIND | Effect.SUPERVISOR_ENDS | Effect.SUPERVISOR_SILENT
    if alone and Effect.SPEAKS_AS_TELEOP not in beside:
        shown |= Effect.TELEOP_ENDS | Effect.TELEOP_SILENT
    return shown


def _by_itself(one: Done, kind: Kind) -> Demand:
    """Return the demand of a class with its own trials: a state after the limit, or an event before it."""
    known = BY_NAME[one.name]
    from_s, until_s = one.at_s, one.until_s
    bound_s = at_s + LEEWAY_S if (at_s := known.bound_s) is not None else 0.0
    if kind is Kind.ZERO:
        from_s += bound_s
    elif kind is not Kind.UNHINDERED:
        until_s = from_s + bound_s
    return Demand(kind, known.promise, one.name, from_s, until_s, known.detectors)


def tolerance_m(done: Sequence[Done]) -> float:
    """Return how much closer than the stop distance the robot may come by its own motion [m].

    The law accounts for its own reaction time, not for faults behind it: while the supervisor hangs, the base holds
    the last command until its timeout; over a delayed link, each command acts later.
    """
    late_m = HELD_M if any(Effect.BASE_HOLDS in one.effect for one in done) else 0.0
    delay_s = _longest_delay_s(one for one in done if BY_NAME[one.name].target == topics.SIM)
    # A longer delay also ages the scans, which use the same link, and stops the robot.
    return TOLERANCE_M + max(late_m, BARRIER_M_S * min(delay_s, SCAN_TIMEOUT_S))


def asked_age_s(done: Sequence[Done]) -> float:
    """Return the maximum age [s], by true time, of the command behind a motion.

    A constant delay that a source had from its first message on cannot be detected.
    """
    return COMMAND_TIMEOUT_S + TICK_S + LEEWAY_S + 2.0 * _longest_delay_s(done)


def _longest_delay_s(done: Iterable[Done]) -> float:
    """Return the longest delay of the delayed links [s]."""
    delayed = (one for one in done if Effect.DELAYED in one.effect)
    return max((float(one.parameters.get("delay_s", 0.0)) for one in delayed), default=0.0)
