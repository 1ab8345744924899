"""Convert wire messages to the law's inputs, and decisions to wire messages. No decision is made here."""

import math
from collections import deque
from collections.abc import Sequence

from supervisor.law.decision import Decision
from supervisor.law.estop_stations import Presence, Station
from supervisor.law.interlock import Source
from supervisor.law.model import Command, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.scan import LaserScan
from wire import cdr
from wire import messages as ros
from wire.access import NODE_TOKENS
from wire.bus import Arrival
from wire.freshness import Sent
from wire.header_clock import SIMULATED_BEFORE_NS, WINDOW_S, HeaderClock
from wire.stamp import Stamp

HEADER_EPOCH = b"header"
"""Epoch of scans whose only stamp is in their header."""
MAX_TOKENS = 256
MAX_NAMES = 8
MAX_NAME_LENGTH = 64


def to_command(source: str, arrival: Arrival[ros.Twist]) -> Command:
    twist = arrival.message
    velocity = None if twist is None else planar(twist)
    return Command(
        source, velocity, arrival.arrival_s, None if arrival.stamp is None else arrival.stamp.sent()
    )


def planar(twist: ros.Twist) -> Velocity | None:
    """Return the planar velocity; None if the Twist has other components that are not zero, NaN included."""
    others = (twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y)
    if any(value != 0.0 for value in others):
        return None
    return Velocity(twist.linear.x, twist.angular.z)


def to_scan(arrival: Arrival[ros.LaserScan], header_tolerance_s: float, lidar: int = 0) -> LaserScan | None:
    """Return the scan with the stamp of its attachment, else of its header; None if it is undecodable.

    Args:
        arrival: the received message.
        header_tolerance_s: tolerance for the clock of the header's stamp.
        lidar: index of the lidar in the configuration.
    """
    scan = arrival.message
    if scan is None:
        return None
    stamp = scan.header.stamp
    sent, tolerance_s = None, None
    if arrival.stamp is not None:
        sent = arrival.stamp.sent()
    elif stamp.sec or stamp.nanosec:
        # A header has no sequence number: the arrival time in microseconds, which only increases, replaces it.
        sequence = round(arrival.arrival_s * 1e6)
        sent = Sent(HEADER_EPOCH, sequence, stamp.sec + stamp.nanosec * 1e-9)
        tolerance_s = header_tolerance_s
    return LaserScan(
        scan.ranges,
        scan.angle_min,
        scan.angle_increment,
        scan.range_min,
        scan.range_max,
        arrival.arrival_s,
        sent,
        tolerance_s,
        scan.angle_max,
        lidar,
        _writer_of(arrival.stamp, scan.header.frame_id),
    )


class ScanHeaders:
    """Finds stamps of scans' headers that do not run like real time, for the status; it ignores scans with an attachment.

    Args:
        lidars: the names of the lidars.
    """

    def __init__(self, lidars: Sequence[str]) -> None:
        self._clocks = [(name, HeaderClock()) for name in lidars]

    def hear(self, lidar: int, arrivals: Sequence[Arrival[ros.LaserScan]]) -> None:
        """Process the scans of one lidar, given by its index."""
        for scan, arrival_s, attachment in arrivals:
            if scan is not None:
                stamp = scan.header.stamp
                stamp_ns = cdr.ns_of(stamp.sec, stamp.nanosec) if attachment is None else 0
                self._clocks[lidar][1].hear(stamp_ns, arrival_s)

    @property
    def problem(self) -> str:
        """Why scans that arrive are too old; empty if their stamps do not show it."""
        return "; ".join(
            f"the stamps of the {name}'s scans {clock.problem}"
            for name, clock in self._clocks
            if clock.problem
        )


class CommandStamps:
    """Finds stamps of commands that do not run like real time, for the status.

    Args:
        sources: the names of the sources.
    """

    def __init__(self, sources: Sequence[str]) -> None:
        self._clocks = {name: (HeaderClock(), deque[float](maxlen=1)) for name in sources}
        """By source, with the arrival of the newest command."""

    def hear(self, source: str, arrivals: Sequence[Arrival[ros.Twist]]) -> None:
        """Process the commands of one source."""
        clock, newest_s = self._clocks[source]
        for _, arrival_s, stamp in arrivals:
            if stamp is not None:
                # The clock of a source may count from its start: that is no simulation.
                clock.hear(stamp.source_time_ns + SIMULATED_BEFORE_NS, arrival_s)
                newest_s.append(arrival_s)

    def problem(self, now_s: float) -> str:
        """Why commands that arrive now are refused; empty if their stamps do not show it."""
        return "; ".join(
            f"the stamps of {name}'s commands {clock.problem}"
            for name, (clock, newest_s) in self._clocks.items()
            if clock.problem and now_s - newest_s[0] <= WINDOW_S
        )


def _writer_of(stamp: Stamp | None, frame_id: str) -> bytes:
    """Return the identity of a sample's sender: the gid of the attachment, else the frame id."""
    return b"frame " + frame_id.encode()[:32] if stamp is None else stamp.gid


