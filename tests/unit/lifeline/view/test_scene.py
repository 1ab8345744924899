"""What each message draws, with known values."""

import math
from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
import pytest

from lifeline.view.scene import HIDDEN, INK, MODE_COLOURS, STOP_RING, WARNING_RING, Scene, scene_of
from lifeline.view.shapes import Area, Frame, Level, Line, LogLine, Points, Primitive, State, Value
from supervisor.config import SupervisorSection
from wire.messages import (
    Message,
    SafetyStatus,
    encode,
    header,
    laser_scan,
    odometry,
    planar_twist,
)

P = TypeVar("P")
BEAMS = 360


@pytest.fixture
def scene() -> Scene:
    return scene_of(SupervisorSection(), "robot")


def draw(scene: Scene, key: str, message: Message, time_s: float = 100.0) -> list[Primitive]:
    return scene.draw(f"/robot/{key}", time_s, encode(message))


def of(kind: type[P], primitives: Iterable[Any]) -> list[P]:
    return [one for one in primitives if isinstance(one, kind)]


def values(primitives: Iterable[Primitive]) -> dict[str, float]:
    return {one.path: one.value for one in of(Value, primitives)}


def states(primitives: Iterable[Primitive]) -> dict[str, str]:
    return {one.path: one.text for one in of(State, primitives)}


