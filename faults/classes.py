"""The table of fault classes: the fault, the affected process, the stop reasons that detect it, and the time limit.

The limit is the time from the fault to zero on `cmd_vel`; if the supervisor itself fails, the time until the base
brakes. Without a limit, no stop time is required; the effect may still require a stop.
"""

from dataclasses import dataclass
from enum import Flag, StrEnum, auto

from faults.promises import Kind

TICK_S = 0.02
"""The supervisor's tick period."""
COMMAND_TIMEOUT_S = 0.2
SCAN_TIMEOUT_S = 0.25
"""The promised limit; the supervisor's own limit is a little lower, so that zero is sent in time."""
BASE_TIMEOUT_S = 0.15
KILL_BOUND_S = 0.010
"""From a process's death to its detection."""
LEASE_S = 0.4
"""Zenoh's lease: the time after which a silent link counts as lost."""

ODOM_TIMEOUT_S = 0.3
"""Maximum age of odometry while the robot drives."""
FROZEN_BOUND_S = 1.0
"""Time in which a moving robot has driven far enough for its scans to change."""

ESTOP_BOUND_S = 2 * TICK_S
"""From the press of the e-stop to zero, over the network."""
ODOM_BOUND_S = ODOM_TIMEOUT_S + TICK_S
SILENT_BOUND_S = COMMAND_TIMEOUT_S + TICK_S
BLIND_BOUND_S = SCAN_TIMEOUT_S + TICK_S
HUNG_BASE_BOUND_S = BASE_TIMEOUT_S + TICK_S


class Group(StrEnum):
    """The part of the system in which a fault happens."""

    TELEOP = "teleop"
    SUPERVISOR = "supervisor"
    SENSORS = "sim and sensors"
    ESTOP = "e-stop"
    NETWORK = "network"
    WIRE = "wire"
    MACHINE = "machine"
    SUPERVISORD = "supervisord"
    PAIR = "pairs"


class Effect(Flag):
    """The effects of a fault; `demands.py` derives from them what must happen."""

    NONE = 0
    TELEOP_ENDS = auto()
    TELEOP_SILENT = auto()
    BLIND = auto()
    """No valid scan comes."""
    SUPERVISOR_ENDS = auto()
    SUPERVISOR_SILENT = auto()
    SENSOR = auto()
    """The readings of the simulated sensors are wrong. A new fault of this kind replaces the one before."""
    STANDSTILL = auto()
    """The simulation is paused or ends, so its robot cannot brake; a new simulation starts at another pose."""
    BASE_HOLDS = auto()
    """The base holds its last command until its own timeout."""
    SPEAKS_AS_TELEOP = auto()
    """Another program sends commands in teleop's name, which may renew the age of teleop's commands."""
    TAKES_OVER = auto()
    """A second source with teleop's name may end teleop's epoch."""
    DELAYED = auto()
    """The target's link takes `delay_s` longer."""


@dataclass(frozen=True, slots=True)
class FaultClass:
    """One class of faults."""

    name: str
    group: Group
    does: str
    """The fault, in a few words."""
    target: str
    """The affected process; empty: none in particular."""
    detectors: tuple[str, ...]
    """The stop reasons that may detect it; those of the base itself begin with `base: `. Empty: no detection is required."""
    bound_s: float | None
    promise: int
    """The number of the promise that it tests."""
    virtual: bool
    """Whether it can be injected on the virtual clock."""
    real: bool = True
    """Whether it can be injected into real processes without special rights."""
    by_itself: bool = False
    """Whether its virtual trials contain no other fault; such a class is never part of a pair."""
    effect: Effect = Effect.NONE
    demands: Kind | None = None
    """The demand for its own trials, in addition to the promises for every run."""


def _teleop(
    name: str,
    does: str,
    effect: Effect,
    detectors: tuple[str, ...],
    bound_s: float | None,
    promise: int,
    *,
    virtual: bool,
) -> FaultClass:
    return FaultClass(
        f"teleop_{name}",
        Group.TELEOP,
        does,
        "teleop",
        detectors,
        bound_s,
        promise,
        virtual,
        effect=effect,
    )


def _supervisor(name: str, does: str, effect: Effect, bound_s: float | None, promise: int = 4) -> FaultClass:
    return FaultClass(
        f"supervisor_{name}",
        Group.SUPERVISOR,
        does,
        "supervisor",
        BASE_ALONE,
        bound_s,
        promise,
        virtual=True,
        effect=effect,
    )


