"""The supervisor and the record of its e-stop: what the status shows when, and how the next supervisor starts."""

import asyncio
import re
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

import pytest

from supervisor.config import SupervisorSection
from supervisor.estop_record import PRESS_PENDING, RESET_PENDING, MemoryRecord
from supervisor.service import SupervisorService
from tests.component.rig import Rig
from virtual.network import VirtualBus
from wire import topics
from wire.messages import Bool, planar_twist

ZERO = (0.0, 0.0)
TICK_S = 0.02


class SlowRecord(MemoryRecord):
    """A record whose disk finishes when the test says so."""

    def __init__(self, *, latched: bool = False) -> None:
        super().__init__(latched=latched, problem="")
        self.kept: list[bool] = []
        self.is_held = False

    def keep(self, *, latched: bool) -> None:
        if latched is self.latched:
            return
        super().keep(latched=latched)
        self.kept.append(latched)
        if self.is_held:
            self.is_pending = True
            self.problem = PRESS_PENDING if latched else RESET_PENDING

    def finish(self, problem: str = "") -> None:
        self.is_pending, self.problem = False, problem
        assert self._on_change is not None
        self._on_change()


@asynccontextmanager
async def robot(rig: Rig, record: MemoryRecord) -> AsyncGenerator[VirtualBus]:
    """A supervisor with this record, a lidar and an operator."""
    async with rig.supervisor(estop_record=record) as bus, rig.lidar(), rig.source():
        yield bus


def press(rig: Rig) -> float:
    rig.network.open_joined("button").publisher(topics.ESTOP).put(Bool(data=True))
    return rig.loop.time()


async def test_a_pressed_estop_outlives_the_supervisor_until_a_reset() -> None:
    rig, record = Rig(), MemoryRecord(problem="")
    async with robot(rig, record) as bus:
        await rig.drive(0.5)
        press(rig)
        await rig.pass_time(0.1)
        bus.die()
    for _ in range(2):
        async with robot(rig, record):
            rig.cmd_vel.take()
            rig.velocity = ZERO
            await rig.pass_time(1.0)
            assert rig.newest_status.reasons[0] == "ESTOP"
            rig.velocity = (0.3, 0.0)
            await rig.pass_time(1.0)
            assert all(o.message == planar_twist(0.0, 0.0) for o in rig.cmd_vel.take())
            assert rig.newest_status.reasons[0] == "ESTOP"
    async with robot(rig, record):
        rig.velocity = ZERO
        await rig.pass_time(0.5)
        reply = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert reply.success
        await rig.drive(0.5)
    async with robot(rig, record):
        await rig.drive(0.5)


@pytest.mark.parametrize("name", ["joy", topics.ROS2, "another program"])
async def test_the_status_says_who_pressed_and_when_until_the_reset_also_after_a_restart(name: str) -> None:
    rig, record = Rig(), MemoryRecord(problem="")
    button = rig.network.open_joined("button")
    pressing = button.publisher(topics.ESTOP)
    # The process `ros2` also holds the tokens of its sources.
    for node in {"joy": ["joy"], topics.ROS2: ["joy", topics.ROS2]}.get(name, []):
        button.declare_alive(node, pressing.epoch)
    told = rf"pressed by {name}, \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d"
    async with robot(rig, record) as bus:
        await rig.drive(0.5)
        pressing.put(Bool(data=True))
        await rig.pass_time(0.1)
        assert re.fullmatch(told, rig.newest_status.detail)
        bus.die()
    async with robot(rig, record):
        rig.velocity = ZERO
        await rig.pass_time(1.0)
        assert re.fullmatch(told, rig.newest_status.detail)
        assert (await rig.outsider.call(topics.SUPERVISOR_RESET)).success
        await rig.pass_time(0.5)
        assert (rig.newest_status.detail, record.by) == ("", "")


async def test_a_refused_reset_leaves_the_record() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        press(rig)
        await rig.pass_time(0.1)
        reply = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert not reply.success
        assert record.kept == [True]


async def test_whatever_latches_the_estop_is_recorded() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        rig.outsider.send(topics.ESTOP.key, b"garbled", None)
        await rig.pass_time(0.01)
        assert record.kept == [True]


async def test_zero_does_not_wait_for_the_disk_and_the_status_waits_for_it_one_tick_at_most() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        await rig.pass_time(0.005)
        rig.cmd_vel.take()
        rig.status.take()
        record.is_held = True
        pressed_s = press(rig)
        await asyncio.sleep(0.1)
        zero = next(o for o in rig.cmd_vel.take() if o.message == planar_twist(0.0, 0.0))
        assert zero.arrival_s - pressed_s < 0.001
        told = [a for a in rig.status.take() if a.message is not None and "ESTOP" in a.message.reasons]
        assert told[0].arrival_s - pressed_s <= 2 * TICK_S
        assert {a.message.estop_record_problem for a in told if a.message} == {PRESS_PENDING}
        record.finish()
        finished_s = rig.loop.time()
        await asyncio.sleep(0.001)
        (recorded,) = rig.status.take()
        assert recorded.arrival_s - finished_s < 0.001
        assert recorded.message is not None
        assert recorded.message.estop_record_problem == ""


