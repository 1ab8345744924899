"""Write the generated parts of docs/safety-law.md.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    reasons   the table of stop reasons; every StopReason must have a row in `REASONS`
    states    the state diagram, found by running the real law breadth first through `EVENTS`
    numbers   the defaults of the speed barrier's formula
    seen      the defaults of seen space and of the memory of near points
    profiles  what each lidar profile means by "no return", and how long it trusts it
    motions   the motions that the files in deploy/examples permit, found by running the law
"""

import math
import tempfile
from collections import deque
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from bench.rig.sheet import markdown_table
from docs.generate import sections
from lifeline.check.check import examine
from lifeline.check.motions import Permitted
from supervisor.config import SupervisorSection
from supervisor.law.agreement import DOUBTS, STEP_M, STEP_RAD
from supervisor.law.base_motion import PATIENCE_S
from supervisor.law.base_rolling import ROLLED_M, WINDOW_S
from supervisor.law.decision import Decision, Mode
from supervisor.law.interlock import BARRIER_REASONS
from supervisor.law.lidar import PROFILES, TIMINGS, LidarProfile
from supervisor.law.model import Command, Inputs, LawConfig, Liveliness, SourceConfig
from supervisor.law.near_memory import MISSES
from supervisor.law.permission import TOUCH_M
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from supervisor.law.sight import SAME_PLACE_M
from supervisor.law.state import State
from supervisor.law.stop_rules import STOP_RULES, RaisedBy, cleared_by
from supervisor.law.surface import LEAST_NOISE_M
from wire.lease import LEASE_S
from wire.reasons import StopReason

DEFAULTS = SupervisorSection()


Row = tuple[str, ...]


# --- the table of reasons


@dataclass(frozen=True)
class Reason:
    """The columns that the page adds to the law's table of stop reasons: when the reason holds, and why it exists."""

    when: str
    why: str


