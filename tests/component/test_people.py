"""Who drives, as the supervisor's black box keeps it: the real page's wheel, supervisor and black box on a virtual network."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from station.driving import Driving, Person, Pictures
from station.messages import MAX_NAME, Wanted
from supervisor.blackbox.people import MAX_ACTS, MAX_LENGTH, PERIOD_S, People
from supervisor.blackbox.reader import BlackBoxReader
from supervisor.blackbox.recorder import BlackBox
from supervisor.config import SupervisorSection
from teleop import wheel
from teleop.holder import Holder
from teleop.wheel import SourceWheel
from tests.component.rig import Rig
from tests.unit.supervisor.blackbox.black_boxes import NOON_UTC_S, WriterAtOnce
from virtual.network import VirtualBus
from wire import topics
from wire.messages import Bool, TriggerResponse, planar_twist


class Station:
    """A station's wheel, and the persons at its pages."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self.bus = rig, rig.network.open_joined("page")
        source = SourceWheel("teleop", (1.0, 1.0))
        source.join(self.bus)
        self.driving = Driving(source)

    async def anna_drives(self) -> Person:
        """Let Anna drive ahead at her page."""
        anna = self.driving.enter("Anna", "Anna's page")
        await self.takes(anna)
        await self.drives(anna, 0.5, 2.0)
        return anna

    async def takes(self, person: Person) -> None:
        assert await self.driving.take(person, self._rig.loop.time()) == ""

    async def drives(self, person: Person, linear: float, seconds: float) -> None:
        """Request zero for a moment, then motion."""
        pictures, end_s = Pictures(), self._rig.loop.time() + seconds
        zero_s = self._rig.loop.time() + 0.5
        while (now_s := self._rig.loop.time()) < end_s:
            pictures.sent(1, now_s)
            share = 0.0 if now_s < zero_s else linear
            self.driving.hear(person, Wanted(share, 0.0, now_s, 1), pictures, now_s)
            await self._rig.pass_time(0.05)


@asynccontextmanager
async def robot(rig: Rig, writer: WriterAtOnce) -> AsyncGenerator[VirtualBus]:
    people = People(utc=lambda: NOON_UTC_S)
    box = BlackBox(SupervisorSection().law(), writer, window_s=60.0, people=people)
    async with rig.supervisor(black_box=box, people=people) as bus, rig.lidar():
        await rig.pass_time(0.5)
        yield bus


def acts(path: Path) -> str:
    return "\n".join(f"{act.by}: {act.text}" for act in BlackBoxReader(path).acts)


async def test_an_incident_names_who_drove_asked_took_over_stopped_and_reset(tmp_path: Path) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        driving = station.driving
        anna = await station.anna_drives()
        assert rig.output() == (0.5, 0.0)
        ben = driving.enter("Ben", "Ben's page")
        assert (
            driving.ending(anna, rig.loop.time(), "Ben")
            == "You handed over to Ben. Press Drive to drive again."
        )
        driving.leave(anna)
        await rig.pass_time(0.05)
        assert rig.output() == (0.0, 0.0), "a hand-over stops a robot that drives"
        await station.takes(ben)
        await rig.pass_time(1.0)
        assert rig.output() == (0.0, 0.0), "and moves nothing"
        await station.drives(ben, 0.3, 2.0)
        assert rig.output() == (0.3, 0.0)
        station.bus.publisher(topics.ESTOP).put(Bool(data=True))
        driving.record("Cleo's page", "Cleo pressed the e-stop")
        await station.drives(ben, 0.0, 4.0)
        told = acts(writer.paths[-1])
        for act in (
            "Anna began to drive",
            "Ben asked to drive",
            "Anna handed over to Ben",
            "Ben began to drive",
            "Cleo pressed the e-stop",
            "e-stop: pressed by ",
        ):
            assert act in told
        assert "requested a reset" not in told
        assert await driving.reset(ben) == ""
        await station.drives(ben, 0.3, 2.0)
        assert rig.output() == (0.3, 0.0)
        driving.leave(ben)
        await rig.pass_time(4.0)
        told = acts(writer.paths[-1])
        for act in ("Ben requested a reset", "reset: ", "Ben ended driving"):
            assert act in told


