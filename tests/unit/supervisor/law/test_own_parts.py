"""Posts of the robot in front of its lidar: the sector that masks them is named."""

import math

import numpy as np
import pytest

from supervisor.law.clearance import Circle, Floats
from supervisor.law.own_parts import AT_HULL_M, SAME_PLACE_M, WIDEST_RAD, own_sector
from supervisor.law.scan import Geometry, Mount, rays_of
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, Law, ring, with_lidar
from tests.unit.supervisor.law.views import BEAM_RAD, BEAMS, GEOMETRY, view_of
from wire.reasons import StopReason

HULL = Circle(0.25)
POST = slice(210, 215)
"""At 30 to 34 degrees to the left."""


def with_post(distance_m: float = 0.25, beams: slice = POST) -> Floats:
    readings = np.full(BEAMS, 3.0)
    readings[beams] = distance_m
    return readings


def place_of(beam: int, distance_m: float = 0.25, mount: Mount | None = None) -> tuple[float, float]:
    rays = rays_of(GEOMETRY, mount or Mount(), HULL)
    x_m, y_m = rays.points(np.array([beam]), np.full(BEAMS, distance_m))[0].tolist()
    return x_m, y_m


def sector_deg(
    readings: Floats, place: tuple[float, float], mount: Mount | None = None, geometry: Geometry = GEOMETRY
) -> list[float] | None:
    sector = own_sector(view_of(readings, geometry), mount or Mount(), HULL, place)
    return None if sector is None else np.degrees(sector).round(6).tolist()


@pytest.mark.parametrize("beam", [210, 212, 214])
def test_the_sector_has_one_beam_more_at_both_sides(beam: int) -> None:
    assert sector_deg(with_post(), place_of(beam)) == [29.0, 35.0]


def test_the_sector_is_an_angle_of_the_scan_whatever_the_mount() -> None:
    mount = Mount(0.02, 0.01, 2.0)
    assert sector_deg(with_post(0.23), place_of(212, 0.23, mount), mount) == [29.0, 35.0]
    upside_down = Mount(0.02, 0.01, 2.0, flip=True)
    assert sector_deg(with_post(0.23), place_of(212, 0.23, upside_down), upside_down) == [-35.0, -29.0]


def test_a_clockwise_scan_gives_the_same_sector() -> None:
    clockwise = Geometry(BEAMS, math.pi, -BEAM_RAD)
    readings = np.roll(with_post()[::-1], 1)
    assert sector_deg(readings, place_of(212), geometry=clockwise) == [29.0, 35.0]


def test_a_post_across_the_first_beam_has_one_sector() -> None:
    readings = with_post()
    readings[:3] = readings[-2:] = 0.25
    assert sector_deg(readings, place_of(0)) == [177.0, -177.0]
    assert sector_deg(readings, place_of(BEAMS - 1)) == [177.0, -177.0]


def test_of_two_posts_the_one_at_the_place_is_masked() -> None:
    readings = with_post()
    readings[100] = 0.25
    assert sector_deg(readings, place_of(100)) == [-81.0, -79.0]


def test_what_is_farther_from_the_hull_is_no_part_of_the_robot() -> None:
    at_m = HULL.radius_m + AT_HULL_M
    assert sector_deg(with_post(at_m - 1e-6), place_of(212)) is not None
    assert sector_deg(with_post(at_m + 1e-6), place_of(212)) is None
    x_m, y_m = place_of(212)
    beyond = 1.0 + (SAME_PLACE_M + 1e-6) / 0.25
    assert sector_deg(with_post(), (beyond * x_m, beyond * y_m)) is None
    assert sector_deg(with_post(), (x_m * (beyond - 1e-5), y_m * (beyond - 1e-5))) is not None


def test_what_is_wide_is_no_post() -> None:
    width = round(WIDEST_RAD / BEAM_RAD)
    assert sector_deg(with_post(beams=slice(200, 200 + width)), place_of(205)) is not None
    assert sector_deg(with_post(beams=slice(200, 201 + width)), place_of(205)) is None
    assert sector_deg(np.full(BEAMS, 0.25), place_of(205)) is None


def test_each_limit_itself_counts() -> None:
    """In numbers that no difference rounds."""
    ahead = BEAMS // 2
    readings = np.full(BEAMS, 3.0)
    readings[ahead] = 2 * AT_HULL_M
    view = view_of(readings)
    assert own_sector(view, Mount(), Circle(AT_HULL_M), (2 * AT_HULL_M, 0.0)) is None
    assert own_sector(view, Mount(), Circle(2 * AT_HULL_M), (2 * AT_HULL_M + SAME_PLACE_M, 0.0)) is not None
    coarse = Geometry(144, -math.pi, WIDEST_RAD / 8)
    readings = np.full(144, 3.0)
    readings[40:48] = 0.25
    x_m, y_m = rays_of(coarse, Mount(), HULL).points(np.array([40]), readings)[0].tolist()
    assert own_sector(view_of(readings, coarse), Mount(), HULL, (x_m, y_m)) is not None


def test_silence_is_no_part_of_the_robot() -> None:
    assert sector_deg(with_post(math.nan), place_of(212)) is None


# --- in the law


def test_a_post_that_blocks_is_named_with_its_sector_and_masked_it_blocks_no_more() -> None:
    law = Law()
    law.ranges = ring()
    law.ranges[178:182] = 0.2
    law.hold(0.1, ("teleop", NEUTRAL))
    law.drive()
    assert law.tick(("teleop", FORWARD)).reasons == (StopReason.OBSTACLE,)
    advice = "; if it is part of the robot: masked_rad = [[-0.052, 0.035]]"
    assert law.decision.detail == f"something is too close ahead{advice}"
    masked = Law(with_lidar(CONFIG, mount=Mount(masked_rad=((-0.052, 0.035),))))
    masked.ranges = law.ranges
    masked.hold(0.1, ("teleop", NEUTRAL))
    assert masked.drive().reasons != (StopReason.OBSTACLE,)


def test_an_obstacle_away_from_the_hull_needs_no_advice() -> None:
    law = Law()
    law.ranges = ring(ahead_m=0.5)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.drive()
    assert law.hold(0.1, ("teleop", FORWARD)).detail == "something is too close at 10° right"


def test_a_scan_that_lacks_beams_where_the_robot_wants_to_go_says_so() -> None:
    law = Law(room_m=2.0)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.drive(FORWARD._replace(linear_m_s=-0.5))
    law.ranges = ring(2.0)[:330]
    law.tick(("teleop", FORWARD._replace(linear_m_s=-0.5)))
    assert law.decision.reasons == (StopReason.SCAN_BLIND,)
    assert law.decision.detail.endswith("; the scan has 30 beams fewer than before")
