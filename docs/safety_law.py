"""Writes the parts of docs/safety-law.md that the code itself can tell: `python -m docs.safety_law`.

Between `<!-- NAME: generated -->` and `<!-- /NAME -->` stand

    reasons   the table of stop reasons; every StopReason must have a row in `REASONS`
    states    the state diagram, found by running the real law breadth first through `EVENTS`
    numbers   the defaults that the text speaks of

`--check` writes nothing and fails if a part is out of date; tests/unit/test_docs.py does the same.
"""

import math
import sys
from collections import deque
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from docs import generated
from supervisor.config import SupervisorSection
from supervisor.model import (
    STANDSTILL,
    Command,
    Decision,
    Inputs,
    LaserScan,
    LawConfig,
    Liveliness,
    Mode,
    SourceConfig,
    State,
    StopReason,
    Velocity,
)
from supervisor.safety import BARRIER_REASONS, initial_state, step

DOCUMENT = Path(__file__).parent / "safety-law.md"
DEFAULTS = SupervisorSection()


# --- the table of reasons


@dataclass(frozen=True)
class Reason:
    """One row: when the law stops for it, how it is cleared, and why it exists."""

    when: str
    cleared: str
    why: str


REASONS: Mapping[StopReason, Reason] = {
    StopReason.ESTOP: Reason(
        "`robot/estop` said true, or said something that cannot be read, or was flooded",
        "a reset, refused while any live source asks for motion; then neutral",
        "A press must outlive the one who pressed. farm-ng/tractor #82 and ubiquity_motor #42: a robot lurches when "
        "its e-stop is released. Husarion refuses a reset under command, and so do we.",
    ),
    StopReason.BASE_RUNAWAY: Reason(
        "zero was commanded for longer than braking takes, and odometry still shows motion; raises the alarm",
        "standing still, and neutral",
        "A supervisor that trusts its own zero sees nothing when a wheel controller does not obey.",
    ),
    StopReason.OVERRUN: Reason(
        f"the law itself ran later than {DEFAULTS.overrun_s:g} s after its last step",
        "the next step on time, and neutral",
        "While the supervisor hung, nobody watched. Nav2's collision_monitor does not run at all without a command "
        "(navigation2 #4555).",
    ),
    StopReason.SENSOR_CONFLICT: Reason(
        "two writers publish on one sensor's key; the status names both",
        "one of them is silent, and neutral",
        "Every bus delivers the newest sample, from any writer: two drivers, or a driver and a recording, then mix. "
        "ROS 2 counts the publishers of a topic, but no node stops because of the count.",
    ),
    StopReason.BASE_UNRESPONSIVE: Reason(
        "odometry does not follow what was commanded, beyond what the base's ramps explain",
        "standing still, and neutral",
        "A base whose own e-stop is released while a command is active lurches: ubiquity_motor #42.",
    ),
    StopReason.ODOM_STALE: Reason(
        "odometry was lost while driving, unless the configuration says that there is none",
        "fresh odometry, and neutral",
        "A frozen lidar shows itself only by the motion that odometry measures between two scans.",
    ),
    StopReason.SCAN_INVALID: Reason(
        "the newest scan proves nothing: too few beams, impossible geometry, no sector with enough valid readings, "
        "undecodable, frozen while the robot moves, or blank from one scan to the next",
        "a valid scan, and neutral",
        "Where out-of-range beams are dropped, a scan of NaN or zeros reads as clear (Nav2 `scan.cpp`).",
    ),
    StopReason.SCAN_STALE: Reason(
        f"no scan yet, or the newest is older than {DEFAULTS.scan_timeout_s:g} s",
        "fresh scans, and neutral",
        "Nav2's collision_monitor waits 2.0 s, and looks only at the next command; a scan stamped in the future never "
        "goes stale there (`sourceValid()`).",
    ),
    StopReason.SOURCE_LOST: Reason(
        "the source's liveliness token went, if only for a moment",
        "it is back, and neutral",
        "cmd_vel_mux sends nothing when its source falls silent (yujin_ocs #16), twist_mux nothing when it is locked "
        "(PR #42): whether the robot stops is left to the next one in the chain. joystick_drivers #92: a lost "
        "joystick repeats its last command for ever.",
    ),
    StopReason.COMMAND_INVALID: Reason(
        "the source's last command was undecodable, NaN, infinite, far beyond the limits, or asked for a motion "
        "that a ground robot does not have",
        "a valid command, and neutral; a bad one never refreshes the age of the last good one",
        "diff_drive_controller keeps the reference from before a NaN, and the NaN refreshes its age.",
    ),
    StopReason.COMMAND_STALE: Reason(
        f"commands arrive, but late, replayed, out of order or from another epoch, and no good one for "
        f"{DEFAULTS.command_timeout_s:g} s",
        "fresh commands, and neutral",
        "A network that stalls delivers its backlog in one burst: teleop_twist_joy #27, “ghost commands”. "
        "pr2_controllers #320 asks for an expiry of each command.",
    ),
    StopReason.COMMAND_TIMEOUT: Reason(
        f"the source's last good command is older than {DEFAULTS.command_timeout_s:g} s",
        "fresh commands, and neutral",
        "A process can be alive and hung: PX4 #20519 and #18346. The heartbeat must be the intent itself. "
        "The anchors wait 0.25 s to 5 s.",
    ),
    StopReason.NO_COMMAND: Reason(
        "nobody has sent a command yet",
        "a first, neutral command",
        "A program that starts with its stick pushed must not drive off. ArduPilot #6623: a latched override is "
        "replayed on reconnect.",
    ),
    StopReason.SCAN_BLIND: Reason(
        "the commanded motion goes where nothing is seen",
        "neutral, or a command that goes elsewhere",
        "Not seen is not free. A sensor that looks ahead says nothing about driving back.",
    ),
    StopReason.OBSTACLE: Reason(
        f"the speed barrier leaves less than {DEFAULTS.creep_m_s:g} m/s: something is at "
        f"{DEFAULTS.stop_distance_m:.2f} m, and the command closes on it",
        "neutral, or a command that does not close on it",
        "A plain stop zone traps the robot: navigation2 #3313, #3748, mowglinext #159 (414 s). A pure rotation can "
        "sweep a corner into something (navigation2 #3171): the barrier looks at the hull, not at the direction.",
    ),
}