def to_odometry(arrival: Arrival[ros.Motion]) -> Odometry | None:
    """Return the base's velocity with its arrival time and sender; None if it is not finite."""
    motion = arrival.message
    if motion is None or not (math.isfinite(motion.linear_m_s) and math.isfinite(motion.angular_rad_s)):
        return None
    velocity = Velocity(motion.linear_m_s, motion.angular_rad_s)
    return Odometry(velocity, arrival.arrival_s, _writer_of(arrival.stamp, motion.frame_id))


def to_presence(station: str, arrival: Arrival[ros.EstopLease]) -> Presence | None:
    """Return a station's message; None if it is undecodable: the next one has the state of its button as well."""
    lease = arrival.message
    if lease is None:
        return None
    epoch = b"" if arrival.stamp is None else arrival.stamp.gid
    return Presence(station, lease.challenge, lease.response, lease.stop, lease.leaves, epoch)


def to_challenge(station: Station, number: int, *, is_stopped: bool) -> ros.EstopLease:
    return ros.EstopLease(number, station.challenge, stop=is_stopped)


def to_twist(velocity: Velocity) -> ros.Twist:
    return ros.planar_twist(velocity.linear_m_s, velocity.angular_rad_s)


class ForeignNodes:
    """The ROS 2 nodes on the hub that use the keys of rmw_zenoh, by their liveliness tokens: at most `MAX_TOKENS`.

    Lifeline does not read their topics on the hub: rmw_zenoh adds domain, type and type hash to each key, so a command of
    such a node has no effect.
    """

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        """By token."""

    def change(self, token: str, *, alive: bool) -> None:
        """Process a token that appeared or disappeared."""
        name = _name_in(token)
        if not alive:
            self._names.pop(token, None)
        elif name is not None and len(self._names) < MAX_TOKENS:
            self._names[token] = name

    def names(self) -> list[str]:
        """Return up to `MAX_NAMES` names such as "/robot/planner", sorted; a last entry counts the others."""
        names = sorted(set(self._names.values()))
        more = len(names) - MAX_NAMES
        return [*names[:MAX_NAMES], f"and {more} more"] if more > 0 else names


def _name_in(token: str) -> str | None:
    """Return the name of a token's node with its namespace; None if it is not the token of a node."""
    chunks = token.split("/")
    if len(chunks) != len(NODE_TOKENS.split("/")):
        return None
    namespace, name = (chunk.replace("%", "/").strip("/") for chunk in chunks[-2:])
    return f"/{namespace}/{name}".replace("//", "/")[:MAX_NAME_LENGTH]


def to_status(
    decision: Decision, now_s: float, estop_record_problem: str = "", rmw_zenoh_nodes: Sequence[str] = ()
) -> ros.SafetyStatus:
    return ros.SafetyStatus(
        header=ros.header("base_link"),
        mode=int(decision.mode),
        reasons=[reason.value for reason in decision.reasons],
        warning=decision.warning,
        alarm=decision.alarm,
        owner=decision.owner,
        commanded=to_twist(decision.commanded),
        permitted=to_twist(decision.output),
        scale=decision.scale,
        nearest_m=decision.nearest_m,
        nearest_bearing_rad=decision.nearest_bearing_rad,
        scan_age_s=decision.scan_age_s,
        scan_problem=decision.scan_problem,
        scans_accepted=decision.scan_counts.accepted,
        scans_refused=decision.scan_counts.late + decision.scan_counts.sequence + decision.scan_counts.epoch,
        unknown_sources=list(decision.strangers),
        sources=[_source_status(source, now_s) for source in decision.sources],
        causes=[reason.value for reason in (*decision.causes, *([decision.limit] if decision.limit else []))],
        latched=[reason.value for reason in decision.latched],
        detail=decision.detail,
        estop_record_problem=estop_record_problem,
        rmw_zenoh_nodes=list(rmw_zenoh_nodes),
        estop_stations=[
            ros.EstopStationStatus(s.config.name, s.config.required, int(s.phase), s.pressed)
            for s in decision.stations
        ],
        source_times=[_source_time(source) for source in decision.sources],
    )


def _source_time(source: Source) -> ros.Time:
    last = source.track.last
    # Any client can fill the 64 bits of a stamp; the seconds of a ROS time have 31.
    if not source.stamped or last is None or not 0.0 <= last.source_time_s < 2**31:
        return ros.Time(0, 0)
    return ros.Time(*cdr.time_of(round(last.source_time_s * 1e9)))


def _source_status(source: Source, now_s: float) -> ros.SourceStatus:
    liveliness = {
        None: ros.SourceStatus.UNKNOWN,
        True: ros.SourceStatus.ALIVE,
        False: ros.SourceStatus.LOST,
    }[source.alive]
    return ros.SourceStatus(
        name=source.config.name,
        priority=source.config.priority,
        liveliness=liveliness,
        armed=source.armed,
        neutral=source.neutral,
        stamped=source.stamped,
        age_s=math.nan if source.velocity is None else now_s - source.sent_s,
        reasons=sorted(reason.value for reason in source.latched),
        accepted=source.counts.accepted,
        refused_late=source.counts.late,
        refused_sequence=source.counts.sequence,
        refused_epoch=source.counts.epoch,
        refused_invalid=source.counts.invalid,
    )
