"""What the faults that were done ask for, by the bounds of their classes. Pure."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from deploy.campaign.classes import (
    BASE_TIMEOUT_S,
    BLIND_BOUND_S,
    BY_NAME,
    COMMAND_TIMEOUT_S,
    KILL_BOUND_S,
    SCAN_TIMEOUT_S,
    SILENT_BOUND_S,
    TICK_S,
)
from deploy.campaign.promises import Demand, Kind

LEEWAY_S = 0.005
"""Hops, and a physics step."""
SLOW_S = 1.0
"""What two faults at once may add: delays, and a backlog that is sent again."""

ENDS_TELEOP = frozenset({"teleop_sigkill", "teleop_sigterm", "teleop_end_of_input", "net_flapping"})
SILENCES_TELEOP = frozenset(
    {
        "teleop_sigstop",
        "teleop_blocked",
        "teleop_gil",
        "teleop_exception",
        "teleop_hang_up",
        "net_cut",
        "net_healed",
        "net_unplugged",
        "net_down_only",
    }
)
BLINDS = frozenset(
    {
        "sim_sigkill",
        "sim_sigstop",
        "sim_blocked",
        "sim_scan_nan",
        "sim_scan_silent",
        "net_cut_base",
        "net_healed_base",
        "net_base_mute",
    }
)
ENDS_SUPERVISOR = frozenset({"supervisor_sigkill", "supervisor_restart", "supervisor_and_teleop_sigkill"})
SILENCES_SUPERVISOR = frozenset({"supervisor_sigstop", "supervisor_blocked", "net_base_deaf"})
SPEAKS_FOR_TELEOP = frozenset(
    {
        "wire_second_teleop",
        "wire_attachments",
        "wire_flood",
        "wire_wrong_type",
        "wire_truncated",
        "wire_malformed",
    }
)
"""Commands under teleop's name that are not teleop's may keep it going."""
BY_THEMSELVES: dict[str, Kind] = {
    "sim_scan_stray": Kind.UNHINDERED,
    "sim_scan_frozen_no_odom": Kind.STOPPED,
    "sim_scan_frozen_odom_zero": Kind.STOPPED,
    "wire_second_lidar_steady": Kind.NAMED,
    "wire_second_lidar_flood": Kind.NAMED,
    "estop_teleop_sigkill": Kind.ZERO,
    "estop_supervisor_sigkill": Kind.ZERO,
    "estop_sim_sigkill": Kind.ZERO,
    "machine_suspend": Kind.NAMED,
}
"""What is asked for besides what every run is held to; of the others, that the hull keeps its distance."""
MOVES_THE_ROBOT = frozenset({"sim_sigkill", "sim_sigstop", "sim_blocked"})
"""While the simulation stands, nothing brakes in it; a new one begins elsewhere."""


MAY_TAKE_OVER = frozenset({"wire_second_teleop", "wire_attachments"})
HOLDS_A_COMMAND = SILENCES_SUPERVISOR | {"net_cut_base", "net_healed_base"}
TOLERANCE_M = 0.01
HELD_M = 0.03
"""What 0.15 s more at the speed that the barrier permits come to, less what the base brakes better than trusted."""
BARRIER_M_S = 0.5
"""As fast as the barrier lets it drive where 0.25 s count."""


@dataclass(frozen=True, slots=True)
class Done:
    """A fault that was done."""

    name: str
    at_s: float
    until_s: float
    """When it ended: woken, healed, started again."""
    parameters: Mapping[str, float | str] = field(default_factory=dict[str, float | str])

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
        found += [_by_itself(one)] if one.name in BY_THEMSELVES else _of(one, others, alone=alone)
    return [demand for demand in found if demand.from_s < demand.until_s]


def may_be_locked_out(names: Collection[str]) -> bool:
    """Whether a source may belong to another one by now after these faults (docs/decisions/0020).

    Who speaks as teleop while something else silences it, or with a copy of its epoch, may end that epoch. Teleop
    notices, and begins another; a source without manners has to be started anew.
    """
    return len(names) > 1 and not MAY_TAKE_OVER.isdisjoint(names)


def _is_of_a_sensor(one: Done) -> bool:
    return one.name.startswith("sim_scan_") or one.name == "sim_odom_gone"


def _of(one: Done, others: Sequence[Done], *, alone: bool) -> Iterable[Demand]:
    names = {other.name for other in others}
    slow_s = LEEWAY_S + (SLOW_S if others else 0.0)
    # Whatever ends meanwhile may mend this one too: start the same process, heal the same link.
    until_s = min((other.until_s for other in others if other.until_s > one.at_s), default=one.until_s)
    until_s = min(until_s, one.until_s)
    if _is_of_a_sensor(one):  # it has one fault at a time: the next one takes its place
        next_s = (other.at_s for other in others if _is_of_a_sensor(other) and other.at_s >= one.at_s)
        until_s = min([until_s, *next_s])

    def window(kind: Kind, promise: int, bound_s: float) -> Demand:
        return Demand(kind, promise, one.name, one.at_s + bound_s + slow_s, until_s)

    if one.name in BLINDS and not names & MOVES_THE_ROBOT:
        yield window(Kind.ZERO, 5, BLIND_BOUND_S)
    if alone and not names & SPEAKS_FOR_TELEOP:
        if one.name in ENDS_TELEOP:
            yield window(Kind.ZERO, 2, KILL_BOUND_S)
        elif one.name in SILENCES_TELEOP:
            yield window(Kind.ZERO, 3, SILENT_BOUND_S)
    if not names & MOVES_THE_ROBOT:
        if one.name in ENDS_SUPERVISOR:
            yield window(Kind.BRAKE, 4, KILL_BOUND_S)
        elif one.name in SILENCES_SUPERVISOR:
            yield window(Kind.BRAKE, 4, BASE_TIMEOUT_S + TICK_S)


def _by_itself(one: Done) -> Demand:
    """What a class with trials of its own asks for: a state from its bound on, or an event by then."""
    known, kind = BY_NAME[one.name], BY_THEMSELVES[one.name]
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
    names = {one.name for one in done}
    late_m = HELD_M if names & HOLDS_A_COMMAND else 0.0
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
