"""The transforms between a robot's frames, its hull and its rings, for a 3D view. Pure."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from supervisor.config import SupervisorSection
from supervisor.law.clearance import ConvexPolygon, Hull
from wire.messages import Odometry, Point, Quaternion, Time

Points = npt.NDArray[np.float64]

BASE_FRAME = "base_link"
"""The frame of the hull until odometry names another."""
MAX_STEP_RAD = math.radians(6.0)
"""Angle between neighbouring points of an arc: it deviates from the true arc by 0.14 % of its radius at most."""


class Transform(NamedTuple):
    """The pose of a frame in its parent frame."""

    parent: str
    child: str
    time: Time
    translation: Point
    """In m."""
    rotation: Quaternion


class Outline(NamedTuple):
    """A closed line around the robot, in its base frame."""

    name: str
    distance_m: float
    """From the hull."""
    points: Points
    """(n, 2) [m], counter-clockwise; the last point is not the first again."""


class Frames:
    """Learns the names of the frames from the robot's messages, because a real robot's may differ from the defaults.

    Args:
        config: the mounts of the lidars.
    """

    def __init__(self, config: SupervisorSection) -> None:
        self.base = BASE_FRAME
        self._mounts = {lidar.topic: lidar.mount() for lidar in config.all_lidars()}
        self._lidars: dict[str, str] = {}
        """The frame of each lidar by topic."""

    def hear_odometry(self, odometry: Odometry) -> Transform | None:
        """Return the pose of the base; None if the message names no two frames or has no valid pose."""
        parent, child = odometry.header.frame_id, odometry.child_frame_id
        position, rotation = odometry.pose.pose.position, odometry.pose.pose.orientation
        if child:
            self.base = child
        norm = math.hypot(rotation.x, rotation.y, rotation.z, rotation.w)
        if not (
            parent
            and child
            and parent != child
            and norm > 0.0
            and math.isfinite(norm + position.x + position.y + position.z)
        ):
            return None
        return Transform(parent, child, odometry.header.stamp, position, rotation)

    def hear_scan(self, topic: str, frame_id: str) -> None:
        """Learn the frame of the lidar on a topic."""
        self._lidars[topic] = frame_id

    def lidars(self, time: Time) -> Iterator[Transform]:
        """Yield the pose of each lidar frame that was heard, in the base frame."""
        done = {self.base, ""}
        for topic, mount in self._mounts.items():
            frame = self._lidars.get(topic, "")
            if frame not in done:
                done.add(frame)
                rotation = Quaternion(0.0, 0.0, math.sin(mount.yaw_rad / 2), math.cos(mount.yaw_rad / 2))
                yield Transform(self.base, frame, time, Point(mount.x_m, mount.y_m, 0.0), rotation)


def outlines(config: SupervisorSection) -> tuple[Outline, ...]:
    """Return the hull, and the rings at the stop distance and at the warning distance."""
    hull = config.footprint.hull()
    return tuple(
        Outline(name, distance_m, points_at(hull, distance_m))
        for name, distance_m in (
            ("hull", 0.0),
            ("stop", config.stop_distance_m),
            ("warning", config.warning_distance_m),
        )
    )


def points_at(hull: Hull, distance_m: float) -> Points:
    """Return the points (n, 2) [m] of the line at a distance from the hull, counter-clockwise."""
    if isinstance(hull, ConvexPolygon):
        return _around(np.array(hull.corners), distance_m)
    return _arc((0.0, 0.0), hull.radius_m + distance_m, 0.0, math.tau)[:-1]


def _around(corners: Points, distance_m: float) -> Points:
    """Return the line around a convex polygon: its sides moved outward, joined by arcs around its corners."""
    if distance_m == 0.0:
        return corners
    sides = np.roll(corners, -1, axis=0) - corners
    normals = np.arctan2(-sides[:, 0], sides[:, 1])  # outward, of the side that begins at each corner
    turns = (normals - np.roll(normals, 1)) % math.tau
    return np.concatenate(
        [
            _arc((x_m, y_m), distance_m, normal - turn, normal)
            for (x_m, y_m), normal, turn in zip(
                corners.tolist(), normals.tolist(), turns.tolist(), strict=True
            )
        ]
    )


def _arc(centre: tuple[float, float], radius_m: float, start_rad: float, end_rad: float) -> Points:
    """Return points (n, 2) on an arc, with both of its ends."""
    angles = np.linspace(start_rad, end_rad, 1 + max(1, math.ceil((end_rad - start_rad) / MAX_STEP_RAD)))
    return np.column_stack([centre[0] + radius_m * np.cos(angles), centre[1] + radius_m * np.sin(angles)])
