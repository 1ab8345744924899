"""The drawing of a robot: its frames are those of its messages, and its rings are at the configured distances."""

import math

import numpy as np
import pytest

from lifeline.robot_drawing import BASE_FRAME, Frames, outlines, points_at
from supervisor.config import SupervisorSection
from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from wire.messages import Odometry, Point, Quaternion, Time, odometry

RECTANGLE = ConvexPolygon(((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)))
TRIANGLE = ConvexPolygon(((0.5, 0.0), (-0.2, 0.1), (-0.2, -0.1)))
HULLS = pytest.mark.parametrize(
    "hull", [Circle(0.25), RECTANGLE, TRIANGLE], ids=["round", "rectangle", "triangle"]
)
NOW = Time(7, 8)


def config(**values: object) -> SupervisorSection:
    return SupervisorSection.model_validate(values)


def two_lidars() -> SupervisorSection:
    front = {"name": "front", "topic": "scan", "x_m": 0.2, "y_m": 0.1, "yaw_rad": math.pi / 2}
    rear = {"name": "rear", "topic": "scan_rear", "x_m": -0.2, "yaw_rad": math.pi}
    return config(lidars=[front, rear])


def at(
    x_m: float = 0.0, rotation: Quaternion | None = None, parent: str = "odom", child: str = "base_link"
) -> Odometry:
    message = odometry((x_m, 0.0, 0.0), (0.0, 0.0), time_ns=3_000_000_004)
    message.header.frame_id, message.child_frame_id = parent, child
    if rotation is not None:
        message.pose.pose.orientation = rotation
    return message


def test_the_pose_of_the_base_is_that_of_its_odometry_and_has_its_stamp() -> None:
    transform = Frames(config()).hear_odometry(odometry((1.0, -2.0, math.pi / 2), (0.0, 0.0), time_ns=5))
    assert transform is not None
    assert (transform.parent, transform.child, transform.time) == ("odom", "base_link", Time(0, 5))
    assert transform.translation == Point(1.0, -2.0, 0.0)
    assert (transform.rotation.z, transform.rotation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize(
    "message",
    [
        at(math.nan),
        at(math.inf),
        at(rotation=Quaternion(0.0, 0.0, 0.0, 0.0)),
        at(rotation=Quaternion(0.0, 0.0, 0.0, math.nan)),
        at(parent=""),
        at(child=""),
        at(parent="base_link"),
    ],
    ids=["nan", "infinite", "no rotation", "nan rotation", "no parent", "no child", "one frame"],
)
def test_odometry_without_a_valid_pose_moves_no_frame(message: Odometry) -> None:
    frames = Frames(config())
    assert frames.hear_odometry(message) is None
    assert frames.base == BASE_FRAME


def test_the_frame_of_a_lidar_is_that_of_its_scans_at_the_configured_mount() -> None:
    frames = Frames(two_lidars())
    assert list(frames.lidars(NOW)) == []
    frames.hear_scan("scan", "laser")
    frames.hear_scan("scan_rear", "laser_rear")
    front, rear = frames.lidars(NOW)
    assert (front.parent, front.child, front.time) == ("base_link", "laser", NOW)
    assert front.translation == Point(0.2, 0.1, 0.0)
    assert (front.rotation.z, front.rotation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    assert (rear.child, rear.translation) == ("laser_rear", Point(-0.2, 0.0, 0.0))
    assert (rear.rotation.z, rear.rotation.w) == pytest.approx((1.0, 0.0), abs=1e-9)


def test_the_lidars_follow_the_base_frame_that_odometry_names() -> None:
    frames = Frames(config())
    frames.hear_scan("scan", "laser")
    frames.hear_odometry(at(child="base_footprint"))
    (lidar,) = frames.lidars(NOW)
    assert (lidar.parent, lidar.child) == ("base_footprint", "laser")


def test_no_frame_is_its_own_parent_or_has_two_poses() -> None:
    frames = Frames(two_lidars())
    frames.hear_scan("scan", BASE_FRAME)
    frames.hear_scan("scan_rear", "")
    assert list(frames.lidars(NOW)) == []
    frames.hear_scan("scan", "laser")
    frames.hear_scan("scan_rear", "laser")
    assert [lidar.translation.x for lidar in frames.lidars(NOW)] == [0.2]


def test_the_rings_have_the_configured_distances() -> None:
    drawn = outlines(config(stop_distance_m=0.4, warning_distance_m=0.7))
    assert [(one.name, one.distance_m) for one in drawn] == [("hull", 0.0), ("stop", 0.4), ("warning", 0.7)]
    assert [np.hypot(*one.points[0]) for one in drawn] == pytest.approx([0.25, 0.65, 0.95])


@HULLS
@pytest.mark.parametrize("distance_m", [0.0, 0.3])
def test_each_point_of_a_line_has_its_distance_from_the_hull(hull: Hull, distance_m: float) -> None:
    assert hull.clearance(points_at(hull, distance_m)) == pytest.approx(distance_m, abs=1e-9)


@HULLS
def test_a_line_surrounds_the_hull_once_counter_clockwise_without_gaps(hull: Hull) -> None:
    points = points_at(hull, 0.3)
    steps = np.roll(points, -1, axis=0) - points
    middles = points + steps / 2
    assert hull.clearance(middles) == pytest.approx(0.3, abs=0.002)
    closed = np.concatenate([points, points[:1]])
    turns = np.diff(np.unwrap(np.arctan2(closed[:, 1], closed[:, 0])))
    assert (turns > 0.0).all()
    assert turns.sum() == pytest.approx(math.tau)


def test_the_line_at_no_distance_from_a_polygon_is_the_polygon() -> None:
    assert points_at(RECTANGLE, 0.0).tolist() == [list(corner) for corner in RECTANGLE.corners]
