"""The newest of everything that a scene draws, as an object for JSON, for a page in a browser. Pure: the times are arguments.

All places are in the base frame of the newest odometry, in centimetres, and as flat lists `x, y, x, y, …`.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from lifeline.view.ghost import Stopping, rest_of
from lifeline.view.scene import (
    ANGULAR,
    BASE,
    LINEAR,
    LOG,
    MEASURED,
    MODE,
    PERMITTED,
    REQUESTED,
    STOP_RING,
    WARNING_RING,
    Scene,
)
from lifeline.view.shapes import Area, Floats, Frame, Line, LogLine, Points, Primitive, State, Value
from station.messages import Fields, cause_of
from supervisor.law.reckoning import Pose
from teleop.screen.view import nearest_in_words
from wire.messages import SafetyStatus, UndecodableError, decode
from wire.reasons import StopReason
from wire.standstill import is_still
from wire.text import printable
from wire.topics import ODOM, STATUS, Topic

MAX_RAYS = 720
"""Of one scan in a picture: a finer scan is thinned out."""
FRESH_S = 1.0
"""What is older is not drawn."""
EVENTS = 4
SILENT = "wait; if this lasts, check that the robot runs"
"""What to do while the supervisor is not heard."""
FASTEST = 100.0
"""A larger velocity [m/s or rad/s] is no measurement, and has no ghost."""
LEAST_STOP_M_S = 0.1
"""Slower stops are not compared with their ghost."""
LATE_S = 0.2
"""How much later than its measurement odometry may arrive."""


class Place(NamedTuple):
    """Where the robot was by its odometry, and how fast."""

    arrival_s: float
    pose: Pose
    linear_m_s: float

    def to_m(self, other: "Place") -> float:
        """Return the straight distance to another place."""
        return math.hypot(other.pose.x_m - self.pose.x_m, other.pose.y_m - self.pose.y_m)

    def leads_to(self, other: "Place") -> bool:
        """Return whether the measured velocities explain the distance to the next place: a restarted odometry jumps."""
        passed_s = other.arrival_s - self.arrival_s
        fastest_m_s = max(abs(self.linear_m_s), abs(other.linear_m_s))
        return passed_s <= FRESH_S and self.to_m(other) <= fastest_m_s * (passed_s + LATE_S)


class Stop(NamedTuple):
    """A stop: where it began, and the distance of the ghost then."""

    began: Place
    ghost_m: float


class Picture:
    """One robot.

    Args:
        scene: draws its messages.
        stopping: what is known of its stops.
        most_m_s: the largest velocity that the robot may be permitted.
    """

    def __init__(self, scene: Scene, stopping: Stopping, most_m_s: float) -> None:
        self._scene, self._stopping, self._most_m_s = scene, stopping, most_m_s
        self._frames = dict[str, Frame]()
        self._shapes = dict[str, tuple[float, Points | Area]]()
        self._values = dict[str, tuple[float, float]]()
        self._mode = ""
        self._events = deque[tuple[float, str]](maxlen=EVENTS)
        self._status: tuple[float, SafetyStatus] | None = None
        self._place: Place | None = None
        self._stop: Stop | None = None
        self._last_stop: tuple[float, float] | None = None

    @property
    def topics(self) -> Mapping[str, Topic[Any]]:
        """The topics that are drawn, by ROS name."""
        return self._scene.topics

    def hear(self, name: str, arrival_s: float, payload: bytes) -> None:
        """Process a message.

        Args:
            name: the ROS name of its topic.
            arrival_s: its time of arrival.
            payload: the message.
        """
        for one in self._scene.draw(name, arrival_s, payload):
            self._keep(one, arrival_s)
        if self._scene.topics.get(name) is STATUS:
            try:
                self._status = arrival_s, decode(payload, SafetyStatus)
            except UndecodableError:
                return
        elif self._scene.topics.get(name) is ODOM:
            self._move(arrival_s)
        self._follow_stop()

    def _keep(self, one: Primitive, arrival_s: float) -> None:
        match one:
            case Frame():
                self._frames[one.name] = one
            case Points() | Area():
                self._shapes[one.path] = arrival_s, one
            case Value():
                self._values[one.path] = arrival_s, one.value
            case State(path, text) if path == MODE:
                self._mode = text
            case LogLine(path, text) if path == LOG:
                self._events.append((arrival_s, text))
            case _:
                pass

    def _move(self, arrival_s: float) -> None:
        """Follow odometry; a jump ends the comparison of a stop with its ghost."""
        if (base := self._frames.get(BASE)) is None:
            return
        pose = Pose(base.x_m, base.y_m, base.yaw_rad)
        place = Place(arrival_s, pose, self._velocity(MEASURED)[0])
        if self._place is None or not self._place.leads_to(place):
            self._stop = None
        self._place = place

    def _follow_stop(self) -> None:
        """Remember where a stop began, and compare its way with the ghost when the robot stands."""
        velocity, ghost = self._velocity(MEASURED), self._ghost()
        if self._place is None or ghost is None or self._velocity(PERMITTED) != (0.0, 0.0):
            self._stop = None
        elif self._stop is None and abs(velocity[0]) >= LEAST_STOP_M_S:
            self._stop = Stop(self._place, math.hypot(ghost.x_m, ghost.y_m))
        elif self._stop is not None and is_still(*velocity):
            self._last_stop, self._stop = (self._stop.began.to_m(self._place), self._stop.ghost_m), None

    def _velocity(self, name: str) -> tuple[float, float]:
        linear, angular = (self._values.get(f"{kind}/{name}", (0.0, 0.0))[1] for kind in (LINEAR, ANGULAR))
        return linear, angular

    def _ghost(self) -> Pose | None:
        velocity = self._velocity(MEASURED)
        if not all(abs(one) <= FASTEST for one in velocity):
            return None
        return rest_of(*velocity, self._stopping)

    # --- what the page gets

    def robot(self) -> dict[str, object]:
        """Return the constant shapes, and the limits of the robot."""
        lines = {
            one.path.rpartition("/")[2]: _flat(one.points_m)
            for one in self._scene.fixed()
            if isinstance(one, Line)
        }
        return {**lines, "most_m_s": self._most_m_s}

    @np.errstate(all="ignore")  # hostile numbers would print warnings
    def picture(self, now_s: float) -> dict[str, object]:
        """Return everything that changes."""
        velocities = {name: self._velocity(name)[0] for name in (REQUESTED, PERMITTED, MEASURED)}
        ghost = self._ghost()
        return {
            "scans": list(self._scans(now_s)),
            "velocity": {
                name: round(one, 3) if math.isfinite(one) else None for name, one in velocities.items()
            },
            "ghost": ghost
            and [round(100.0 * ghost.x_m, 1), round(100.0 * ghost.y_m, 1), round(ghost.yaw_rad, 3)],
            "stop": self._last_stop and [round(100.0 * one, 1) for one in self._last_stop],
            "events": [[round(now_s - at_s, 1), text] for at_s, text in self._events],
            "age_s": None if math.isinf(scan_s := self.scan_s) else round(now_s - scan_s, 3),
            **self._texts(now_s),
        }

    @property
    def scan_s(self) -> float:
        """When the newest scan arrived, of the lidar whose scan is the oldest; -inf if one is missing, or the robot's place."""
        arrivals_s = [at_s for path, (at_s, _) in self._shapes.items() if path.endswith("/points")]
        if BASE not in self._frames or len(arrivals_s) < len(self._scene.lidars):
            return -math.inf
        return min(arrivals_s, default=-math.inf)

    def _texts(self, now_s: float) -> Fields:
        """Return the mode, its cause and what to do, in words, and who drives: `own_step` is for the driver at a page."""
        if self._status is None or now_s - self._status[0] > FRESH_S:
            unknown = dict.fromkeys(("mode", "owner", "nearest"), "")
            return unknown | {
                "why": "nothing is heard from the supervisor",
                "own_step": SILENT,
                "step": SILENT,
            }
        status = self._status[1]
        cause, step = cause_of(status)
        if self._mode != "STOPPED":
            step = ""
        if not any(station.is_missed for station in status.estop_stations):
            step = step.removeprefix("start it, ")
        return {
            "mode": self._mode,
            "why": cause if self._mode in {"STOPPED", "LIMITED"} else "",
            "step": _step(step, "the driver requests zero", "resets"),
            "own_step": _step(step, "let go", "press Reset"),
            "owner": "" if StopReason.NO_COMMAND in status.causes else printable(status.owner),
            "nearest": nearest_in_words(status, "°"),
        }

    def _scans(self, now_s: float) -> Iterable[dict[str, object]]:
        """Yield, for each lidar with a fresh scan, its returns with their classes (0 far, 1 warning, 2 stop), hidden places and free space."""
        base = self._frames.get(BASE)
        frames = [name for name in self._frames if name != BASE]
        for frame in frames:
            fresh = {
                path.rpartition("/")[2]: shape
                for path, (arrival_s, shape) in self._shapes.items()
                if path.startswith(f"{frame}/") and now_s - arrival_s <= FRESH_S
            }
            points, free, hidden = fresh.get("points"), fresh.get("free"), fresh.get("hidden")
            if base is None or not (
                isinstance(points, Points) and isinstance(free, Area) and isinstance(hidden, Points)
            ):
                continue
            here = self._frames[frame]
            stride = 1 + (len(free.corners_m) - 2) // MAX_RAYS
            corners, is_round = free.corners_m, len(free.triangles) > 0 and bool(free.triangles[-1, 2] == 1)
            ends = corners[1::stride] if is_round else np.vstack([corners[:1], corners[1::stride]])
            yield {
                "points": _flat(_moved(points.points_m[::stride], here, base)),
                "classes": _classes(points.colours[::stride]),
                "hidden": _flat(_moved(hidden.points_m, here, base)),
                "free": _flat(_moved(ends, here, base)),
            }


