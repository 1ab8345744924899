"""What a run requests from the operator's program; the driver and the injector only note the calls."""

import asyncio
import math
from typing import Any, cast

import pytest

from commission.driver import FIND_S, SurpriseError
from commission.plan import Base, Drive
from commission.trace import Driven, Odom
from commission.wall import Wall
from passport import rounds
from passport.cells import Bases, Fault, Plan, standing_m, standing_s
from passport.injection import InjectionError
from passport.rounds import Place, Rounds, Seen
from teleop.path.course import Pose
from teleop.pilots.pilot import NEUTRAL, Velocity
from wire.reasons import StopReason

BASE = Base(1.0, 1.0, 0.5)
POSE = Pose(0.0, 0.0, 0.0)
WALL = Wall(5.0, 0.0, 3.0)
SEEN = Seen(0.0, POSE, WALL, 1.0, 1.0, is_stopped=False)


class Samples:
    """The samples of odometry, with a wall that is always seen."""

    def __init__(self, odometry: list[Odom]) -> None:
        self.odometry = odometry

    def between(self, *_: float) -> "Samples":
        return self

    def mean_wall(self) -> Wall:
        return WALL


class Done:
    """Watches a drive that is done immediately."""

    def __init__(self, *_: object, is_first: bool) -> None:
        pass

    def is_done(self, *_: object) -> bool:
        return True


class Robot:
    """Stands for the driver, the operator's program, the injector and the person, and notes the calls."""

    def __init__(self, *, speed_m_s: float = 0.8, bearing_rad: float = 0.0, begins: bool = True) -> None:
        self.now_s, self.speed_m_s, self.bearing_of_wall_rad, self.begins = (
            2.0,
            speed_m_s,
            bearing_rad,
            begins,
        )
        self.requests: list[Velocity] = []
        self.drives: list[Drive] = []
        self.lifted: list[tuple[Fault, Velocity]] = []
        self.presses = 0
        self.trace = Samples([self.odom()])

    def odom(self) -> Odom:
        return Odom(self.now_s, POSE, self.speed_m_s, 0.0, self.now_s)

    async def beat(self) -> None:
        self.now_s += 0.1
        self.trace.odometry.append(self.odom())

    async def start(self, *, with_link: bool) -> None:
        assert not with_link

    async def end(self) -> None:
        pass

    async def wait(self, seconds: float) -> None:
        self.now_s += seconds

    async def drive(self, drive: Drive, _: Base) -> None:
        self.drives.append(drive)

    async def begin(self, _: Fault) -> float:
        if not self.begins:
            raise InjectionError("no answer")
        return self.now_s

    async def lift(self, fault: Fault) -> None:
        self.lifted.append((fault, self.requests[-1]))

    def request(self, velocity: Velocity) -> None:
        self.requests.append(velocity)

    def press_estop(self) -> None:
        self.presses += 1

    def wall(self) -> Wall:
        return WALL

    async def find_wall(self) -> Wall:
        await self.wait(FIND_S)
        return WALL

    def has_stopped(self, _: StopReason) -> bool:
        return False

    def gap_m(self, _: Wall) -> float:
        return 5.0

    def bearing_rad(self, _: Wall) -> float:
        return self.bearing_of_wall_rad

    def key(self) -> None:
        return None

    def silent(self) -> None:
        return None

    def show(self, _: str) -> None:
        pass

    def say(self, _: str) -> None:
        pass


def rounds_of(robot: Robot) -> Rounds:
    same = cast("Any", robot)
    found = Rounds(same, same, same, same, Bases(BASE, BASE, BASE, BASE), "teleop")
    found.place = Place(POSE, 5.0)
    return found


class Unseen(Robot):
    """A robot of which nothing arrives during a fault. Then its last odometry of the time before arrives, and 0.5 s later it is seen at rest.

    Args:
        way_m: how far it has driven since the fault.
        creeps: whether it then moves.
        clock_s: the clock of its base less that of the recorder.
    """

    def __init__(self, way_m: float, *, creeps: bool = False, clock_s: float = 0.0) -> None:
        self.fault_s, self.lift_s = math.inf, math.inf
        self.way_m, self.creeps, self.clock_s = way_m, creeps, clock_s
        super().__init__()

    def odom(self) -> Odom:
        return super().odom()._replace(sent_s=self.now_s + self.clock_s - 0.01)

    async def beat(self) -> None:
        self.now_s += 0.1
        if self.now_s >= self.lift_s + 0.5:
            rest = self.odom()._replace(linear_m_s=0.02 if self.creeps else 0.0)
            self.trace.odometry.append(rest._replace(pose=Pose(self.way_m, 0.0, 0.0)))

    async def wait(self, seconds: float) -> None:
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            await self.beat()

    async def begin(self, _: Fault) -> float:
        self.fault_s = await super().begin(_)
        return self.fault_s

    async def lift(self, fault: Fault) -> None:
        await super().lift(fault)
        self.lift_s = self.now_s
        late = self.odom()
        self.trace.odometry.append(late._replace(sent_s=self.fault_s + self.clock_s))


