"""The robot in its warehouse, with the real physics: does it move, stop, measure and collide as it says."""

import math
from pathlib import Path

import numpy as np
import pytest

from sim import mj
from sim.plant import HALL_HALF_X_M, Plant

AHEAD = 180
END_RACK_X_M = 4.6


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
    angles_rad = plant.lidar.angle_min_rad + plant.lidar.angle_increment_rad * np.arange(plant.lidar.beams)
    ranges = plant.scan()
    in_the_way = (np.abs(ranges * np.sin(angles_rad)) < half_width_m) & (np.cos(angles_rad) > 0.0)
    assert np.min((ranges * np.cos(angles_rad))[in_the_way]) > 4.0 + plant.hull_radius_m


def test_there_is_at_least_a_metre_behind_the_start(plant: Plant) -> None:
    assert plant.scan()[0] - plant.hull_radius_m == pytest.approx(1.25)


def test_a_robot_that_is_told_nothing_stays_where_it_is(plant: Plant) -> None:
    _run(plant, 0.0, 0.0, 2.0)
    assert plant.true_pose == pytest.approx(plant.start_pose, abs=1e-6)


def test_the_robot_reaches_its_speed_and_the_wheels_count_the_true_way(plant: Plant) -> None:
    _run(plant, 0.5, 0.0, 4.0)
    assert plant.true_velocity == pytest.approx((0.5, 0.0), abs=0.005)
    odometry, true = plant.odometry(), plant.true_pose
    assert odometry.linear_m_s == pytest.approx(0.5, abs=0.005)
    assert odometry.x_m == pytest.approx(true.x_m - plant.start_pose.x_m, rel=0.01)
    assert true.y_m == pytest.approx(0.0, abs=0.001)


def test_odometry_follows_an_arc(plant: Plant) -> None:
    _run(plant, 0.4, 0.5, 3.0)
    odometry, true, start = plant.odometry(), plant.true_pose, plant.start_pose
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
        assert plant.odometry().linear_m_s == pytest.approx(plant.true_velocity.linear_m_s, abs=0.005)
        tilt_rad = 2.0 * math.hypot(plant.data.qpos[4], plant.data.qpos[5])
        assert tilt_rad < math.radians(0.2)


@pytest.mark.parametrize("angular_rad_s", [1.0, -2.0])
def test_the_robot_turns_at_the_rate_it_is_told_on_the_spot(plant: Plant, angular_rad_s: float) -> None:
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
    assert plant.clearance_m() < 0.005
    assert plant.true_pose.x_m < END_RACK_X_M - plant.hull_radius_m + 0.01


def test_driving_into_the_pillar_counts_a_collision_and_does_not_move_it(plant: Plant) -> None:
    plant.place_pillar(-3.5, 0.0)
    _run(plant, 0.5, 0.0, 3.0)
    assert plant.collisions >= 1
    assert plant.true_pose.x_m < -3.5
    assert plant.pillar == (-3.5, 0.0)


def test_backing_into_the_wall_counts_a_collision(plant: Plant) -> None:
    _run(plant, -0.5, 0.0, 4.0)
    assert plant.collisions >= 1
    assert plant.true_pose.x_m > -HALL_HALF_X_M


def test_a_reset_brings_the_robot_back_while_time_goes_on_and_the_pillar_stays(plant: Plant) -> None:
    plant.place_pillar(-3.5, 0.0)
    _run(plant, 0.5, 0.3, 2.5)
    time_s = plant.time_s
    plant.reset()
    assert plant.true_pose == plant.start_pose
    assert plant.true_velocity == (0.0, 0.0)
    assert plant.odometry() == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert plant.drive_twist == (0.0, 0.0)
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


def test_nothing_of_the_robot_reaches_out_of_its_hull(plant: Plant) -> None:
    model, data = plant.model, plant.data
    robot = mj.body_id(model, "robot")
    for geom in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[geom]] != robot:
            continue
        centre = data.geom_xpos[geom, :2] - np.array(plant.start_pose[:2])
        rotation = data.geom_xmat[geom].reshape(3, 3)
        size = model.geom_size[geom]
        if model.geom_type[geom] == mj.Shape.BOX:
            corners = np.array([(sx, sy) for sx in (-1, 1) for sy in (-1, 1)]) * size[:2]
            reach_m = np.max(np.linalg.norm(corners @ rotation[:2, :2].T + centre, axis=1))
        elif model.geom_type[geom] == mj.Shape.ELLIPSOID:
            angles_rad = np.linspace(0.0, math.tau, 100)
            rim = np.stack((size[0] * np.cos(angles_rad), size[2] * np.sin(angles_rad)), axis=1)
            reach_m = np.max(np.linalg.norm(rim + centre, axis=1))
        else:
            reach_m = np.linalg.norm(centre) + size[0]
        assert reach_m <= plant.hull_radius_m


def test_what_the_hull_can_hit_the_lidar_can_see(plant: Plant) -> None:
    model, data = plant.model, plant.data
    plane_m = plant.lidar.height_m
    for geom in range(model.ngeom):
        if not model.geom_conaffinity[geom] & 2 or model.body_mocapid[model.geom_bodyid[geom]] >= 0:
            continue
        half_height_m = model.geom_size[geom, 1 if model.geom_type[geom] == mj.Shape.CYLINDER else 2]
        assert model.geom_group[geom] == 1
        assert abs(data.geom_xpos[geom, 2] - plane_m) < half_height_m


def test_a_model_without_the_robot_is_refused_by_what_it_lacks(tmp_path: Path) -> None:
    (tmp_path / "empty.xml").write_text("<mujoco/>")
    with pytest.raises(ValueError, match="no joint named 'robot'"):
        Plant(tmp_path / "empty.xml")