def reasons_table(reasons: Mapping[StopReason, Reason] = REASONS) -> str:
    """The most restrictive first.

    Raises:
        ValueError: a StopReason has no row.
    """
    missing = [reason.name for reason in StopReason if reason not in reasons]
    if missing:
        raise ValueError(f"docs/safety_law.py: REASONS has no row for {', '.join(missing)}")
    rows = ((reason, reasons[reason]) for reason in StopReason)
    return "\n".join(
        [
            "| reason | when | cleared by | why it exists, and who lacks it |",
            "|---|---|---|---|",
            *(f"| `{name.value}` | {row.when} | {row.cleared} | {row.why} |" for name, row in rows),
        ]
    )


# --- the numbers


def numbers_table() -> str:
    """The defaults behind the letters of the formula."""
    d = DEFAULTS
    rows = (
        ("`d`", "stop distance", f"{d.stop_distance_m:.2f} m", "`stop_distance_m`"),
        (
            "`a`",
            "deceleration that the base is trusted with",
            f"{d.deceleration_m_s2:g} m/s²",
            "`deceleration_m_s2`",
        ),
        (
            "",
            "share of `T` for transport and one tick",
            f"{d.transport_s:g} s",
            "`transport_s`",
        ),
        ("", "slower than this is not worth moving for", f"{d.creep_m_s:g} m/s", "`creep_m_s`"),
        ("", "a warning is shown below", f"{d.warning_distance_m:.2f} m", "`warning_distance_m`"),
        (
            "",
            "limits of a command",
            f"{d.max_linear_m_s:g} m/s, {d.max_angular_rad_s:g} rad/s",
            "`max_linear_m_s`, `max_angular_rad_s`",
        ),
    )
    return "\n".join(
        [
            "| letter | what | default | in `[supervisor]` |",
            "|---|---|---|---|",
            *(f"| {' | '.join(row)} |" for row in rows),
        ]
    )


# --- the state diagram

TICK_S = 0.09
"""As long as two steps may lie apart without an overrun, so that few of them outlast every timeout."""
SETTLE_TICKS = 4
"""After each event the world stays as it is for so long, which is beyond every timeout."""

