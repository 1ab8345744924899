"""The robot in its warehouse, with the real physics: does it move, stop, measure and collide as it says."""

import hashlib
import math
import subprocess
import sys

import numpy as np
import pytest

from sim import mj
from sim.config import Build, Hull
from sim.lidar_config import LidarConfig
from sim.motion_sensors import PERFECT, Odometer
from sim.movers import BODIES, MoverKind
from sim.plant import Plant, Pose

AHEAD = 180
END_RACK_X_M = 4.6
WEST_WALL_X_M = -6.0
RECTANGULAR = Build(hull=Hull.RECTANGULAR)


@pytest.fixture
def plant() -> Plant:
    return Plant()


def _run(plant: Plant, linear_m_s: float, angular_rad_s: float, duration_s: float) -> None:
    plant.step((linear_m_s, angular_rad_s), round(duration_s / plant.timestep_s))


def test_the_robot_starts_at_rest_facing_at_least_four_metres_of_free_aisle(plant: Plant) -> None:
    assert plant.true_pose == (-4.5, 0.0, 0.0)
    free_m = plant.scan()[AHEAD] - plant.hull_radius_m
    assert free_m == pytest.approx(END_RACK_X_M + 4.5 - 0.25)
    assert free_m > 4.0
    # The whole width of the hull and the stop distance beside it fits the aisle.
    half_width_m = plant.hull_radius_m + 0.30
    angles_rad = plant.lidars[0].angle_min_rad + plant.lidars[0].angle_increment_rad * np.arange(
        plant.lidars[0].beams
    )
    ranges = plant.scan()
    in_the_way = (np.abs(ranges * np.sin(angles_rad)) < half_width_m) & (np.cos(angles_rad) > 0.0)
    assert np.min((ranges * np.cos(angles_rad))[in_the_way]) > 4.0 + plant.hull_radius_m


def test_there_is_at_least_a_metre_behind_the_start(plant: Plant) -> None:
    assert plant.scan()[0] - plant.hull_radius_m == pytest.approx(1.25)


def test_a_robot_without_a_command_stays_where_it_is(plant: Plant) -> None:
    _run(plant, 0.0, 0.0, 2.0)
    assert plant.true_pose == pytest.approx(plant.start_pose, abs=1e-6)


def test_the_robot_reaches_its_speed_and_the_wheels_count_the_true_way(plant: Plant) -> None:
    _run(plant, 0.5, 0.0, 4.0)
    assert plant.true_velocity == pytest.approx((0.5, 0.0), abs=0.005)
    assert plant.wheel_twist == pytest.approx((0.5, 0.0), abs=0.005)
    left_rad, right_rad = plant.wheel_angles_rad
    true = plant.true_pose
    way_m = 0.5 * (left_rad + right_rad) * plant.wheels.radius_m
    assert way_m == pytest.approx(true.x_m - plant.start_pose.x_m, rel=0.01)
    assert true.y_m == pytest.approx(0.0, abs=0.001)


def test_the_wheels_report_an_arc(plant: Plant) -> None:
    odometer = Odometer(plant.wheels, PERFECT)
    odometry = odometer.read(*plant.wheel_angles_rad, 0.02)
    for _ in range(150):
        plant.step((0.4, 0.5), 10)
        odometry = odometer.read(*plant.wheel_angles_rad, 0.02)
    true, start = plant.true_pose, plant.start_pose
    assert odometry.x_m == pytest.approx(true.x_m - start.x_m, abs=0.01)
    assert odometry.y_m == pytest.approx(true.y_m - start.y_m, abs=0.01)
    assert odometry.yaw_rad == pytest.approx(true.yaw_rad, abs=0.01)
    assert true.y_m > 0.3


