"""The first drive with the real supervisor and the real MuJoCo robot, in virtual time, and with bases that differ from it."""

import asyncio
import tomllib
from collections import deque
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from commission import plan
from commission.commission import EXIT_ABORTED, Conductor
from commission.mounting import Mistake
from sim import service
from sim.config import SimSection
from sim.lidar_config import SimLidarSection
from sim.messages import to_odometry
from sim.motion_sensors import EncoderConfig, Reckoning
from sim.plant import Plant
from supervisor.config import LidarSection, SupervisorSection
from tests.component.rig import Rig
from wire import topics
from wire.messages import Bool, Odometry, Point

HALL = "[hall]\nsize_m = [12.0, 10.0]\n\n[start]\nx_m = {x_m}\n"
"""The wall is at x = 6 m, ahead of the robot, and all others are farther away."""

ANSWERS = {
    "if it agrees": "yes",
    "Type ahead or back": "ahead",
    "Type left or right": "left",
    "Type go to drive": "go",
    "Type write": "write",
}


class ForeignPlant(Plant):
    """A robot whose base obeys late, or in the wrong direction, or drives a little too fast."""

    dead_s = drift_m_s = 0.0
    forward = turn = 1.0

    def __init__(self, hall: Path, sim: SimSection) -> None:
        super().__init__(hall, sim.limits(), sim.lidar_configs(), sim.seed, sim.build())
        self._late: deque[tuple[float, float]] = deque()

    def step(self, twist_target: tuple[float, float], n_steps: int = 1) -> None:
        self._late.append(twist_target)
        is_late = len(self._late) > round(self.dead_s / self.timestep_s)
        linear_m_s, angular_rad_s = self._late.popleft() if is_late else (0.0, 0.0)
        twist = self.forward * linear_m_s + self.drift_m_s, self.turn * angular_rad_s
        super().step(twist, n_steps)


@dataclass
class ScriptedPerson:
    """Answers each question by its text; any other sentence is only kept."""

    answers: Mapping[str, str]
    said: list[str] = field(default_factory=list[str])
    typed: str = ""
    is_asked: bool = False
    has_ended: bool = False

    def say(self, sentence: str) -> None:
        self.said.append(sentence)

    def show(self, line: str) -> None:
        pass

    def expect(self, *, line: bool) -> None:
        self.typed, self.is_asked = "", line

    def take(self) -> str:
        if self.is_asked:
            return next((answer for words, answer in self.answers.items() if words in self.said[-1]), "end")
        typed, self.typed = self.typed, ""
        return typed


@dataclass
class FirstDrive:
    """One run of the command on one robot."""

    rig: Rig
    plant: ForeignPlant
    person: ScriptedPerson
    file: Path
    conductor: Conductor
    stop: asyncio.Event

    async def run(self) -> int:
        return await self.conductor.run(self.stop)

    @property
    def speed_m_s(self) -> float:
        return self.plant.true_velocity.linear_m_s

    def has_said(self, words: str) -> bool:
        return any(words in said for said in self.person.said)

    @property
    def measured(self) -> dict[str, Any]:
        return tomllib.loads(self.file.read_text())["measured"]

    def value(self, *path: str) -> float:
        found = self.measured
        for key in path:
            found = found[key]
        return found["value"]


@asynccontextmanager
async def first_drive(
    directory: Path,
    sim: SimSection,
    config: SupervisorSection,
    answers: Mapping[str, str] = ANSWERS,
    x_m: float = 2.0,
    **base: float,
) -> AsyncGenerator[FirstDrive]:
    hall, file = directory / "hall.toml", directory / "robot.toml"
    hall.write_text(HALL.format(x_m=x_m))
    file.write_text("# my robot\n[supervisor]\ndeceleration_m_s2 = 1.5 # a guess\n")
    rig, person = Rig(), ScriptedPerson(answers)
    plant = ForeignPlant(hall, sim)
    for name, value in base.items():
        setattr(plant, name, value)
    bus, stop = rig.network.open_joined("path"), asyncio.Event()
    conductor = Conductor(bus, person, file, config, config.all_lidars()[0], "path")
    async with rig.supervisor(config), rig.sim(plant, config=sim):
        yield FirstDrive(rig, plant, person, file, conductor, stop)