async def test_the_driver_of_a_station_that_is_killed_is_in_the_incident(tmp_path: Path) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        await station.anna_drives()
        station.bus.die()
        await rig.pass_time(4.0)
        assert "Anna began to drive" in acts(writer.paths[-1])


async def test_a_press_at_a_page_is_recorded_although_nobody_has_driven_from_a_page(tmp_path: Path) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer), rig.source():
        station = Station(rig)
        await rig.drive(0.5)
        station.bus.publisher(topics.ESTOP).put(Bool(data=True))
        station.driving.record("Cleo's page", "Cleo pressed the e-stop")
        await rig.pass_time(4.0)
    assert "Cleo pressed the e-stop" in acts(writer.paths[-1])


@asynccontextmanager
async def ben_drives(rig: Rig) -> AsyncGenerator[None]:
    """Let a program that is no page drive as the same source."""
    bus = rig.network.open_joined("program")
    commands = bus.publisher(topics.source_cmd_vel("teleop"))
    holder = Holder(bus, "teleop", commands, "the program of Ben\x1b[2J")
    await holder.claim()
    async with rig.every(0.05, lambda: commands.put(planar_twist(*rig.velocity))):
        await rig.drive(0.3)
        yield
    holder.drop()


async def test_a_page_at_which_nobody_drives_does_not_answer_for_the_program_that_drives(
    tmp_path: Path,
) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        anna = await station.anna_drives()
        station.driving.leave(anna)
        await rig.pass_time(1.0)
        async with ben_drives(rig):
            asks = station.driving.enter("Cleo", "Cleo's page")
            refusal = await station.driving.take(asks, rig.loop.time())
            assert refusal == "End the program that drives the robot: the program of Ben?[2J."
            station.driving.leave(asks)
            assert rig.output() == (0.3, 0.0)
        await rig.pass_time(4.0)
    assert "teleop: the program of Ben?[2J" in acts(writer.paths[-1])


async def test_a_driver_whose_link_was_lost_while_another_program_took_over_loses_control(
    tmp_path: Path,
) -> None:
    """Otherwise the pages would show her name while the other program drives."""
    rig = Rig()
    async with robot(rig, WriterAtOnce(tmp_path)):
        station = Station(rig)
        anna = await station.anna_drives()
        assert station.driving.ending(anna, rig.loop.time()) == ""
        rig.network.cut("page")
        await rig.pass_time(2.0)
        async with ben_drives(rig):
            rig.network.heal("page")
            await rig.pass_time(1.0)
            sentence = station.driving.ending(anna, rig.loop.time())
            assert sentence == "You lost control to another program. Press Drive to drive again."
            station.driving.leave(anna)
            await rig.pass_time(0.5)
            assert rig.output() == (0.3, 0.0)


async def test_a_program_that_answers_nothing_or_anything_delays_no_command(tmp_path: Path) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        silent = rig.network.open_joined("silent")
        asked_s = list[float]()

        async def answer(_: str) -> TriggerResponse:
            asked_s.append(rig.loop.time())
            return TriggerResponse(success=True, message="\x1b[2J" + "x" * 60_000)

        silent.serve(topics.source_holder("teleop"), answer)
        async with rig.source():
            await rig.drive(0.5)
            for number in range(200):  # runs that begin and end all the time
                silent.declare_alive("teleop", number.to_bytes(16, "big")).withdraw()
                await rig.pass_time(0.02)
            assert rig.output() == (0.5, 0.0)
        assert len(asked_s) > 2
        assert all(later - earlier >= PERIOD_S for earlier, later in pairwise(asked_s))
        await rig.pass_time(4.0)
    (one,) = [act for act in BlackBoxReader(writer.paths[-1]).acts if act.by == "teleop"]
    assert one.text.startswith("?[2Jx")
    assert len(one.text) == MAX_LENGTH