def test_from_full_speed_a_zero_target_stops_within_its_braking_distance(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 2.0)
    from_x_m = plant.true_pose.x_m
    stopped_after_s = math.nan
    for step in range(500):
        plant.step((0.0, 0.0))
        if abs(plant.true_velocity.linear_m_s) < 0.005:
            stopped_after_s = step * plant.timestep_s
            break
    assert stopped_after_s == pytest.approx(0.5, abs=0.06)
    _run(plant, 0.0, 0.0, 0.5)
    assert plant.true_velocity == pytest.approx((0.0, 0.0), abs=1e-4)
    assert 0.25 <= plant.true_pose.x_m - from_x_m < 0.25 + 0.03


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_body_never_speeds_up_or_brakes_harder_than_its_limits(plant: Plant, direction: float) -> None:
    _run(plant, 0.0, 0.0, 0.5)
    window = 10  # 20 ms: what a body feels, without the ringing of single contact steps
    speeds_m_s = [0.0]
    for target_m_s, duration_s in ((1.0, 1.2), (0.0, 0.7)):
        for _ in range(round(duration_s / (window * plant.timestep_s))):
            plant.step((direction * target_m_s, 0.0), window)
            speeds_m_s.append(direction * plant.true_velocity.linear_m_s)
        if direction < 0.0:
            assert plant.collisions == 0
    accelerations_m_s2 = np.diff(speeds_m_s) / (window * plant.timestep_s)
    assert 0.95 < np.max(accelerations_m_s2) < 1.03
    assert -2.06 < np.min(accelerations_m_s2) < -1.9


def test_the_wheels_do_not_slip_and_the_robot_does_not_tip_in_a_full_stop(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 2.0)
    for _ in range(300):
        plant.step((0.0, 0.0))
        assert plant.wheel_twist.linear_m_s == pytest.approx(plant.true_velocity.linear_m_s, abs=0.005)
        tilt_rad = 2.0 * math.hypot(plant.data.qpos[4], plant.data.qpos[5])
        assert tilt_rad < math.radians(0.2)


@pytest.mark.parametrize("angular_rad_s", [1.0, -2.0])
def test_the_robot_turns_at_the_commanded_rate_on_the_spot(plant: Plant, angular_rad_s: float) -> None:
    _run(plant, 0.0, angular_rad_s, 1.0)
    yaw_rad = plant.true_pose.yaw_rad
    _run(plant, 0.0, angular_rad_s, 1.0)
    assert math.remainder(plant.true_pose.yaw_rad - yaw_rad, math.tau) == pytest.approx(
        angular_rad_s, rel=0.01
    )
    assert plant.true_velocity.angular_rad_s == pytest.approx(angular_rad_s, rel=0.01)
    assert plant.true_pose[:2] == pytest.approx(plant.start_pose[:2], abs=0.002)


def test_the_beam_ahead_measures_the_rack_from_anywhere_in_the_aisle(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 3.0)
    assert plant.scan()[AHEAD] == pytest.approx(END_RACK_X_M - plant.true_pose.x_m, abs=0.001)


def test_the_lidar_sees_everything_within_the_hall_and_nothing_of_the_robot(plant: Plant) -> None:
    ranges = plant.scan()
    assert np.all(np.isfinite(ranges))
    assert np.min(ranges) > 1.0


def test_a_pillar_is_seen_where_it_was_put_at_once_and_gone_when_taken_away(plant: Plant) -> None:
    plant.place_pillar(-3.0, 0.0)
    assert plant.scan()[AHEAD] == pytest.approx(1.5 - plant.pillar_radius_m, abs=1e-4)
    assert plant.clearance_m() == pytest.approx(1.5 - 0.05 - 0.25)
    assert plant.pillar == (-3.0, 0.0)
    plant.remove_pillar()
    assert plant.scan()[AHEAD] == pytest.approx(9.1)
    assert plant.pillar is None


