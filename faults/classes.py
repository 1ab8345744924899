"""The table of fault classes: the fault, the affected process, the stop reasons that detect it, and the time limit.

A sentence gives the ranges of what is drawn; injection.py draws it for both campaigns. The virtual campaign varies the
length of faults for which the sentence gives none.

The limit is the time from the fault to zero on `cmd_vel`; if the supervisor itself fails, the time until the base
brakes. Without a limit, no stop time is required; the effect may still require a stop.
"""

from dataclasses import KW_ONLY, dataclass
from enum import Flag, StrEnum, auto
from functools import partial

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
    does: str
    """The fault and its ranges, in a few words."""
    detectors: tuple[str, ...]
    """The stop reasons that may detect it; those of the base itself begin with `base: `. Empty: no detection is required."""
    bound_s: float | None
    promise: int
    """The number of the promise that it tests."""
    effect: Effect = Effect.NONE
    _: KW_ONLY
    group: Group
    target: str = ""
    """The affected process; empty: none in particular."""
    virtual: bool = True
    """Whether it can be injected on the virtual clock."""
    real: bool = True
    """Whether it can be injected into real processes without special rights."""
    by_itself: bool = False
    """Whether its virtual trials contain no other fault; such a class is never part of a pair."""
    demands: Kind | None = None
    """The demand for its own trials, in addition to the promises for every run."""


SILENT = ("COMMAND_TIMEOUT", "COMMAND_STALE")
SILENT_OR_LOST = (*SILENT, "SOURCE_LOST")
GONE = ("SOURCE_LOST", "NO_COMMAND")
"""NO_COMMAND if the source sent zero before its token was deleted, else SOURCE_LOST."""
BASE_ALONE = ("base: SUPERVISOR_LOST", "base: COMMAND_TIMEOUT")
SCAN_STALE = ("SCAN_STALE",)
SCAN_INVALID = ("SCAN_INVALID",)
BARRIER = ("OBSTACLE", "SCAN_BLIND")

ENDS, CUT = Effect.TELEOP_ENDS, Effect.TELEOP_SILENT
CUT_BASE = Effect.BLIND | Effect.BASE_HOLDS
HUNG = Effect.SUPERVISOR_SILENT | Effect.BASE_HOLDS
STANDS = Effect.BLIND | Effect.STANDSTILL
BLINDED = Effect.BLIND | Effect.SENSOR
FOREIGN = Effect.SPEAKS_AS_TELEOP
POSES = FOREIGN | Effect.TAKES_OVER

_teleop = partial(FaultClass, group=Group.TELEOP, target="teleop")
_supervisor = partial(FaultClass, group=Group.SUPERVISOR, target="supervisor")
_sim = partial(FaultClass, group=Group.SENSORS, target="sim")
_lidar = partial(_sim, by_itself=True, effect=Effect.SENSOR)
_network = partial(FaultClass, group=Group.NETWORK, target="teleop")
_base_network = partial(FaultClass, group=Group.NETWORK, target="sim")
_wire = partial(FaultClass, group=Group.WIRE)
_second_writer = partial(_wire, by_itself=True, demands=Kind.NAMED)
_machine = partial(FaultClass, group=Group.MACHINE)
_supervisord = partial(FaultClass, group=Group.SUPERVISORD, virtual=False)


def _estop(node: str) -> FaultClass:
    return FaultClass(
        f"estop_{node}_sigkill",
        f"an e-stop, then SIGKILL of {node} within 0.3 s: only a reset ends the stop",
        ("ESTOP",),
        ESTOP_BOUND_S,
        7,
        group=Group.ESTOP,
        target=node,
        by_itself=True,
        demands=Kind.ZERO,
    )


PAIR = "pair"
"""The class of two faults together."""

