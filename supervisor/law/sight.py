"""What the lidars show: the newest scan of each, the memory of near points, and the places that no lidar sees.

The functions of `Sight` are called in this order at each step: `see`, `usable`, `seek_hidden`, `causes`.
"""

import math
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from supervisor.law.agreement import Agreement, agree, repeat
from supervisor.law.base import Base, measured_stop
from supervisor.law.base_motion import moves
from supervisor.law.clearance import NO_POINTS, Block, Floats, Kind, moved, nothing_around, survey
from supervisor.law.model import Counts, LawConfig
from supervisor.law.near_memory import Remembered, remember
from supervisor.law.own_parts import own_sector
from supervisor.law.own_way import Stand, own_way, went
from supervisor.law.reach import Place
from supervisor.law.reckoning import Odometer, Pose, back_then, between, displacement
from supervisor.law.scan import LaserScan, Lidar, Moment, ScanReading, View, read_scan
from supervisor.law.seen_space import Evidence, hidden_places, lookout
from supervisor.law.slip import NO_MEASUREMENT, SlipMeasurement, measure_slip
from supervisor.law.writers import Sensor, Writer, heard
from wire.freshness import FALL_TOLERANCE_S, Track, Verdict, judge
from wire.reasons import StopReason

SAME_PLACE_M = 0.15
"""A return within this distance of an earlier one is from the same object; covers a walking person."""

SAME_DEPTH_M = 0.003
"""A return that is less than this farther from the hull than another one is as near."""

PAST_VIEWS = 10


class Past(NamedTuple):
    """A recent view of one lidar, for places that are no longer in view."""

    lidar: str
    view: View


class LidarState(NamedTuple):
    """State of one lidar."""

    scan: ScanReading | None = None
    track: Track = Track()
    counts: Counts = Counts()
    writers: tuple[Writer, ...] = ()
    earlier: Floats = NO_POINTS
    """(n, 2) [m]: near points of the scans before the newest, in the newest scan's base frame; it may show them again."""
    agreement: Agreement = Agreement()
    """Whether its scans agree with the motion of the robot."""
    slip: SlipMeasurement = NO_MEASUREMENT
    """How much farther than odometry shows the robot moves during the present stop."""


class Sight(NamedTuple):
    """State of all lidars."""

    lidars: tuple[LidarState, ...] = ()
    """One for each configured lidar."""
    memory: Remembered = Remembered()
    """Near points of earlier scans."""
    memory_pose: Pose = Odometer().pose
    """The odometer pose that is the frame of `memory`."""
    past: tuple[Past, ...] = ()
    """Views of the last `unseen_memory_s`."""
    way: tuple[Stand, ...] = ()
    """The hull's poses of the last `unseen_memory_s`."""
    places: tuple[Place, ...] = ()
    """The remembered points and the hidden places."""
    looking: tuple[int, ...] = ()
    """Indices of the lidars from whose scans the hidden places were computed."""


Usable = Sequence[tuple[int, ScanReading]]
"""Pairs of a lidar's index in the configuration and its newest scan."""


def suspended(sight: Sight, config: LawConfig) -> Sight:
    """Return the state after a suspend of the machine: scans from before it prove no space free, but their points remain."""
    for place in range(len(sight.lidars)):
        sight = _keep_shown(sight, config, place)
    lidars = (
        lidar._replace(
            scan=None,
            agreement=lidar.agreement._replace(reference=None),
            slip=lidar.slip._replace(slip_m=math.nan),
        )
        for lidar in sight.lidars
    )
    return sight._replace(lidars=tuple(lidars), past=(), way=())


def spoil(sight: Sight, place: int) -> Sight:
    """Mark a lidar's newest scan as invalid, because an undecodable message arrived on its key."""
    lidar = sight.lidars[place]
    if lidar.scan is None:
        return sight
    return _with(sight, place, lidar._replace(scan=lidar.scan._replace(problem="undecodable")))


def _with(sight: Sight, place: int, lidar: LidarState) -> Sight:
    return sight._replace(lidars=(*sight.lidars[:place], lidar, *sight.lidars[place + 1 :]))


