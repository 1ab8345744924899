"""Converts each message of a robot to shapes, values, states and log lines. The times are arguments, and the scene holds what it has drawn so far.

The scans are read by the law's own modules (`supervisor.law.scan`, `seen_space`). The scene reads them without the states of
sources and odometry that the law has, so its hidden places show what the scans prove, not what the supervisor decided.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from deploy.stack.formatting import mode_name, nearest, speed
from lifeline.view.shapes import (
    Area,
    Colour,
    Floats,
    Frame,
    Level,
    Line,
    LogLine,
    Points,
    Primitive,
    State,
    Value,
    fan,
    free_space,
    outline,
)
from recordings.incidents import incident
from recordings.recording import Recorded, RecordingReader
from supervisor.blackbox.file import SUFFIX
from supervisor.blackbox.reader import BlackBoxReader
from supervisor.config import SupervisorSection
from supervisor.law.model import LawConfig
from supervisor.law.reckoning import Pose
from supervisor.law.scan import LaserScan, Moment, ScanReading, rays_of, read_scan
from supervisor.law.seen_space import hidden_places, lookout
from wire import ros, topics
from wire.messages import Odometry, SafetyStatus, Twist, UndecodableError, decode, yaw_of
from wire.text import printable
from wire.topics import Topic, lidar_scan

BASE, ODOM = "base_link", "odom"
LINEAR, ANGULAR = "velocity/linear", "velocity/angular"
REQUESTED, PERMITTED, MEASURED = "requested", "permitted", "measured"
MODE, CAUSES, LATCHED, SCANS, LOG = "mode", "reasons/now", "reasons/over", "scans", "log"
DISTANCE = "distance"
"""Paths of values, states and log lines."""

INK: Colour = (214, 220, 228, 255)
FREE: Colour = (76, 175, 118, 52)
HIDDEN: Colour = (186, 120, 226, 255)
STOP_RING: Colour = (229, 83, 75, 255)
WARNING_RING: Colour = (240, 173, 78, 255)
TRAIL: Colour = (92, 156, 230, 255)
MODE_COLOURS: dict[str, Colour] = {
    "STOPPED": (229, 83, 75, 255),
    "READY": (92, 156, 230, 255),
    "DRIVING": (76, 175, 118, 255),
    "LIMITED": (240, 173, 78, 255),
}
"""The colour of the hull in each mode."""

TRAIL_STEP_M = 0.02
TRAIL_POINTS = 5000
"""Points of the driven path that are shown: 100 m."""
RANGE_OF_PLACES_M = 3.0
"""Hidden places farther than this from the hull limit no motion, and are not drawn."""


@dataclass(slots=True)
class Scene:
    """One robot.

    Args:
        law: the configuration of its safety law.
        lidars: the topics of its lidars, in the order of the configuration.
        namespace: the first part of its topics' names.
    """

    law: LawConfig
    lidars: Sequence[Topic[ros.LaserScan]]
    namespace: str
    undecodable: int = 0
    """Number of messages that could not be decoded."""
    topics: Mapping[str, Topic[Any]] = field(init=False)
    """The topics that the scene draws, by ROS name."""
    _readings: dict[int, ScanReading] = field(init=False, default_factory=dict[int, ScanReading])
    """The last scan of each lidar, by its index in the configuration."""
    _pose: Pose = Pose(0.0, 0.0, 0.0)
    _travelled_m: float = 0.0
    _trail: deque[tuple[float, float]] = field(init=False)
    _told: tuple[object, ...] = ()
    """The contents of the last log line."""

    def __post_init__(self) -> None:
        self._trail = deque(maxlen=TRAIL_POINTS)
        entries: list[Topic[Any]] = [topics.ODOM, topics.STATUS, topics.CMD_VEL, *self.lidars]
        self.topics = {f"/{self.namespace}/{topic.key}": topic for topic in entries}

    def fixed(self) -> Iterator[Primitive]:
        """Yield the constant shapes: the hull and its rings, in `base_link`."""
        hull = self.law.hull
        stop_m, warning_m = self.law.stop_distance_m, self.law.warning_distance_m
        yield Line(f"{BASE}/rings/stop", outline(hull, stop_m), STOP_RING, 0.012, 0.02)
        yield Line(f"{BASE}/rings/warning", outline(hull, warning_m), WARNING_RING, 0.012, 0.02)
        yield Line(f"{BASE}/outline", outline(hull), INK, 0.008, 0.09)
        yield Line(f"{BASE}/heading", _heading(hull.radius_m), INK, 0.012, 0.09)

    @np.errstate(all="ignore")  # hostile numbers would print warnings
    def draw(self, name: str, time_s: float, payload: bytes) -> list[Primitive]:
        """Return what a message draws; nothing for other topics and for undecodable messages.

        Args:
            name: the ROS name of its topic: /robot/scan.
            time_s: its time of arrival, by any clock that only increases.
            payload: the message.
        """
        topic = self.topics.get(name)
        if topic is None:
            return []
        try:
            message = decode(payload, topic.type)
        except UndecodableError:
            self.undecodable += 1
            return []
        match message:
            case Odometry():
                return list(self._odometry(message))
            case SafetyStatus():
                return list(self._status(message))
            case Twist():
                return list(_velocity(PERMITTED, message))
            case ros.LaserScan():
                place = next(index for index, one in enumerate(self.lidars) if one.key == topic.key)
                return list(self._scan(place, message, time_s))
            case _:
                return []

    def _odometry(self, message: Odometry) -> Iterator[Primitive]:
        yield from _velocity(MEASURED, message.twist.twist)
        position = message.pose.pose.position
        pose = Pose(position.x, position.y, yaw_of(message.pose.pose.orientation))
        if not all(map(math.isfinite, pose)):
            return
        step_m = math.hypot(pose.x_m - self._pose.x_m, pose.y_m - self._pose.y_m)
        turn_rad = abs(math.remainder(pose.yaw_rad - self._pose.yaw_rad, math.tau))
        if self._trail:  # the first pose is no travel
            self._travelled_m += step_m + turn_rad * self.law.hull.radius_m
        # The law's yaw is not wrapped at ±π.
        yaw_rad = self._pose.yaw_rad + math.remainder(pose.yaw_rad - self._pose.yaw_rad, math.tau)
        self._pose = pose._replace(yaw_rad=yaw_rad)
        yield Frame(BASE, pose.x_m, pose.y_m, pose.yaw_rad)
        last = self._trail[-1] if self._trail else (math.inf, math.inf)
        if math.dist(last, (pose.x_m, pose.y_m)) >= TRAIL_STEP_M:
            self._trail.append((pose.x_m, pose.y_m))
            yield Line(f"{ODOM}/path", np.array(self._trail), TRAIL, 0.01, 0.01)

    def _scan(self, place: int, message: ros.LaserScan, time_s: float) -> Iterator[Primitive]:
        law, lidar = self.law, self.law.lidars[place]
        before = self._readings.get(place)
        period_s = lidar.timeout_s if before is None else min(lidar.timeout_s, time_s - before.taken_s)
        scan = LaserScan(
            message.ranges,
            message.angle_min,
            message.angle_increment,
            message.range_min,
            message.range_max,
            time_s,
            angle_max=message.angle_max,
            lidar=place,
        )
        moment = Moment(time_s, period_s, self._pose, self._travelled_m, self._travelled_m)
        reading = read_scan(
            before,
            scan,
            moment,
            lidar,
            law.hull,
            law.reach_m,
            law.smallest_obstacle_m,
            in_the_open=law.works_in_the_open,
        )
        self._readings[place] = reading
        yield State(f"{SCANS}/{lidar.name}", printable(reading.problem or ""))
        if reading.problem is not None or reading.view is None:
            return
        view, frame = reading.view, f"{lidar.name}_scan"
        yield Frame(frame, *view.pose)
        rays = rays_of(view.geometry, lidar.mount, law.hull)
        (hits,) = view.hit.nonzero()
        returns = rays.points(hits, view.free_m)
        yield Points(f"{frame}/points", returns, self._by_distance(returns))
        yield Area(f"{frame}/free", *free_space(view, lidar.mount, law.hull), FREE)
        hidden = self._hidden(place, reading)
        colours = np.tile(np.array(HIDDEN, dtype=np.uint8), (len(hidden), 1))
        yield Points(f"{frame}/hidden", hidden, colours)

    def _hidden(self, place: int, reading: ScanReading) -> Floats:
        """Return the hidden places (n, 2) [m] near the hull that no lidar proves free, in the base frame of this scan."""
        law, view = self.law, reading.view
        assert view is not None  # the caller has checked it
        others = [
            lookout(other.view, law.lidars[index].mount, other.view.pose, view.pose)
            for index, other in self._readings.items()
            if index != place
            and other.view is not None
            and reading.taken_s - other.taken_s <= law.lidars[index].timeout_s
        ]
        reach_m = min(law.reach_m, RANGE_OF_PLACES_M)
        mount = law.lidars[place].mount
        return hidden_places(view, mount, law.hull, law.smallest_obstacle_m, reach_m, lambda: others)

    def _by_distance(self, points: Floats) -> "np.ndarray[tuple[int, int], np.dtype[np.uint8]]":
        """Return a colour (n, 4) for each point (n, 2): inside the stop ring, inside the warning ring, or farther."""
        away_m = self.law.hull.clearance(points)
        colours = np.tile(np.array(INK, dtype=np.uint8), (len(points), 1))
        colours[away_m < self.law.warning_distance_m] = WARNING_RING
        colours[away_m < self.law.stop_distance_m] = STOP_RING
        return colours

    def _status(self, status: SafetyStatus) -> Iterator[Primitive]:
        mode = mode_name(status)
        causes, latched = (
            printable(", ".join(reasons)) if mode in {"STOPPED", "LIMITED"} else ""
            for reasons in status.causes_and_latched()
        )
        yield from _velocity(REQUESTED, status.commanded)
        if math.isfinite(status.nearest_m):
            yield Value(f"{DISTANCE}/nearest", status.nearest_m)
        yield Value(f"{DISTANCE}/stop", self.law.stop_distance_m)
        yield Value(f"{DISTANCE}/warning", self.law.warning_distance_m)
        told = (mode, causes, latched, status.owner, status.warning, status.alarm)
        if told == self._told:
            return
        if not self._told or self._told[0] != mode:
            hull = fan(outline(self.law.hull))
            yield Area(f"{BASE}/hull", *hull, MODE_COLOURS[mode], 0.08)
        self._told = told
        yield State(MODE, mode)
        yield State(CAUSES, causes)
        yield State(LATCHED, latched)
        yield LogLine(LOG, _sentence(status, mode), _level(status, mode))


def _heading(radius_m: float) -> Floats:
    """Return an arrow head (5, 2) [m] on the hull that points ahead."""
    tip, back, side = 0.75 * radius_m, 0.1 * radius_m, 0.4 * radius_m
    return np.array([(back, side), (tip, 0.0), (back, -side), (tip, 0.0), (-tip, 0.0)])


def _velocity(name: str, twist: Twist) -> Iterator[Primitive]:
    yield Value(f"{LINEAR}/{name}", twist.linear.x)
    yield Value(f"{ANGULAR}/{name}", twist.angular.z)


def _sentence(status: SafetyStatus, mode: str) -> str:
    """Return a status as a line of the log."""
    parts = [mode]
    if status.owner:
        parts.append(f"by {status.owner}")
    why = status.why() if mode in {"STOPPED", "LIMITED"} else ""
    if why:
        parts.append(f"because of {why}")
    if status.detail:
        parts.append(f"({status.detail})")
    if mode in {"DRIVING", "LIMITED"}:
        parts.append(f"at {speed(status.permitted)}")
    if status.warning:
        parts.append(f"(nearest {nearest(status.nearest_m, status.nearest_bearing_rad)})")
    if status.alarm:
        parts.append("ALARM: the base moves although zero is commanded")
    return printable(" ".join(parts))


def _level(status: SafetyStatus, mode: str) -> Level:
    if status.alarm or mode == "STOPPED":
        return Level.ERROR
    return Level.WARN if status.warning or mode == "LIMITED" else Level.INFO


def scene_of(config: SupervisorSection, namespace: str) -> Scene:
    """Return the scene of a robot with this configuration."""
    topics = [lidar_scan(lidar.topic) for lidar in config.all_lidars()]
    return Scene(config.law(), topics, namespace)


def read_source(path: Path, config: SupervisorSection, namespace: str) -> tuple[Scene, Iterator[Recorded]]:
    """Return the scene that draws a recording or a black box, which brings its own configuration, and its messages.

    Raises:
        DeployError: the file cannot be read, or is neither.
    """
    if not path.name.endswith(SUFFIX):
        return scene_of(config, namespace), RecordingReader(path).messages()
    with incident.damage_of(path):
        reader = BlackBoxReader(path)
        topics = [lidar_scan(topic) for topic in reader.lidar_topics]
        scene = Scene(reader.law, topics, namespace)
    return scene, incident.messages(path, namespace)