@pytest.mark.parametrize(
    ("x_m", "y_m", "why"),
    [
        (math.nan, 0.0, "finite"),
        (0.0, math.inf, "finite"),
        (5.96, 0.0, "walls"),
        (0.0, -4.5, "walls"),
        (-4.5, 0.0, "in the robot"),
        (-4.21, 0.0, "in the robot"),
        (5.05, 0.0, "in the rack end 1"),
        (-5.25, 3.0, "in the pallet 2"),
    ],
)
def test_a_pillar_in_a_place_that_cannot_be_is_refused_and_nothing_moves(
    plant: Plant, x_m: float, y_m: float, why: str
) -> None:
    plant.place_pillar(0.0, 0.0)
    with pytest.raises(ValueError, match=why):
        plant.place_pillar(x_m, y_m)
    assert plant.pillar == (0.0, 0.0)


def test_a_pillar_may_stand_close_to_the_hull_without_touching(plant: Plant) -> None:
    plant.place_pillar(-4.19, 0.0)
    plant.step((0.0, 0.0), 10)
    assert plant.clearance_m() == pytest.approx(0.01, abs=1e-4)
    assert plant.hull_contacts == 0


def test_driving_into_the_rack_counts_a_collision(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 9.0)
    assert plant.collisions == 0
    _run(plant, 1.0, 0.0, 2.0)
    assert plant.collisions >= 1
    assert plant.hull_contacts >= 1
    assert plant.last_contact == "rack end 1"
    assert plant.clearance_m() < 0.005
    assert plant.true_pose.x_m < END_RACK_X_M - plant.hull_radius_m + 0.01


def test_driving_into_the_pillar_counts_a_collision_and_does_not_move_it(plant: Plant) -> None:
    plant.place_pillar(-3.5, 0.0)
    _run(plant, 0.5, 0.0, 3.0)
    assert plant.collisions >= 1
    assert plant.true_pose.x_m < -3.5
    assert plant.last_contact == "pillar"
    assert plant.pillar == (-3.5, 0.0)
    plant.remove_pillar()
    plant.reset()
    assert plant.last_contact is None


def test_backing_into_the_wall_counts_a_collision(plant: Plant) -> None:
    _run(plant, -0.5, 0.0, 4.0)
    assert plant.collisions >= 1
    assert plant.true_pose.x_m > WEST_WALL_X_M
    assert plant.last_contact == "west wall"


def test_a_reset_brings_the_robot_back_while_time_goes_on_and_the_pillar_stays(plant: Plant) -> None:
    plant.place_pillar(-3.5, 0.0)
    _run(plant, 0.5, 0.3, 2.5)
    time_s = plant.time_s
    plant.reset()
    assert plant.true_pose == plant.start_pose
    assert plant.true_velocity == (0.0, 0.0)
    assert plant.wheel_angles_rad == (0.0, 0.0)
    assert plant.drive.twist == (0.0, 0.0)
    assert plant.collisions == 0
    assert plant.time_s == time_s
    assert plant.pillar == (-3.5, 0.0)
    assert plant.scan()[AHEAD] == pytest.approx(0.95, abs=1e-4)


def test_a_reset_onto_the_pillar_is_refused(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 2.0)
    plant.place_pillar(-4.5, 0.1)
    with pytest.raises(ValueError, match="the pillar stands there"):
        plant.reset()
    assert plant.true_pose.x_m > -4.0


def test_the_same_commands_make_the_same_trajectory_bit_for_bit() -> None:
    def trajectory(plant: Plant) -> list[bytes]:
        states: list[bytes] = []
        plant.place_pillar(-3.0, 0.2)
        for target in ((0.6, 0.0), (0.6, 0.4), (1.0, -2.0), (0.0, 0.0), (-0.4, 1.0)):
            for _ in range(20):
                plant.step(target, 10)
                states += [plant.data.qpos.tobytes(), plant.data.qvel.tobytes(), plant.scan().tobytes()]
        return states

    plant = Plant()
    first = trajectory(plant)
    assert trajectory(Plant()) == first
    plant.remove_pillar()
    plant.reset()
    assert trajectory(plant) == first