def see(sight: Sight, config: LawConfig, scan: LaserScan, base: Base) -> Sight:
    """Process a scan; a scan that is late, replayed or older than the previous one is discarded."""
    place = scan.lidar
    lidar, state = config.lidars[place], sight.lidars[place]
    tolerance_s = FALL_TOLERANCE_S if scan.sent_tolerance_s is None else scan.sent_tolerance_s
    track, verdict, on_way_s = judge(
        state.track,
        scan.sent,
        scan.arrival_s,
        lidar.timeout_s,
        tolerance_s,
        may_return=True,
        trusts_arrival=True,
    )
    before, taken_s = state.scan, scan.arrival_s - on_way_s - lidar.latency_s
    writers = heard(state.writers, scan.writer, scan.arrival_s)
    state = state._replace(track=track, counts=state.counts.add(verdict), writers=writers)
    if verdict is not Verdict.FRESH:
        return _with(sight, place, state)
    period_s = lidar.timeout_s if before is None else min(lidar.timeout_s, max(0.0, taken_s - before.taken_s))
    pose = back_then(base.odometers, base.odometer, taken_s)
    moment = Moment(taken_s, period_s, pose, base.way_m, base.proven_way_m, base.stopped_s is not None)
    agreement = repeat(state.agreement, before, scan, None if base.odometry is None else pose)
    state = state._replace(agreement=agreement)
    reading = read_scan(
        before,
        scan,
        moment,
        lidar,
        config.hull,
        config.reach_m,
        config.smallest_obstacle_m,
        in_the_open=config.works_in_the_open,
        repeated=agreement.repeated,
    )
    if before is not None and reading.taken_s == before.taken_s:  # it is identical to the previous scan
        return _with(sight, place, state._replace(scan=reading))
    memory = _with_shown(sight, before)
    if reading.problem is not None:
        return _with(sight, place, state._replace(scan=reading))._replace(memory=memory)
    assert reading.view is not None  # a reading without a problem has one
    if base.odometry is not None:  # nothing is concluded from commands, which the base may not have followed
        slip = measure_slip(
            state.slip,
            None if before is None else before.view,
            reading.view,
            lidar.mount,
            measured_stop(base),
            stands=not moves(base.odometer.velocity, config.residual),
        )
        state = state._replace(agreement=agree(state.agreement, reading.view, lidar.mount), slip=slip)
    memory, earlier = _remember(sight, config, memory, reading.view, lidar)
    return _with(sight, place, state._replace(scan=reading, earlier=earlier))._replace(
        memory=memory,
        memory_pose=reading.view.pose,
        past=_keep_past(sight.past, config, lidar, reading.view),
        way=_keep_way(sight.way, config, reading.view, base),
    )


def _keep_shown(sight: Sight, config: LawConfig, place: int) -> Sight:
    """Move the returns of a lidar's newest scan to the memory, so that they survive the loss of the scan."""
    lidar = sight.lidars[place]
    if lidar.scan is None:
        return sight
    kept = lidar._replace(scan=lidar.scan._replace(around=nothing_around(config.hull)))
    return _with(sight, place, kept)._replace(memory=_with_shown(sight, lidar.scan))


def _with_shown(sight: Sight, scan: ScanReading | None) -> Remembered:
    """Return the memory with the returns of a scan added."""
    if scan is None or len(scan.around.points) == 0:
        return sight.memory
    assert scan.view is not None  # a scan with returns has one
    shown, pose = scan.around.points, scan.view.pose
    if pose != sight.memory_pose:
        shown = moved(shown, between(pose, sight.memory_pose))
    points, misses = sight.memory
    return Remembered(np.concatenate((points, shown)), np.concatenate((misses, np.zeros(len(shown)))))


def _remember(
    sight: Sight, config: LawConfig, shown: Remembered, view: View, lidar: Lidar
) -> tuple[Remembered, Floats]:
    """Update the memory with a new view.

    Returns:
        the near points that the view neither replaces nor disproves; and all near points (n, 2) [m] before the
        update, in the base frame of the view.
    """
    points, misses = shown
    if len(points) == 0:
        return shown, points
    earlier = moved(points, between(sight.memory_pose, view.pose))
    near = np.hypot(earlier[:, 0], earlier[:, 1]) < config.hull.radius_m + config.reach_m
    earlier, misses = earlier[near], misses[near]
    return remember(Remembered(earlier, misses), view, lidar.mount), earlier


def _keep_past(past: tuple[Past, ...], config: LawConfig, lidar: Lidar, view: View) -> tuple[Past, ...]:
    """Return the views of the last `unseen_memory_s`, about `PAST_VIEWS` of each lidar."""
    memory_s = config.unseen_memory_s
    if memory_s == 0.0:
        return ()
    kept = [p for p in past if view.taken_s - p.view.taken_s <= memory_s]
    same = [p for p in kept if p.lidar == lidar.name]
    if not same or view.taken_s - same[-1].view.taken_s >= memory_s / PAST_VIEWS:
        kept.append(Past(lidar.name, view))
    return tuple(kept)


def _keep_way(way: tuple[Stand, ...], config: LawConfig, view: View, base: Base) -> tuple[Stand, ...]:
    """Return the hull's poses of the last `unseen_memory_s`; none without odometry, because commands prove no way."""
    if config.unseen_memory_s == 0.0 or base.odometry is None:
        return ()
    return went(way, view.pose, view.taken_s, view.taken_s - config.unseen_memory_s, config.hull)