REASONS: Mapping[StopReason, Reason] = {
    StopReason.ESTOP: Reason(
        "`robot/estop` was true, unreadable or flooded; or a supervisor that starts finds the record of an earlier "
        "e-stop, or cannot read it",
        "An e-stop must outlive the process that sent it and the one that received it. farm-ng/tractor #82 and ubiquity_motor #42: a robot lurches when "
        "its e-stop is released. Husarion refuses a reset under command, and so do we.",
    ),
    StopReason.ESTOP_STATION_LOST: Reason(
        f"a required e-stop station has not been heard yet, has not answered a challenge of the last {LEASE_S:g} s, has left, "
        "or its token was deleted; after a loss, until a reset",
        "An e-stop button whose link is dead stops nothing, and nobody notices. Spot's E-stop service requires "
        "that each endpoint answers challenges.",
    ),
    StopReason.ESTOP_UNRECORDED: Reason(
        "the disk has not confirmed that a press would be recorded: it is full, read-only, changed by others, or still "
        "at work on a reset",
        "If a press is not recorded and the supervisor is killed, the next supervisor does not know of the press, and drives.",
    ),
    StopReason.BASE_RUNAWAY: Reason(
        "zero was commanded for longer than braking takes, and odometry still shows motion or has shown more than "
        f"{100 * ROLLED_M:.0f} cm of net motion within {WINDOW_S:.0f} s, also if somebody pushes the robot; raises the alarm",
        "A supervisor that trusts its own zero sees nothing when a wheel controller does not obey.",
    ),
    StopReason.OVERRUN: Reason(
        f"the law ran later than {DEFAULTS.overrun_s:g} s after its last step, or the machine was suspended",
        "While the supervisor hangs or the machine sleeps, nothing is supervised. Nav2's collision_monitor does not run at all without a command "
        "(navigation2 #4555).",
    ),
    StopReason.SENSOR_CONFLICT: Reason(
        "each of two writers was heard twice within a short time on one sensor's key; the status names both",
        "A subscriber receives a mixture of the samples of all writers, for example of two drivers, or of a driver and a "
        "recording. ROS 2 counts the publishers of a topic, but no node stops because of the count.",
    ),
    StopReason.SENSOR_MISMATCH: Reason(
        f"in {DOUBTS} judgements in a row, each over {STEP_M:g} m or {STEP_RAD:g} rad of measured motion, the returns of a lidar have not moved as the "
        "configuration predicts, but as with a turned or mirrored lidar, or a wrong sign of odometry; the status names which",
        "A wrong yaw of the lidar is the most frequent mistake in public reports. The robot then stops for what is behind it, and drives into what is ahead.",
    ),
    StopReason.BASE_UNRESPONSIVE: Reason(
        f"odometry has not followed the command for {PATIENCE_S:g} s, beyond what the base's ramps explain",
        "A base whose own e-stop is released while a command is active lurches: ubiquity_motor #42.",
    ),
    StopReason.ODOM_STALE: Reason(
        f"odometry was received before, and the newest is older than {DEFAULTS.odom_timeout_s:g} s, unless `odometry = false`",
        "Without odometry the law cannot check that the base follows, nor where the robot is between two scans.",
    ),
    StopReason.SCAN_INVALID: Reason(
        "no lidar has a usable scan, and the newest is fresh but proves nothing: undecodable, too few beams, numbers "
        "that contradict each other, no reading that the profile explains, the same scan while the robot moves, "
        "returns that disappear from one scan to the next, or no return since the start",
        "Where out-of-range beams are dropped, a scan of NaN or zeros reads as clear (Nav2 `scan.cpp`).",
    ),
    StopReason.SCAN_STALE: Reason(
        f"no lidar has a scan that is newer than its timeout ({DEFAULTS.scan_timeout_s:g} s by default)",
        "Nav2's collision_monitor waits 2.0 s, and checks only at the next command; a scan stamped in the future never "
        "goes stale there (`sourceValid()`).",
    ),
    StopReason.SOURCE_LOST: Reason(
        "the source's liveliness token was deleted, even if it returned at once, and its last command was not a valid "
        "zero; or a source that has left sends commands without declaring its token again",
        "cmd_vel_mux sends nothing when its source stops sending (yujin_ocs #16), twist_mux nothing when it is locked "
        "(PR #42): whether the robot stops depends on the next node. joystick_drivers #92: after the joystick is lost, its "
        "last command is repeated without end.",
    ),
    StopReason.COMMAND_INVALID: Reason(
        "the source's last command was undecodable, NaN, infinite, far beyond the limits, or had components "
        "that a ground robot does not have",
        "An invalid command must not refresh the age of the last valid one: diff_drive_controller keeps the "
        "reference from before a NaN, and the NaN refreshes its age.",
    ),
    StopReason.COMMAND_STALE: Reason(
        f"commands arrive, but late, replayed, out of order or from another epoch, and none was accepted for "
        f"{DEFAULTS.command_timeout_s:g} s",
        "A network that stalls delivers its backlog in one burst: teleop_twist_joy #27, “ghost commands”. "
        "pr2_controllers #320 asks for an expiry of each command.",
    ),
    StopReason.COMMAND_TIMEOUT: Reason(
        f"the source's last accepted command is older than {DEFAULTS.command_timeout_s:g} s",
        "A process can be alive and hung: PX4 #20519 and #18346. The commands themselves must be the heartbeat. "
        "The reference stacks wait 0.25 s to 5 s.",
    ),
    StopReason.NO_COMMAND: Reason(
        "the source has sent no command since start, or it commanded zero and then deleted its liveliness token "
        "(it has left)",
        "A program that starts while the stick is pushed must not move the robot. ArduPilot #6623: a latched override is "
        "replayed on reconnect.",
    ),
    StopReason.SCAN_BLIND: Reason(
        f"the barrier leaves less than {DEFAULTS.creep_m_s:g} m/s because of a hidden place: no scan rules out an "
        "object there",
        "Space that was not seen may be occupied. A lidar that looks ahead proves nothing about driving back.",
    ),
    StopReason.OBSTACLE: Reason(
        f"the barrier leaves less than {DEFAULTS.creep_m_s:g} m/s because of a point that two scans have shown: the "
        f"command closes on something at {DEFAULTS.stop_distance_m:.2f} m",
        "A plain stop zone traps the robot: navigation2 #3313, #3748, mowglinext #159 (414 s). A pure rotation can "
        "sweep a corner into something (navigation2 #3171): the barrier checks the hull, not the direction.",
    ),
}


