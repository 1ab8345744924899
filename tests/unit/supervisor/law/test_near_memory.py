"""The memory of near points, and when points are dropped."""

import math

import numpy as np
import pytest

from supervisor.law.near_memory import (
    BESIDE_RAD,
    MISSES,
    MOST_POINTS,
    ONE_SURFACE_M,
    SAME_M,
    Remembered,
    remember,
)
from supervisor.law.scan import Geometry, Mount
from tests.unit.supervisor.law.views import BEAM_RAD, BEAMS, view_of

AHEAD = BEAMS // 2
BESIDE = slice(AHEAD - 2, AHEAD + 3)
"""The beams that are checked for a point straight ahead."""

NO_RETURN, UNKNOWN = math.inf, math.nan


def room(distance_m: float = 3.0) -> np.ndarray:
    return np.full(BEAMS, distance_m)


def point(x_m: float = 1.0, y_m: float = 0.0, misses: int = 0) -> Remembered:
    return Remembered(np.array([[x_m, y_m]]), np.array([float(misses)]))


def left(earlier: Remembered, readings: np.ndarray, mount: Mount | None = None) -> list[list[float]]:
    return remember(earlier, view_of(readings), mount or Mount()).points.tolist()


def test_without_earlier_points_there_is_nothing_to_remember() -> None:
    assert left(Remembered(), room()) == []


def test_a_point_is_dropped_at_once_when_every_beam_around_it_returns_from_behind() -> None:
    behind, before = room(), room()
    behind[BESIDE] = math.nextafter(1.0 + SAME_M, 2.0)
    assert left(point(), behind) == []
    before[BESIDE] = 3.0
    before[AHEAD + 2] = NO_RETURN
    assert left(point(), before) == [[1.0, 0.0]], "one beam did not return"


def test_a_point_that_a_scan_shows_again_is_no_longer_remembered() -> None:
    for distance_m in (1.0 - SAME_M + 1e-9, 1.0, 1.0 + SAME_M - 1e-9):
        ranges = room()
        ranges[AHEAD + 2] = distance_m
        assert left(point(), ranges) == []
    near, far = room(), room()
    near[BESIDE] = 1.0 - SAME_M - 1e-9
    assert left(point(), near) == [[1.0, 0.0]], "another object is in front of it"
    far[AHEAD + 3] = 1.0
    far[BESIDE] = NO_RETURN
    assert left(point(), far) == [[1.0, 0.0]], "that beam is too far from the point"


def test_a_beam_that_ends_at_the_lidar_s_range_shows_nothing_there() -> None:
    silent = view_of(room(NO_RETURN), range_max_m=1.0 + SAME_M / 2)
    memory = point()
    for _ in range(MISSES - 1):
        memory = remember(memory, silent, Mount())
        assert memory.points.tolist() == [[1.0, 0.0]]
    assert len(remember(memory, silent, Mount()).points) == 0


def test_two_returns_of_a_slanted_surface_show_a_point_between_them() -> None:
    slant, gap = room(), room(NO_RETURN)
    slant[BESIDE] = (0.82, 0.88, 1.08, 1.14, 1.2)
    assert left(point(), slant) == []
    gap[AHEAD - 2], gap[AHEAD + 2] = 0.8, math.nextafter(0.8 + ONE_SURFACE_M, 2.0)
    assert left(point(), gap) == [[1.0, 0.0]], "two objects, with the point between them"


def test_a_point_that_no_beam_covers_stays_for_any_number_of_scans() -> None:
    for cover_m in (UNKNOWN, 0.5):
        ranges = room()
        ranges[AHEAD] = cover_m
        memory = point()
        for _ in range(10 * MISSES):
            memory = remember(memory, view_of(ranges), Mount())
        assert memory.points.tolist() == [[1.0, 0.0]]
        assert memory.misses.tolist() == [0]