def _sim(
    name: str,
    does: str,
    effect: Effect,
    detectors: tuple[str, ...],
    bound_s: float | None,
    promise: int = 5,
    *,
    virtual: bool = True,
) -> FaultClass:
    return FaultClass(
        f"sim_{name}", Group.SENSORS, does, "sim", detectors, bound_s, promise, virtual, effect=effect
    )


def _network(
    name: str,
    does: str,
    target: str,
    detectors: tuple[str, ...],
    bound_s: float | None,
    promise: int = 3,
    *,
    effect: Effect = Effect.NONE,
    virtual: bool = True,
    real: bool = True,
) -> FaultClass:
    """Return a network class; `real` is false for faults that cannot happen on TCP."""
    return FaultClass(
        f"net_{name}",
        Group.NETWORK,
        does,
        target,
        detectors,
        bound_s,
        promise,
        virtual,
        real=real,
        effect=effect,
    )


def _wire(
    name: str,
    does: str,
    target: str,
    detectors: tuple[str, ...],
    promise: int,
    effect: Effect = Effect.NONE,
) -> FaultClass:
    return FaultClass(
        f"wire_{name}", Group.WIRE, does, target, detectors, None, promise, virtual=True, effect=effect
    )


def _lidar(
    name: str,
    does: str,
    detectors: tuple[str, ...],
    bound_s: float | None,
    promise: int,
    demands: Kind | None = None,
) -> FaultClass:
    return FaultClass(
        f"sim_scan_{name}",
        Group.SENSORS,
        does,
        "sim",
        detectors,
        bound_s,
        promise,
        virtual=True,
        by_itself=True,
        effect=Effect.SENSOR,
        demands=demands,
    )


def _second_writer(name: str, does: str) -> FaultClass:
    return FaultClass(
        f"wire_second_lidar_{name}",
        Group.WIRE,
        does,
        "",
        ("SENSOR_CONFLICT",),
        BLIND_BOUND_S,
        5,
        virtual=True,
        by_itself=True,
        demands=Kind.NAMED,
    )


def _estop(node: str) -> FaultClass:
    return FaultClass(
        f"estop_{node}_sigkill",
        Group.ESTOP,
        f"an e-stop, then SIGKILL of {node}: only a reset ends the stop",
        node,
        ("ESTOP",),
        ESTOP_BOUND_S,
        7,
        virtual=True,
        by_itself=True,
        demands=Kind.ZERO,
    )


def _machine(name: str, does: str, detectors: tuple[str, ...] = ()) -> FaultClass:
    return FaultClass(f"machine_{name}", Group.MACHINE, does, "", detectors, None, promise=8, virtual=False)


SILENT = ("COMMAND_TIMEOUT", "COMMAND_STALE")
SILENT_OR_LOST = (*SILENT, "SOURCE_LOST")
GONE = ("SOURCE_LOST", "NO_COMMAND")
"""NO_COMMAND if the source sent zero before its token was deleted, else SOURCE_LOST."""
BASE_ALONE = ("base: SUPERVISOR_LOST", "base: COMMAND_TIMEOUT")
NO_VALID_SCAN = ("SCAN_STALE", "SCAN_INVALID")
BARRIER = ("OBSTACLE", "SCAN_BLIND")

CUT = Effect.TELEOP_SILENT
CUT_BASE = Effect.BLIND | Effect.BASE_HOLDS
HUNG = Effect.SUPERVISOR_SILENT | Effect.BASE_HOLDS
STANDS = Effect.BLIND | Effect.STANDSTILL
BLINDED = Effect.BLIND | Effect.SENSOR
FOREIGN = Effect.SPEAKS_AS_TELEOP

