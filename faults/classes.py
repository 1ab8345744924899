"""The table of fault classes: the fault, the affected process, the stop reasons that detect it, and the time limit.

A sentence gives the ranges of what is drawn; injection.py draws it for both campaigns. The virtual campaign varies the
length of faults for which the sentence gives none.

The limit is the time from the fault to zero on `cmd_vel`; if the supervisor itself fails, the time until the base
brakes. Without a limit, no stop time is required; the effect may still require a stop.
"""

from dataclasses import KW_ONLY, dataclass
from enum import Flag, StrEnum, auto
from functools import partial

from faults.page import BEAT_S
from faults.promises import KILL_LIMIT_S, Kind
from station.driving import STALE_S
from wire.lease import PRESENCE_PERIOD_S

TICK_S = 0.02
"""The supervisor's tick period."""
COMMAND_TIMEOUT_S = 0.2
SCAN_TIMEOUT_S = 0.25
"""The promised limit; the supervisor's own limit is a little lower, so that zero is sent in time."""
BASE_TIMEOUT_S = 0.15

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
PAGE_BOUND_S = PRESENCE_PERIOD_S + BEAT_S + KILL_LIMIT_S
"""After the page's decision to send garbage: its next message is garbage, and the server acts at its next command at the latest."""
PICTURE_BOUND_S = STALE_S + BEAT_S


class Group(StrEnum):
    """The part of the system in which a fault happens."""

    TELEOP = "teleop"
    SUPERVISOR = "supervisor"
    SENSORS = "sim and sensors"
    ESTOP = "e-stop"
    NETWORK = "network"
    STATION = "station"
    """The operator drives by the page of a station instead of teleop."""
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
    _: KW_ONLY
    group: Group
    promise: int
    """The number of the promise that it tests."""
    detectors: tuple[str, ...] = ()
    """The stop reasons that may detect it; those of the base itself begin with `base: `. Empty: no detection is required."""
    bound_s: float | None = None
    """Of each stop; `KILL_LIMIT_S` is that of the 95 % quantile."""
    effect: Effect = Effect.NONE
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

CUT = Effect.TELEOP_SILENT
FOREIGN = Effect.SPEAKS_AS_TELEOP

_teleop = partial(FaultClass, group=Group.TELEOP, target="teleop")
_teleop_ends = partial(_teleop, promise=2, detectors=GONE, bound_s=KILL_LIMIT_S, effect=Effect.TELEOP_ENDS)
_teleop_fails = partial(_teleop, promise=2, detectors=GONE, effect=CUT, virtual=False)
_teleop_hangs = partial(_teleop, promise=3, bound_s=SILENT_BOUND_S, effect=CUT)
_supervisor = partial(
    FaultClass, group=Group.SUPERVISOR, target="supervisor", promise=4, detectors=BASE_ALONE
)
_supervisor_ends = partial(_supervisor, bound_s=KILL_LIMIT_S, effect=Effect.SUPERVISOR_ENDS)
_supervisor_hangs = partial(
    _supervisor, bound_s=HUNG_BASE_BOUND_S, effect=Effect.SUPERVISOR_SILENT | Effect.BASE_HOLDS
)
_sim = partial(FaultClass, group=Group.SENSORS, target="sim")
_sim_stands = partial(
    _sim, promise=5, detectors=SCAN_STALE, bound_s=BLIND_BOUND_S, effect=Effect.BLIND | Effect.STANDSTILL
)
_scans = partial(_sim, promise=5, effect=Effect.SENSOR)
_no_scans = partial(_sim, promise=5, bound_s=BLIND_BOUND_S, effect=Effect.BLIND | Effect.SENSOR)
_lidar = partial(_sim, by_itself=True, effect=Effect.SENSOR)
_barrier = partial(_lidar, promise=6, detectors=("OBSTACLE", "SCAN_BLIND"))
_frozen = partial(_lidar, promise=5, demands=Kind.STOPPED)
_network = partial(FaultClass, group=Group.NETWORK, target="teleop")
_cut = partial(_network, promise=3, detectors=SILENT_OR_LOST, bound_s=SILENT_BOUND_S, effect=CUT)
_base_network = partial(FaultClass, group=Group.NETWORK, target="sim")
_cut_base = partial(
    _base_network,
    promise=5,
    detectors=SCAN_STALE,
    bound_s=BLIND_BOUND_S,
    effect=Effect.BLIND | Effect.BASE_HOLDS,
)
_station = partial(FaultClass, group=Group.STATION, target="teleop", by_itself=True)
_station_ends = partial(_station, promise=2, detectors=GONE, bound_s=KILL_LIMIT_S, effect=Effect.TELEOP_ENDS)
_station_hangs = partial(
    _station, promise=3, detectors=SILENT_OR_LOST, bound_s=SILENT_BOUND_S, effect=Effect.TELEOP_SILENT
)
_wire = partial(FaultClass, group=Group.WIRE)
_second_writer = partial(
    _wire,
    promise=5,
    detectors=("SENSOR_CONFLICT",),
    bound_s=BLIND_BOUND_S,
    by_itself=True,
    demands=Kind.NAMED,
)
_machine = partial(FaultClass, group=Group.MACHINE)
_supervisord = partial(FaultClass, group=Group.SUPERVISORD, virtual=False, promise=8)