def test_a_point_is_dropped_only_after_the_full_number_of_covering_scans_without_a_reading() -> None:
    ranges, memory = room(NO_RETURN), point()
    for missed in range(1, MISSES):
        memory = remember(memory, view_of(ranges), Mount())
        assert memory.misses.tolist() == [missed]
    assert remember(memory, view_of(ranges), Mount()).points.tolist() == []


def test_a_scan_that_does_not_cover_a_point_leaves_its_misses_unchanged() -> None:
    dirty = room(NO_RETURN)
    dirty[AHEAD] = UNKNOWN
    assert remember(point(misses=3), view_of(dirty), Mount()).misses.tolist() == [3]


def test_a_ray_filled_from_an_earlier_scan_does_not_count_as_a_miss() -> None:
    """A direction that is filled from an earlier scan is not new evidence."""
    view = view_of(room(NO_RETURN))
    explained_s = view.explained_s.copy()
    explained_s[AHEAD] = -0.05
    filled = view._replace(explained_s=explained_s)
    assert remember(point(misses=MISSES - 1), filled, Mount()).misses.tolist() == [MISSES - 1]


def test_of_too_many_points_the_nearest_are_kept() -> None:
    distance_m = np.linspace(0.5, 2.5, MOST_POINTS + 50)
    points = np.stack([distance_m, np.zeros_like(distance_m)], axis=1)[::-1]
    memory = Remembered(points, np.arange(len(points), dtype=np.float64) % 3)
    kept = remember(memory, view_of(room(NO_RETURN)), Mount())
    assert sorted(kept.points[:, 0].tolist()) == distance_m[:MOST_POINTS].tolist()
    exactly = Remembered(points[-MOST_POINTS:], np.zeros(MOST_POINTS))
    assert len(remember(exactly, view_of(room(NO_RETURN)), Mount()).points) == MOST_POINTS
    came = dict(zip(points[:, 0].tolist(), memory.misses.tolist(), strict=True))
    for x_m, misses in zip(kept.points[:, 0].tolist(), kept.misses.tolist(), strict=True):
        assert misses == came[x_m] + 1, "each keeps its own misses"


@pytest.mark.parametrize("sign", [1, -1], ids=["counter-clockwise", "clockwise"])
@pytest.mark.parametrize("bearing_rad", [-3.14, -3.1, -2.0, -0.7, 0.0, 0.3, 1.57, 2.9, 3.14, math.pi])
def test_the_beams_beside_a_point_are_found_for_both_directions_of_rotation(
    sign: int, bearing_rad: float
) -> None:
    geometry = Geometry(BEAMS, -sign * math.pi, sign * BEAM_RAD)
    angles = geometry.angle_min + geometry.increment * np.arange(BEAMS)
    off_rad = np.abs(np.arctan2(np.sin(angles - bearing_rad), np.cos(angles - bearing_rad)))
    earlier = point(math.cos(bearing_rad), math.sin(bearing_rad))
    shown = np.where(off_rad < 0.6 * BEAM_RAD, 1.0, NO_RETURN)
    assert remember(earlier, view_of(shown, geometry), Mount()).points.tolist() == []
    elsewhere = np.where(off_rad < BESIDE_RAD + BEAM_RAD, NO_RETURN, 1.0)
    assert len(remember(earlier, view_of(elsewhere, geometry), Mount()).points) == 1


@pytest.mark.parametrize("sign", [1, -1], ids=["counter-clockwise", "clockwise"])
def test_a_point_outside_a_partial_view_is_not_covered(sign: int) -> None:
    beams = 181
    geometry = Geometry(beams, -sign * math.pi / 2, sign * BEAM_RAD)
    view = view_of(np.full(beams, 3.0), geometry)
    for bearing_deg in (91.0, 100.0, 180.0, -100.0, -91.0):
        bearing_rad = math.radians(bearing_deg)
        memory = point(math.cos(bearing_rad), math.sin(bearing_rad))
        for _ in range(2 * MISSES):
            memory = remember(memory, view, Mount())
        assert len(memory.points) == 1, bearing_deg
    inside = point(math.cos(1.5), math.sin(1.5))
    assert remember(inside, view, Mount()).points.tolist() == []


