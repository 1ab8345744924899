"""The picture from above: sides and distances are correct."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop.screen.top_view import clearance_m, draw_top_view, robot_of, scale_of
from teleop.screen.view import Line, Robot, Tone
from tests.unit.teleop.views import room, scan_of, text
from wire.messages import LaserScan

COLUMNS, ROWS = 40, 20
FAR_M = 50.0
"""Outside every picture."""
ROUND = Robot()
BOX = Robot(corners_m=((0.4, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.4, -0.2)))

Place = tuple[int, int]
"""Dots down from the top and right from the left side."""


def one_beam(bearing_rad: float, range_m: float, **fields: Any) -> LaserScan:  # noqa: ANN401 - any field of the scan
    numbers: dict[str, Any] = {"range_min_m": 0.1, "range_max_m": 12.0} | fields
    return scan_of([range_m], bearing_rad, 1.0, **numbers)


def cells(lines: list[Line], tones: Iterable[Tone]) -> list[tuple[int, int, str]]:
    """(row, column, character) of everything in one of these tones."""
    found: list[tuple[int, int, str]] = []
    for row, line in enumerate(lines):
        tones_here = [segment.tone for segment in line for _ in segment.text]
        found += [
            (row, column, char)
            for column, (char, tone) in enumerate(zip(text(line), tones_here, strict=True))
            if tone in tones and char != " "
        ]
    return found


def dots(lines: list[Line], *tones: Tone) -> set[Place]:
    """Where the dots in one of these tones are."""
    bits = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
    return {
        (4 * row + down, 2 * column + right)
        for row, column, char in cells(lines, tones)
        for down in range(4)
        for right in range(2)
        if (ord(char) - 0x2800) & bits[down][right]
    }


POINTS = (Tone.PLAIN, Tone.CAUTION, Tone.STOP)


def point_of(scan: LaserScan, robot: Robot = ROUND) -> Place:
    (place,) = dots(draw_top_view(scan, robot, COLUMNS, ROWS), *POINTS)
    return place


def test_the_picture_has_exactly_the_size_that_is_asked_for() -> None:
    lines = draw_top_view(room(1.0, 1.0, 1.0, 1.0), ROUND, COLUMNS, ROWS)
    assert [len(text(line)) for line in lines] == [COLUMNS] * ROWS


MIDDLE = range(39, 42)


@pytest.mark.parametrize(
    ("bearing_rad", "down", "right"),
    [
        (0.0, range(30), MIDDLE),
        (math.pi / 2, MIDDLE, range(30)),
        (math.pi, range(50, 80), MIDDLE),
        (-math.pi / 2, MIDDLE, range(50, 80)),
        (math.pi / 4, range(35), range(35)),
    ],
)
def test_ahead_is_up_and_left_is_left(bearing_rad: float, down: range, right: range) -> None:
    place = point_of(one_beam(bearing_rad, 1.2))
    assert place[0] in down
    assert place[1] in right


def test_a_wall_on_the_left_is_a_line_on_the_left() -> None:
    wall = dots(draw_top_view(room(FAR_M, 1.0, FAR_M, FAR_M), ROUND, COLUMNS, ROWS), *POINTS)
    columns = {right for _, right in wall}
    expected = COLUMNS - 1.0 / scale_of(ROUND, COLUMNS, ROWS).dot_m
    assert all(abs(column - expected) <= 1 for column in columns)
    assert len({down for down, _ in wall}) > 2 * ROWS  # it is long


@settings(deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(0.9, 1.6))
def test_a_point_is_drawn_where_it_is_to_within_a_dot(bearing_rad: float, range_m: float) -> None:
    down, right = point_of(one_beam(bearing_rad, range_m))
    dot_m = scale_of(ROUND, COLUMNS, ROWS).dot_m
    ahead_m, left_m = (2 * ROWS - 0.5 - down) * dot_m, (COLUMNS - 0.5 - right) * dot_m
    assert abs(ahead_m - range_m * math.cos(bearing_rad)) <= 0.501 * dot_m
    assert abs(left_m - range_m * math.sin(bearing_rad)) <= 0.501 * dot_m


def test_the_lidars_mount_counts() -> None:
    turned = Robot(lidar_x_m=0.2, lidar_yaw_rad=math.pi / 2)
    dot_m = scale_of(turned, COLUMNS, ROWS).dot_m
    down, right = point_of(one_beam(0.0, 1.2), turned)
    assert abs((2 * ROWS - 0.5 - down) * dot_m - 0.2) <= dot_m
    assert abs((COLUMNS - 0.5 - right) * dot_m - 1.2) <= dot_m


def test_the_scan_of_a_lidar_upside_down_is_mirrored() -> None:
    turned = Robot(lidar_yaw_rad=math.pi / 2, lidar_flip=True)
    dot_m = scale_of(turned, COLUMNS, ROWS).dot_m
    down, right = point_of(one_beam(math.pi / 6, 1.2), turned)
    assert abs((2 * ROWS - 0.5 - down) * dot_m - 0.6) <= dot_m
    assert abs((COLUMNS - 0.5 - right) * dot_m - 1.2 * math.cos(math.pi / 6)) <= dot_m
    assert robot_of({"supervisor": {"lidar": {"flip": True}}}).lidar_flip
    assert not robot_of({"supervisor": {"lidar": {"flip": "no"}}}).lidar_flip


@pytest.mark.parametrize(
    ("gap_m", "tone"),
    [(0.29, Tone.STOP), (0.31, Tone.CAUTION), (0.49, Tone.CAUTION), (0.51, Tone.PLAIN)],
)
def test_a_point_has_the_tone_of_its_distance_from_the_hull(gap_m: float, tone: Tone) -> None:
    assert dots(draw_top_view(one_beam(0.3, 0.25 + gap_m), ROUND, COLUMNS, ROWS), tone)


@pytest.mark.parametrize("range_m", [math.nan, math.inf, -math.inf, 0.0, 0.05, 12.5, FAR_M])
def test_what_is_no_reading_or_out_of_the_picture_is_no_point(range_m: float) -> None:
    assert draw_top_view(one_beam(0.0, range_m), ROUND, COLUMNS, ROWS) == draw_top_view(
        None, ROUND, COLUMNS, ROWS
    )


def test_a_scan_that_is_too_old_is_grey() -> None:
    lines = draw_top_view(room(0.6, 1.0, 1.0, 1.0), ROUND, COLUMNS, ROWS, is_stale=True)
    assert {segment.tone for line in lines for segment in line} == {Tone.DIM, Tone.STRONG}


def test_the_rings_are_at_the_stop_and_the_warning_distance() -> None:
    robot = Robot(radius_m=0.3, stop_distance_m=0.4, warning_distance_m=0.8)
    dot_m = scale_of(robot, COLUMNS, ROWS).dot_m
    ring = dots(draw_top_view(None, robot, COLUMNS, ROWS), Tone.DIM)
    gaps_m = {math.hypot(2 * ROWS - 0.5 - down, COLUMNS - 0.5 - right) * dot_m - 0.3 for down, right in ring}
    assert all(min(abs(gap_m - 0.4), abs(gap_m - 0.8)) <= dot_m for gap_m in gaps_m)
    assert any(abs(gap_m - 0.4) <= dot_m for gap_m in gaps_m)
    assert any(abs(gap_m - 0.8) <= dot_m for gap_m in gaps_m)


@pytest.mark.parametrize("robot", [Robot(), BOX])
def test_the_hull_is_drawn_with_its_nose_ahead(robot: Robot) -> None:
    hull = dots(draw_top_view(None, robot, COLUMNS, ROWS), Tone.STRONG)
    axis = {down for down, right in hull if abs(right - (COLUMNS - 0.5)) < 1}
    front, back = min(axis), max(axis)
    ahead = {down for down in axis if down < 2 * ROWS}
    behind = {down for down in axis if down >= 2 * ROWS}
    assert ahead == set(range(front, 2 * ROWS))  # a line from the middle to the front
    assert len(behind) < back - 2 * ROWS + 1  # none to the back


def test_a_hull_with_corners_is_as_wide_and_long_as_they_say() -> None:
    dot_m = scale_of(BOX, COLUMNS, ROWS).dot_m
    hull = dots(draw_top_view(None, BOX, COLUMNS, ROWS), Tone.STRONG)
    assert (2 * ROWS - min(down for down, _ in hull)) * dot_m == pytest.approx(0.4, abs=dot_m)
    assert (max(down for down, _ in hull) + 1 - 2 * ROWS) * dot_m == pytest.approx(0.3, abs=dot_m)
    assert (COLUMNS - min(right for _, right in hull)) * dot_m == pytest.approx(0.2, abs=dot_m)


def test_a_point_over_the_rings_is_seen_and_one_inside_the_hull_too() -> None:
    assert dots(draw_top_view(one_beam(0.0, 0.55), ROUND, COLUMNS, ROWS), Tone.CAUTION, Tone.STOP)
    assert dots(draw_top_view(one_beam(0.0, 0.2), ROUND, COLUMNS, ROWS), Tone.STOP)


def test_in_ascii_the_same_picture_has_a_character_for_each_kind() -> None:
    lines = draw_top_view(room(0.6, 0.9, 1.4, 0.5), Robot(), 60, 24, unicode=False)
    drawn = "".join(map(text, lines))
    assert drawn.isascii()
    assert set(drawn) == set(" .:o+X#")


def test_more_room_shows_more_once_the_dots_are_fine_enough() -> None:
    small, large = scale_of(Robot(), 30, 14), scale_of(Robot(), 200, 80)
    assert large.dot_m < small.dot_m
    assert large.rows * large.dot_m > small.rows * small.dot_m


@pytest.mark.parametrize("corners", [BOX.corners_m, BOX.corners_m[::-1]])
def test_the_distance_from_a_hull_with_corners(corners: tuple[tuple[float, float], ...]) -> None:
    points = np.array([[0.9, 0.0], [0.0, 0.5], [0.7, 0.6], [0.1, 0.1], [0.4, 0.2]])
    assert clearance_m(points, Robot(corners_m=corners)) == pytest.approx([0.5, 0.3, 0.5, 0.0, 0.0])


def test_the_distance_from_a_round_hull() -> None:
    assert clearance_m(np.array([[0.3, 0.4], [0.1, 0.0]]), Robot()) == pytest.approx([0.25, 0.0])


ANY = st.floats(width=32)
CORNERS = st.lists(st.tuples(ANY, ANY), max_size=4).map(tuple)


@settings(deadline=None)
@given(
    st.lists(ANY, max_size=50),
    ANY,
    ANY,
    ANY,
    ANY,
    st.builds(Robot, ANY, CORNERS, ANY, ANY, ANY, ANY, ANY),
    st.integers(1, 60),
    st.integers(1, 30),
    st.booleans(),
)
def test_whatever_the_scan_and_the_configuration_say_there_is_a_picture_of_its_size(
    ranges: list[float],
    angle_min_rad: float,
    increment_rad: float,
    range_min_m: float,
    range_max_m: float,
    robot: Robot,
    columns: int,
    rows: int,
    unicode: bool,  # noqa: FBT001 - drawn by hypothesis
) -> None:
    scan = scan_of(ranges, angle_min_rad, increment_rad, range_min_m, range_max_m)
    lines = draw_top_view(scan, robot, columns, rows, unicode=unicode)
    assert [len(text(line)) for line in lines] == [columns] * rows