CLASSES = (
    _teleop("teleop_sigkill", "SIGKILL", GONE, KILL_BOUND_S, 2, ENDS),
    _teleop("teleop_sigterm", "SIGTERM", GONE, KILL_BOUND_S, 2, ENDS),
    _teleop("teleop_sigstop", "SIGSTOP, then SIGCONT", SILENT_OR_LOST, SILENT_BOUND_S, 3, CUT),
    _teleop("teleop_blocked", "its event loop is blocked for a while", SILENT, SILENT_BOUND_S, 3, CUT),
    _teleop("teleop_exception", "an uncaught exception", GONE, None, 2, CUT, virtual=False),
    _teleop("teleop_hang_up", "its terminal is closed", GONE, None, 2, CUT, virtual=False),
    _teleop("teleop_end_of_input", "end of its keyboard input", GONE, KILL_BOUND_S, 2, ENDS),
    _teleop("teleop_gil", "one of its threads holds the interpreter's lock", SILENT, SILENT_BOUND_S, 3, CUT),
    _supervisor(
        "supervisor_sigkill", "SIGKILL, then a restart", BASE_ALONE, KILL_BOUND_S, 4, Effect.SUPERVISOR_ENDS
    ),
    _supervisor("supervisor_sigstop", "SIGSTOP, then SIGCONT", BASE_ALONE, HUNG_BASE_BOUND_S, 4, HUNG),
    _supervisor(
        "supervisor_blocked",
        "its event loop is blocked, its interpreter's lock is held, or a decided motion is sent late",
        BASE_ALONE,
        HUNG_BASE_BOUND_S,
        4,
        HUNG,
    ),
    _supervisor(
        "supervisor_and_teleop_sigkill",
        "SIGKILL of supervisor and teleop together",
        BASE_ALONE,
        KILL_BOUND_S,
        4,
        Effect.SUPERVISOR_ENDS,
    ),
    _supervisor(
        "supervisor_restart",
        "it ends by SIGTERM or by an exception, and is restarted",
        BASE_ALONE,
        KILL_BOUND_S,
        4,
        Effect.SUPERVISOR_ENDS,
    ),
    _sim("sim_sigkill", "SIGKILL, then a restart", SCAN_STALE, BLIND_BOUND_S, 5, STANDS),
    _sim("sim_sigstop", "SIGSTOP, then SIGCONT", SCAN_STALE, BLIND_BOUND_S, 5, STANDS),
    _sim(
        "sim_blocked",
        "its event loop is blocked, or its interpreter's lock is held",
        SCAN_STALE,
        BLIND_BOUND_S,
        5,
        STANDS,
        virtual=False,
    ),
    _sim("sim_scan_frozen", "the same scan is repeated", SCAN_INVALID, None, 5, Effect.SENSOR),
    _sim("sim_scan_nan", "every beam reads NaN", SCAN_INVALID, BLIND_BOUND_S, 5, BLINDED),
    _sim(
        "sim_scan_blocked",
        "dirt on 20 to 120° of the lidar's window, at least half of the time straight ahead",
        ("SCAN_BLIND", "SCAN_INVALID"),
        None,
        5,
        Effect.SENSOR,
    ),
    _sim("sim_scan_silent", "no scans arrive", SCAN_STALE, BLIND_BOUND_S, 5, BLINDED),
    _sim("sim_scan_rate", "scans arrive at 1 to 14 Hz", SCAN_STALE, None, 5, Effect.SENSOR),
    _sim("sim_odom_gone", "no odometry arrives", (), None, 6, Effect.SENSOR),
    _lidar("sim_scan_dirt", "1 to 20° of NaN straight ahead, with a pillar inside", BARRIER, None, 6),
    _lidar("sim_scan_dropout", "the nearest object is missing from 2 to 30 % of the scans", BARRIER, None, 6),
    _lidar("sim_scan_short", "a range of 0.5 to 1 m, as range_max says", BARRIER, None, 6),
    _lidar(
        "sim_scan_stray",
        "single false readings near the hull, in 4 % of the scans",
        (),
        None,
        8,
        demands=Kind.UNHINDERED,
    ),
    _lidar(
        "sim_scan_frozen_no_odom",
        "the same scan is repeated, and no odometry arrives",
        ("ODOM_STALE", "SCAN_INVALID"),
        ODOM_BOUND_S,
        5,
        demands=Kind.STOPPED,
    ),
    _lidar(
        "sim_scan_frozen_odom_zero",
        "the same scan is repeated, and odometry reports a standstill",
        ("BASE_UNRESPONSIVE", "SCAN_INVALID"),
        FROZEN_BOUND_S,
        5,
        demands=Kind.STOPPED,
    ),
    _network(
        "net_cut", "a link is cut; with real processes for 1.5 s", SILENT_OR_LOST, SILENT_BOUND_S, 3, CUT
    ),
    _base_network("net_cut_base", "the same for the sim's link", SCAN_STALE, BLIND_BOUND_S, 5, CUT_BASE),
    _network(
        "net_healed",
        "a link is cut and healed after 0.3, 1 or 3 s: its backlog arrives in one burst",
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        3,
        CUT,
    ),
    _base_network("net_healed_base", "the same for the sim's link", SCAN_STALE, BLIND_BOUND_S, 5, CUT_BASE),
    _network("net_delayed", "messages are delayed by 50 to 500 ms, with jitter", (), None, 3, Effect.DELAYED),
    _base_network("net_delayed_base", "the same for the sim's link", (), None, 6, Effect.DELAYED),
    _network("net_up_only", "no message reaches teleop", ("SOURCE_LOST",), None, 8),
    _network("net_down_only", "no message from teleop arrives", SILENT_OR_LOST, SILENT_BOUND_S, 3, CUT),
    _base_network("net_base_deaf", "no message reaches the sim", (), None, 4, HUNG),
    _base_network(
        "net_base_mute", "no message from the sim arrives", SCAN_STALE, BLIND_BOUND_S, 5, Effect.BLIND
    ),
    _network("net_lossy", "10 to 80 % of the messages are lost", (), None, 7, real=False),
    _network("net_reordered", "messages are reordered within 50 to 250 ms", (), None, 7, real=False),
    _network(
        "net_flapping",
        "teleop's token disappears and returns within 2 ms",
        ("SOURCE_LOST",),
        KILL_BOUND_S,
        7,
        ENDS,
        real=False,
    ),
    _network(
        "net_unplugged",
        "teleop's cable is unplugged, and plugged in after 0.3, 1 or 3 s",
        SILENT_OR_LOST,
        SILENT_BOUND_S,
        3,
        CUT,
        virtual=False,
    ),
    _wire("wire_malformed", "random bytes on every key, at 400 Hz", (), None, 1, FOREIGN),
    _wire("wire_truncated", "truncated messages, at 400 Hz", (), None, 1, FOREIGN),
    _wire("wire_oversized", "payloads of up to 3 MiB, at 20 Hz", (), None, 1),
    _wire("wire_wrong_type", "messages of another type, at 400 Hz", (), None, 1, FOREIGN),
    _wire("wire_not_finite", "NaN and infinite values, at 400 Hz", (), None, 1),
    _wire("wire_huge", "values beyond every robot's limits, at 400 Hz", (), None, 1),
    _wire(
        "wire_attachments",
        "replayed messages, and attachments with other layouts, times and epochs, at 400 Hz",
        (),
        None,
        7,
        POSES,
    ),
    _wire(
        "wire_flood",
        "valid messages of one kind at up to 10 kHz for 0.5 to 1 s: up to 10,000 messages",
        (),
        None,
        1,
        FOREIGN,
    ),
    _wire("wire_rogue_cmd_vel", "a client publishes cmd_vel, at 400 Hz", (), None, 1),
    _wire("wire_second_teleop", "a second program with teleop's name", (), None, 7, POSES, target="teleop"),
    _wire("wire_second_lidar", "a second client's scans, all NaN, at 20 Hz", (), None, 8),
    _second_writer(
        "wire_second_lidar_steady",
        "a second client's scans of free space at 20 Hz; the real lidar pauses for 0.6 s",
        ("SENSOR_CONFLICT",),
        BLIND_BOUND_S,
        5,
    ),
    _second_writer(
        "wire_second_lidar_flood",
        "the same at up to 2 kHz for 1.5 s",
        ("SENSOR_CONFLICT",),
        BLIND_BOUND_S,
        5,
    ),
    _wire(
        "wire_clock_step",
        "its clock, or the sim's, steps by 0.05 s to 1 h, forward or back, and returns",
        (),
        None,
        7,
        target="teleop",
    ),
    _wire("wire_estop", "an emergency stop, then a reset", ("ESTOP",), None, 7, target="supervisor"),
    *(_estop(node) for node in ("teleop", "supervisor", "sim")),
    _machine(
        "machine_suspend",
        "the machine is suspended for 0.2 to 60 s, and its monotonic clock with it",
        ("OVERRUN",),
        TICK_S,
        7,
        real=False,
        by_itself=True,
        demands=Kind.NAMED,
    ),
    _machine("machine_cpu_hogs", "eight CPU-bound processes", (), None, 8, virtual=False),
    _machine("machine_memory", "little free memory", (), None, 8, virtual=False),
    _machine("machine_disk", "a full disk", (), None, 8, virtual=False),
    _supervisord(
        "supervisord_sigkill",
        "SIGKILL: its children continue; a new supervisord replaces them after 0.5 s",
        (),
        None,
        8,
    ),
    _supervisord(
        "supervisord_restart", "a restart of all processes", BASE_ALONE, None, 8, target="supervisor"
    ),
    _supervisord(
        "supervisord_crash_loop",
        "a child that ends at each start, for 1 to 2 s",
        ("SCAN_STALE", "SCAN_INVALID"),
        None,
        8,
        target="sim",
    ),
    FaultClass(PAIR, "two of these faults together", (), None, 8, group=Group.PAIR),
)

BY_NAME = {one.name: one for one in CLASSES}
"""The classes by name."""


def real_classes() -> tuple[FaultClass, ...]:
    """Return the classes of the real campaign, including pairs."""
    return tuple(one for one in CLASSES if one.real)


def virtual_classes() -> tuple[FaultClass, ...]:
    """Return the classes that the virtual campaign mixes at random; pairs consist of these."""
    return tuple(one for one in CLASSES if one.virtual and not one.by_itself and one.group is not Group.PAIR)


def classes_by_themselves() -> tuple[FaultClass, ...]:
    """Return the classes whose virtual trials contain no other fault."""
    return tuple(one for one in CLASSES if one.virtual and one.by_itself)