async def test_a_press_that_would_not_survive_a_kill_yet_is_shown_with_the_next_regular_status() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        await rig.pass_time(0.005)
        rig.status.take()
        record.is_held, record.is_marked = True, False
        pressed_s = press(rig)
        await asyncio.sleep(0.3)
        shown_s = [a.arrival_s for a in rig.status.take() if a.message and "ESTOP" in a.message.reasons]
        assert shown_s[0] - pressed_s == pytest.approx(0.1, abs=TICK_S)
        assert rig.output() == ZERO


async def test_a_fast_disk_lets_the_first_status_show_a_recorded_estop() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        await rig.pass_time(0.005)
        record.is_held = True
        press(rig)
        rig.loop.call_later(0.003, record.finish)
        await asyncio.sleep(0.1)
        shown = [a.message for a in rig.status.take() if a.message is not None]
        (first, *_) = [s for s in shown if "ESTOP" in s.reasons]
        assert first.estop_record_problem == ""


FULL = "a pressed e-stop could not be recorded: No space left on device"


async def test_a_robot_whose_estop_could_not_be_recorded_does_not_move() -> None:
    rig, record = Rig(), SlowRecord()
    record.problem = FULL
    async with robot(rig, record):
        await rig.pass_time(0.5)
        rig.velocity = (0.5, 0.0)
        await rig.pass_time(0.5)
        assert rig.output() == ZERO
        assert rig.newest_status.causes_and_latched()[0] == ["ESTOP_UNRECORDED"]
        assert rig.newest_status.estop_record_problem == FULL
        record.finish()
        await rig.pass_time(0.5)
        assert rig.output() == ZERO, "no neutral has come"
        await rig.drive(0.5)


async def test_a_driving_robot_stops_within_a_tick_when_an_estop_can_no_longer_be_recorded() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        await rig.pass_time(0.005)
        rig.cmd_vel.take()
        record.finish(FULL)
        told_s = rig.loop.time()
        await rig.pass_time(0.1)
        zero = next(o for o in rig.cmd_vel.take() if o.message == planar_twist(0.0, 0.0))
        assert zero.arrival_s - told_s <= TICK_S
        assert rig.newest_status.reasons == ["ESTOP_UNRECORDED"]


async def test_a_press_that_is_being_recorded_is_shown_as_an_estop_alone() -> None:
    rig, record = Rig(), SlowRecord()
    async with robot(rig, record):
        await rig.drive(0.5)
        record.is_held = True
        press(rig)
        await rig.pass_time(0.5)
        assert rig.newest_status.reasons == ["ESTOP"]
        record.finish("the e-stop cannot be recorded: No space left on device")
        await rig.pass_time(0.1)
        assert rig.newest_status.reasons == ["ESTOP", "ESTOP_UNRECORDED"]


async def test_after_a_reset_the_robot_waits_for_the_disk() -> None:
    rig, record = Rig(), SlowRecord(latched=True)
    async with robot(rig, record):
        await rig.pass_time(0.5)
        record.is_held = True
        assert (await rig.outsider.call(topics.SUPERVISOR_RESET)).success
        await rig.pass_time(0.5)
        rig.velocity = (0.5, 0.0)
        await rig.pass_time(0.5)
        assert rig.output() == ZERO
        assert "ESTOP_UNRECORDED" in rig.newest_status.reasons
        record.finish()
        await rig.drive(0.5)


async def test_the_answer_to_a_reset_waits_for_the_disk() -> None:
    rig, record = Rig(), SlowRecord(latched=True)
    async with robot(rig, record):
        await rig.pass_time(0.5)
        record.is_held = True
        asked_s = rig.loop.time()
        rig.loop.call_later(0.1, record.finish)
        reply = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert reply.success
        assert reply.message == "the emergency stop is reset"
        assert rig.loop.time() - asked_s == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("hangs", [True, False])
async def test_the_answer_to_a_reset_says_that_it_could_not_be_recorded(hangs: bool) -> None:  # noqa: FBT001
    rig, record = Rig(), SlowRecord(latched=True)
    async with robot(rig, record):
        await rig.pass_time(0.5)
        record.is_held = True
        if not hangs:
            rig.loop.call_later(0.1, record.finish, "the disk is gone")
        reply = await rig.outsider.call(topics.SUPERVISOR_RESET)
        assert reply.success, "the e-stop of this supervisor is reset"
        assert reply.message.endswith(RESET_PENDING if hangs else "the disk is gone")


async def test_a_press_after_a_reset_ends_recorded() -> None:
    rig, record = Rig(), SlowRecord(latched=True)
    async with robot(rig, record):
        await rig.pass_time(0.5)
        await rig.outsider.call(topics.SUPERVISOR_RESET)
        press(rig)
        await rig.pass_time(0.1)
        assert record.kept == [False, True]
        assert rig.newest_status.reasons[0] == "ESTOP"


async def test_a_supervisor_without_a_record_does_not_move_the_robot_and_says_so() -> None:
    rig = Rig()
    bus, stop = rig.network.open_joined(topics.SUPERVISOR), asyncio.Event()
    running = asyncio.create_task(SupervisorService(bus, SupervisorSection()).run(stop))
    await rig.pass_time(0.2)
    assert "ESTOP_UNRECORDED" in rig.newest_status.reasons
    assert "no record" in rig.newest_status.estop_record_problem
    stop.set()
    await running