async def until(drive: FirstDrive, running: asyncio.Task[int], holds: Callable[[], bool]) -> None:
    """Let time pass until something holds; the command must not end before."""
    while not holds():
        assert not running.done(), drive.person.said
        await drive.rig.pass_time(0.05)


SIM = SimSection(
    moving=False,
    imu_hz=1.0,
    braking_m_s2=1.2,
    lidar_noise_m=0.004,
    odom_left_error=0.04,
    odom_right_error=0.04,
)
CONFIG = SupervisorSection(deceleration_m_s2=1.0)


async def press_estop_in_the_last_step(drive: FirstDrive) -> None:
    """Press it once the robot drives in the step of the e-stop."""
    moving = drive.rig.outsider.subscribe(topics.CMD_VEL)
    while True:
        await asyncio.sleep(0.1)
        latest = moving.latest()
        in_step = any(said.startswith("Step e-stop") for said in drive.person.said)
        if in_step and latest is not None and latest.message is not None and latest.message.linear.x > 0.0:
            await asyncio.sleep(2.0)
            drive.rig.outsider.publisher(topics.ESTOP).put(Bool(data=True))
            return


@pytest.mark.long
@pytest.mark.timeout(600)  # it computes two minutes of driving
async def test_what_the_first_drive_measures_is_what_the_robot_is(tmp_path: Path) -> None:
    dead_s = 0.12
    async with first_drive(tmp_path, SIM, CONFIG, dead_s=dead_s) as drive:
        pressing = asyncio.create_task(press_estop_in_the_last_step(drive))
        code = await drive.run()
        await pressing
        assert code == 0, drive.person.said
        assert drive.plant.collisions == 0
    assert drive.value("deceleration_m_s2") == pytest.approx(1.2, rel=0.06)
    assert drive.measured["deceleration_m_s2"]["limit"] < 1.21
    assert drive.value("dead_time_s") == pytest.approx(dead_s, abs=0.02)
    assert drive.value("odometry_scale") == pytest.approx(1.0 / 1.04, rel=0.005)
    track = EncoderConfig().track_error
    assert drive.value("turn_scale") == pytest.approx((1.0 + track) / 1.04, rel=0.01)
    assert drive.value("slip") == pytest.approx(0.0, abs=0.03)
    assert 0.0 < drive.value("estop_s") < 0.5 + dead_s
    assert drive.value("lidars", "lidar", "noise_m") == pytest.approx(0.004, rel=0.05)
    assert drive.value("lidars", "lidar", "period_s") == pytest.approx(0.05, rel=0.01)
    assert drive.value("lidars", "lidar", "latency_s") == pytest.approx(0.0, abs=0.01)
    assert drive.value("lidars", "lidar", "yaw_rad") == pytest.approx(0.0, abs=0.02)
    assert drive.file.read_text().startswith("# my robot\n[supervisor]\ndeceleration_m_s2 = 1.5 # a guess\n")