@pytest.mark.parametrize("hull", list(Hull))
def test_nothing_of_the_robot_reaches_out_of_its_hull(hull: Hull) -> None:
    plant = Plant(options=Build(hull=hull, scenery=True))
    model, data = plant.model, plant.data
    robot = mj.id_of(model, "body", "robot")
    geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == robot]
    assert len(geoms) > 10
    for geom in geoms:
        centre = data.geom_xpos[geom, :2] - np.array(plant.start_pose[:2])
        rotation = data.geom_xmat[geom].reshape(3, 3)
        size = model.geom_size[geom]
        shape = model.geom_type[geom]
        if shape == mj.Shape.BOX:
            rim = np.array([(sx, sy) for sx in (-1, 1) for sy in (-1, 1)]) * size[:2] @ rotation[:2, :2].T
        else:
            angles_rad = np.linspace(0.0, math.tau, 100)
            depth = size[2] if shape == mj.Shape.ELLIPSOID else size[0]
            rim = np.stack((size[0] * np.cos(angles_rad), depth * np.sin(angles_rad)), axis=1)
        reach = rim + centre
        if hull is Hull.ROUND:
            assert np.max(np.linalg.norm(reach, axis=1)) <= plant.hull_radius_m + 1e-9
        else:
            assert np.all(np.abs(reach) <= np.array([0.3, 0.2]) + 1e-9)


@pytest.mark.parametrize("scene", ["warehouse", "aisle", "empty"])
def test_what_the_hull_can_hit_the_lidar_can_see(scene: str) -> None:
    plant = Plant(scene, options=Build(moving=True))
    model, data = plant.model, plant.data
    plane_m = plant.lidars[0].height_m
    plant.place_pillar(*(plant.start_pose[0] + 1.0, 0.0))
    solids = [g for g in range(model.ngeom) if model.geom_conaffinity[g] & 2]
    assert len(solids) > 4 + len(plant.movers)
    for geom in solids:
        half_height_m = model.geom_size[geom, 1 if model.geom_type[geom] == mj.Shape.CYLINDER else 2]
        assert model.geom_group[geom] == 1
        assert abs(data.geom_xpos[geom, 2] - plane_m) < half_height_m


@pytest.mark.parametrize("scene", ["warehouse", "aisle", "empty"])
def test_every_layout_has_four_metres_of_free_aisle_ahead_of_the_start(scene: str) -> None:
    plant = Plant(scene, lidars=(LidarConfig(range_max_m=20.0),))
    ranges, angles_rad = plant.scan(), plant.lidars[0].angles_rad
    half_width_m = plant.hull_radius_m + 0.30
    in_the_way = (np.abs(ranges * np.sin(angles_rad)) < half_width_m) & (np.cos(angles_rad) > 0.0)
    assert np.min((ranges * np.cos(angles_rad))[in_the_way]) > 4.0 + plant.hull_radius_m


def test_the_aisle_is_1_2_m_wide() -> None:
    plant = Plant("aisle", options=RECTANGULAR)
    plant.step((1.0, 0.0), 2500)
    ranges = plant.scan()
    assert ranges[90] + ranges[270] == pytest.approx(1.2, abs=1e-3)
    assert plant.clearance_m() == pytest.approx(0.6 - 0.2, abs=1e-3)
    assert plant.collisions == 0


def test_the_scenery_changes_nothing_but_the_picture() -> None:
    plain, furnished = Plant(), Plant(options=Build(scenery=True))
    assert plain.model.ngeom < furnished.model.ngeom
    for plant in (plain, furnished):
        plant.step((1.0, 0.02), 5500)
    assert plain.collisions > 0
    assert plain.data.qpos.tobytes() == furnished.data.qpos.tobytes()
    assert plain.scan().tobytes() == furnished.scan().tobytes()