def _step(step: str, neutral: str, reset: str) -> str:
    """Return a step of `wire.reasons`: how to request zero, and how to reset."""
    return (
        step.replace("NEUTRAL", neutral)
        .replace("then r to reset", f"then {reset}")
        .replace("then r if", f"then {reset} if")
    )


def _classes(colours: "np.ndarray[tuple[int, int], np.dtype[np.uint8]]") -> list[int]:
    warning = (colours == np.array(WARNING_RING, dtype=np.uint8)).all(axis=1)
    stop = (colours == np.array(STOP_RING, dtype=np.uint8)).all(axis=1)
    return (warning + 2 * stop).tolist()


def _moved(points_m: Floats, here: Frame, base: Frame) -> Floats:
    """Return points (n, 2) [m] of one frame in another; both frames are poses in `odom`."""
    cos, sin = math.cos(here.yaw_rad), math.sin(here.yaw_rad)
    inverse = np.array(
        [[math.cos(base.yaw_rad), math.sin(base.yaw_rad)], [-math.sin(base.yaw_rad), math.cos(base.yaw_rad)]]
    )
    world = points_m @ np.array([[cos, sin], [-sin, cos]]) + np.array(
        [here.x_m - base.x_m, here.y_m - base.y_m]
    )
    return world @ inverse.T


def _flat(points_m: Floats) -> list[int]:
    """Return points (n, 2) [m] as a flat list [cm]."""
    return np.rint(np.clip(np.nan_to_num(100.0 * points_m), -1e6, 1e6)).astype(np.int64).ravel().tolist()