def reasons_table(reasons: Mapping[StopReason, Reason] = REASONS) -> str:
    """Return the table of stop reasons, the most restrictive first.

    Raises:
        ValueError: a StopReason has no row.
    """
    whose = {RaisedBy.EVERYTHING_SHARED: "shared", RaisedBy.SOURCE: "source", RaisedBy.BARRIER: "barrier"}
    missing = [reason.name for reason in StopReason if reason not in reasons]
    if missing:
        raise ValueError(f"docs/generate/safety_law.py: REASONS has no row for {', '.join(missing)}")
    return markdown_table(
        ("reason", "raised by", "when", "cleared by", "why it exists, and known failures without it"),
        (
            (
                f"`{name.value}`",
                whose[STOP_RULES[name].raised_by],
                reasons[name].when,
                cleared_by(STOP_RULES[name]),
                reasons[name].why,
            )
            for name in StopReason
        ),
    )


# --- the numbers


def numbers_table() -> str:
    """Return the table of the defaults of the barrier's formula."""
    d = DEFAULTS
    rows = (
        ("`d`", "stop distance", f"{d.stop_distance_m:.2f} m", "`stop_distance_m`"),
        (
            "`a`",
            "trusted deceleration of the base",
            f"{d.deceleration_m_s2:g} m/s²",
            "`deceleration_m_s2`",
        ),
        (
            "",
            "part of `T`: transport and one tick",
            f"{d.transport_s:g} s",
            "`transport_s`",
        ),
        (
            "",
            "part of `T`: time for which the base keeps its speed after a new command",
            f"{d.base_dead_time_s:g} s",
            "`base_dead_time_s`",
        ),
        (
            "",
            "constant time from a measurement to its message, part of the age of a scan",
            f"{d.lidar.usual_latency_s():g} s",
            "`latency_s` of a lidar",
        ),
        (
            "",
            f"time for which the base drives on without a command; the second bound then keeps {TOUCH_M:g} m",
            f"{d.base_timeout_s:g} s",
            "`base_timeout_s`",
        ),
        ("", "minimum useful speed; below it the output is zero", f"{d.creep_m_s:g} m/s", "`creep_m_s`"),
        (
            "",
            "clearance below which a warning is shown",
            f"{d.warning_distance_m:.2f} m",
            "`warning_distance_m`",
        ),
        (
            "",
            "limits of a command",
            f"{d.max_linear_m_s:g} m/s, {d.max_angular_rad_s:g} rad/s",
            "`max_linear_m_s`, `max_angular_rad_s`",
        ),
    )
    return markdown_table(("letter", "what", "default", "in `[supervisor]`"), rows)


def seen_table() -> str:
    """Return the table of the defaults of seen space."""
    d, law = DEFAULTS, DEFAULTS.law()
    rows = (
        ("`w`: diameter of the smallest obstacle", f"{d.smallest_obstacle_m:g} m", "`smallest_obstacle_m`"),
        ("distance from the hull beyond which no point limits a motion", f"{law.reach_m:.2f} m", "computed"),
        (
            "time for which space that was seen free counts as free when out of view",
            f"{d.unseen_memory_s:g} s",
            "`unseen_memory_s`",
        ),
        (
            "permitted closing speed toward a hidden place",
            f"{d.blind_creep_m_s:g} m/s",
            "`blind_creep_m_s`",
        ),
        (
            "whether silence counts as free on beams that never had a return, while less than a tenth of the beams have one",
            str(d.works_in_the_open).lower(),
            "`works_in_the_open`",
        ),
        ("maximum speed in that case", f"{d.open_m_s:g} m/s", "`open_m_s`"),
        (
            "number of scans that cover a remembered point and find nothing there, after which it is dropped",
            f"{MISSES}",
            "fixed",
        ),
        (
            "distance within which an earlier reading confirms a stop, if it is as near to the hull",
            f"{SAME_PLACE_M:g} m",
            "fixed",
        ),
        (
            "measured range noise from which the distance of a beam is that of its surface",
            f"{1000 * LEAST_NOISE_M:g} mm",
            "fixed",
        ),
    )
    return markdown_table(("what", "default", "in `[supervisor]`"), rows)


def profiles_table() -> str:
    """Return the table of the readings that mean "no return" in each lidar profile."""
    return markdown_table(
        (
            "profile",
            "“no return”, besides +Inf and readings from `range_max` on",
            "trusted from the start",
            "trusted without a return for",
            "timeout",
            "latency",
        ),
        [_profile_row(name, profile) for name, profile in PROFILES.items()],
    )