def test_a_rectangular_hull_is_as_far_from_a_thing_as_its_nearest_side_or_corner() -> None:
    plant = Plant("empty", options=RECTANGULAR)
    assert plant.clearance_m() == pytest.approx(1.5 - 0.3)
    plant.place_pillar(-4.5, 1.0)
    assert plant.clearance_m() == pytest.approx(1.0 - 0.2 - 0.05)
    plant.place_pillar(-4.5 + 0.3 + 0.3, 0.2 + 0.4)
    assert plant.clearance_m() == pytest.approx(0.5 - 0.05)
    plant.place_pillar(-4.5 + 0.36, 0.0)
    assert plant.clearance_m() == pytest.approx(0.01)
    with pytest.raises(ValueError, match="in the robot"):
        plant.place_pillar(-4.5 + 0.34, 0.0)


def test_a_rectangular_hull_swings_its_corners_into_what_a_round_one_would_miss() -> None:
    collisions: dict[Hull, int] = {}
    for hull in Hull:
        plant = Plant("empty", options=Build(hull=hull))
        plant.place_pillar(-4.5, 0.32)
        plant.step((0.0, 1.0), 1000)
        collisions[hull] = plant.collisions
    assert collisions[Hull.ROUND] == 0
    assert collisions[Hull.RECTANGULAR] > 0


def test_the_inertial_unit_feels_gravity_braking_and_the_turn(plant: Plant) -> None:
    _run(plant, 0.0, 0.0, 1.0)
    gyro_rad_s, accel_m_s2 = plant.imu()
    assert gyro_rad_s == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
    assert accel_m_s2 == pytest.approx((0.0, 0.0, 9.81), abs=1e-3)
    _run(plant, 1.0, 0.0, 2.0)
    _run(plant, 0.0, 0.0, 0.2)
    assert plant.imu()[1] == pytest.approx((-2.0, 0.0, 9.81), abs=0.1)
    plant.reset()
    _run(plant, 0.5, 0.8, 2.0)
    gyro_rad_s, accel_m_s2 = plant.imu()
    assert gyro_rad_s == pytest.approx((0.0, 0.0, 0.8), abs=0.01)
    assert accel_m_s2 == pytest.approx((0.0, 0.5 * 0.8, 9.81), abs=0.05)


def test_the_wheels_count_all_their_turns(plant: Plant) -> None:
    _run(plant, 1.0, 0.0, 3.0)
    left_rad, right_rad = plant.wheel_angles_rad
    way_m = plant.true_pose.x_m - plant.start_pose.x_m
    assert left_rad == pytest.approx(way_m / plant.wheels.radius_m, rel=0.001)
    assert right_rad == pytest.approx(left_rad, rel=1e-6)


def _braking_m(options: Build) -> tuple[float, float]:
    """How far it comes from 1 m/s, truly and by its wheels."""
    plant = Plant(options=options)
    plant.step((1.0, 0.0), 1500)
    from_x_m, from_rad = plant.true_pose.x_m, plant.wheel_angles_rad[0]
    assert plant.true_velocity.linear_m_s == pytest.approx(1.0, abs=0.01)
    plant.step((0.0, 0.0), 1000)
    return plant.true_pose.x_m - from_x_m, (plant.wheel_angles_rad[0] - from_rad) * plant.wheels.radius_m


def test_a_payload_that_the_motors_can_hold_changes_no_braking_distance_and_more_does() -> None:
    empty_m, _ = _braking_m(Build())
    assert empty_m == pytest.approx(0.26, abs=0.01)
    assert _braking_m(Build(payload_kg=20.0))[0] == pytest.approx(empty_m, abs=0.02)
    assert _braking_m(Build(payload_kg=100.0))[0] == pytest.approx(0.52, abs=0.05)


def test_wheels_with_little_grip_lock_and_say_that_it_stands_while_it_slides() -> None:
    true_m, wheels_m = _braking_m(Build(wheel_slip=0.9))
    assert true_m > 0.6
    assert wheels_m < 0.5 * true_m