CLASSES = (
    _teleop("sigkill", "SIGKILL", Effect.TELEOP_ENDS, GONE, KILL_BOUND_S, 2, virtual=True),
    _teleop("sigterm", "SIGTERM", Effect.TELEOP_ENDS, GONE, KILL_BOUND_S, 2, virtual=True),
    _teleop(
        "sigstop",
        "SIGSTOP, then SIGCONT",
        Effect.TELEOP_SILENT,
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        3,
        virtual=True,
    ),
    _teleop(
        "blocked",
        "its event loop is blocked for a while",
        Effect.TELEOP_SILENT,
        SILENT,
        SILENT_BOUND_S,
        3,
        virtual=True,
    ),
    _teleop("exception", "an uncaught exception", Effect.TELEOP_SILENT, GONE, None, 2, virtual=False),
    _teleop("hang_up", "its terminal is closed", Effect.TELEOP_SILENT, GONE, None, 2, virtual=False),
    _teleop(
        "end_of_input", "end of its keyboard input", Effect.TELEOP_ENDS, GONE, KILL_BOUND_S, 2, virtual=True
    ),
    _teleop(
        "gil",
        "one of its threads holds the interpreter's lock",
        Effect.TELEOP_SILENT,
        SILENT,
        SILENT_BOUND_S,
        3,
        virtual=True,
    ),
    _supervisor("sigkill", "SIGKILL, then a restart", Effect.SUPERVISOR_ENDS, KILL_BOUND_S),
    _supervisor("sigstop", "SIGSTOP, then SIGCONT", HUNG, HUNG_BASE_BOUND_S),
    _supervisor("blocked", "its event loop is blocked for a while", HUNG, HUNG_BASE_BOUND_S),
    _supervisor(
        "and_teleop_sigkill",
        "SIGKILL of supervisor and teleop together",
        Effect.SUPERVISOR_ENDS,
        KILL_BOUND_S,
    ),
    _supervisor("restart", "it ends and is restarted", Effect.SUPERVISOR_ENDS, KILL_BOUND_S),
    _sim("sigkill", "SIGKILL, then a restart", STANDS, ("SCAN_STALE",), BLIND_BOUND_S),
    _sim("sigstop", "SIGSTOP, then SIGCONT", STANDS, ("SCAN_STALE",), BLIND_BOUND_S),
    _sim(
        "blocked",
        "its event loop is blocked for a while",
        STANDS,
        ("SCAN_STALE",),
        BLIND_BOUND_S,
        virtual=False,
    ),
    _sim("scan_frozen", "the same scan is repeated", Effect.SENSOR, ("SCAN_INVALID",), None),
    _sim("scan_nan", "every beam reads NaN", BLINDED, ("SCAN_INVALID",), BLIND_BOUND_S),
    _sim("scan_blocked", "dirt on the lidar's window", Effect.SENSOR, ("SCAN_BLIND", "SCAN_INVALID"), None),
    _sim("scan_silent", "no scans arrive", BLINDED, ("SCAN_STALE",), BLIND_BOUND_S),
    _sim("scan_rate", "scans arrive at a low rate", Effect.SENSOR, ("SCAN_STALE",), None),
    _sim("odom_gone", "no odometry arrives", Effect.SENSOR, (), None, 6),
    _lidar("dirt", "1 to 20° of NaN straight ahead, with a pillar inside", BARRIER, None, 6),
    _lidar("dropout", "the nearest object is missing from 2 to 30 % of the scans", BARRIER, None, 6),
    _lidar("short", "a range of 0.5 to 1 m, as range_max says", BARRIER, None, 6),
    _lidar("stray", "single false readings near the hull", (), None, 8, Kind.UNHINDERED),
    _lidar(
        "frozen_no_odom",
        "the same scan is repeated, and no odometry arrives",
        ("ODOM_STALE", "SCAN_INVALID"),
        ODOM_BOUND_S,
        5,
        Kind.STOPPED,
    ),
    _lidar(
        "frozen_odom_zero",
        "the same scan is repeated, and odometry reports a standstill",
        ("BASE_UNRESPONSIVE", "SCAN_INVALID"),
        FROZEN_BOUND_S,
        5,
        Kind.STOPPED,
    ),
    _network("cut", "a link is cut permanently", "teleop", SILENT_OR_LOST, SILENT_BOUND_S, effect=CUT),
    _network(
        "cut_base",
        "the sim's link is cut permanently",
        "sim",
        ("SCAN_STALE",),
        BLIND_BOUND_S,
        5,
        effect=CUT_BASE,
    ),
    _network(
        "healed",
        "a link is cut and healed: its backlog arrives in one burst",
        "teleop",
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        effect=CUT,
    ),
    _network(
        "healed_base",
        "the same for the sim's link",
        "sim",
        ("SCAN_STALE",),
        BLIND_BOUND_S,
        5,
        effect=CUT_BASE,
    ),
    _network(
        "delayed",
        "messages are delayed by 50 to 500 ms, with jitter",
        "teleop",
        (),
        None,
        effect=Effect.DELAYED,
    ),
    _network("delayed_base", "the same for the sim's link", "sim", (), None, 6, effect=Effect.DELAYED),
    _network("up_only", "no message reaches teleop", "teleop", ("SOURCE_LOST",), None, 8),
    _network(
        "down_only",
        "no message from teleop arrives",
        "teleop",
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        effect=CUT,
    ),
    _network("base_deaf", "no message reaches the sim", "sim", (), None, 4, effect=HUNG),
    _network(
        "base_mute",
        "no message from the sim arrives",
        "sim",
        ("SCAN_STALE",),
        BLIND_BOUND_S,
        5,
        effect=Effect.BLIND,
    ),
    _network("lossy", "messages are lost at random", "teleop", (), None, 7, real=False),
    _network("reordered", "messages are reordered", "teleop", (), None, 7, real=False),
    _network(
        "flapping",
        "teleop's token disappears and returns within 2 ms",
        "teleop",
        ("SOURCE_LOST",),
        KILL_BOUND_S,
        7,
        effect=Effect.TELEOP_ENDS,
        real=False,
    ),
    _network(
        "unplugged",
        "teleop's cable is unplugged and plugged in again",
        "teleop",
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        effect=CUT,
        virtual=False,
    ),
    _wire("malformed", "random bytes on every key", "", (), 1, FOREIGN),
    _wire("truncated", "truncated messages", "", (), 1, FOREIGN),
    _wire("oversized", "payloads larger than any message", "", (), 1),
    _wire("wrong_type", "messages of another type", "", (), 1, FOREIGN),
    _wire("not_finite", "NaN and infinite values", "", (), 1),
    _wire("huge", "values beyond every robot's limits", "", (), 1),
    _wire(
        "attachments",
        "attachments with other layouts, times and epochs",
        "",
        (),
        7,
        FOREIGN | Effect.TAKES_OVER,
    ),
    _wire("flood", "a burst of a thousand messages", "", (), 1, FOREIGN),
    _wire("rogue_cmd_vel", "a client publishes cmd_vel", "", (), 1),
    _wire(
        "second_teleop", "a second program with teleop's name", "teleop", (), 7, FOREIGN | Effect.TAKES_OVER
    ),
    _wire("second_lidar", "a second client's scans, all NaN", "", (), 8),
    _second_writer(
        "steady", "a second client's scans of free space at 20 Hz; the real lidar pauses for 0.6 s"
    ),
    _second_writer("flood", "the same for 1.5 s at the highest possible rate"),
    _wire("clock_step", "the sender's clock steps", "teleop", (), 7),
    _wire("estop", "an emergency stop, then a reset", "supervisor", ("ESTOP",), 7),
    _estop("teleop"),
    _estop("supervisor"),
    _estop("sim"),
    FaultClass(
        "machine_suspend",
        Group.MACHINE,
        "the machine is suspended, and its monotonic clock with it",
        "",
        ("OVERRUN",),
        TICK_S,
        7,
        virtual=True,
        real=False,
        by_itself=True,
        demands=Kind.NAMED,
    ),
    _machine("cpu_hogs", "eight CPU-bound processes"),
    _machine("memory", "little free memory"),
    _machine("disk", "a full disk"),
    FaultClass(
        "supervisord_sigkill",
        Group.SUPERVISORD,
        "SIGKILL: its children continue; a new supervisord replaces them after 0.5 s",
        "",
        (),
        None,
        8,
        virtual=False,
    ),
    FaultClass(
        "supervisord_restart",
        Group.SUPERVISORD,
        "a restart of all processes",
        "supervisor",
        BASE_ALONE,
        None,
        8,
        virtual=False,
    ),
    FaultClass(
        "supervisord_crash_loop",
        Group.SUPERVISORD,
        "a child that ends at each start",
        "sim",
        NO_VALID_SCAN,
        None,
        8,
        virtual=False,
    ),
    FaultClass("pair", Group.PAIR, "two of these faults together", "", (), None, 8, virtual=True),
)

BY_NAME = {one.name: one for one in CLASSES}
"""The classes by name."""


def virtual_classes() -> tuple[FaultClass, ...]:
    """Return the classes that the virtual campaign mixes at random; pairs consist of these."""
    return tuple(one for one in CLASSES if one.virtual and not one.by_itself and one.group is not Group.PAIR)


def classes_by_themselves() -> tuple[FaultClass, ...]:
    """Return the classes whose virtual trials contain no other fault."""
    return tuple(one for one in CLASSES if one.virtual and one.by_itself)
