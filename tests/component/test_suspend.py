"""The machine is suspended while the robot drives: the loop's clock stands still, the world does not."""

from sim.plant import Plant
from tests.component.rig import Rig
from wire.messages import SafetyStatus, planar_twist

ZERO = planar_twist(0.0, 0.0)


class Sleep:
    """The clocks of a machine with suspends."""

    def __init__(self) -> None:
        self.slept_s = 0.0

    def __call__(self) -> float:
        slept_s, self.slept_s = self.slept_s, 0.0
        return slept_s


async def test_after_a_suspend_the_operators_motion_moves_nothing_until_neutral() -> None:
    rig, sleep = Rig(), Sleep()
    async with rig.supervisor(suspended_s=sleep), rig.lidar(), rig.source():
        await rig.drive(0.5)
        await rig.pass_time(0.5)
        rig.cmd_vel.take()
        sleep.slept_s = 30.0
        await rig.pass_time(0.021)
        assert rig.cmd_vel.take()[-1].message == ZERO
        await rig.pass_time(2.0)
        assert all(a.message == ZERO for a in rig.cmd_vel.take())
        assert "OVERRUN" in rig.newest_status.reasons
        await rig.drive(0.5)


async def test_a_short_tick_is_no_suspend() -> None:
    rig, sleep = Rig(), Sleep()
    async with rig.supervisor(suspended_s=sleep), rig.lidar(), rig.source():
        await rig.drive(0.5)
        sleep.slept_s = 0.001
        await rig.pass_time(0.2)
        assert rig.newest_status.mode == SafetyStatus.DRIVING


async def test_the_base_brakes_after_a_suspend_whatever_a_supervisor_that_noticed_none_still_says() -> None:
    rig, plant, sleep = Rig(), Plant(), Sleep()
    async with rig.supervisor(), rig.sim(plant, sleep), rig.source():
        await rig.drive(0.5)
        await rig.pass_time(1.0)
        assert plant.true_velocity.linear_m_s > 0.45
        sleep.slept_s = 30.0
        await rig.pass_time(0.1)
        assert plant.true_velocity.linear_m_s < 0.4
        assert rig.output() == (0.5, 0.0)


async def test_after_a_suspend_of_base_and_supervisor_the_robot_stands_until_neutral() -> None:
    rig, plant = Rig(), Plant()
    sleeps = Sleep(), Sleep()
    async with rig.supervisor(suspended_s=sleeps[0]), rig.sim(plant, sleeps[1]), rig.source():
        await rig.drive(0.5)
        await rig.pass_time(1.0)
        for sleep in sleeps:
            sleep.slept_s = 30.0
        await rig.pass_time(0.5)
        x_m = plant.true_pose.x_m
        await rig.pass_time(2.0)
        assert abs(plant.true_pose.x_m - x_m) < 0.001
        await rig.drive(0.5)
        await rig.pass_time(1.0)
        assert plant.true_pose.x_m > x_m + 0.2