BEAMS = 180
FORWARD, BACK = Velocity(0.5, 0.0), Velocity(-0.5, 0.0)
CLEAR_M, NEAR_M, TOO_NEAR_M = 3.0, 0.65, 0.50
"""From the lidar, with a round hull of 0.25 m: far away, so that the barrier slows, so that it stops."""
CONFIG: LawConfig = replace(DEFAULTS.law(), sources=(SourceConfig("teleop", 1),))


@dataclass(frozen=True)
class World:
    """What goes on until an event changes it. At first: nothing."""

    speaking: bool = False
    velocity: Velocity | None = None
    """What the operator's program sends at each tick while it speaks; None: what cannot be read."""
    token: bool | None = None
    ahead_m: float | None = None
    """Where the lidar sees something ahead; None: there are no scans."""


@dataclass(frozen=True)
class Event:
    """One thing that happens: the world as it is from now on, or something that the law is told once."""

    name: str
    change: Callable[[World], World] = lambda world: world
    happens_in: Callable[[World], bool] = lambda _: True
    estop: bool = False
    reset: bool = False
    late: bool = False


def _command(name: str, velocity: Velocity | None) -> Event:
    return Event(name, lambda world: replace(world, velocity=velocity, speaking=True))


def _scene(name: str, ahead_m: float | None) -> Event:
    return Event(name, lambda world: replace(world, ahead_m=ahead_m), lambda world: world.ahead_m is not None)


EVENTS = (
    _command("neutral", STANDSTILL),
    _command("forward", FORWARD),
    _command("back", BACK),
    _command("bad command", None),
    Event("silence", lambda world: replace(world, speaking=False), lambda world: world.speaking),
    Event("token lost", lambda world: replace(world, token=False), lambda world: world.token is not False),
    Event("token back", lambda world: replace(world, token=True), lambda world: world.token is False),
    _scene("scans stop", None),
    Event("scans back", lambda world: replace(world, ahead_m=CLEAR_M), lambda world: world.ahead_m is None),
    _scene("way clear", CLEAR_M),
    _scene("obstacle near", NEAR_M),
    _scene("obstacle too near", TOO_NEAR_M),
    Event("late tick", late=True),
    Event("e-stop", estop=True),
    Event("reset", reset=True),
)

NODES = {
    "Estop": "STOPPED by e-stop",
    "NobodyYet": "STOPPED, nobody has spoken",
    "Cause": "STOPPED, a cause holds",
    "Latched": "STOPPED, cause gone, waits for neutral",
    "Barrier": "STOPPED by the barrier",
    "Ready": "READY, at rest",
    "Driving": "DRIVING as commanded",
    "Limited": "LIMITED by the barrier",
}
WORDS = {
    "a cause comes": frozenset({"bad command", "silence", "token lost", "scans stop"}),
    "the cause goes": frozenset({"token back", "scans back"}),
    "motion": frozenset({"forward", "back"}),
}
"""One word for events that lead the same way."""

Edges = dict[tuple[str, str], set[str]]
"""(from, to): the names of the events that lead there."""


def node_of(state: State, decision: Decision) -> str:
    """Which node of the picture this is."""
    if state.estop:
        return "Estop"
    if decision.mode is not Mode.STOPPED:
        return decision.mode.name.capitalize()
    reasons = set(decision.reasons)
    (source,) = state.sources
    if source.velocity is None and reasons <= {StopReason.NO_COMMAND, StopReason.SCAN_STALE}:
        return "NobodyYet"
    if reasons <= BARRIER_REASONS:
        return "Barrier"
    return "Cause" if source.caused_s == state.now_s else "Latched"


@cache
def transitions() -> Edges:
    """Every edge of the picture, found breadth first from the initial state; not those from a node to itself."""
    start = _settle(initial_state(CONFIG), World(), 0.0, None)
    queue = deque([start])
    known = {_key(*start)}
    edges: Edges = {}
    while queue:
        state, world, decision = queue.popleft()
        assert state.now_s is not None
        for event in EVENTS:
            if not event.happens_in(world):
                continue
            after = _settle(state, event.change(world), state.now_s, event)
            before_node, after_node = node_of(state, decision), node_of(after[0], after[2])
            if before_node != after_node:
                edges.setdefault((before_node, after_node), set()).add(event.name)
            key = _key(*after)
            if key not in known:
                known.add(key)
                queue.append(after)
    return edges