def test_a_payload_and_a_hull_add_their_mass() -> None:
    def mass_kg(options: Build) -> float:
        model = Plant(options=options).model
        return float(np.sum(model.body_mass[model.body_rootid == mj.id_of(model, "body", "robot")]))

    assert mass_kg(Build()) == pytest.approx(20.0)
    assert mass_kg(RECTANGULAR) == pytest.approx(20.0)
    assert mass_kg(Build(payload_kg=30.0)) == pytest.approx(50.0)


# Movers in the empty hall: the walker crosses x = 0 between y = -3 and 3 at 1.2 m/s, the robot drives along y = 0.


def test_someone_walks_into_the_way_is_seen_and_waits_for_the_robot() -> None:
    plant = Plant("empty", options=Build(moving=True))
    assert plant.movers["walker"] == (0.0, -3.0, math.pi / 2)
    while plant.true_pose.x_m < -0.25:
        plant.step((1.0, 0.0), 10)
    before = plant.movers["walker"]
    plant.step((0.0, 0.0), 5000)
    waits = plant.movers["walker"]
    assert plant.collisions == 0
    assert abs(waits.y_m) < 1.3
    front_m = BODIES[MoverKind.PERSON].front_m
    gap_m = abs(waits.y_m) - plant.hull_radius_m - front_m
    assert 0.3 < gap_m < 0.5, f"it stopped {gap_m:.2f} m from the hull, coming from {before}"
    seen_m = float(np.min(plant.scan()))
    assert plant.clearance_m() == pytest.approx(seen_m - plant.hull_radius_m, abs=0.02)
    plant.step((0.5, 0.0), 2000)
    assert abs(plant.movers["walker"].y_m - waits.y_m) > 0.5, "it goes on once the robot is gone"


def test_someone_waits_for_the_pillar_too() -> None:
    plant = Plant("empty", options=Build(moving=True))
    plant.place_pillar(0.0, 0.0)
    plant.step((0.0, 0.0), 2500)
    assert plant.movers["walker"].y_m == pytest.approx(-0.05 - 0.25 - 0.45, abs=0.03)
    plant.remove_pillar()
    plant.step((0.0, 0.0), 500)
    assert plant.movers["walker"].y_m > 0.0


def test_a_pillar_is_not_put_into_someone_and_someone_on_the_start_forbids_a_reset() -> None:
    plant = Plant("empty", options=Build(moving=True))
    walker = plant.movers["walker"]
    with pytest.raises(ValueError, match="in the walker"):
        plant.place_pillar(walker.x_m + 0.1, walker.y_m + 0.1)
    plant.start_pose = Pose(0.0, -3.0, 0.0)
    with pytest.raises(ValueError, match="the walker stands there"):
        plant.reset()


def test_driving_into_someone_is_a_collision_with_them() -> None:
    plant = Plant("empty", options=Build(moving=True))
    plant.place_pillar(0.0, 0.42)  # makes the walker wait on the robot's way, or at least near it
    plant.step((0.0, 0.0), 2500)
    assert abs(plant.movers["walker"].y_m) < 0.4
    plant.step((1.0, 0.0), 2400)
    assert plant.collisions >= 1
    assert plant.last_contact == "walker"


def test_movers_stay_away_from_the_way_ahead_in_the_warehouse() -> None:
    plant = Plant(options=Build(moving=True))
    assert set(plant.movers) == {"forklift", "picker", "packer"}
    seen: dict[str, set[float]] = {name: set() for name in plant.movers}
    for _ in range(120):
        plant.step((0.0, 0.0), 250)
        for name, pose in plant.movers.items():
            seen[name].add(round(pose.x_m, 1))
            body = BODIES[MoverKind.FORKLIFT if name == "forklift" else MoverKind.PERSON]
            assert abs(pose.y_m) - body.half_width_m - 0.8 > 1.5 - 1e-9
    assert all(len(places) > 3 for places in seen.values()), "they all move"
    assert plant.true_pose == pytest.approx(plant.start_pose, abs=1e-6)


