"""What a page gets of a robot's messages, with known values."""

import json
import math
import re
from typing import Any

import numpy as np
import pytest

from lifeline.view.ghost import Stopping
from lifeline.view.picture import FRESH_S, LATE_S, MAX_RAYS, Picture
from lifeline.view.scene import scene_of
from supervisor.config import NamedLidarSection, SupervisorSection
from tests.unit.lifeline.view.test_scene import full, scan, status
from wire.messages import (
    EstopStationStatus,
    Message,
    SafetyStatus,
    encode,
    laser_scan,
    odometry,
    planar_twist,
)

STOPPING = Stopping(0.2, 1.0, 4.0)


class Page:
    """A picture, and the messages that it hears."""

    def __init__(self, config: SupervisorSection = SupervisorSection()) -> None:  # noqa: B008 - it is frozen
        self.picture = Picture(scene_of(config, "robot"), STOPPING, 1.0)

    def hear(self, key: str, message: Message, arrival_s: float = 100.0) -> None:
        self.picture.hear(f"/robot/{key}", arrival_s, encode(message))

    def drives(
        self, x_m: float, speed_m_s: float, *, permitted: bool = True, arrival_s: float = 100.0
    ) -> None:
        self.hear("cmd_vel", planar_twist(0.5 if permitted else 0.0, 0.0), arrival_s)
        self.hear("odom", odometry((x_m, 0.0, 0.0), (speed_m_s, 0.0), time_ns=0), arrival_s)

    def shows(self, now_s: float = 100.0) -> dict[str, Any]:
        """Return the picture as a browser reads it."""
        return json.loads(json.dumps(self.picture.picture(now_s), allow_nan=False))


@pytest.fixture
def page() -> Page:
    return Page()


def test_nothing_is_known_before_the_first_message(page: Page) -> None:
    shown = page.shows()
    assert (shown["scans"], shown["mode"], shown["age_s"], shown["stop"]) == ([], "", None, None)
    assert shown["why"] == "nothing is heard from the supervisor"
    assert shown["own_step"] == "wait; if this lasts, check that the robot runs"


def test_the_constant_shapes_are_the_hull_and_its_rings_in_centimetres(page: Page) -> None:
    robot = json.loads(json.dumps(page.picture.robot()))
    for name, radius_cm in (("outline", 25), ("stop", 55), ("warning", 75)):
        line = np.array(robot[name]).reshape(-1, 2)
        assert np.hypot(line[:, 0], line[:, 1]) == pytest.approx(np.full(len(line), radius_cm), abs=0.8)
    assert robot["most_m_s"] == 1.0


def test_returns_are_where_they_were_seen_and_stay_there_while_the_robot_drives_on(page: Page) -> None:
    page.hear("odom", odometry((1.0, 2.0, math.pi / 2), (0.0, 0.0), time_ns=0))
    page.hear("scan", scan(full(2.0)))
    page.hear("odom", odometry((1.0, 2.5, math.pi / 2), (0.0, 0.0), time_ns=0))
    (one,) = page.shows()["scans"]
    points = np.array(one["points"]).reshape(-1, 2)
    assert points[:, 0].max() == pytest.approx(150, abs=1)
    assert points[:, 0].min() == pytest.approx(-250, abs=1)
    assert points[:, 1].max() == pytest.approx(200, abs=1)
    assert len(one["classes"]) == len(points)
    assert len(one["free"]) // 2 == len(points)


def test_returns_have_the_class_of_their_distance(page: Page) -> None:
    page.hear("odom", odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))
    ranges = full(2.0)
    ranges[:10], ranges[100:120] = 0.5, 0.7
    page.hear("scan", scan(ranges))
    (one,) = page.shows()["scans"]
    classes = np.array(one["classes"])
    assert [(classes == kind).sum() for kind in (0, 1, 2)] == [330, 20, 10]


def test_old_scans_and_a_silent_supervisor_are_not_shown(page: Page) -> None:
    page.hear("odom", odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))
    page.hear("scan", scan(full(2.0)))
    page.hear("supervisor/status", status(SafetyStatus.READY))
    assert page.shows(100.5)["age_s"] == 0.5
    old = page.shows(100.0 + FRESH_S + 0.1)
    assert (old["scans"], old["mode"]) == ([], "")


def test_a_picture_has_a_time_only_if_it_shows_a_scan_of_each_lidar_around_the_robot() -> None:
    both = (NamedLidarSection(name="a", topic="a"), NamedLidarSection(name="b", topic="b"))
    page = Page(SupervisorSection(lidars=both))
    page.hear("a", scan(full(2.0)), 99.9)
    page.hear("b", scan(full(2.0)), 100.0)
    assert page.picture.scan_s == -math.inf
    page.hear("odom", odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))
    assert page.picture.scan_s == 99.9
    half = Page(SupervisorSection(lidars=both))
    half.hear("odom", odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))
    half.hear("a", scan(full(2.0)))
    assert half.picture.scan_s == -math.inf


def test_a_fine_scan_is_thinned_out(page: Page) -> None:
    page.hear("odom", odometry((0.0, 0.0, 0.0), (0.0, 0.0), time_ns=0))
    fine = laser_scan(np.full(5000, 2.0, dtype=np.float32), range_m=(0.1, 12.0), period_s=0.05, time_ns=0)
    page.hear("scan", fine)
    for one in page.shows()["scans"]:
        assert len(one["points"]) <= 2 * MAX_RAYS
        assert len(one["free"]) <= 2 * (MAX_RAYS + 1)