@pytest.fixture
def no_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the step of the stops, which takes most of the time."""
    monkeypatch.setattr(plan, "STOP_SPEEDS_M_S", ())


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("no_stops")
async def test_the_yaw_of_a_lidar_that_looks_elsewhere_than_configured_is_measured(tmp_path: Path) -> None:
    answers = {**ANSWERS, "skip to leave it out": "skip"}
    config = CONFIG.model_copy(update={"lidar": LidarSection(yaw_rad=0.25)})
    async with first_drive(tmp_path, SIM, config, answers) as drive:
        assert await drive.run() == 0, drive.person.said
    assert drive.value("lidars", "lidar", "yaw_rad") == pytest.approx(0.0, abs=0.03)
    assert "estop_s" not in drive.measured


@pytest.mark.long
@pytest.mark.parametrize(
    ("base", "answers", "flip", "sentence"),
    [
        ({"forward": -1.0}, {"Type ahead or back": "back"}, False, "the base drives backwards"),
        ({"turn": -1.0}, {"Type left or right": "right"}, False, "the base turns right"),
        ({"drift_m_s": 0.01}, {}, False, "the robot moves although zero is commanded"),
        ({}, {}, True, "the lidar is mirrored: change flip"),
    ],
)
async def test_a_wrong_sign_or_a_mirrored_lidar_ends_it_with_what_to_correct(
    tmp_path: Path, base: dict[str, float], answers: dict[str, str], *, flip: bool, sentence: str
) -> None:
    config = CONFIG.model_copy(update={"lidar": LidarSection(flip=flip)})
    async with first_drive(tmp_path, SIM, config, {**ANSWERS, **answers}, **base) as drive:
        assert await drive.run() == EXIT_ABORTED
        assert sentence in drive.person.said[-1]
        await drive.rig.pass_time(1.0)
        assert abs(drive.plant.true_velocity.linear_m_s) < 0.005 + base.get("drift_m_s", 0.0)
    assert "measured" not in drive.file.read_text()


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_a_robot_that_sees_only_ahead_is_measured_with_the_stops_that_fit(tmp_path: Path) -> None:
    """It may not drive back beyond what it has seen, so each step ends nearer to the wall."""
    front = SimLidarSection(name="front", topic="scan", x_m=0.1, span_rad=4.0, beams=541)
    sim = SIM.model_copy(update={"lidars": (front,)})
    lidar = LidarSection(x_m=0.1, view_rad=(-2.0, 2.0), beams=541)
    config = CONFIG.model_copy(update={"lidar": lidar})
    answers = {**ANSWERS, "skip to leave it out": "skip"}
    async with first_drive(tmp_path, sim, config, answers) as drive:
        assert await drive.run() == 0, drive.person.said
        assert drive.plant.collisions == 0
    assert drive.value("lidars", "lidar", "yaw_rad") == pytest.approx(0.0, abs=0.05)
    assert drive.value("odometry_scale") == pytest.approx(1.0 / 1.04, rel=0.02)
    assert any(said.startswith("step stops from") and "needs" in said for said in drive.person.said)
    assert drive.value("deceleration_m_s2") == pytest.approx(1.2, rel=0.2)


@pytest.mark.long
async def test_a_key_ends_a_drive_at_once_and_the_person_may_repeat_the_step(tmp_path: Path) -> None:
    answers = {**ANSWERS, "Type again for this step": "again"}
    async with first_drive(tmp_path, SIM, CONFIG, answers) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.speed_m_s > 0.05)
        drive.person.typed = "x"
        await drive.rig.pass_time(0.5)
        assert abs(drive.plant.true_velocity.linear_m_s) < 0.005
        await until(drive, running, lambda: drive.has_said("Step left"))
        assert drive.has_said("step ahead: a key was pressed")
        drive.stop.set()
        await running


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_a_key_between_two_drives_of_a_step_keeps_the_robot_at_rest(tmp_path: Path) -> None:
    async with first_drive(tmp_path, SIM, CONFIG) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.has_said("Step headings"))
        await until(drive, running, lambda: drive.speed_m_s > 0.05)
        await until(drive, running, lambda: drive.speed_m_s < 0.005)
        drive.person.typed = "x"
        assert await running == EXIT_ABORTED
        assert "a key was pressed" in drive.person.said[-1]
        assert drive.plant.true_velocity.linear_m_s == pytest.approx(0.0, abs=0.005)


async def test_when_the_supervisor_falls_silent_the_person_must_switch_the_robot_off(tmp_path: Path) -> None:
    async with first_drive(tmp_path, SIM, CONFIG) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.speed_m_s > 0.05)
        drive.rig.network.cut("path")
        assert await running == EXIT_ABORTED
        assert "the supervisor is silent: if the robot moves, switch it off" in drive.person.said[-1]


@pytest.fixture
def only_estop(monkeypatch: pytest.MonkeyPatch, no_stops: None) -> None:
    """Leave out the headings and the stops, and drive a shorter distance."""
    back = plan.Drive(turn_rad=-plan.TURN_RAD, speed=plan.SLOW_RAD_S)
    monkeypatch.setattr(plan, "HEADINGS", plan.HEADINGS._replace(drives=(back,)))
    monkeypatch.setattr(plan, "ESTOP", plan.ESTOP._replace(drives=(plan.Drive(0.3),)))


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("only_estop")
async def test_an_estop_after_the_drive_does_not_count(tmp_path: Path) -> None:
    answers = {**ANSWERS, "skip to leave it out": "skip"}
    async with first_drive(tmp_path, SIM, CONFIG, answers) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.has_said("Step e-stop"))
        await until(drive, running, lambda: drive.speed_m_s > 0.05)
        await until(drive, running, lambda: drive.speed_m_s < 0.005)
        drive.rig.outsider.publisher(topics.ESTOP).put(Bool(data=True))
        assert await running == 0
        assert drive.has_said("no e-stop was heard")
    assert "estop_s" not in drive.measured


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("only_estop")
async def test_a_file_that_became_unusable_during_the_drives_may_be_corrected_and_written(
    tmp_path: Path,
) -> None:
    answers = {**ANSWERS, "skip to leave it out": "skip"}
    async with first_drive(tmp_path, SIM, CONFIG, answers) as drive:
        drive.file.write_text("measured = {}\n")
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.has_said("Correct it, and try again"))
        drive.file.write_text("[measured]\n")
        assert await running == 0
    assert drive.value("lidars", "lidar", "noise_m") == pytest.approx(0.004, rel=0.05)


def too_fast(message: Odometry) -> None:
    message.twist.twist.linear.x *= 1.2


def too_short(message: Odometry) -> None:
    message.pose.pose.position.x *= 0.5
    message.twist.twist.linear.x *= 0.5


def turned_back(message: Odometry) -> None:
    message.pose.pose.orientation.z *= -1.0
    message.twist.twist.angular.z *= -1.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        (too_fast, Mistake.ODOMETRY_SPEED),
        (too_short, Mistake.ODOMETRY_DISTANCE),
        pytest.param(turned_back, Mistake.ODOMETRY_TURNS_BACK, marks=pytest.mark.long),
    ],
)
async def test_wrong_odometry_ends_it_with_what_to_correct(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Odometry], None], mistake: Mistake
) -> None:
    def wrong(reckoning: Reckoning) -> Odometry:
        message = to_odometry(reckoning)
        change(message)
        return message

    monkeypatch.setattr(service, "to_odometry", wrong)
    async with first_drive(tmp_path, SIM, CONFIG) as drive:
        assert await drive.run() == EXIT_ABORTED
        assert drive.person.said[-1] == f"aborted: {mistake}. Nothing was written"


@pytest.mark.long
async def test_a_base_that_does_not_follow_may_make_the_first_turn_again(tmp_path: Path) -> None:
    answers = {**ANSWERS, "Type again for this step": "again"}
    async with first_drive(tmp_path, SIM, CONFIG, answers, turn=0.0) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.has_said("step left: "))
        assert drive.has_said("step left: STOPPED: BASE_UNRESPONSIVE")
        drive.plant.turn = 1.0
        await until(drive, running, lambda: drive.has_said("Step headings"))
        drive.stop.set()
        await running


async def test_a_person_who_does_not_confirm_ends_it_before_the_robot_moves(tmp_path: Path) -> None:
    async with first_drive(tmp_path, SIM, CONFIG, {**ANSWERS, "Type go to drive": "wait"}) as drive:
        start = drive.plant.true_pose
        assert await drive.run() == EXIT_ABORTED
        assert drive.plant.true_pose == pytest.approx(start, abs=1e-4)


async def test_a_robot_too_near_to_the_wall_says_what_it_needs_and_does_not_move(tmp_path: Path) -> None:
    async with first_drive(tmp_path, SIM, CONFIG, x_m=5.0) as drive:
        assert await drive.run() == EXIT_ABORTED
        assert "it needs 0.98 m ahead of the hull, and the wall is 0.75 m away" in drive.person.said[-1]
        assert drive.plant.true_pose.x_m == pytest.approx(5.0, abs=1e-3)


async def test_a_pillar_before_the_wall_ends_a_drive_by_a_stop_of_the_supervisor(tmp_path: Path) -> None:
    async with first_drive(tmp_path, SIM, CONFIG) as drive:
        running = asyncio.create_task(drive.run())
        await until(drive, running, lambda: drive.speed_m_s > 0.05)
        pose = drive.plant.true_pose
        drive.rig.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m + 0.6, pose.y_m, 0.0))
        assert await running == EXIT_ABORTED
        assert "STOPPED: OBSTACLE" in drive.person.said[-1]
        assert drive.plant.collisions == 0