def test_movers_are_solid_within_the_floor_that_they_take() -> None:
    plant = Plant("empty", options=Build(moving=True))
    model, data = plant.model, plant.data
    for name, kind in (("walker", MoverKind.PERSON), ("forklift", MoverKind.FORKLIFT)):
        pose = plant.movers[name]
        body = mj.id_of(model, "body", name)
        for geom in (g for g in range(model.ngeom) if model.geom_bodyid[g] == body):
            dx_m, dy_m, _ = data.geom_xpos[geom] - data.mocap_pos[model.body_mocapid[body]]
            ahead_m = dx_m * math.cos(pose.yaw_rad) + dy_m * math.sin(pose.yaw_rad)
            aside_m = dy_m * math.cos(pose.yaw_rad) - dx_m * math.sin(pose.yaw_rad)
            half_x_m, half_y_m = (
                model.geom_size[geom, (0, 0)] if kind is MoverKind.PERSON else model.geom_size[geom, :2]
            )
            assert BODIES[kind].rear_m <= ahead_m - half_x_m + 1e-9
            assert ahead_m + half_x_m <= BODIES[kind].front_m + 1e-9
            assert abs(aside_m) + half_y_m <= BODIES[kind].half_width_m


_STORY = """
import hashlib, sys
from sim.lidar_config import LidarConfig
from sim.motion_sensors import PERFECT, Odometer
from sim.plant import Plant
from sim.config import Build, Hull
plant = Plant("empty", None, (LidarConfig(noise_m=0.01),), 5, Build(Hull.RECTANGULAR, 20.0, 0.8, moving=True))
digest = hashlib.sha256()
for target in ((1.0, 0.0), (0.4, 1.5), (0.0, 0.0), (-0.5, -0.5)):
    for _ in range(30):
        plant.step(target, 25)
        for part in (plant.data.qpos, plant.data.qvel, plant.data.mocap_pos, plant.scan(), plant.data.sensordata):
            digest.update(part.tobytes())
        digest.update(repr((plant.wheel_twist, plant.clearance_m(), plant.movers)).encode())
print(digest.hexdigest())
"""


def test_two_processes_see_the_same_trajectory_noise_and_movers_bit_for_bit() -> None:
    def run() -> str:
        done = subprocess.run(
            [sys.executable, "-c", _STORY], capture_output=True, text=True, timeout=60, check=True
        )
        return done.stdout.strip()

    assert len(first := run()) == hashlib.sha256().digest_size * 2
    assert run() == first


def test_steps_one_by_one_and_many_at_a_time_are_the_same() -> None:
    many, single = (Plant("empty", options=Build(moving=True)) for _ in range(2))
    for target in ((1.0, 0.5), (0.0, 0.0), (math.nan, 0.0), (0.3, 0.0)):
        many.step(target, 333)
        for _ in range(333):
            single.step(target)
    assert many.save() == single.save()


def test_another_seed_makes_other_noise_and_the_same_way() -> None:
    config = LidarConfig(noise_m=0.01)
    one, other = (Plant(lidars=(config,), seed=seed) for seed in (1, 2))
    for plant in (one, other):
        _run(plant, 0.5, 0.2, 1.0)
    assert one.data.qpos.tobytes() == other.data.qpos.tobytes()
    assert one.scan().tobytes() != other.scan().tobytes()


DIAGONAL = (
    LidarConfig(
        beams=541, span_rad=1.5 * math.pi, x_m=0.3, y_m=0.2, yaw_rad=math.pi / 4, name="front", topic="scan"
    ),
    LidarConfig(
        beams=541,
        span_rad=1.5 * math.pi,
        x_m=-0.3,
        y_m=-0.2,
        yaw_rad=-0.75 * math.pi,
        name="rear",
        topic="scan_rear",
    ),
)
BOXY = Build(Hull.RECTANGULAR, moving=False)