def test_a_stop_is_in_words_with_what_to_do(page: Page) -> None:
    stopped = status(
        SafetyStatus.STOPPED, reasons=["COMMAND_TIMEOUT"], causes=["COMMAND_TIMEOUT"], owner="teleop"
    )
    page.hear("supervisor/status", stopped)
    shown = page.shows()
    assert shown["mode"] == "STOPPED"
    assert "WHO" not in shown["why"]
    assert "NEUTRAL" not in shown["step"]
    assert shown["step"]
    assert shown["events"] == [[0.0, "STOPPED by teleop because of COMMAND_TIMEOUT"]]


def test_a_reset_is_named_without_the_key_of_teleop(page: Page) -> None:
    for reason in ("ESTOP", "ESTOP_STATION_LOST"):
        page.hear("supervisor/status", status(SafetyStatus.STOPPED, reasons=[reason], causes=[reason]))
        shown = page.shows()
        assert re.fullmatch(r"the driver requests zero, then resets( if still stopped)?", shown["step"])
        assert re.fullmatch(r"let go, then press Reset( if still stopped)?", shown["own_step"])


def test_a_lost_station_is_to_be_started_only_while_it_is_missed(page: Page) -> None:
    for state, is_missed in ((EstopStationStatus.LOST, True), (EstopStationStatus.HEARD, False)):
        station = EstopStationStatus("door", required=True, state=state, pressed=False)
        reasons = ["ESTOP_STATION_LOST"]
        stopped = status(SafetyStatus.STOPPED, reasons=reasons, causes=reasons, estop_stations=[station])
        page.hear("supervisor/status", stopped)
        assert page.shows()["own_step"].startswith("start it, ") is is_missed


def test_nobody_is_shown_as_the_driver_while_no_source_commands_the_robot(page: Page) -> None:
    for reason, owner in (("COMMAND_TIMEOUT", "teleop"), ("NO_COMMAND", "")):
        stopped = status(SafetyStatus.STOPPED, reasons=[reason], causes=[reason], owner="teleop")
        page.hear("supervisor/status", stopped)
        assert page.shows()["owner"] == owner


def test_the_way_of_a_stop_is_shown_beside_its_ghost_when_the_robot_stands(page: Page) -> None:
    page.drives(0.0, 1.0)
    assert page.shows()["ghost"] == [70.0, 0.0, 0.0]
    page.drives(0.1, 1.0, permitted=False, arrival_s=100.1)
    page.drives(0.4, 0.5, permitted=False, arrival_s=100.4)
    assert page.shows()["stop"] is None
    page.drives(0.6, 0.0, permitted=False, arrival_s=100.8)
    assert page.shows()["stop"] == pytest.approx([60.0, 70.0])
    page.drives(0.6, 0.0, permitted=False, arrival_s=100.9)
    assert page.shows()["stop"] == pytest.approx([60.0, 70.0])


STEP_S, SPEED_M_S = 0.05, 0.5
MOST_M = SPEED_M_S * (STEP_S + LATE_S)
"""The longest way of a step that this speed explains."""


@pytest.mark.parametrize(
    ("to_m", "after_s", "counts"),
    [
        (0.0, STEP_S, True),
        (MOST_M - 0.001, STEP_S, True),
        (MOST_M + 0.001, STEP_S, False),
        (-MOST_M - 0.001, STEP_S, False),
        (-2.39, STEP_S, False),
        (0.0, FRESH_S - 0.001, True),
        (0.0, FRESH_S + 0.001, False),
    ],
)
def test_a_jump_or_a_gap_of_odometry_is_no_way_of_a_stop(
    page: Page,
    to_m: float,
    after_s: float,
    counts: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    """A restarted sim begins at its start position."""
    page.drives(0.0, SPEED_M_S)
    page.drives(0.0, SPEED_M_S, permitted=False, arrival_s=100.05)
    page.drives(to_m, 0.0, permitted=False, arrival_s=100.05 + after_s)
    assert (page.shows()["stop"] is not None) is counts


def test_motion_that_is_permitted_again_ends_the_comparison(page: Page) -> None:
    page.drives(0.0, 1.0)
    page.drives(0.1, 1.0, permitted=False, arrival_s=100.1)
    page.drives(0.2, 0.8, arrival_s=100.2)
    page.drives(0.2, 0.0, arrival_s=100.3)
    assert page.shows()["stop"] is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e30])
def test_any_number_gives_a_picture_that_a_browser_can_read(page: Page, number: float) -> None:
    page.hear("odom", odometry((number, 0.0, 0.0), (number, number), time_ns=0))
    page.hear("cmd_vel", planar_twist(number, number))
    page.hear("scan", scan(np.full(360, number, dtype=np.float64).astype(np.float32)))
    page.hear(
        "supervisor/status",
        status(SafetyStatus.LIMITED, nearest_m=number, owner="\x1b[2J" * 9, reasons=["X\x00"]),
    )
    shown = page.shows()
    assert "\x1b" not in json.dumps(shown, ensure_ascii=False)
    page.picture.hear("/robot/supervisor/status", 100.0, b"garbage")
    page.shows()