@pytest.mark.parametrize("fault", [fault for fault in Fault if fault.takes_recorder])
@pytest.mark.parametrize("clock_s", [0.0, -40.0, 1e6])
def test_a_base_stood_during_a_fault_if_it_is_at_rest_no_farther_away_than_one_that_stood_in_time(
    monkeypatch: pytest.MonkeyPatch, fault: Fault, clock_s: float
) -> None:
    monkeypatch.setattr(rounds, "Watch", Done)
    plan = Plan(fault, 0.8)
    most_m = standing_m(plan, BASE)
    stopped = {
        (way_m, creeps): asyncio.run(
            rounds_of(Unseen(way_m, creeps=creeps, clock_s=clock_s))._drive(plan)  # pyright: ignore[reportPrivateUsage]
        ).is_stopped
        for way_m in (most_m, math.nextafter(most_m, 9.0))
        for creeps in (False, True)
    }
    assert [case for case, is_stopped in stopped.items() if is_stopped] == [(most_m, False)]


def test_a_base_that_drives_on_until_the_supervisor_is_back_and_stops_it_has_not_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rounds, "Watch", Done)
    plan = Plan(Fault.SUPERVISOR_STOPPED, 0.8)
    robot = Unseen(plan.speed * standing_s(plan, BASE))
    assert not asyncio.run(rounds_of(robot)._drive(plan)).is_stopped  # pyright: ignore[reportPrivateUsage]
    assert robot.presses > 0
    assert robot.lifted == [(plan.fault, NEUTRAL)]


def test_a_robot_that_moves_after_its_fault_was_lifted_is_not_driven_on_but_stopped() -> None:
    robot = Robot()
    plan = Plan(Fault.LIDAR_SILENT, 0.8)
    seen = asyncio.run(rounds_of(robot)._at_rest(plan, SEEN))  # pyright: ignore[reportPrivateUsage]
    assert not seen.is_stopped
    assert robot.presses > 0
    assert set(robot.requests) == {NEUTRAL}


def test_a_base_that_turns_too_far_each_time_is_turned_only_a_few_times() -> None:
    robot = Robot(bearing_rad=0.2)
    asyncio.run(rounds_of(robot)._face())  # pyright: ignore[reportPrivateUsage]
    assert len(robot.drives) == rounds.MOST_TURNS


def test_a_robot_that_faces_the_wall_is_not_turned() -> None:
    robot = Robot(bearing_rad=rounds.TURN_RAD)
    asyncio.run(rounds_of(robot)._face())  # pyright: ignore[reportPrivateUsage]
    assert robot.drives == []


def test_a_robot_of_which_odometry_says_nothing_after_a_time_has_not_stood() -> None:
    robot, plan = Robot(speed_m_s=0.0), Plan(Fault.ROS2_KILLED, 0.8)
    seen = SEEN._replace(fault_s=2.0)
    assert not rounds_of(robot)._stood(plan, seen)  # pyright: ignore[reportPrivateUsage]
    robot.now_s += standing_s(plan, BASE) + 0.1
    robot.trace.odometry.append(robot.odom())
    assert rounds_of(robot)._stood(plan, seen)  # pyright: ignore[reportPrivateUsage]
    assert not rounds_of(robot)._stood(plan, SEEN)  # pyright: ignore[reportPrivateUsage]


def test_a_fault_whose_begin_failed_is_lifted_after_zero_was_requested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rounds, "Watch", Done)
    robot = Robot(begins=False)
    with pytest.raises(InjectionError):
        asyncio.run(rounds_of(robot)._drive(Plan(Fault.ROS2_KILLED, 0.8)))  # pyright: ignore[reportPrivateUsage]
    assert robot.lifted == [(Fault.ROS2_KILLED, NEUTRAL)]


@pytest.mark.parametrize("with_lifeline", [True, False])
def test_a_key_during_a_run_presses_the_e_stop_without_lifeline_only(
    monkeypatch: pytest.MonkeyPatch, *, with_lifeline: bool
) -> None:
    robot = Robot()
    monkeypatch.setattr(robot, "key", lambda: "a key was pressed")
    plan = Plan(Fault.OPERATOR_KILLED, 0.8, with_lifeline=with_lifeline)
    found = rounds_of(robot)
    monkeypatch.setattr(found, "_start_operator", robot.start)
    monkeypatch.setattr(rounds, "Watch", Done)
    with pytest.raises(SurpriseError, match="a key was pressed"):
        asyncio.run(found.run(plan))
    assert (robot.presses > 0) is not with_lifeline


@pytest.mark.parametrize("is_stopped", [True, False])
def test_a_run_that_does_not_fit_says_whether_the_robot_could_not_drive_back(
    monkeypatch: pytest.MonkeyPatch, *, is_stopped: bool
) -> None:
    robot = Robot()

    async def drive(*_: object) -> Driven:
        return Driven(cast("Any", None), POSE, 0.2, WALL, WALL, 0.0, 0.0, is_stopped)

    async def ready() -> None:
        pass

    def gap_m(_: Wall) -> float:
        return 1.0

    monkeypatch.setattr(robot, "drive", drive)
    monkeypatch.setattr(robot, "ready", ready, raising=False)
    monkeypatch.setattr(robot, "gap_m", gap_m)
    found = rounds_of(robot)
    asyncio.run(found.back())
    with pytest.raises(SurpriseError, match=r"needs \d\.\d\d m ahead") as caught:
        asyncio.run(found.run(Plan(Fault.ZERO, 0.8)))
    assert (rounds.NOT_BACK in str(caught.value)) is is_stopped
