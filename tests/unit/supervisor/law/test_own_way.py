"""The hull's own way counts as seen free, for as long as other space that was seen does."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law.clearance import Circle, ConvexPolygon, Hull
from supervisor.law.model import Inputs, Odometry
from supervisor.law.own_way import MOST_STANDS, STEP_M, OwnWay, Stand, own_way, went
from supervisor.law.reckoning import NEGLIGIBLE, STANDSTILL, Pose, Velocity
from supervisor.law.scan import LaserScan, Mount
from supervisor.law.sight import suspended
from tests.unit.supervisor.law.closed_loop import ANGLES, BEAMS, Base, World, advance
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, TICK_S, Law, on_time, with_lidar

CIRCLE = Circle(0.25)
TRUCK = ConvexPolygon(((0.4, -0.3), (0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3)))


def stand(x_m: float, until_s: float, yaw_rad: float = 0.0) -> Stand:
    return Stand(Pose(x_m, 0.0, yaw_rad), until_s)


# --- which poses are kept


def test_a_pose_is_kept_when_the_hull_has_moved_one_step() -> None:
    way = (stand(1.0, 5.0),)
    assert went(way, Pose(1.0 + STEP_M - 1e-9, 0.0, 0.0), 5.1, 0.0, CIRCLE) == way
    assert went(way, Pose(1.0 + STEP_M + 1e-9, 0.0, 0.0), 5.1, 0.0, CIRCLE)[1:] == (stand(1.1 + 1e-9, 5.1),)
    assert len(went(way, Pose(1.0, 2.0 * STEP_M, 0.0), 5.1, 0.0, CIRCLE)) == 2


def test_each_distance_itself_counts_as_motion() -> None:
    way = (stand(0.0, 5.0),)
    assert went(way, Pose(STEP_M, 0.0, 0.0), 5.1, 0.0, CIRCLE) == (*way, stand(STEP_M, 5.1))
    assert went(way, Pose(NEGLIGIBLE, 0.0, 0.0), 5.1, 0.0, CIRCLE) == way


def test_a_turn_moves_the_rim_of_the_hull() -> None:
    way = (stand(0.0, 5.0),)
    step_rad = STEP_M / CIRCLE.radius_m
    assert len(went(way, Pose(0.0, 0.0, -step_rad + 1e-9), 5.1, 0.0, CIRCLE)) == 1
    assert len(went(way, Pose(0.0, 0.0, -step_rad - 1e-9), 5.1, 0.0, CIRCLE)) == 2
    assert len(went(way, Pose(0.09, 0.0, 0.05), 5.1, 0.0, CIRCLE)) == 2, "both add up"


def test_while_the_hull_stands_its_place_stays_new() -> None:
    way = went((stand(0.0, 1.0), stand(2.0, 5.0)), Pose(2.0 + 0.9 * NEGLIGIBLE, 0.0, 0.0), 9.0, 0.0, CIRCLE)
    assert way == (stand(0.0, 1.0), stand(2.0, 9.0))
    assert went(way, Pose(2.0, 0.0, 0.0), 8.0, 0.0, CIRCLE) == way, "a scan of another lidar may be older"
    assert went(way, Pose(2.0 + 1.1 * NEGLIGIBLE, 0.0, 0.0), 9.5, 0.0, CIRCLE) == way, "the hull has left it"


def test_a_pose_is_dropped_just_after_its_time() -> None:
    way = (stand(0.0, 1.0), stand(1.0, 2.0))
    assert went(way, Pose(1.0, 0.0, 0.0), 2.0, 1.0, CIRCLE) == way
    assert went(way, Pose(1.0, 0.0, 0.0), 2.0, math.nextafter(1.0, 2.0), CIRCLE) == way[1:]
    assert went(way, Pose(5.0, 0.0, 0.0), 9.0, 8.0, CIRCLE) == (stand(5.0, 9.0),)


def test_at_most_so_many_poses_are_kept_the_newest() -> None:
    way: tuple[Stand, ...] = ()
    for number in range(2 * MOST_STANDS):
        way = went(way, Pose(float(number), 0.0, 0.0), float(number), 0.0, CIRCLE)
    assert [one.until_s for one in way] == [float(n) for n in range(MOST_STANDS - 1, 2 * MOST_STANDS)]


# --- what they prove


@given(
    st.sampled_from([CIRCLE, TRUCK]),
    st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=1, max_size=4),
    st.lists(st.tuples(*[st.floats(-2.5, 2.5)] * 2), min_size=1, max_size=8),
)
def test_the_hull_covers_what_has_no_clearance_from_it(
    hull: Hull, poses: list[tuple[float, float, float]], points: list[tuple[float, float]]
) -> None:
    places, there = np.array(points), np.array(poses)
    clearance_m = hull.clearance_along(places, there)
    covers = hull.covers_along(places, there)
    assert covers.shape == clearance_m.shape
    assert covers[clearance_m < -1e-9].all()
    assert not covers[clearance_m > 1e-9].any()
    free = OwnWay(hull, there).proves_free(places, 0.04)
    assert (free == covers.any(axis=0)).all()


def test_the_own_way_is_looked_at_from_where_the_robot_is() -> None:
    way = own_way((Stand(Pose(2.0, 1.0, 0.0), 0.0),), TRUCK, Pose(2.0, 3.0, math.pi / 2))
    inside, outside = (
        np.array(((-2.0, 0.39), (-2.29, 0.0))),
        np.array(((-2.0, 0.41), (-2.31, 0.0), (0.0, 0.0))),
    )
    assert way.proves_free(inside, 0.04).tolist() == [True, True]
    assert way.proves_free(outside, 0.04).tolist() == [False] * 3


def test_the_outline_of_the_hull_is_part_of_it() -> None:
    outline = np.array(((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)))
    square = ConvexPolygon(((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)))
    assert OwnWay(CIRCLE, np.zeros((1, 3))).proves_free(0.25 * outline, 0.04).all()
    assert OwnWay(square, np.zeros((1, 3))).proves_free(outline, 0.04).all()


# --- in the law


def test_without_a_memory_of_seen_space_no_pose_is_kept() -> None:
    assert in_the_hall(0.0).state.sight.way == ()
    assert len(in_the_hall(1.0).state.sight.way) == 4


def test_without_odometry_no_pose_is_kept() -> None:
    law = Law(replace(CONFIG, unseen_memory_s=5.0, odometry=False))
    for _ in range(100):
        law.tick(("teleop", FORWARD if law.decision.owner else NEUTRAL))
    assert law.state.base.way_m > 0.5
    assert law.state.sight.way == ()


def test_a_suspend_of_the_machine_ends_the_own_way() -> None:
    sight = in_the_hall(5.0).state.sight
    assert len(sight.way) > 1
    assert suspended(sight, CONFIG).way == ()


def in_the_hall(memory_s: float) -> Law:
    """After 0.34 m."""
    law = Law(replace(CONFIG, unseen_memory_s=memory_s))
    for _ in range(34):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(Velocity(0.5, 0.0), law.now_s + TICK_S))
    return law


def test_the_own_way_is_kept_for_the_time_of_the_memory() -> None:
    law = in_the_hall(1.0)
    for _ in range(100):
        law.tick(("teleop", NEUTRAL), odometry=Odometry(STANDSTILL, law.now_s + TICK_S))
    assert [law.now_s - one.until_s for one in law.state.sight.way] == [pytest.approx(0.0, abs=1e-9)]


def pocket(width_m: float) -> World:
    """A hall, with a pocket of this width from x = 0 to x = 2.4 m."""
    half_m = width_m / 2
    corners = np.array(
        [(-4, -4), (0, -4), (0, -half_m), (2.4, -half_m), (2.4, half_m), (0, half_m), (0, 4), (-4, 4)]
    )
    return World(corners, np.full(len(corners), 0.01), corners, np.roll(corners, -1, axis=0))


class Robot:
    """A robot with a lidar of 240° at its front, which is driven into the pocket."""

    def __init__(
        self, hull: Circle | ConvexPolygon, lidar_x_m: float, memory_s: float, start_m: float
    ) -> None:
        config = with_lidar(replace(CONFIG, hull=hull, unseen_memory_s=memory_s), mount=Mount(lidar_x_m))
        self.law = Law(config, scanning=False)
        self.world, self.lidar_x_m = pocket(1.3), lidar_x_m
        self.base, self.pose = Base(), Pose(start_m, 0.0, 0.0)
        self.closest_m = math.inf

    def drive(self, asked: Velocity, ticks: int) -> bool:
        """Drive until the law stops the robot; return whether it did."""
        hull, (in_view,) = self.law.config.hull, (np.abs(ANGLES) < math.radians(120.5)).nonzero()
        for tick in range(ticks):
            law, twist = self.law, self.base.step(self.law.decision.output, TICK_S)
            self.pose = advance(self.pose, twist, TICK_S)
            self.closest_m = min(self.closest_m, self.world.clearance_m(*self.pose, hull))  # type: ignore[arg-type]
            law.now_s += TICK_S
            scans: tuple[LaserScan, ...] = ()
            if tick % 2 == 0:
                x_m = self.pose.x_m + self.lidar_x_m
                noise_m = 1e-4 * (round(law.now_s / TICK_S) % 4)  # also from one call to the next
                ranges = self.world.ranges(x_m, 0.0, 0.0)[in_view] + np.float32(noise_m)
                first = float(ANGLES[in_view[0]])
                scans = (LaserScan(ranges, first, 2 * math.pi / BEAMS, 0.02, 12.0, law.now_s),)
            command = on_time("teleop", asked, law.now_s)
            law.step(Inputs((command,), scans=scans, odometry=Odometry(twist, law.now_s)))
            if asked != NEUTRAL and law.decision.reasons:
                return True
        return False


@pytest.mark.parametrize(
    ("hull", "lidar_x_m", "start_m", "speed_m_s", "memory_s", "backs_m"),
    [
        (CIRCLE, 0.0, -0.6, 0.5, 5.0, 0.7),  # what is left is beside the hull at its start
        (TRUCK, 0.35, -0.6, 0.5, 5.0, 0.25),
        (CIRCLE, 0.0, -1.5, 0.5, 5.0, 0.75),  # what is left was seen more than 5 s ago
        (TRUCK, 0.35, -1.5, 0.5, 5.0, 0.5),
        (CIRCLE, 0.0, -1.5, 1.0, 5.0, 1.2),
        (TRUCK, 0.35, -1.5, 1.0, 5.0, 1.15),
        (TRUCK, 0.35, -1.5, 0.5, 10.0, 1.2),
    ],
)
def test_a_robot_backs_out_of_a_pocket_along_its_own_way(
    hull: Circle | ConvexPolygon,
    lidar_x_m: float,
    start_m: float,
    speed_m_s: float,
    memory_s: float,
    backs_m: float,
) -> None:
    robot = Robot(hull, lidar_x_m, memory_s, start_m)
    robot.drive(NEUTRAL, 20)
    ticks = 0
    while robot.pose.x_m < 1.1 - (speed_m_s**2) / 4 and ticks < 500:
        assert not robot.drive(Velocity(speed_m_s, 0.0), 2)
        ticks += 2
    robot.drive(NEUTRAL, 40)
    entered_m = robot.pose.x_m
    robot.drive(Velocity(-speed_m_s, 0.0), 300)
    robot.drive(NEUTRAL, 40)
    assert entered_m - robot.pose.x_m > backs_m
    assert robot.closest_m > 0.3
