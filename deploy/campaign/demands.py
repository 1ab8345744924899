"""What the faults that were done ask for, by the bounds of their classes. Pure."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from deploy.campaign.classes import (
    BASE_TIMEOUT_S,
    BLIND_BOUND_S,
    BY_NAME,
    COMMAND_TIMEOUT_S,
    KILL_BOUND_S,
    SCAN_TIMEOUT_S,
    SILENT_BOUND_S,
    TICK_S,
    Effect,
)
from deploy.campaign.promises import Demand, Kind

LEEWAY_S = 0.005
"""Hops, and a physics step."""
SLOW_S = 1.0
"""What two faults at once may add: delays, and a backlog that is sent again."""

TOLERANCE_M = 0.01
HELD_M = 0.03
"""What 0.15 s more at the speed that the barrier permits come to, less what the base brakes better than trusted."""
BARRIER_M_S = 0.5
"""As fast as the barrier lets it drive where 0.25 s count."""


class _Window(NamedTuple):
    """What must hold from a bound after a fault on."""

    kind: Kind
    promise: int
    bound_s: float


FOLLOWS = {
    Effect.BLIND: _Window(Kind.ZERO, 5, BLIND_BOUND_S),
    Effect.TELEOP_ENDS: _Window(Kind.ZERO, 2, KILL_BOUND_S),
    Effect.TELEOP_SILENT: _Window(Kind.ZERO, 3, SILENT_BOUND_S),
    Effect.SUPERVISOR_ENDS: _Window(Kind.BRAKE, 4, KILL_BOUND_S),
    Effect.SUPERVISOR_SILENT: _Window(Kind.BRAKE, 4, BASE_TIMEOUT_S + TICK_S),
}
"""What each effect demands, unless another fault prevents it."""


@dataclass(frozen=True, slots=True)
class Done:
    """A fault that was done."""

    name: str
    at_s: float
    until_s: float
    """When it ended: woken, healed, started again."""
    parameters: Mapping[str, float | str] = field(default_factory=dict[str, float | str])

    @property
    def effect(self) -> Effect:
        return BY_NAME[self.name].effect

    def touches(self, other: "Done") -> bool:
        """Whether the two, or what follows from them, may be in force at once."""
        return self.at_s < other.until_s + SLOW_S and other.at_s < self.until_s + SLOW_S


def demands(done: Sequence[Done], *, alone: bool) -> list[Demand]:
    """What must follow.

    Args:
        done: everything that was done in a run.
        alone: there is one command source only.
    """
    found: list[Demand] = []
    for one in done:
        others = [other for other in done if other is not one and one.touches(other)]
        kind = BY_NAME[one.name].demands
        found += [_by_itself(one, kind)] if kind is not None else _of(one, others, alone=alone)
    return [demand for demand in found if demand.from_s < demand.until_s]


def may_be_locked_out(names: Collection[str]) -> bool:
    """Whether a source may belong to another one by now after these faults (docs/decisions/0020).

    Who speaks as teleop while something else silences it, or with a copy of its epoch, may end that epoch. Teleop
    notices, and begins another; a source without manners has to be started anew.
    """
    return len(names) > 1 and any(Effect.TAKES_OVER in BY_NAME[name].effect for name in names)


def _of(one: Done, others: Sequence[Done], *, alone: bool) -> Iterable[Demand]:
    beside = Effect.NONE
    for other in others:
        beside |= other.effect
    slow_s = LEEWAY_S + (SLOW_S if others else 0.0)
    # Whatever ends meanwhile may mend this one too: start the same process, heal the same link.
    until_s = min((other.until_s for other in others if other.until_s > one.at_s), default=one.until_s)
    until_s = min(until_s, one.until_s)
    if Effect.SENSOR in one.effect:
        next_s = (other.at_s for other in others if Effect.SENSOR in other.effect and other.at_s >= one.at_s)
        until_s = min([until_s, *next_s])
    for effect in one.effect & _shown(beside, alone=alone):
        kind, promise, bound_s = FOLLOWS[effect]
        yield Demand(kind, promise, one.name, one.at_s + bound_s + slow_s, until_s)


def _shown(beside: Effect, *, alone: bool) -> Effect:
    """The effects whose consequences show, beside what else is done."""
    shown = Effect.NONE
    if Effect.STANDSTILL not in beside:
        shown |= Effect.BLIND | Effect.SUPERVISOR_ENDS | Effect.SUPERVISOR_SILENT
    if alone and Effect.SPEAKS_AS_TELEOP not in beside:
        shown |= Effect.TELEOP_ENDS | Effect.TELEOP_SILENT
    return shown


def _by_itself(one: Done, kind: Kind) -> Demand:
    """What a class with trials of its own asks for: a state from its bound on, or an event by then."""
    known = BY_NAME[one.name]
    from_s, until_s = one.at_s, one.until_s
    bound_s = at_s + LEEWAY_S if (at_s := known.bound_s) is not None else 0.0
    if kind is Kind.ZERO:
        from_s += bound_s
    elif kind is not Kind.UNHINDERED:
        until_s = from_s + bound_s
    return Demand(kind, known.promise, one.name, from_s, until_s, known.detectors)


def tolerance_m(done: Sequence[Done]) -> float:
    """How much nearer than the stop distance the robot may bring itself.

    The law reckons with its own reaction, not with one that comes late: of a supervisor that hangs, the base
    holds the last command for its timeout; and over a delayed link, each command acts that much later.
    """
    late_m = HELD_M if any(Effect.BASE_HOLDS in one.effect for one in done) else 0.0
    delays_s = [float(one.parameters.get("delay_s", 0.0)) for one in done if one.name == "net_delayed_base"]
    # A longer delay shows in the scans, which come the same way, as an age that stops the robot.
    return TOLERANCE_M + max(late_m, BARRIER_M_S * min(max(delays_s, default=0.0), SCAN_TIMEOUT_S))


def asked_age_s(done: Sequence[Done]) -> float:
    """How old, by the true time, the wish behind a motion may be.

    A delay that a source had from its first word on is no delay that anybody could see.
    """
    delays_s = [
        float(one.parameters.get("delay_s", 0.0)) for one in done if one.name.startswith("net_delayed")
    ]
    return COMMAND_TIMEOUT_S + TICK_S + LEEWAY_S + 2.0 * max(delays_s, default=0.0)
