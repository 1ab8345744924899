"""The stops of the real MuJoCo robot behind the real supervisor, in virtual time, with an operator in the same process."""

import asyncio
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from commission.commission import EXIT_ABORTED
from deploy.stack.launch import Launch
from deploy.stack.robot_file import read_robot
from deploy.stack.statedir import StateDir
from passport.cells import Fault
from passport.injection import Operator
from passport.measure import Measurement, Orders, Robot
from passport.record import Cell, Passport, Run, from_json
from sim.config import SimSection
from supervisor.config import SupervisorSection
from teleop.pilots.pilot import NEUTRAL, Velocity
from tests.component.rig import Rig
from tests.component.test_commission import ForeignPlant, ScriptedPerson
from virtual.network import VirtualBus
from wire import topics
from wire.host.config import read_toml
from wire.messages import Bool, planar_twist

HALL = "[hall]\nsize_m = [14.0, 14.0]\n\n[start]\nx_m = 3.0\n"
SPEED_M_S, BRAKING_M_S2, DEAD_S = 0.4, 1.2, 0.1
FILE = f"[supervisor]\nmax_linear_m_s = {SPEED_M_S}\ndeceleration_m_s2 = 1.0\nbase_dead_time_s = {DEAD_S}\n"
SIM = SimSection(moving=False, imu_hz=1.0, braking_m_s2=BRAKING_M_S2)
BRAKES_M = SPEED_M_S * DEAD_S + SPEED_M_S**2 / (2.0 * BRAKING_M_S2)
"""Distance that the robot drives after the zero."""
ANSWERS = {
    "Type yes if it agrees": "yes",
    "Type what the floor is": "concrete",
    "Type go to drive": "go",
    "Type the mass": "5 kg",
    "Type reset to reset": "reset",
}


class StubbornPlant(ForeignPlant):
    """A base that keeps its last motion when it is commanded to stop."""

    is_stubborn = 0.0

    def step(self, twist_target: tuple[float, float], n_steps: int = 1) -> None:
        if twist_target[0] > 0.3:
            self._last = twist_target
        last = getattr(self, "_last", twist_target)
        super().step(last if self.is_stubborn else twist_target, n_steps)


class VirtualOperator(Operator):
    """An operator on the virtual network."""

    def __init__(self, rig: Rig, launch: Launch) -> None:
        super().__init__(launch, topics.TELEOP)
        self._rig, self._velocity = rig, NEUTRAL
        self._bus: VirtualBus | None = None

    async def start(self, *, with_link: bool) -> None:
        bus = self._bus = self._rig.network.open_joined(topics.TELEOP)
        bus.declare_alive(topics.TELEOP)
        commands = bus.publisher(topics.source_cmd_vel(topics.TELEOP))

        async def repeat() -> None:
            while True:
                commands.put(planar_twist(*self._velocity))
                await asyncio.sleep(0.05)

        self._beating = asyncio.create_task(repeat())

    def request(self, velocity: Velocity) -> None:
        self._velocity = velocity

    def hit(self, fault: Fault) -> None:
        assert fault is Fault.OPERATOR_KILLED
        assert self._bus is not None
        self._beating.cancel()
        self._bus.die()

    async def end(self) -> None:
        self._beating.cancel()
        if self._bus is not None:
            self._bus.die()
        self._bus = None


@dataclass
class Site:
    """A robot in front of a wall, and its measurement."""

    rig: Rig
    plant: StubbornPlant
    out: Path
    robot: Robot
    state: StateDir
    said: list[str] = field(default_factory=list[str])

    async def measure(self, *faults: Fault, answers: Mapping[str, str] = ANSWERS) -> int:
        bus, person = self.rig.network.open_joined("path"), ScriptedPerson(answers, self.said)
        orders = Orders("path", None, self.out, 1, (0,), faults)
        operator = VirtualOperator(self.rig, self.robot.launch)
        measurement = Measurement(bus, person, operator, self.robot, self.state, orders, None)
        try:
            return await measurement.run(asyncio.Event())
        finally:
            bus.die()

    @property
    def record(self) -> Passport:
        return from_json(self.out.read_text())

    def cell(self, fault: Fault) -> Cell:
        return next(one for one in self.record.cells if one.fault == fault.words)

    def run(self, fault: Fault) -> Run:
        (found,) = self.cell(fault).runs
        return found


@asynccontextmanager
async def site(directory: Path) -> AsyncGenerator[Site]:
    hall, file = directory / "hall.toml", directory / "robot.toml"
    hall.write_text(HALL)
    file.write_text(FILE)
    rig, plant = Rig(), StubbornPlant(hall, SIM)
    plant.dead_s = DEAD_S
    sections = read_robot(read_toml(file), simulated=False)
    config = sections[SupervisorSection]
    robot = Robot(file, Launch.read(file, None), sections, config.all_lidars()[0])
    async with rig.supervisor(config), rig.sim(plant, config=SIM):
        yield Site(rig, plant, directory / "passport.json", robot, StateDir(directory))