def _settle(state: State, world: World, now_s: float, event: Event | None) -> tuple[State, World, Decision]:
    """The event, and the world as it is from then on for `SETTLE_TICKS`."""
    if event is not None and event.late:
        now_s += 2 * CONFIG.overrun_s
    now_s += TICK_S
    state, decision = step(state, now_s, _inputs(world, now_s, event))
    for _ in range(SETTLE_TICKS - 1):
        now_s += TICK_S
        state, decision = step(state, now_s, _inputs(world, now_s, None))
    return state, world, decision


def _inputs(world: World, now_s: float, event: Event | None) -> Inputs:
    return Inputs(
        commands=(Command("teleop", world.velocity, now_s),) if world.speaking else (),
        liveliness=() if world.token is None else (Liveliness("teleop", world.token),),
        scans=(None,) if world.ahead_m is None else (),
        estop=event is not None and event.estop,
        reset=event is not None and event.reset,
    )


def _scan(ahead_m: float, now_s: float) -> LaserScan:
    ranges = np.full(BEAMS, CLEAR_M, dtype=np.float32)
    ranges[BEAMS // 2 - 8 : BEAMS // 2 + 8] = ahead_m
    return LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.05, 12.0, now_s)


def _key(state: State, world: World, decision: Decision) -> Hashable:
    """The settled state, as far as its future depends on it: every age is now, or beyond every timeout."""
    (source,) = state.sources
    return (
        world,
        node_of(state, decision),
        state.owner,
        source.invalid,
        source.velocity,
        source.armed,
        source.latched <= BARRIER_REASONS,
        source.block,
        source.caused_s == state.now_s,
        source.neutral_s > source.caused_s,
    )


def _from_everywhere(edges: Edges) -> dict[str, str]:
    """Events that lead to one and the same node from every other: drawn once, as a sentence."""
    found: dict[str, str] = {}
    for target in NODES:
        others = [edges.get((node, target), set[str]()) for node in NODES if node != target]
        found.update(dict.fromkeys(set[str].intersection(*others), target))
    return found


def _label(events: set[str]) -> str:
    """The events in their order, or one word for several."""
    words: list[str] = []
    for word, meant in WORDS.items():
        if meant <= events:
            events = events - meant
            words.append(word)
    return ", ".join([*(event.name for event in EVENTS if event.name in events), *words])


def state_diagram() -> str:
    """Mermaid's `stateDiagram-v2`, flat; what leaves a node as it is, is left out.

    Raises:
        ValueError: the law never reaches a node of the picture.
    """
    edges = transitions()
    missing = NODES.keys() - {node for edge in edges for node in edge}
    if missing:
        raise ValueError(f"docs/safety_law.py: never reached: {', '.join(sorted(missing))}")
    everywhere = _from_everywhere(edges)
    lines = ["```mermaid", "stateDiagram-v2"]
    lines += [f'    state "{text}" as {node}' for node, text in NODES.items()]
    lines.append("    [*] --> NobodyYet")
    places = list(NODES)
    for before, after in sorted(edges, key=lambda edge: (places.index(edge[0]), places.index(edge[1]))):
        events = {e for e in edges[before, after] if everywhere.get(e) != after}
        if events:
            lines.append(f"    {before} --> {after} : {_label(events)}")
    lines += ["```", ""]
    lines += [
        f"* Not drawn: from every other state, *{event}* leads to *{NODES[target]}*."
        for event, target in everywhere.items()
    ]
    lines += [
        f"* *{word}*: {', '.join(event.name for event in EVENTS if event.name in meant)}."
        for word, meant in WORDS.items()
    ]
    return "\n".join(lines)


# --- the document

PARTS: generated.Parts = {
    "numbers": numbers_table,
    "states": state_diagram,
    "reasons": reasons_table,
}


def regenerated(text: str) -> str:
    """The document with each part written anew.

    Raises:
        ValueError: a part has no place in the document, or a StopReason no row.
    """
    return generated.regenerated(text, PARTS, "docs/safety-law.md")


if __name__ == "__main__":
    sys.exit(generated.main("python -m docs.safety_law", DOCUMENT, regenerated))