def status(mode: int, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - any fields of the message
    return SafetyStatus(header("base_link", 0), mode=mode, **fields)


def scan(ranges: "np.ndarray[tuple[int], np.dtype[np.float32]]") -> Message:
    return laser_scan(ranges, range_m=(0.1, 12.0), period_s=0.05, time_ns=0)


def full(distance_m: float) -> "np.ndarray[tuple[int], np.dtype[np.float32]]":
    return np.full(BEAMS, distance_m, dtype=np.float32)


def test_the_rings_are_at_the_stop_and_the_warning_distance(scene: Scene) -> None:
    rings = {one.path: one for one in of(Line, scene.fixed())}
    for name, away_m in (("stop", 0.30), ("warning", 0.50)):
        ring = rings[f"base_link/rings/{name}"].points_m
        assert np.hypot(ring[:, 0], ring[:, 1]) == pytest.approx(np.full(len(ring), 0.25 + away_m))


def test_odometry_places_the_robot_and_is_the_measured_velocity(scene: Scene) -> None:
    drawn = draw(scene, "odom", odometry((1.0, -2.0, 0.5), (0.4, -0.2), time_ns=0))
    (frame,) = of(Frame, drawn)
    assert (frame.name, frame.x_m, frame.y_m) == ("base_link", 1.0, -2.0)
    assert frame.yaw_rad == pytest.approx(0.5)
    assert values(drawn) == {"velocity/linear/measured": 0.4, "velocity/angular/measured": -0.2}


def test_the_driven_path_grows_by_steps_of_two_centimetres(scene: Scene) -> None:
    lengths: list[int] = []
    for x_m in (0.0, 0.01, 0.0201, 0.03, 0.05):
        lengths += [
            len(line.points_m)
            for line in of(Line, draw(scene, "odom", odometry((x_m, 0.0, 0.0), (0.0, 0.0), time_ns=0)))
        ]
    assert lengths == [1, 2, 3]


def test_a_pose_that_is_not_finite_moves_nothing(scene: Scene) -> None:
    drawn = draw(scene, "odom", odometry((math.nan, 0.0, 0.0), (0.1, 0.0), time_ns=0))
    assert not of(Frame, drawn)
    assert values(drawn)["velocity/linear/measured"] == 0.1


def test_cmd_vel_is_the_permitted_velocity(scene: Scene) -> None:
    assert values(draw(scene, "cmd_vel", planar_twist(0.3, 0.1))) == {
        "velocity/linear/permitted": 0.3,
        "velocity/angular/permitted": 0.1,
    }


def test_returns_are_coloured_by_their_distance_from_the_hull(scene: Scene) -> None:
    ranges = full(3.0)
    ranges[180], ranges[90] = 0.5, 0.7  # ahead at 0.25 m from the hull, to the right at 0.45 m
    points = {one.path: one for one in of(Points, draw(scene, "scan", scan(ranges)))}["lidar_scan/points"]
    assert points.points_m[180] == pytest.approx((0.5, 0.0), abs=1e-6)
    assert points.points_m[90] == pytest.approx((0.0, -0.7), abs=1e-6)
    assert [tuple(points.colours[beam]) for beam in (180, 90, 0)] == [STOP_RING, WARNING_RING, INK]


def test_a_scan_stays_where_the_robot_was_when_it_arrived(scene: Scene) -> None:
    draw(scene, "odom", odometry((1.0, 2.0, 0.3), (0.0, 0.0), time_ns=0))
    (frame,) = of(Frame, draw(scene, "scan", scan(full(3.0))))
    assert (frame.name, frame.x_m, frame.y_m) == ("lidar_scan", 1.0, 2.0)
    assert frame.yaw_rad == pytest.approx(0.3)


def test_a_hole_in_the_view_hides_places_and_is_not_free(scene: Scene) -> None:
    whole = draw(scene, "scan", scan(full(2.0)), 100.0)
    (area,) = of(Area, whole)
    assert len(area.triangles) == BEAMS
    ranges = full(2.0)
    ranges[170:190] = math.nan
    for time_s in (100.3, 100.6):  # longer than earlier scans stand in for the hole
        drawn = draw(scene, "scan", scan(ranges), time_s)
    hidden = {one.path: one for one in of(Points, drawn)}["lidar_scan/hidden"]
    (area,) = of(Area, drawn)
    assert len(area.triangles) == BEAMS - 21
    assert tuple(hidden.colours[0]) == HIDDEN
    bearings = np.degrees(np.arctan2(hidden.points_m[:, 1], hidden.points_m[:, 0]))
    assert len(bearings) > 20
    assert np.abs(bearings).max() < 45.0


def test_a_scan_that_proves_nothing_is_named_and_draws_no_points(scene: Scene) -> None:
    drawn = draw(scene, "scan", scan(full(math.nan)))
    assert states(drawn) == {"scans/lidar": "no reading that the profile explains"}
    assert not of(Points, drawn)
    assert states(draw(scene, "scan", scan(full(2.0)), 100.1)) == {"scans/lidar": ""}


def test_two_lidars_draw_in_frames_of_their_own() -> None:
    config = SupervisorSection.model_validate(
        {
            "lidars": [
                {"name": "front", "topic": "scan", "x_m": 0.2},
                {"name": "rear", "topic": "scan_rear", "x_m": -0.2, "yaw_rad": math.pi},
            ]
        }
    )
    scene = scene_of(config, "robot")
    front, rear = draw(scene, "scan", scan(full(2.0))), draw(scene, "scan_rear", scan(full(2.0)))
    assert [one.path for one in of(Area, front)] == ["front_scan/free"]
    assert [one.path for one in of(Area, rear)] == ["rear_scan/free"]
    points = of(Points, rear)[0].points_m
    assert points[180] == pytest.approx((-2.2, 0.0), abs=1e-6)


def test_a_status_shows_mode_reasons_and_the_requested_velocity(scene: Scene) -> None:
    stopped = status(
        SafetyStatus.STOPPED,
        reasons=["OBSTACLE", "COMMAND_TIMEOUT"],
        causes=["OBSTACLE"],
        latched=["COMMAND_TIMEOUT"],
        owner="teleop",
        commanded=planar_twist(0.5, 0.25),
        nearest_m=0.31,
        nearest_bearing_rad=0.0,
        warning=True,
        detail="something is too close ahead",
    )
    drawn = draw(scene, "supervisor/status", stopped)
    assert states(drawn) == {"mode": "STOPPED", "reasons/now": "OBSTACLE", "reasons/over": "COMMAND_TIMEOUT"}
    found = values(drawn)
    assert (found["velocity/linear/requested"], found["velocity/angular/requested"]) == (0.5, 0.25)
    assert (found["distance/nearest"], found["distance/stop"], found["distance/warning"]) == (
        0.31,
        0.30,
        0.50,
    )
    (line,) = of(LogLine, drawn)
    assert line.level is Level.ERROR
    assert line.text == (
        "STOPPED by teleop because of OBSTACLE, COMMAND_TIMEOUT (over) (something is too close ahead) "
        "(nearest 0.31 m, ahead)"
    )
    (hull,) = of(Area, drawn)
    assert (hull.path, hull.colour) == ("base_link/hull", MODE_COLOURS["STOPPED"])


def test_an_unchanged_status_is_logged_once(scene: Scene) -> None:
    assert of(LogLine, draw(scene, "supervisor/status", status(SafetyStatus.READY)))
    again = draw(scene, "supervisor/status", status(SafetyStatus.READY, nearest_m=1.0))
    assert not of(LogLine, again)
    assert not of(State, again)
    assert values(again)["distance/nearest"] == 1.0


@pytest.mark.parametrize(
    ("mode", "fields", "level"),
    [
        (SafetyStatus.READY, {}, Level.INFO),
        (SafetyStatus.DRIVING, {}, Level.INFO),
        (SafetyStatus.DRIVING, {"warning": True}, Level.WARN),
        (SafetyStatus.LIMITED, {}, Level.WARN),
        (SafetyStatus.READY, {"alarm": True}, Level.ERROR),
    ],
)
def test_the_level_of_a_log_line_follows_the_danger(
    scene: Scene, mode: int, fields: dict[str, Any], level: Level
) -> None:
    (line,) = of(LogLine, draw(scene, "supervisor/status", status(mode, **fields)))
    assert line.level is level


def test_control_characters_of_a_payload_are_not_shown(scene: Scene) -> None:
    (line,) = of(LogLine, draw(scene, "supervisor/status", status(SafetyStatus.READY, owner="a\x1b[2Jb")))
    assert "\x1b" not in line.text


def test_other_topics_and_undecodable_payloads_draw_nothing(scene: Scene) -> None:
    assert scene.draw("/robot/imu", 0.0, b"") == []
    assert scene.draw("/other/odom", 0.0, encode(odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))) == []
    assert scene.draw("/robot/odom", 0.0, b"\x00\x01\x00\x00abc") == []
    assert scene.undecodable == 1