def usable(sight: Sight, config: LawConfig, now_s: float) -> Usable:
    """Return the newest scans that are valid and not too old, with the indices of their lidars."""
    return [(place, scan) for place, scan in _fresh(sight, config, now_s) if scan.problem is None]


def _fresh(sight: Sight, config: LawConfig, now_s: float) -> Usable:
    """Return the newest scans that are not too old, valid or not, with the indices of their lidars."""
    return [
        (place, lidar.scan)
        for place, lidar in enumerate(sight.lidars)
        if lidar.scan is not None and now_s - lidar.scan.taken_s <= config.lidars[place].timeout_s
    ]


def seek_hidden(sight: Sight, config: LawConfig, scans: Usable, *, moved_on: bool) -> Sight:
    """Update the remembered points and hidden places; a lidar without a usable scan proves no space free.

    Args:
        sight: the state with the newest scans.
        config: the configuration of the law.
        scans: those that are usable.
        moved_on: whether a scan has arrived in this step.
    """
    looking = tuple(place for place, _ in scans)
    if not moved_on and looking == sight.looking:
        return sight
    for place in sight.looking:
        sight = sight if place in looking else _keep_shown(sight, config, place)
    places = list[Place]()
    if len(sight.memory.points):
        remembered = survey(config.hull, sight.memory.points, Kind.REMEMBERED)
        places.append(Place(sight.memory_pose, remembered))
    if scans:
        newest = max((scan.view for _, scan in scans if scan.view is not None), key=attrgetter("taken_s"))
        hidden = np.concatenate([_hidden_from(sight, config, one, scans, newest.pose) for one in scans])
        if len(hidden):
            places.append(Place(newest.pose, survey(config.hull, hidden, Kind.HIDDEN)))
    return sight._replace(places=tuple(places), looking=looking)


def _hidden_from(
    sight: Sight, config: LawConfig, one: tuple[int, ScanReading], scans: Usable, pose: Pose
) -> Floats:
    """Return the hidden places (n, 2) [m] of one lidar that no other view proves free, in the frame of `pose`.

    Each lidar is checked in turn, because the space that no lidar sees borders on the views of several lidars.
    """
    place, scan = one
    view = scan.view
    assert view is not None  # a usable scan has one
    others = [other for other in scans if other is not one]
    hidden = hidden_places(
        view,
        config.lidars[place].mount,
        config.hull,
        config.smallest_obstacle_m,
        config.reach_m,
        lambda: _evidence(sight, config, others, view.pose),
    )
    if view.pose == pose:
        return hidden
    hidden = moved(hidden, between(view.pose, pose))
    return hidden[config.hull.clearance(hidden) > 0.0]  # no object can be inside the hull


def _evidence(sight: Sight, config: LawConfig, others: Usable, pose: Pose) -> list[Evidence]:
    """Return what may prove one lidar's hidden places free: views of other lidars, recent views, and the hull's own way."""
    mounts = {lidar.name: lidar.mount for lidar in config.lidars}
    now = [(config.lidars[place].mount, scan.view) for place, scan in others]
    before = [(mounts[p.lidar], p.view) for p in sight.past]
    views = [lookout(view, mount, view.pose, pose) for mount, view in (*now, *before) if view is not None]
    return [own_way(sight.way, config.hull, pose), *views] if sight.way else [*views]


def causes(sight: Sight, config: LawConfig, now_s: float, scans: Usable) -> Iterator[StopReason]:
    """Yield the causes of the lidars that prevent every source from driving now."""
    if not scans:
        yield StopReason.SCAN_INVALID if _fresh(sight, config, now_s) else StopReason.SCAN_STALE
    if any(lidar.agreement.mismatch for lidar in sight.lidars):
        yield StopReason.SENSOR_MISMATCH


def mounts_confirmed(sight: Sight) -> bool:
    """Return whether motion has confirmed the mounting of every lidar."""
    return not any(lidar.agreement.not_ruled_out for lidar in sight.lidars)


def slip_m(sight: Sight, base: Base) -> float | None:
    """Return by how much the present stop is longer than odometry shows [m]; NaN if no lidar shows it.

    Returns None until every lidar has concluded. The least counts: something else moves where two lidars do not agree.
    """
    if base.braking.ended is None:
        return None
    slips = [lidar.slip.slip_m for lidar in sight.lidars if lidar.slip.stopped_s == base.stopped_s]
    known = [slip_m for slip_m in slips if slip_m is not None]
    if len(known) < len(sight.lidars):
        return None
    return min((slip_m for slip_m in known if not math.isnan(slip_m)), default=math.nan)