def test_the_mount_of_the_lidar_is_applied_to_the_points() -> None:
    mount = Mount(0.5, 0.2, math.pi / 2)
    seen_ahead_of_the_base = AHEAD - BEAMS // 4
    ranges = room(NO_RETURN)
    ranges[seen_ahead_of_the_base] = 0.5
    assert left(point(1.0, 0.2), ranges, mount) == []
    ranges[seen_ahead_of_the_base] = 1.0
    assert left(point(1.0, 0.2), ranges, mount) == [[1.0, 0.2]]


@pytest.mark.parametrize("yaw_rad", [-3.0, -1.0, 1.0, 3.0])
@pytest.mark.parametrize("bearing_rad", [-3.0, -1.0, 1.0, 3.0])
def test_a_point_is_found_at_every_yaw_of_the_lidar(yaw_rad: float, bearing_rad: float) -> None:
    angles = yaw_rad - math.pi + BEAM_RAD * np.arange(BEAMS)
    off_rad = np.abs(np.arctan2(np.sin(angles - bearing_rad), np.cos(angles - bearing_rad)))
    ranges = np.where(off_rad < 0.6 * BEAM_RAD, 1.0, NO_RETURN)
    earlier = point(math.cos(bearing_rad), math.sin(bearing_rad))
    assert left(earlier, ranges, Mount(yaw_rad=yaw_rad)) == []


def test_several_points_are_judged_independently() -> None:
    """Ahead: shown by a beam beside it; left: passed by every beam; right: covered; behind: not covered."""
    ranges = room()
    ranges[AHEAD + 2] = 1.0
    ranges[BEAMS // 4 - 2 : BEAMS // 4 + 3] = NO_RETURN
    ranges[0] = UNKNOWN
    earlier = Remembered(np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [-1.0, 0.0]]), np.zeros(4))
    assert [earlier.points[n].tolist() for n in range(4)][2:] == left(earlier, ranges)
    assert remember(earlier, view_of(ranges), Mount()).misses.tolist() == [1.0, 0.0]


def test_a_beam_that_ends_exactly_at_a_point_covers_it() -> None:
    for range_max_m, misses in ((1.0, [1.0]), (math.nextafter(1.0, 0.0), [0.0])):
        view = view_of(room(NO_RETURN), range_max_m=range_max_m)
        assert remember(point(), view, Mount()).misses.tolist() == misses


def test_a_return_shows_a_point_up_to_exactly_the_same_place_distance() -> None:
    """Near the lidar, where no difference of distances is rounded."""
    assert 2 * SAME_M - SAME_M == SAME_M
    for distance_m, shown in ((2 * SAME_M, True), (math.nextafter(2 * SAME_M, 1.0), False)):
        ranges = room(NO_RETURN)
        ranges[AHEAD + 1] = distance_m
        assert (left(point(SAME_M), ranges) == []) is shown


def test_two_returns_are_one_surface_only_below_the_limit_of_their_difference() -> None:
    nearest_m, farthest_m = 0.1, 0.5
    assert farthest_m - nearest_m == ONE_SURFACE_M
    for far_m, shown in ((math.nextafter(farthest_m, 0.0), True), (farthest_m, False)):
        ranges = room(NO_RETURN)
        ranges[AHEAD - 2], ranges[AHEAD + 2] = nearest_m, far_m
        assert (left(point(0.3), ranges) == []) is shown


def test_the_slant_is_computed_separately_for_each_point() -> None:
    ranges = room()
    ranges[BESIDE] = (0.82, 0.88, 1.08, 1.14, 1.2)
    ranges[3 * BEAMS // 4 - 2 : 3 * BEAMS // 4 + 3] = (1.82, 1.88, 2.08, 2.14, 2.2)
    earlier = Remembered(np.array([[1.0, 0.0], [0.0, 2.0]]), np.zeros(2))
    assert left(earlier, ranges) == []