SEEN = (Fault.OPERATOR_KILLED, Fault.LIDAR_SILENT, Fault.ODOMETRY_SILENT, Fault.ESTOP)


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_the_stops_are_those_of_the_robot_and_a_complete_measurement_does_not_drive_again(
    tmp_path: Path,
) -> None:
    async with site(tmp_path) as subject:
        assert await subject.measure(*SEEN, Fault.SUPERVISOR_KILLED) == 0, subject.said
        for fault in SEEN:
            run = subject.run(fault)
            assert run.t1_s is not None
            assert run.t3_s is not None
            assert run.v0_m_s == pytest.approx(SPEED_M_S, rel=0.02)
            assert run.distance_m == pytest.approx(BRAKES_M + SPEED_M_S * run.t1_s, abs=0.02), fault
            assert run.t3_s == pytest.approx(run.t1_s + DEAD_S + SPEED_M_S / BRAKING_M_S2, abs=0.08), fault
            assert run.deceleration_m_s2 == pytest.approx(BRAKING_M_S2, rel=0.2), fault
            assert not run.slip
        refused = subject.cell(Fault.SUPERVISOR_KILLED)
        assert refused.refused == "the process supervisor is not one of this computer's `lifeline up`"
        assert refused.runs == ()
        assert subject.record.conditions.loads == ("0 %: 5 kg",)
        assert "; at the last run, load average " in subject.record.conditions.machine_load
        assert subject.record.deviations == ()
        assert subject.plant.collisions == 0
        pose = subject.plant.true_pose
        assert await subject.measure(*SEEN) == 0
        assert subject.plant.true_pose == pytest.approx(pose, abs=1e-3)


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_a_turn_is_measured_in_rad_and_the_robot_faces_the_wall_again_for_the_next_run(
    tmp_path: Path,
) -> None:
    async with site(tmp_path) as subject:
        rate_rad_s, braking_rad_s2 = subject.robot.top.angular_rad_s, SIM.angular_braking_rad_s2
        assert await subject.measure(Fault.TURN, Fault.ESTOP) == 0, "\n".join(subject.said)
        run, cell = subject.run(Fault.TURN), subject.cell(Fault.TURN)
        assert run.t1_s is not None
        assert run.t3_s is not None
        assert cell.turn
        assert cell.speed_m_s == rate_rad_s
        assert run.v0_m_s == pytest.approx(rate_rad_s, rel=0.02)
        within_rad = subject.record.instrument.uncertainty_rad
        truth_rad = rate_rad_s * (DEAD_S + run.t1_s) + rate_rad_s**2 / (2.0 * braking_rad_s2)
        assert run.distance_m == pytest.approx(truth_rad, abs=within_rad)
        assert run.odometry_m == pytest.approx(truth_rad, abs=within_rad)
        assert run.t3_s == pytest.approx(run.t1_s + DEAD_S + rate_rad_s / braking_rad_s2, abs=0.08)
        assert not run.slip
        assert subject.run(Fault.ESTOP).stopped
        assert not subject.cell(Fault.ESTOP).turn


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_a_robot_that_does_not_stop_ends_the_measurement_with_the_estop_pressed(tmp_path: Path) -> None:
    async with site(tmp_path) as subject:
        subject.plant.is_stubborn = 1.0
        assert await subject.measure(Fault.OPERATOR_KILLED, Fault.ESTOP) == EXIT_ABORTED
        run = subject.run(Fault.OPERATOR_KILLED)
        assert (run.stopped, run.distance_m, run.t3_s) == (False, None, None)
        assert len(subject.record.cells) == 1
        assert any("The e-stop of Lifeline is pressed" in one for one in subject.said)
        await subject.rig.pass_time(0.5)
        assert "ESTOP" in subject.rig.newest_status.reasons


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_a_robot_that_an_estop_stopped_after_another_fault_makes_no_run(tmp_path: Path) -> None:
    async with site(tmp_path) as subject:
        running = asyncio.create_task(subject.measure(Fault.ODOMETRY_SILENT))
        estop = subject.rig.outsider.publisher(topics.ESTOP)
        silent = 0
        while silent < 5 and not running.done():  # 0.1 s
            await asyncio.sleep(0.02)
            silent = silent + 1 if subject.rig.odom.latest() is None else 0
        estop.put(Bool(data=True))
        assert await running == EXIT_ABORTED
        assert subject.record.cells == ()
        assert "ESTOP has stopped the robot, not the fault" in subject.record.deviations[0]
