"""Beams whose returns vanish at once: the sensor's silence proves nothing."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from supervisor.law.lidar import PROFILES
from supervisor.law.model import Inputs, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.scan import LaserScan, Mount
from supervisor.law.silence import LEAST_RAD, vanished
from tests.unit.supervisor.law.closed_loop import ANGLES, Base, World, advance
from tests.unit.supervisor.law.law_harness import (
    ANY_AGE,
    BEAMS,
    FORWARD,
    NEUTRAL,
    TICK_S,
    Law,
    laser_scan,
    on_time,
    ring,
    with_lidar,
)
from wire.reasons import StopReason

STEP_RAD = 2 * math.pi / BEAMS
Spoil = Callable[[npt.NDArray[np.float32]], None]

CORNERS = np.array([[6.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [6.0, -2.0]])
ROOM = World(np.array([[6.0, 2.0]]), np.array([0.01]), CORNERS, np.roll(CORNERS, -1, axis=0))
"""A room without posts, whose front wall is 6 m ahead of the origin."""


def silence(half_rad: float, value: float) -> Spoil:
    def spoil(ranges: npt.NDArray[np.float32]) -> None:
        ranges[np.abs(ANGLES) <= half_rad] = value

    return spoil


def approach(
    spoil: Spoil, *, profile: str = "rep117", from_x_m: float = 2.5, until_x_m: float = math.inf
) -> float:
    """Drive at the front wall at full speed; from `from_x_m` on, each scan is spoiled. Return the least clearance."""
    law = Law(with_lidar(ANY_AGE, profile=PROFILES[profile]), scanning=False)
    pose, base, closest_m, output = Pose(0.0, 0.0, 0.0), Base(), math.inf, STANDSTILL
    for tick in range(round(12.0 / TICK_S)):
        law.now_s += TICK_S
        twist = base.step(output, TICK_S)
        pose = advance(pose, twist, TICK_S)
        closest_m = min(closest_m, ROOM.clearance_m(*pose, ANY_AGE.hull))  # type: ignore[arg-type]
        scans: tuple[LaserScan, ...] = ()
        if tick % 2 == 0:
            ranges = ROOM.ranges(*pose) + np.float32(1e-4 * (tick % 4))
            if from_x_m < pose.x_m < until_x_m:
                spoil(ranges)
            scans = (laser_scan(ranges, law.now_s),)
        asked = NEUTRAL if tick < 10 or law.decision.reasons else Velocity(1.0, 0.0)
        command = on_time("teleop", asked, law.now_s)
        law.step(Inputs((command,), scans=scans, odometry=Odometry(twist, law.now_s)))
        output = law.decision.output
    return closest_m


@pytest.mark.parametrize("half_rad", [0.175, 0.5, 1.57])
@pytest.mark.parametrize(
    ("profile", "value"), [("rep117", math.inf), ("rep117", 13.0), ("rplidar", math.inf), ("rplidar", 0.0)]
)
def test_a_sector_that_falls_silent_at_once_is_not_free(profile: str, value: float, half_rad: float) -> None:
    assert approach(silence(half_rad, value), profile=profile) > 0.285


def test_a_short_silence_before_a_wall_changes_nothing() -> None:
    """For 0.8 s at full speed, 1 m before the stop."""
    assert approach(silence(0.5, math.inf), from_x_m=3.6, until_x_m=4.4) > 0.285


BEAM_RAD = math.radians(1.0)


def block(first: int, last: int) -> npt.NDArray[np.bool_]:
    beams = np.zeros(BEAMS, dtype=np.bool_)
    beams[first : last + 1] = True
    return beams


def lost_beams(
    gone: npt.NDArray[np.bool_], distance_m: float, strip_m: float, *, is_round: bool = True
) -> int:
    everywhere = np.ones(BEAMS, dtype=np.bool_)
    lost = vanished(gone, everywhere, np.full(BEAMS, distance_m), BEAM_RAD, strip_m, is_round=is_round)
    assert not (lost & ~gone).any()
    return int(np.count_nonzero(lost))


def test_a_block_is_judged_from_ten_degrees_on() -> None:
    width = round(LEAST_RAD / BEAM_RAD)
    assert lost_beams(block(100, 99 + width), 1.0, 0.1) == width
    assert lost_beams(block(100, 98 + width), 1.0, 0.1) == 0


def test_motion_explains_a_block_that_is_no_wider_than_the_strip() -> None:
    arc_m = 20 * BEAM_RAD * 2.0
    assert lost_beams(block(100, 119), 2.0, arc_m + 1e-9) == 0
    assert lost_beams(block(100, 119), 2.0, arc_m - 1e-9) == 20


def test_narrow_blocks_are_no_wide_block() -> None:
    beams = block(0, -1)
    beams[::2] = True
    assert lost_beams(beams, 5.0, 0.1) == 0


def test_a_block_passes_over_the_end_of_a_full_turn_only() -> None:
    beams = block(0, 5) | block(BEAMS - 6, BEAMS - 1)
    assert lost_beams(beams, 5.0, 0.1) == 12
    assert lost_beams(beams, 5.0, 0.1, is_round=False) == 0


def test_a_block_at_the_end_of_the_view_is_whole() -> None:
    assert lost_beams(block(0, 14), 5.0, 0.1, is_round=False) == 15
    assert lost_beams(block(BEAMS - 15, BEAMS - 1), 5.0, 0.1, is_round=False) == 15


def test_a_full_turn_that_falls_silent_is_one_block() -> None:
    assert lost_beams(block(0, BEAMS - 1), 5.0, 0.1) == BEAMS


# --- in the law


def lost_of(law: Law) -> npt.NDArray[np.bool_]:
    scan = law.state.sight.lidars[0].scan
    assert scan is not None
    assert scan.view is not None
    lost_m = scan.view.lost_m
    return np.zeros(BEAMS, dtype=np.bool_) if lost_m is None else ~np.isnan(lost_m)


AHEAD = np.abs(ANGLES) <= 0.3


def law_with_silence_ahead() -> Law:
    law = Law(room_m=2.0)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, 2.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    assert (lost_of(law) == AHEAD).all()
    return law


@pytest.mark.parametrize("gap_s", [0.16, 0.7, 2.0])
def test_a_gap_in_the_scans_explains_no_silence(gap_s: float) -> None:
    """If an object may have moved during the whole gap, it may have moved anywhere: the robot touched a pillar."""
    law = Law(room_m=1.0)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.scanning = False
    law.hold(gap_s, ("teleop", NEUTRAL))
    law.scanning = True
    law.ranges = np.where(AHEAD, np.inf, 1.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    assert (lost_of(law) == AHEAD).all()


@pytest.mark.parametrize(("width", "is_lost"), [(11, False), (12, True)])
@pytest.mark.parametrize("age_s", [0.1, 1.0])
def test_an_object_has_moved_for_a_tenth_of_a_second_at_most(
    age_s: float, width: int, *, is_lost: bool
) -> None:
    """By 0.2 m: 11.5 beams of a degree at a distance of 1 m."""
    law = Law(room_m=1.0, scanning=False)
    silent = np.where(np.arange(BEAMS) < width, np.inf, 1.0).astype(np.float32)
    for ranges in (ring(1.0), silent):
        law.now_s += age_s
        law.step(Inputs(scans=(laser_scan(ranges, law.now_s),)))
    assert bool(lost_of(law).any()) is is_lost


def test_a_lost_beam_proves_nothing_until_it_returns() -> None:
    law = law_with_silence_ahead()
    law.hold(0.4, ("teleop", NEUTRAL))
    assert StopReason.SCAN_BLIND in law.drive().reasons
    law.ranges = ring(2.0)
    law.hold(0.1, ("teleop", NEUTRAL))
    assert not lost_of(law).any()
    assert law.drive().output == FORWARD


@pytest.mark.parametrize("turn_rad", [1.0, -1.0])
def test_silence_that_turns_with_the_robot_remains_lost(turn_rad: float) -> None:
    law = law_with_silence_ahead()
    turn(law, turn_rad)
    assert (lost_of(law) == AHEAD).all()


@pytest.mark.parametrize("turn_rad", [1.0, -1.0])
@pytest.mark.parametrize("far_m", [10.0, math.inf])
def test_a_beam_of_the_same_sector_that_lost_no_near_return_confirms_no_silence(
    turn_rad: float, far_m: float
) -> None:
    law = Law(room_m=2.0)
    law.ranges = np.where(np.abs(ANGLES) <= 0.05, far_m, 2.0).astype(np.float32)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, 2.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    lost = lost_of(law)
    turn(law, turn_rad)
    assert (lost_of(law) == lost).all()
    assert lost.sum() > 20


@pytest.mark.parametrize("turn_rad", [1.0, -1.0])
def test_another_beam_that_finds_the_same_direction_silent_confirms_it(turn_rad: float) -> None:
    law = law_with_silence_ahead()
    turn(law, turn_rad, world=True)
    assert not lost_of(law).any()


@pytest.mark.parametrize(("silent_rad", "is_confirmed"), [(-2.18, True), (-1.2, False)])
def test_from_another_place_only_a_beam_to_the_lost_return_confirms(
    silent_rad: float, *, is_confirmed: bool
) -> None:
    """The return was 2 m ahead; after a turn by 1.2 rad and 2 m straight on, it is 2.18 rad to the right."""
    law = law_with_silence_ahead()
    turn(law, 1.2)
    for _ in range(round(2.0 / TICK_S)):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(Velocity(1.0, 0.0), law.now_s + TICK_S))
    ranges = law.ranges.copy()
    ranges[np.abs(ANGLES - silent_rad) <= 0.08] = np.inf  # too narrow to be lost itself
    law.ranges = ranges
    law.tick(("teleop", NEUTRAL))
    assert lost_of(law)[BEAMS // 2] != is_confirmed


@pytest.mark.parametrize("yaw_rad", [0.0, 1.5, -2.5])
def test_the_place_of_a_lost_return_is_where_it_was(yaw_rad: float) -> None:
    """Also for a lidar that is neither in the middle nor looks ahead."""
    law = Law(with_lidar(ANY_AGE, mount=Mount(0.2, -0.1, yaw_rad)), room_m=2.0)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, 2.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    scan = law.state.sight.lidars[0].scan
    assert scan is not None
    assert scan.view is not None
    assert scan.view.lost_m is not None
    expected = np.where(AHEAD, 0.2 - 0.1j + 2.0 * np.exp(1j * (ANGLES + yaw_rad)), complex("nan"))
    assert scan.view.lost_m == pytest.approx(expected, abs=1e-3, nan_ok=True)


def turn(law: Law, turn_rad: float, *, world: bool = False) -> None:
    """Turn the robot; the silence turns with it, or, with `world`, remains where it is."""
    yaw_rad, rate = 0.0, Velocity(0.0, math.copysign(1.0, turn_rad))
    while abs(yaw_rad) < abs(turn_rad):
        odometry = Odometry(rate, law.now_s + TICK_S)
        yaw_rad += rate.angular_rad_s * TICK_S
        if world:
            there = (ANGLES + yaw_rad + math.pi) % (2 * math.pi) - math.pi
            law.ranges = np.where(np.abs(there) <= 0.3, np.inf, 2.0).astype(np.float32)
        law.tick(("teleop", NEUTRAL), odometry=odometry)


@pytest.mark.parametrize(("room_m", "is_lost"), [(9.5, True), (9.6, False)])
def test_returns_near_range_max_may_vanish(room_m: float, *, is_lost: bool) -> None:
    law = Law(room_m=room_m)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, room_m).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    assert lost_of(law).any() == is_lost


def test_a_lost_beam_stays_lost_while_its_reading_is_invalid() -> None:
    law = law_with_silence_ahead()
    law.ranges = np.where(AHEAD, np.nan, 2.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, 2.0).astype(np.float32)
    law.tick(("teleop", NEUTRAL))
    assert (lost_of(law) == AHEAD).all()


def test_silence_of_a_lost_beam_erases_no_near_memory() -> None:
    law = Law(room_m=4.0)
    law.ranges = ring(4.0, ahead_m=0.9)
    law.hold(0.1, ("teleop", NEUTRAL))
    law.ranges = np.where(AHEAD, np.inf, 4.0).astype(np.float32)
    law.hold(2.0, ("teleop", NEUTRAL))
    near = law.state.sight.memory.points
    assert (np.hypot(near[:, 0], near[:, 1]) < 1.0).any()