def _estop(node: str) -> FaultClass:
    return FaultClass(
        f"estop_{node}_sigkill",
        f"an e-stop, then SIGKILL of {node} within 0.3 s: only a reset ends the stop",
        group=Group.ESTOP,
        promise=7,
        detectors=("ESTOP",),
        bound_s=ESTOP_BOUND_S,
        target=node,
        by_itself=True,
        demands=Kind.ZERO,
    )


PAIR = "pair"
"""The class of two faults together."""

CLASSES = (
    _teleop_ends("teleop_sigkill", "SIGKILL"),
    _teleop_ends("teleop_sigterm", "SIGTERM"),
    _teleop_hangs("teleop_sigstop", "SIGSTOP, then SIGCONT", detectors=SILENT_OR_LOST),
    _teleop_hangs("teleop_blocked", "its event loop is blocked for a while", detectors=SILENT),
    _teleop_fails("teleop_exception", "an uncaught exception"),
    _teleop_fails("teleop_hang_up", "its terminal is closed"),
    _teleop_ends("teleop_end_of_input", "end of its keyboard input"),
    _teleop_hangs("teleop_gil", "one of its threads holds the interpreter's lock", detectors=SILENT),
    _supervisor_ends("supervisor_sigkill", "SIGKILL, then a restart"),
    _supervisor_hangs("supervisor_sigstop", "SIGSTOP, then SIGCONT"),
    _supervisor_hangs(
        "supervisor_blocked",
        "its event loop is blocked, its interpreter's lock is held, or a decided motion is sent late",
    ),
    _supervisor_ends("supervisor_and_teleop_sigkill", "SIGKILL of supervisor and teleop together"),
    _supervisor_ends("supervisor_restart", "it ends by SIGTERM or by an exception, and is restarted"),
    _sim_stands("sim_sigkill", "SIGKILL, then a restart"),
    _sim_stands("sim_sigstop", "SIGSTOP, then SIGCONT"),
    _sim_stands("sim_blocked", "its event loop is blocked, or its interpreter's lock is held", virtual=False),
    _scans("sim_scan_frozen", "the same scan is repeated", detectors=SCAN_INVALID),
    _no_scans("sim_scan_nan", "every beam reads NaN", detectors=SCAN_INVALID),
    _scans(
        "sim_scan_blocked",
        "dirt on 20 to 120° of the lidar's window, at least half of the time straight ahead",
        detectors=("SCAN_BLIND", "SCAN_INVALID"),
    ),
    _no_scans("sim_scan_silent", "no scans arrive", detectors=SCAN_STALE),
    _scans("sim_scan_rate", "scans arrive at 1 to 14 Hz", detectors=SCAN_STALE),
    _sim("sim_odom_gone", "no odometry arrives", promise=6, effect=Effect.SENSOR),
    _barrier("sim_scan_dirt", "1 to 20° of NaN straight ahead, with a pillar inside"),
    _barrier("sim_scan_dropout", "the nearest object is missing from 2 to 30 % of the scans"),
    _barrier("sim_scan_short", "a maximum range of 0.5 to 1 m, given in range_max"),
    _lidar(
        "sim_scan_stray",
        "single false readings near the hull, in 4 % of the scans",
        promise=8,
        demands=Kind.UNHINDERED,
    ),
    _frozen(
        "sim_scan_frozen_no_odom",
        "the same scan is repeated, and no odometry arrives",
        detectors=("ODOM_STALE", "SCAN_INVALID"),
        bound_s=ODOM_BOUND_S,
    ),
    _frozen(
        "sim_scan_frozen_odom_zero",
        "the same scan is repeated, and odometry reports a standstill",
        detectors=("BASE_UNRESPONSIVE", "SCAN_INVALID"),
        bound_s=FROZEN_BOUND_S,
    ),
    _cut("net_cut", "a link is cut; with real processes for 1.5 s"),
    _cut_base("net_cut_base", "the same for the sim's link"),
    _cut("net_healed", "a link is cut and healed after 0.3, 1 or 3 s: its backlog arrives in one burst"),
    _cut_base("net_healed_base", "the same for the sim's link"),
    _network(
        "net_delayed", "messages are delayed by 50 to 500 ms, with jitter", promise=3, effect=Effect.DELAYED
    ),
    _base_network("net_delayed_base", "the same for the sim's link", promise=6, effect=Effect.DELAYED),
    _network("net_up_only", "no message reaches teleop", promise=8, detectors=("SOURCE_LOST",)),
    _cut("net_down_only", "no message from teleop arrives"),
    _base_network(
        "net_base_deaf",
        "no message reaches the sim",
        promise=4,
        effect=Effect.SUPERVISOR_SILENT | Effect.BASE_HOLDS,
    ),
    _cut_base("net_base_mute", "no message from the sim arrives", effect=Effect.BLIND),
    _network("net_lossy", "10 to 80 % of the messages are lost", promise=7, real=False),
    _network("net_reordered", "messages are reordered within 50 to 250 ms", promise=7, real=False),
    _network(
        "net_flapping",
        "teleop's token disappears and returns within 2 ms",
        promise=7,
        detectors=("SOURCE_LOST",),
        bound_s=KILL_LIMIT_S,
        effect=Effect.TELEOP_ENDS,
        real=False,
    ),
    _cut("net_unplugged", "teleop's cable is unplugged, and plugged in after 0.3, 1 or 3 s", virtual=False),
    _station_ends("station_sigkill", "a page drives; SIGKILL of its server"),
    _station_hangs("station_sigstop", "a page drives; SIGSTOP of its server, then SIGCONT"),
    _station_ends("station_page_sigkill", "SIGKILL of the page that drives: its connections end"),
    _station_hangs(
        "station_page_sigstop", "SIGSTOP of the page that drives, then SIGCONT: its connections last"
    ),
    _station(
        "station_page_frozen",
        "the page that drives names the same picture with all its commands",
        promise=3,
        bound_s=PICTURE_BOUND_S,
        demands=Kind.ZERO,
    ),
    _station(
        "station_page_garbage",
        "the page that drives sends garbage to its server",
        promise=2,
        bound_s=PAGE_BOUND_S,
        demands=Kind.ZERO,
    ),
    _supervisor_ends(
        "station_supervisor_sigkill",
        "a page drives; SIGKILL of the supervisor, then a restart",
        group=Group.STATION,
        by_itself=True,
    ),
    _wire("wire_malformed", "random bytes on every key, at 400 Hz", promise=1, effect=FOREIGN),
    _wire("wire_truncated", "truncated messages, at 400 Hz", promise=1, effect=FOREIGN),
    _wire("wire_oversized", "payloads of up to 3 MiB, at 20 Hz", promise=1),
    _wire("wire_wrong_type", "messages of another type, at 400 Hz", promise=1, effect=FOREIGN),
    _wire("wire_not_finite", "NaN and infinite values, at 400 Hz", promise=1),
    _wire("wire_huge", "values beyond every robot's limits, at 400 Hz", promise=1),
    _wire(
        "wire_attachments",
        "replayed messages, and attachments with other layouts, times and epochs, at 400 Hz",
        promise=7,
        effect=FOREIGN | Effect.TAKES_OVER,
    ),
    _wire(
        "wire_flood",
        "valid messages of one kind at up to 10 kHz for 0.5 to 1 s: up to 10,000 messages",
        promise=1,
        effect=FOREIGN,
    ),
    _wire("wire_rogue_cmd_vel", "a client publishes cmd_vel, at 400 Hz", promise=1),
    _wire(
        "wire_second_teleop",
        "a second program with teleop's name",
        promise=7,
        effect=FOREIGN | Effect.TAKES_OVER,
        target="teleop",
    ),
    _wire("wire_second_lidar", "a second client's scans, all NaN, at 20 Hz", promise=8),
    _second_writer(
        "wire_second_lidar_steady",
        "a second client's scans of free space at 20 Hz; the real lidar pauses for 0.6 s",
    ),
    _second_writer("wire_second_lidar_flood", "the same at up to 2 kHz for 1.5 s"),
    _wire(
        "wire_clock_step",
        "its clock, or the sim's, steps by 0.05 s to 1 h, forward or back, and returns",
        promise=7,
        target="teleop",
    ),
    _wire(
        "wire_estop", "an emergency stop, then a reset", promise=7, detectors=("ESTOP",), target="supervisor"
    ),
    *(_estop(node) for node in ("teleop", "supervisor", "sim")),
    _machine(
        "machine_suspend",
        "the machine is suspended for 0.2 to 60 s, and its monotonic clock with it",
        promise=7,
        detectors=("OVERRUN",),
        bound_s=TICK_S,
        real=False,
        by_itself=True,
        demands=Kind.NAMED,
    ),
    _machine("machine_cpu_hogs", "eight CPU-bound processes", promise=8, virtual=False),
    _machine("machine_memory", "little free memory", promise=8, virtual=False),
    _machine("machine_disk", "a full disk", promise=8, virtual=False),
    _supervisord(
        "supervisord_sigkill", "SIGKILL: its children continue; a new supervisord replaces them after 0.5 s"
    ),
    _supervisord(
        "supervisord_restart", "a restart of all processes", detectors=BASE_ALONE, target="supervisor"
    ),
    _supervisord(
        "supervisord_crash_loop",
        "a child that ends at each start, for 1 to 2 s",
        detectors=("SCAN_STALE", "SCAN_INVALID"),
        target="sim",
    ),
    FaultClass(PAIR, "two of these faults together", group=Group.PAIR, promise=8),
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
