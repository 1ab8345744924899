"""The path source beside the real supervisor and the real MuJoCo robot, in virtual time."""

import asyncio
import math
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import pytest

from sim.plant import Plant
from supervisor.config import SourceSection, SupervisorSection
from teleop.holder import ASK_LIMIT_S, HeldError
from teleop.path.course import Path, PathError, Pose, Poses, TrackError, placed, square, to_path
from teleop.path.service import ARM_LIMIT_S, HEADWAY_S, Drive, Ending, PathService, Plan
from tests.component.rig import Rig
from virtual.loop import VirtualLoop
from wire import topics
from wire.messages import Bool, Point, SafetyStatus, SourceStatus, header, odometry, planar_twist

CMD_VEL = topics.source_cmd_vel("path")
BEAT_S = 0.05
AHEAD = np.array([(0.0, 0.0, 0.0), (1.6, 0.0, 0.0)])


def here(poses: Poses) -> Plan:
    return lambda pose: to_path(placed(poses, pose))


@dataclass
class Watcher:
    """The person at the terminal."""

    present: bool = True
    said: list[str] = field(default_factory=list[str])
    shown: list[str] = field(default_factory=list[str])


class Run:
    """A running PathService, and an outside subscriber."""

    def __init__(self, rig: Rig, plan: Plan, person: Watcher, speed_m_s: float) -> None:
        self.rig, self.person, self.stop = rig, person, asyncio.Event()
        self._commands = rig.outsider.subscribe(CMD_VEL, depth=100_000)
        self.asked_for: list[tuple[float, float]] = []
        self.bus = rig.network.open_joined("path")
        service = PathService(
            self.bus, plan, speed_m_s=speed_m_s, say=person.said.append, show=person.shown.append
        )
        service.is_attended, self.enter = person.present, service.go_on
        self.task: asyncio.Task[Drive] = asyncio.create_task(service.run(self.stop))

    def listen(self) -> list[tuple[float, float]]:
        for arrival in self._commands.take():
            assert arrival.message is not None
            self.asked_for.append((arrival.message.linear.x, arrival.message.angular.z))
        return self.asked_for

    @property
    def asks_for_nothing(self) -> bool:
        return self.listen()[-1] == (0.0, 0.0)

    @property
    def alive(self) -> bool:
        return "path" in self.rig.outsider.alive

    async def until(self, condition: Callable[[], object], limit_s: float = 60.0) -> None:
        """Let time pass until a condition holds and all messages until then have arrived."""
        for _ in range(round(limit_s / BEAT_S)):
            if condition():
                return await self.rig.pass_time(0.001)
            await self.rig.pass_time(BEAT_S)
        pytest.fail(f"not within {limit_s:g} s; said: {self.person.said}, {self.rig.newest_status}")

    async def paused(self, words: str) -> None:
        count = len(self.person.said)
        await self.until(lambda: any("paused" in said for said in self.person.said[count:]))
        assert words in self.person.said[-1]
        assert self.asks_for_nothing

    async def at_its_end(self, limit_s: float = 90.0) -> Drive:
        await self.until(self.task.done, limit_s)
        assert self.asks_for_nothing
        assert not self.alive
        return self.task.result()


@asynccontextmanager
async def driving(
    rig: Rig, plan: Plan, person: Watcher | None = None, speed_m_s: float = 0.5
) -> AsyncGenerator[Run]:
    run = Run(rig, plan, person or Watcher(), speed_m_s)
    try:
        yield run
    finally:
        run.task.cancel()
        await asyncio.wait({run.task})