def _points_m(plant: Plant, number: int) -> np.ndarray:
    """Where a lidar's beams end in the world, by its mount and the robot's pose; (n, 2)."""
    lidar, ranges = plant.lidars[number], plant.scan(number).astype(np.float64)
    pose = plant.true_pose
    seen = np.isfinite(ranges)
    own = complex(lidar.x_m, lidar.y_m) + ranges[seen] * np.exp(1j * (lidar.angles_rad[seen] + lidar.yaw_rad))
    world = complex(pose.x_m, pose.y_m) + own * np.exp(1j * pose.yaw_rad)
    return np.column_stack((world.real, world.imag))


def test_two_diagonal_lidars_see_the_same_world_from_their_corners() -> None:
    """A pillar that both see, and one for each that the other does not."""
    plant = Plant("empty", lidars=DIAGONAL, options=BOXY)
    _run(plant, 0.5, 0.6, 2.0)
    pose = plant.true_pose
    for ahead_m, left_m, seers in ((-1.0, 1.0, {0, 1}), (1.0, 0.5, {0}), (-1.0, -0.5, {1})):
        x_m = pose.x_m + ahead_m * math.cos(pose.yaw_rad) - left_m * math.sin(pose.yaw_rad)
        y_m = pose.y_m + ahead_m * math.sin(pose.yaw_rad) + left_m * math.cos(pose.yaw_rad)
        plant.place_pillar(x_m, y_m)
        for number in range(2):
            away_m = np.abs(np.hypot(*(_points_m(plant, number) - (x_m, y_m)).T) - plant.pillar_radius_m)
            assert (np.sum(away_m < 1e-4) >= 3) == (number in seers), (ahead_m, left_m, number)


def test_two_diagonal_lidars_leave_no_direction_around_the_hull_unseen() -> None:
    """Wherever a pillar stands 1 m off, one of them sees it."""
    plant = Plant("empty", lidars=DIAGONAL, options=BOXY)
    pose = plant.true_pose
    for angle_rad in np.arange(-math.pi, math.pi, 0.1):
        place = (pose.x_m + 1.0 * math.cos(angle_rad), pose.y_m + 1.0 * math.sin(angle_rad))
        plant.place_pillar(*place)
        hits = [np.hypot(*(_points_m(plant, number) - place).T) < 0.051 for number in range(2)]
        assert max(np.sum(hit) for hit in hits) >= 3, angle_rad


def test_the_first_of_several_lidars_has_the_noise_of_one_alone_and_the_others_their_own() -> None:
    noisy = tuple(lidar.model_copy(update={"noise_m": 0.01}) for lidar in DIAGONAL)
    alone, both = (Plant("empty", lidars=some, seed=5, options=BOXY) for some in (noisy[:1], noisy))
    assert alone.scan().tobytes() == both.scan().tobytes()
    same_place = (noisy[0], noisy[0].model_copy(update={"name": "twin", "topic": "scan_twin"}))
    twins = Plant("empty", lidars=same_place, seed=5, options=BOXY)
    assert twins.scan(0).tobytes() != twins.scan(1).tobytes()


def test_the_beams_of_a_corner_lidar_leave_the_hull_at_once_and_those_of_one_on_the_axis_at_its_edge() -> (
    None
):
    plant = Plant("empty", lidars=(*DIAGONAL, LidarConfig(name="top", topic="top")), options=BOXY)
    _run(plant, 0.0, 0.7, 1.0)
    assert np.sum(plant.way_out_m(0) > 0.0) <= 4, "but for those along its edges"
    assert plant.way_out_m(2)[[AHEAD, AHEAD + 90]] == pytest.approx([0.3, 0.2])