def _profile_row(name: str, profile: LidarProfile) -> Row:
    codes = [
        text
        for text, is_code in (
            ("0.0", profile.zero_is_free),
            ("NaN", profile.nan_is_free),
            (f"below {profile.codes_below_m:g} m", profile.codes_below_m > 0.0),
            *((f"{code:g}", True) for code in profile.free_codes_m),
        )
        if is_code
    ]
    limited = profile.silence_limit_s < math.inf
    limit = (
        f"{profile.silence_limit_s:g} s or {profile.silence_limit_m:g} m of travel, whichever lasts longer"
        if limited
        else "no limit"
    )
    timeout_s, latency_s = (
        (TIMINGS[name].timeout_s, TIMINGS[name].latency_s)
        if name in TIMINGS
        else (DEFAULTS.scan_timeout_s, 0.0)
    )
    start = "yes" if profile.trusts_silence_at_start else "no"
    return (f"`{name}`", ", ".join(codes) or "none", start, limit, f"{timeout_s:g} s", f"{latency_s:g} s")


# --- what examples permit

EXAMPLES = Path(__file__).parents[2] / "deploy" / "examples"


def motions_table() -> str:
    """Return the table of motions that a robot with one front lidar may do, with each of the two relaxed settings."""
    text = (EXAMPLES / "amr_one_lidar.toml").read_text()
    variants = {
        "one lidar": text,
        "one lidar, `unseen_memory_s = 5.0`": text.replace("unseen_memory_s = 0.0", "unseen_memory_s = 5.0"),
        "one lidar, `blind_creep_m_s = 0.1`": text.replace("blind_creep_m_s = 0.0", "blind_creep_m_s = 0.1"),
        "two lidars": (EXAMPLES / "amr_two_lidars.toml").read_text(),
    }
    rows: list[Row] = []
    for name, variant in variants.items():
        found = _examined(variant)
        rows.append((name, "at rest", *(_permitted(p.at_rest) for p in found)))
        rows.append(("", "after driving ahead", *(_permitted(p.after_driving) for p in found)))
    motions = tuple(p.motion.name for p in _examined(text))
    return markdown_table(("lidars", "commanded", *motions), rows)


def _examined(text: str) -> tuple[Permitted, ...]:
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory) / "robot.toml"
        file.write_text(text)
        return tuple(p for p in examine(file).motions if p.motion.name not in {"arc right", "turn right"})


def _permitted(decision: Decision) -> str:
    if decision.output == STANDSTILL:
        return "no"
    parts = ((decision.output.linear_m_s, "m/s"), (decision.output.angular_rad_s, "rad/s"))
    return ", ".join(f"{abs(value):.2f} {unit}" for value, unit in parts if value)


# --- the state diagram

TICK_S = 0.09
"""Nearly the longest time between two steps without an overrun, so that few steps are longer than every timeout."""
SETTLE_TICKS = 4
"""Number of steps after each event in which the world does not change; together longer than every timeout."""

BEAMS = 360
NOISE_M = 1e-3
FORWARD, BACK = Velocity(0.5, 0.0), Velocity(-0.5, 0.0)
CLEAR_M, NEAR_M, TOO_NEAR_M = 3.0, 0.65, 0.50
"""Distances from the lidar, with a round hull of 0.25 m: free; the barrier slows the robot; the barrier stops it."""
CONFIG: LawConfig = replace(DEFAULTS.law(), sources=(SourceConfig("teleop", 1),))


@dataclass(frozen=True)
class World:
    """The inputs that are repeated at each step until an event changes them; none at first."""

    speaking: bool = False
    velocity: Velocity | None = None
    """The velocity that the operator's program sends at each step while `speaking`; None: an undecodable command."""
    token: bool | None = None
    ahead_m: float | None = None
    """Distance of the nearest object ahead of the lidar; None: there are no scans."""


@dataclass(frozen=True)
class Event:
    """A change of the world, or a single input of the law."""

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
    Event("token returns", lambda world: replace(world, token=True), lambda world: world.token is False),
    _scene("scans stop", None),
    Event("scans return", lambda world: replace(world, ahead_m=CLEAR_M), lambda world: world.ahead_m is None),
    _scene("path clear", CLEAR_M),
    _scene("obstacle near", NEAR_M),
    _scene("obstacle too near", TOO_NEAR_M),
    Event("late tick", late=True),
    Event("e-stop", estop=True),
    Event("reset", reset=True),
)