async def test_a_page_that_asks_and_leaves_all_the_time_under_any_name_hides_nothing_that_others_did(
    tmp_path: Path,
) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        driving = station.driving
        anna = await station.anna_drives()
        station.bus.publisher(topics.ESTOP).put(Bool(data=True))
        driving.record("Cleo's page", "Cleo pressed the e-stop")
        for number in range(100):  # before the supervisor asks
            name = f"{number:024d}"
            asks = driving.enter(name, "page of a flood")
            driving.record(asks.page, f"{name} pressed the e-stop")
            driving.leave(asks)
        await station.drives(anna, 0.0, 4.0)
    told = acts(writer.paths[-1])
    assert "Cleo pressed the e-stop" in told
    assert f"{99:024d} pressed the e-stop" in told


async def test_an_act_that_a_person_repeats_hides_no_other_act_of_this_person(tmp_path: Path) -> None:
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        anna = await station.anna_drives()
        station.bus.publisher(topics.ESTOP).put(Bool(data=True))
        station.driving.record(anna.page, "Anna pressed the e-stop")
        for _ in range(50):  # before the supervisor asks
            station.driving.record(anna.page, "Anna requested a reset")
        await station.drives(anna, 0.0, 4.0)
    told = acts(writer.paths[-1])
    assert "Anna pressed the e-stop" in told
    assert "Anna requested a reset" in told


async def test_the_newest_acts_are_kept_of_a_report_that_is_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def about(source: str) -> str:
        return f"the {source} of {'u' * 32}@{'h' * 64}"

    monkeypatch.setattr(wheel, "about_this_process", about)
    rig, writer = Rig(), WriterAtOnce(tmp_path)
    async with robot(rig, writer):
        station = Station(rig)
        for number in range(MAX_ACTS):
            station.driving.record(number, f"{number:0{MAX_NAME}d} lost control after 30 s without motion")
        anna = station.driving.enter("A" * MAX_NAME, "her page")
        await station.takes(anna)
        await station.drives(anna, 0.5, 2.0)
        station.driving.leave(anna)
        await rig.pass_time(4.0)
    told = acts(writer.paths[-1])
    assert "A began to drive" in told
    assert "A ended driving" in told


@pytest.mark.parametrize("others", [[], [("teleop", "Anna began to drive")]])
async def test_each_press_and_each_reset_is_kept_but_not_a_flood_of_resets(
    others: list[tuple[str, str]],
) -> None:
    people = People(utc=lambda: NOON_UTC_S)
    life = [("e-stop", "pressed by phone"), *others, ("reset", "done"), *others, ("reset", "done")]
    for by, text in life * 2:
        people.note(by, text)
    assert [act["by"] for act in people.acts if act["by"] != "teleop"] == ["e-stop", "reset"] * 2


async def test_a_source_that_reports_all_the_time_hides_no_press_and_no_other_source() -> None:
    people = People(utc=lambda: NOON_UTC_S)
    people.note("e-stop", "pressed by phone")
    people.note("path", "Ben began to drive")
    for number in range(10 * MAX_ACTS):
        people.note("teleop", f"act {number}")
    assert [act["by"] for act in people.acts] == ["e-stop", "path", *["teleop"] * (MAX_ACTS - 2)]
    assert people.acts[-1]["text"] == f"act {10 * MAX_ACTS - 1}"


async def test_only_the_newest_acts_are_kept_and_none_twice_in_a_row() -> None:
    people = People(utc=lambda: NOON_UTC_S)
    for number in range(MAX_ACTS + 5):
        for _ in range(3):
            people.note("teleop", f"act {number}")
    assert [act["text"] for act in people.acts] == [f"act {number}" for number in range(5, MAX_ACTS + 5)]
    people.close()
    await asyncio.sleep(0)
