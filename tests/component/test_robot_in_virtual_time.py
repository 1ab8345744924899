"""The real supervisor and the real MuJoCo robot on a perfect network: minutes of driving in a second."""

import pytest

from sim.plant import Plant
from tests.component.rig import Rig
from wire import topics
from wire.messages import Point, SafetyStatus, planar_twist

STOP_DISTANCE_M = 0.30
TOLERANCE_M = 0.01


@pytest.mark.long
@pytest.mark.parametrize("speed_m_s", [pytest.param(0.3, marks=pytest.mark.proof), 0.6, 1.0])
async def test_driven_at_the_rack_it_comes_to_rest_at_30_cm_and_backs_out(speed_m_s: float) -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), rig.source():
        await rig.drive(speed_m_s)
        nearest_m = plant.clearance_m()
        for _ in range(400):
            await rig.pass_time(0.1)
            nearest_m = min(nearest_m, plant.clearance_m())
            if plant.true_pose.x_m > 3.0 and abs(plant.true_velocity.linear_m_s) < 0.001:
                break
        for _ in range(20):  # it stays there, although the operator still asks for motion
            await rig.pass_time(0.1)
            nearest_m = min(nearest_m, plant.clearance_m())
        assert plant.true_pose.x_m > 3.0, "it never drove to the rack"
        assert rig.newest_status.reasons == ["OBSTACLE"]
        assert abs(plant.true_velocity.linear_m_s) < 0.001
        assert STOP_DISTANCE_M - TOLERANCE_M <= nearest_m < STOP_DISTANCE_M + 0.05
        assert plant.collisions == 0
        rig.velocity = (-0.3, 0.0)
        await rig.pass_time(3.0)
        assert plant.clearance_m() > 0.8


@pytest.mark.parametrize("ahead_m", [0.8, 1.2])
async def test_a_pillar_dropped_ahead_is_never_touched(ahead_m: float) -> None:
    """From 1 m/s, 0.8 m is too short for stopping at 30 cm: the robot brakes as hard as it can."""
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), rig.source():
        await rig.drive(1.0)
        await rig.pass_time(2.0)
        pose = plant.true_pose
        assert plant.true_velocity.linear_m_s > 0.95
        rig.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m + ahead_m, pose.y_m, 0.0))
        await rig.pass_time(4.0)
        assert plant.collisions == 0
        assert rig.newest_status.mode == SafetyStatus.STOPPED
        assert abs(plant.true_velocity.linear_m_s) < 0.001
        assert plant.clearance_m() > 0.05


async def test_the_base_brakes_when_the_supervisor_dies_and_waits_for_a_neutral_after_its_return() -> None:
    rig, plant = Rig(), Plant()
    async with rig.sim(plant), rig.source():
        async with rig.supervisor() as supervisor:
            await rig.drive(0.8)
            await rig.pass_time(2.0)
            assert plant.true_velocity.linear_m_s > 0.75
            supervisor.die()
            await rig.pass_time(0.6)
            assert abs(plant.true_velocity.linear_m_s) < 0.001
        x_m = plant.true_pose.x_m
        async with rig.supervisor():
            await rig.pass_time(2.0)
            assert plant.true_pose.x_m == pytest.approx(x_m, abs=0.001)
            await rig.drive(0.5)
            await rig.pass_time(1.0)
            assert plant.true_pose.x_m > x_m + 0.2


async def test_the_base_brakes_150_ms_after_the_last_command_of_a_hung_supervisor() -> None:
    rig, plant = Rig(), Plant()
    bus = rig.network.open_joined(topics.SUPERVISOR)
    bus.declare_alive(topics.SUPERVISOR)
    cmd_vel = bus.publisher(topics.CMD_VEL)
    async with rig.sim(plant):
        for _ in range(100):
            cmd_vel.put(planar_twist(0.5, 0.0))
            await rig.pass_time(0.02)
        assert plant.drive.twist.linear_m_s == 0.5
        await rig.pass_time(0.12)
        assert plant.drive.twist.linear_m_s == 0.5
        await rig.pass_time(0.02)
        assert plant.drive.twist.linear_m_s < 0.5


async def test_a_reset_puts_the_robot_back_and_a_senseless_pillar_does_no_harm() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), rig.source():
        await rig.drive(0.5)
        await rig.pass_time(1.0)
        rig.velocity = (0.0, 0.0)
        await rig.pass_time(1.0)
        for x_m, y_m in ((float("nan"), 0.0), (99.0, 0.0), plant.true_pose[:2]):
            rig.outsider.publisher(topics.OBSTACLE).put(Point(x_m, y_m, 0.0))
        await rig.pass_time(0.1)
        assert plant.pillar is None
        assert (await rig.outsider.call(topics.SIM_RESET)).success
        assert plant.true_pose == pytest.approx(plant.start_pose, abs=1e-6)