NODES = {
    "Estop": "STOPPED by e-stop",
    "NobodyYet": "STOPPED, no command source",
    "Cause": "STOPPED, a cause holds",
    "Latched": "STOPPED, cause over, waits for neutral",
    "Barrier": "STOPPED by the barrier",
    "Ready": "READY, at rest",
    "Driving": "DRIVING as requested",
    "Limited": "LIMITED by the barrier",
}
WORDS = {
    "a cause begins": frozenset({"bad command", "silence", "token lost", "scans stop"}),
    "the cause ends": frozenset({"token returns", "scans return"}),
    "motion": frozenset({"forward", "back"}),
}
"""A common name for events with the same effect."""

Edges = dict[tuple[str, str], set[str]]
"""(from, to): the names of the events that lead there."""


def node_of(state: State, decision: Decision) -> str:
    """Return the node of the diagram for a state of the law."""
    if state.interlock.estop:
        return "Estop"
    if decision.mode is not Mode.STOPPED:
        return decision.mode.name.capitalize()
    reasons = set(decision.reasons)
    (source,) = state.interlock.sources
    if source.velocity is None and reasons <= {StopReason.NO_COMMAND, StopReason.SCAN_STALE}:
        return "NobodyYet"
    if reasons <= BARRIER_REASONS:
        return "Barrier"
    return "Cause" if source.caused_s == state.clock.now_s else "Latched"


@cache
def transitions() -> Edges:
    """Return every edge between different nodes, found breadth first from the initial state."""
    start = _settle(initial_state(CONFIG), World(), 0.0, None)
    queue = deque([start])
    known = {_key(*start)}
    edges: Edges = {}
    while queue:
        state, world, decision = queue.popleft()
        assert state.clock.now_s is not None
        for event in EVENTS:
            if not event.happens_in(world):
                continue
            after = _settle(state, event.change(world), state.clock.now_s, event)
            before_node, after_node = node_of(state, decision), node_of(after[0], after[2])
            if before_node != after_node:
                edges.setdefault((before_node, after_node), set()).add(event.name)
            key = _key(*after)
            if key not in known:
                known.add(key)
                queue.append(after)
    return edges


def _settle(state: State, world: World, now_s: float, event: Event | None) -> tuple[State, World, Decision]:
    """Apply an event, and run the law for `SETTLE_TICKS` steps with the resulting world."""
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
        scans=() if world.ahead_m is None else (_scan(world.ahead_m, now_s),),
        estop=event is not None and event.estop,
        reset=event is not None and event.reset,
    )


def _scan(ahead_m: float, now_s: float) -> LaserScan:
    ranges = np.full(BEAMS, CLEAR_M, dtype=np.float32)
    ranges[BEAMS // 2 - 16 : BEAMS // 2 + 16] = ahead_m
    ranges += np.float32(NOISE_M * math.sin(now_s))  # no real scan repeats itself
    return LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.05, 12.0, now_s)


def _key(state: State, world: World, decision: Decision) -> Hashable:
    """Return the part of a settled state that decides its future: every age is zero, or beyond every timeout."""
    (source,) = state.interlock.sources
    return (
        world,
        node_of(state, decision),
        state.interlock.owner,
        source.invalid,
        source.velocity,
        source.armed,
        source.latched <= BARRIER_REASONS,
        None if source.block is None else (source.block.kind, round(source.block.per_linear)),
        source.caused_s == state.clock.now_s,
        source.neutral_s > source.caused_s,
    )


def _from_everywhere(edges: Edges) -> dict[str, str]:
    """Return the events that lead to the same node from every other node; the page lists them in a sentence."""
    found: dict[str, str] = {}
    for target in NODES:
        others = [edges.get((node, target), set[str]()) for node in NODES if node != target]
        found.update(dict.fromkeys(set[str].intersection(*others), target))
    return found


def _label(events: set[str]) -> str:
    """Return the events in their order, with common names for groups of them."""
    words: list[str] = []
    for word, meant in WORDS.items():
        if meant <= events:
            events = events - meant
            words.append(word)
    return ", ".join([*(event.name for event in EVENTS if event.name in events), *words])


def state_diagram() -> str:
    """Return the state diagram in Mermaid's `stateDiagram-v2`, without events that do not change the node.

    Raises:
        ValueError: the law never reaches a node of the diagram.
    """
    edges = transitions()
    missing = NODES.keys() - {node for edge in edges for node in edge}
    if missing:
        raise ValueError(f"docs/generate/safety_law.py: never reached: {', '.join(sorted(missing))}")
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

PARTS: sections.Parts = {
    "numbers": numbers_table,
    "seen": seen_table,
    "profiles": profiles_table,
    "motions": motions_table,
    "states": state_diagram,
    "reasons": reasons_table,
}