class Operator:
    """A teleop that sends on its beat, and once more at each key."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._bus = rig, rig.network.open_joined(topics.TELEOP)
        self._cmd_vel = self._bus.publisher(topics.source_cmd_vel(topics.TELEOP))
        self.velocity = (0.0, 0.0)

    def press(self, linear_m_s: float = 0.0) -> None:
        self.velocity = (linear_m_s, 0.0)
        self._cmd_vel.put(planar_twist(*self.velocity))

    @asynccontextmanager
    async def beating(self) -> AsyncGenerator["Operator"]:
        self._bus.declare_alive(topics.TELEOP)
        async with self._rig.every(BEAT_S, lambda: self._cmd_vel.put(planar_twist(*self.velocity))):
            yield self


def hang(seconds: float) -> None:
    """Time passes while the loop does not turn."""
    cast("VirtualLoop", asyncio.get_running_loop()).advance(seconds)


async def test_a_square_is_driven_to_its_end_by_a_source_that_is_neutral_first() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: run.listen()[-1:] != [(0.0, 0.0)] and run.asked_for)
        armed = run.asked_for.index(next(asked for asked in run.asked_for if asked != (0.0, 0.0)))
        assert armed >= 2
        drive = await run.at_its_end()
        assert drive.ending is Ending.DONE
        assert drive.done_m == pytest.approx(4.0)
        error = TrackError.of(drive.off_path_m)
        assert error is not None
        print(
            f"\n    measured: square of 1 m, supervised: {error.rms_m * 1e3:.1f} mm rms, "
            f"{error.max_m * 1e3:.1f} mm at most"
        )
        assert error.rms_m < 0.006
        assert error.max_m < 0.02
        assert math.dist(plant.true_pose[:2], plant.start_pose[:2]) < 0.03
        assert plant.true_velocity == pytest.approx((0.0, 0.0), abs=0.01)
        assert any(line.startswith("driving: ") and " of 4.00 m" in line for line in run.person.shown)


@pytest.mark.long
async def test_the_operator_takes_over_and_the_path_goes_on_only_when_it_is_asked_to() -> None:
    rig, plant = Rig(), Plant()
    operator = Operator(rig)
    async with rig.supervisor(), rig.sim(plant), operator.beating(), driving(rig, here(square(0.6))) as run:
        await run.until(lambda: plant.true_pose.x_m > plant.start_pose.x_m + 0.4)
        operator.velocity = (-0.3, 0.0)
        await run.paused("teleop took over; Enter continues")
        await rig.pass_time(1.0)
        assert plant.true_velocity.linear_m_s == pytest.approx(-0.3, abs=0.02)
        run.enter()
        await run.paused("teleop drives; it must stop first")
        operator.press()
        await rig.pass_time(2.0)
        assert plant.true_velocity == pytest.approx((0.0, 0.0), abs=0.01)
        assert run.asks_for_nothing
        run.enter()
        drive = await run.at_its_end()
        assert drive.ending is Ending.DONE
        assert drive.done_m == pytest.approx(2.4)
        assert math.dist(plant.true_pose[:2], plant.start_pose[:2]) < 0.03
        assert all(off_m < 0.05 for off_m in drive.off_path_m)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
async def test_a_key_of_the_operator_pauses_the_path_although_it_asks_for_no_motion(share: float) -> None:
    rig, plant = Rig(), Plant()
    operator = Operator(rig)
    async with rig.supervisor(), rig.sim(plant), operator.beating(), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: plant.true_pose.x_m > plant.start_pose.x_m + 0.4)
        await rig.pass_time(share * BEAT_S)
        operator.press()
        await rig.pass_time(BEAT_S)
        assert run.asks_for_nothing
        assert "a key was pressed at teleop" in run.person.said[-1]


async def test_an_obstacle_on_the_path_pauses_it_until_it_is_gone_and_somebody_asks() -> None:
    rig, plant = Rig(), Plant()
    pillar = rig.outsider.publisher(topics.OBSTACLE)
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(AHEAD)) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        pillar.put(Point(plant.start_pose.x_m + 1.2, plant.start_pose.y_m, 0.0))
        await run.paused("STOPPED: OBSTACLE (0.3")
        run.enter()
        await run.paused("STOPPED: OBSTACLE")
        pillar.put(Point(0.0, 0.0, -1.0))
        await rig.pass_time(2.0)
        assert run.asks_for_nothing
        run.enter()
        drive = await run.at_its_end()
        assert drive.ending is Ending.DONE
        assert plant.collisions == 0


async def test_an_enter_from_before_a_stop_does_not_answer_it() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(square(1.5))) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        run.enter()
        await rig.pass_time(0.2)
        rig.outsider.publisher(topics.ESTOP).put(Bool(data=True))
        await run.paused("STOPPED: ESTOP")
        assert (await rig.outsider.call(topics.SUPERVISOR_RESET)).success
        await rig.pass_time(2.0)
        assert run.asks_for_nothing
        run.enter()
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)


@pytest.mark.parametrize("x_m", [None, math.nan], ids=["silent", "no number"])
async def test_odometry_that_falls_silent_or_is_no_number_pauses_the_path(x_m: float | None) -> None:
    rig = Rig()
    odom = rig.outsider.publisher(topics.ODOM)
    said: list[float | None] = [0.0]

    def tell() -> None:
        if said[0] is not None:
            odom.put(odometry((said[0], 0.0, 0.0), (0.0, 0.0)))

    async with rig.supervisor(), rig.lidar(), rig.every(0.02, tell), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: run.listen() and not run.asks_for_nothing)
        said[0] = x_m
        await run.paused("the odometry is silent")


async def test_a_robot_whose_wheels_spin_on_the_spot_pauses_the_path() -> None:
    rig = Rig()
    odom = rig.outsider.publisher(topics.ODOM)

    def spin() -> None:
        odom.put(odometry((0.0, 0.0, 0.0), rig.output()))

    async with rig.supervisor(), rig.lidar(), rig.every(0.02, spin), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: run.listen() and not run.asks_for_nothing)
        await rig.pass_time(HEADWAY_S - 0.2)
        assert not run.asks_for_nothing
        await run.paused("no headway for 3 s (nearest: 2.75 m")


async def test_a_base_that_stands_whatever_is_commanded_pauses_the_path() -> None:
    rig = Rig()
    odom = rig.outsider.publisher(topics.ODOM)

    def stand() -> None:
        odom.put(odometry((0.0, 0.0, 0.0), (0.0, 0.0)))

    async with rig.supervisor(), rig.lidar(), rig.every(0.02, stand), driving(rig, here(square(1.0))) as run:
        await run.paused("STOPPED: BASE_UNRESPONSIVE")


@pytest.mark.long
async def test_a_supervisor_that_dies_pauses_the_path_and_a_new_one_does_not_set_it_going() -> None:
    rig, plant = Rig(), Plant()
    async with rig.sim(plant), rig.supervisor() as supervisor, driving(rig, here(AHEAD)) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        supervisor.die()
        await run.paused("the supervisor is silent")
        async with rig.supervisor():
            await rig.pass_time(3.0)
            assert run.asks_for_nothing
            assert plant.true_velocity == pytest.approx((0.0, 0.0), abs=0.01)
            run.enter()
            assert (await run.at_its_end()).ending is Ending.DONE


async def test_a_hang_of_its_own_pauses_the_path() -> None:
    """With a supervisor that does not hang: this one only sends what a real one would."""
    rig = Rig()
    odom, statuses = rig.outsider.publisher(topics.ODOM), rig.outsider.publisher(topics.STATUS)
    own = SourceStatus("path", 10, SourceStatus.ALIVE, True, True, True, 0.02, [], 9, 0, 0, 0, 0)  # noqa: FBT003

    def tell() -> None:
        odom.put(odometry((0.0, 0.0, 0.0), (0.0, 0.0)))
        statuses.put(SafetyStatus(header(""), mode=SafetyStatus.READY, owner="path", sources=[own]))

    async with rig.every(0.02, tell), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: run.listen() and not run.asks_for_nothing)
        hang(0.1)
        await rig.pass_time(0.3)
        assert not run.asks_for_nothing, "late is not hung"
        hang(0.4)
        await rig.pass_time(0.001)
        assert "this program hung for 0." in run.person.said[-1]
        assert run.asks_for_nothing


async def test_with_nobody_there_a_stop_ends_it_with_the_reason() -> None:
    rig, plant = Rig(), Plant()
    person = Watcher(present=False)
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(square(1.0)), person) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        rig.outsider.publisher(topics.ESTOP).put(Bool(data=True))
        drive = await run.at_its_end(1.0)
        assert (drive.ending, drive.reason) == (Ending.STOPPED, "STOPPED: ESTOP")
        assert 0.0 < drive.done_m < 1.0
        assert drive.driving_s > 0.3


async def test_what_may_not_start_for_too_long_does_not_start_by_itself_later() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant):
        rig.outsider.publisher(topics.ESTOP).put(Bool(data=True))
        await rig.pass_time(0.5)
        async with driving(rig, here(square(1.0))) as run:
            await rig.pass_time(ARM_LIMIT_S - 0.2)
            assert run.person.said == []
            assert run.person.shown[-1].startswith("waiting: STOPPED: ESTOP")
            await run.paused("STOPPED: ESTOP")
            assert (await rig.outsider.call(topics.SUPERVISOR_RESET)).success
            await rig.pass_time(2.0)
            assert plant.true_pose == pytest.approx(plant.start_pose, abs=0.001)
            run.enter()
            await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)


async def test_a_supervisor_without_this_source_is_named_as_the_reason() -> None:
    rig = Rig()
    config = SupervisorSection(sources=(SourceSection(name="teleop", priority=100),))
    nobody = Watcher(present=False)
    async with rig.supervisor(config), rig.sim(Plant()), driving(rig, here(square(1.0)), nobody) as run:
        drive = await run.at_its_end(ASK_LIMIT_S + ARM_LIMIT_S + 1.0)
        assert drive.ending is Ending.STOPPED
        assert "ignores source path" in drive.reason
        assert drive.path is None


async def test_being_told_to_end_leaves_a_zero_and_no_token() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(square(1.0))) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        run.stop.set()
        drive = await run.at_its_end(0.2)
        assert drive.ending is Ending.INTERRUPTED
        assert drive.driving_s > 0.3


async def test_a_plan_that_fails_ends_it_with_its_sentence() -> None:
    rig = Rig()

    def plan(_: Pose) -> Path:
        raise PathError("the path begins elsewhere")

    async with rig.supervisor(), rig.sim(Plant()), driving(rig, plan) as run:
        await run.until(run.task.done)
        assert isinstance(run.task.exception(), PathError)
        assert set(run.listen()) == {(0.0, 0.0)}
        assert not run.alive


async def test_a_name_that_is_held_is_not_spoken_in() -> None:
    rig = Rig()
    rig.outsider.declare_alive("path", b"some other run..")
    async with rig.supervisor(), rig.sim(Plant()), driving(rig, here(square(1.0))) as run:
        await run.until(run.task.done, 5.0)
        error = run.task.exception()
        assert isinstance(error, HeldError)
        assert "a path is driven already" in str(error)
        assert run.listen() == []


async def test_it_can_be_ended_while_it_takes_its_name() -> None:
    rig = Rig()
    rig.outsider.declare_alive("path", b"some other run..")
    async with driving(rig, here(square(1.0))) as run:
        await rig.pass_time(0.1)
        run.stop.set()
        await rig.pass_time(0.01)
        assert run.task.result().ending is Ending.INTERRUPTED
        assert run.listen() == []


async def test_what_is_no_message_is_passed_over() -> None:
    rig, plant = Rig(), Plant()
    async with rig.supervisor(), rig.sim(plant), driving(rig, here(square(0.5))) as run:
        await run.until(lambda: plant.true_velocity.linear_m_s > 0.3)
        for topic in (topics.ODOM, topics.STATUS, topics.source_cmd_vel(topics.TELEOP)):
            rig.outsider.send(topic.key, b"junk", None)
        await rig.pass_time(0.5)
        assert not run.asks_for_nothing
        assert rig.newest_status.mode == SafetyStatus.DRIVING