def is_assumed(scans: Usable) -> bool:
    """Return whether a lidar's silence counts as free only because the robot works in the open."""
    return any(scan.is_assumed for _, scan in scans)


def sensors(sight: Sight, config: LawConfig) -> Iterator[Sensor]:
    """Yield each lidar as a sensor with its writers."""
    for lidar, state in zip(config.lidars, sight.lidars, strict=True):
        yield Sensor(lidar.name, state.writers, lidar.timeout_s)


def advice(config: LawConfig, scans: Usable, block: Block) -> str:
    """Return what may explain a blocking point that the surroundings do not; empty if nothing."""
    named = [(config.lidars[place], scan, scan.view) for place, scan in scans]
    if block.kind is Kind.HIDDEN:
        fewer = [
            f"{scan.missing_beams} beams fewer than before" for _, scan, _ in named if scan.missing_beams
        ]
        return f"the scan has {fewer[0]}" if fewer else ""
    for lidar, _, view in named:
        assert view is not None  # a usable scan has one
        sector = own_sector(view, lidar.mount, config.hull, (block.x_m, block.y_m))
        if sector is not None:
            return "if it is part of the robot: masked_rad = [[{:.3f}, {:.3f}]]".format(*sector)
    return ""


def is_confirmed(sight: Sight, config: LawConfig, block: Block, odometer: Odometer, now_s: float) -> bool:
    """Return whether a block is confirmed, so that it latches: a hidden place, or a return that an earlier scan confirms.

    The earlier scan must show a return that is nearby and as near to the hull, or inside the stop distance too. Otherwise a stray
    return, from dust, rain or noise, stops the robot while it is present, but latches nothing, even in front of a wall.
    """
    if block.kind is not Kind.SEEN:
        return block.kind is Kind.HIDDEN
    now_m = max(_clearance_m(sight, block, odometer, now_s), config.stop_distance_m)
    earlier = np.concatenate([lidar.earlier for lidar in sight.lidars])
    beside = earlier[np.hypot(earlier[:, 0] - block.x_m, earlier[:, 1] - block.y_m) < SAME_PLACE_M]
    return bool((config.hull.clearance(beside) < now_m + SAME_DEPTH_M).any())


def _clearance_m(sight: Sight, block: Block, odometer: Odometer, now_s: float) -> float:
    """Return the clearance [m] of a block in the newest scan that shows it.

    The block is in the base frame of this scan, or in the present one.
    """
    found: list[tuple[float, float]] = []
    for scan in newest(sight):
        points = scan.around.points
        if scan.view is None or len(points) == 0:
            continue
        way = displacement(odometer, scan.view.pose, now_s)
        for frame in (points,) if way is None else (points, moved(points, way)):
            away_m = np.hypot(frame[:, 0] - block.x_m, frame[:, 1] - block.y_m)
            nearest = int(away_m.argmin())
            found.append((away_m.item(nearest), scan.around.clearance_m.item(nearest)))
    return min(found)[1]


def nearest(sight: Sight) -> tuple[float, float]:
    """Return clearance [m] and bearing [rad] of the nearest seen or remembered point; NaN without a valid scan."""
    found = [(scan.nearest_m, scan.nearest_bearing_rad) for scan in newest(sight) if scan.problem is None]
    if not found:
        return math.nan, math.nan
    found.extend(place.around.nearest() for place in sight.places if place.around.kind is Kind.REMEMBERED)
    return min(found)


def newest(sight: Sight) -> list[ScanReading]:
    """Return the newest scan of each lidar that has sent one, valid or not."""
    return [lidar.scan for lidar in sight.lidars if lidar.scan is not None]


def counts(sight: Sight) -> Counts:
    """Return the numbers of scans by verdict, of all lidars together."""
    if len(sight.lidars) == 1:
        return sight.lidars[0].counts
    return Counts(*np.array([lidar.counts for lidar in sight.lidars]).sum(axis=0).tolist())


def problems(sight: Sight, config: LawConfig) -> str:
    """Return why the newest scans prove nothing; with several lidars, each problem follows the lidar's name."""
    return _by_lidar(config, [None if s.scan is None else s.scan.problem for s in sight.lidars])


def mismatches(sight: Sight, config: LawConfig) -> str:
    """Return what motion shows instead of the configuration; with several lidars, each text follows the lidar's name."""
    return _by_lidar(config, [s.agreement.mismatch for s in sight.lidars])


def _by_lidar(config: LawConfig, texts: Sequence[str | None]) -> str:
    """Join the texts of the lidars that have one."""
    if not any(texts):
        return ""
    found = [(lidar.name, text) for lidar, text in zip(config.lidars, texts, strict=True) if text]
    alone = len(config.lidars) == 1
    return "; ".join(text if alone else f"{name}: {text}" for name, text in found)
