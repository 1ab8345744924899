"""E-stop stations on a virtual network: the real station and the real supervisor, with cuts, losses and deaths."""

import asyncio
import itertools
import json
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from recordings.incidents.replay import replay
from supervisor.blackbox.file import Order, write
from supervisor.blackbox.reader import read
from supervisor.blackbox.recorder import BlackBox
from supervisor.config import SupervisorSection
from supervisor.estop_record import MemoryRecord
from teleop.pilots.keys import FOCUS_OUT, UNFOCUSED
from teleop.pilots.pilot import KeyEvent
from teleop.station.service import Station
from teleop.station.state import Look, Word
from tests.component.rig import Rig
from virtual.network import VirtualBus
from wire import topics
from wire.bus import Arrival
from wire.lease import LEASE_S
from wire.messages import EstopLease, EstopStationStatus, SafetyStatus, encode, planar_twist

TICK_S = 0.02
LOST, ESTOP = "ESTOP_STATION_LOST", "ESTOP"
CTRL_R = "\x12"


def section(**required: bool) -> SupervisorSection:
    stations = [{"name": name, "required": value} for name, value in required.items()]
    return SupervisorSection.model_validate({"estop_stations": stations})


DOOR = section(door=True)


class Person:
    """The terminal of a station: keys in, looks out."""

    def __init__(self, rig: Rig, bus: VirtualBus) -> None:
        self.rig, self.bus = rig, bus
        self.wake = asyncio.Event()
        self.typed: list[KeyEvent] = []
        self.ended = False
        self.looks: list[Look] = []
        self.stop = asyncio.Event()

    def take(self) -> list[KeyEvent]:
        typed, self.typed = self.typed, []
        return typed

    def type(self, *keys: str) -> None:
        self.typed += [KeyEvent(key) for key in keys]
        self.wake.set()

    @property
    def word(self) -> Word:
        return self.looks[-1].word


@asynccontextmanager
async def station(rig: Rig, name: str = "door", node: str = "") -> AsyncGenerator[Person]:
    bus = rig.network.open_joined(node or f"{name} station")
    person = Person(rig, bus)
    subject = Station(name, "tcp/x:1", keys=person, show=person.looks.append, wake=person.wake)
    subject.join(bus)
    running = asyncio.create_task(subject.run(person.stop))
    try:
        yield person
    finally:
        person.stop.set()
        await running


@asynccontextmanager
async def robot(
    rig: Rig, config: SupervisorSection = DOOR, record: MemoryRecord | None = None
) -> AsyncGenerator[VirtualBus]:
    async with (
        rig.supervisor(config, estop_record=record or MemoryRecord(problem="")) as bus,
        rig.lidar(),
        rig.source(),
    ):
        yield bus


@asynccontextmanager
async def driving(config: SupervisorSection = DOOR) -> AsyncGenerator[tuple[Rig, Person]]:
    """A robot that drives at 0.5 m/s while its station is heard."""
    rig = Rig()
    async with robot(rig, config), station(rig) as person:
        await rig.pass_time(0.5)
        await rig.drive(0.5)
        yield rig, person


async def stop_time_s(rig: Rig, since_s: float, limit_s: float = 2.0) -> float:
    """Return the time from then to the first zero."""
    await rig.pass_time(limit_s)
    zeros = (a.arrival_s for a in rig.cmd_vel.take() if a.message == planar_twist(0.0, 0.0))
    return next(at_s for at_s in zeros if at_s >= since_s) - since_s


async def reset(rig: Rig) -> tuple[bool, str]:
    rig.velocity = (0.0, 0.0)
    await rig.pass_time(0.3)
    reply = await rig.outsider.call(topics.SUPERVISOR_RESET)
    return reply.success, reply.message


def states(status: SafetyStatus) -> dict[str, int]:
    return {one.name: one.state for one in status.estop_stations}


async def test_the_robot_stands_until_its_station_is_heard_and_both_know_it() -> None:
    rig = Rig()
    async with robot(rig):
        await rig.pass_time(1.0)
        assert LOST in rig.newest_status.causes
        assert states(rig.newest_status) == {"door": EstopStationStatus.UNHEARD}
        async with station(rig) as person:
            await rig.pass_time(0.5)
            assert states(rig.newest_status) == {"door": EstopStationStatus.HEARD}
            assert person.word is Word.HEARD
            await rig.drive(0.5)
            assert person.looks[-1].is_needed


@pytest.mark.parametrize("seconds", [20, pytest.param(120, marks=pytest.mark.proof)])
async def test_the_presence_of_a_station_stops_nothing(seconds: int) -> None:
    async with driving() as (rig, person):
        for _ in range(seconds // 10):
            rig.cmd_vel.take()
            await rig.pass_time(10.0)
            assert all(a.message == planar_twist(0.5, 0.0) for a in rig.cmd_vel.take())
        words = {look.word for look in person.looks[5:]}
        assert words == {Word.HEARD}


async def test_a_station_whose_terminal_loses_the_focus_stops_nothing_and_any_key_still_does() -> None:
    async with driving() as (rig, person):
        person.type(FOCUS_OUT)
        await rig.pass_time(1.0)
        assert person.word is Word.HEARD
        assert all(a.message == planar_twist(0.5, 0.0) for a in rig.cmd_vel.take()[-5:])
        person.type(UNFOCUSED)
        await rig.pass_time(0.2)
        assert rig.newest_status.causes == [ESTOP]


async def test_a_killed_station_stops_the_robot_by_its_token_and_stays_latched_until_it_is_back_and_reset() -> (
    None
):
    rig = Rig()
    async with robot(rig):
        async with station(rig) as person:
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            died_s = rig.loop.time()
            person.bus.die()
            assert await stop_time_s(rig, died_s) < 0.004
            assert LOST in rig.newest_status.causes
            assert rig.newest_status.detail == "door is silent"
        assert await reset(rig) == (False, "the required e-stop station door is not heard: start it first")
        async with station(rig, node="another run"):
            await rig.pass_time(0.5)
            assert rig.newest_status.causes == [LOST]
            assert (await reset(rig))[0]
            await rig.drive(0.5)


async def test_a_stopped_station_stops_the_robot_when_its_lease_ends() -> None:
    async with driving() as (rig, person):
        stopped_s = rig.loop.time()
        rig.network.cut("door station")
        assert LEASE_S - 0.06 < await stop_time_s(rig, stopped_s) < LEASE_S + 0.001
        rig.network.heal("door station")
        assert person.word is Word.NOT_HEARD


@pytest.mark.parametrize(("up", "down"), [(True, False), (False, True)])
async def test_one_direction_of_the_link_that_is_cut_ends_the_lease_too(up: bool, down: bool) -> None:  # noqa: FBT001 - parameters of the test
    async with driving() as (rig, person):
        cut_s = rig.loop.time()
        rig.network.cut("door station", up=up, down=down)
        assert await stop_time_s(rig, cut_s) < LEASE_S + TICK_S
        assert person.word is Word.NOT_HEARD
        rig.network.heal("door station")


async def test_the_backlog_of_a_stalled_link_does_not_bring_a_station_back() -> None:
    async with driving() as (rig, _):
        rig.network.lease_s = 10.0  # the connection outlives the cut
        rig.network.cut("door station", up=True, down=False)
        await rig.pass_time(1.0)
        assert rig.newest_status.causes == [LOST]
        up, _ = rig.network.link("door station")
        up.delay_s = 1.0  # the backlog arrives, and what is new comes too late
        rig.network.heal("door station")
        await rig.pass_time(3.0)
        assert states(rig.newest_status) == {"door": EstopStationStatus.LOST}
        up.delay_s = 0.0
        await rig.pass_time(3.0)
        assert states(rig.newest_status) == {"door": EstopStationStatus.HEARD}
        assert rig.newest_status.causes == [LOST], "back, and not reset"


async def test_a_replay_of_recorded_messages_does_not_keep_a_dead_station_alive() -> None:
    rig = Rig()
    heard = rig.outsider.subscribe(topics.estop_presence("door"), depth=1000)
    async with robot(rig):
        async with station(rig) as person:
            await rig.pass_time(1.0)
            recorded: list[Arrival[EstopLease]] = heard.take()
            await rig.drive(0.5)
            person.bus.die()
            await rig.pass_time(0.1)
        assert len(recorded) > 15
        attacker = rig.network.open_joined("attacker").publisher(topics.estop_presence("door"))
        for one in itertools.islice(itertools.cycle(recorded), 60):
            assert one.message is not None
            attacker.put(one.message)
            await rig.pass_time(0.05)
            assert states(rig.newest_status) == {"door": EstopStationStatus.LOST}
        assert not (await reset(rig))[0]


async def test_a_press_stops_at_once_and_the_button_must_be_released_before_the_reset() -> None:
    async with driving() as (rig, person):
        pressed_s = rig.loop.time()
        person.type("k")
        assert await stop_time_s(rig, pressed_s) < 0.001
        assert rig.newest_status.causes == [ESTOP]
        assert rig.newest_status.detail == "door is pressed"
        assert (person.word, person.looks[-1].is_pressed) == (Word.STOPPED, True)
        assert await reset(rig) == (False, "the e-stop station door is pressed: release it there first")
        person.type(CTRL_R)
        await rig.pass_time(0.2)
        assert (person.word, person.looks[-1].is_pressed) == (Word.STOPPED, False)
        assert (await reset(rig))[0]
        await rig.pass_time(0.2)
        assert person.word is Word.HEARD
        await rig.drive(0.5)


async def test_a_press_gets_through_a_link_that_loses_nine_of_ten_messages() -> None:
    async with driving(section(door=False)) as (rig, person):
        for conditions in rig.network.link("door station"):
            conditions.loss = 0.9
        person.type(" ")
        await rig.pass_time(3.0)
        assert rig.newest_status.causes == [ESTOP]


async def test_a_press_counts_although_the_message_on_estop_is_lost() -> None:
    async with driving() as (rig, person):
        up, _ = rig.network.link("door station")
        up.loss = 1.0
        person.type(" ")
        await rig.pass_time(0.01)
        up.loss = 0.0
        assert rig.newest_status.causes == []
        pressed_s = rig.loop.time()
        assert await stop_time_s(rig, pressed_s) < 0.1
        assert rig.newest_status.causes == [ESTOP]


async def test_a_press_of_a_station_that_is_not_configured_is_repeated_until_a_status_shows_it() -> None:
    """The supervisor ignores its presence: only the message on `estop` counts."""
    rig = Rig()
    async with robot(rig), station(rig), station(rig, "window") as window:
        await rig.pass_time(0.5)
        await rig.drive(0.5)
        up, _ = rig.network.link("window station")
        up.loss = 1.0
        window.type(" ")
        await rig.pass_time(0.01)
        up.loss = 0.0
        await rig.pass_time(0.5)
        assert rig.newest_status.causes == [ESTOP]
        assert await reset(rig) == (True, "the emergency stop is reset")
        await rig.pass_time(1.0)
        assert rig.newest_status.causes == []


async def test_a_press_without_a_supervisor_is_kept_and_sent_as_soon_as_there_is_one() -> None:
    rig = Rig()
    async with station(rig) as person:
        person.type(" ")
        await rig.pass_time(1.0)
        assert person.word is Word.NOT_HEARD
        assert person.looks[-1].is_pressed
        person.type(CTRL_R)
        await rig.pass_time(0.2)
        assert person.looks[-1].is_pressed, "not confirmed: it cannot be released"
        async with robot(rig):
            await rig.pass_time(0.5)
            assert rig.newest_status.causes[0] == ESTOP
            assert (person.word, person.looks[-1].is_confirmed) == (Word.STOPPED, True)


async def test_a_required_station_that_leaves_stops_the_robot_and_one_that_is_not_required_does_not() -> None:
    rig = Rig()
    async with robot(rig, section(door=True, gate=False)):
        async with station(rig) as door:
            async with station(rig, "gate") as gate:
                await rig.pass_time(0.5)
                await rig.drive(0.5)
                gate.type("q")
                await rig.pass_time(1.0)
            assert rig.output() == (0.5, 0.0)
            assert states(rig.newest_status)["gate"] == EstopStationStatus.LEFT
            left_s = rig.loop.time()
            door.type("q")
            assert await stop_time_s(rig, left_s) < TICK_S + 0.002
        assert states(rig.newest_status)["door"] == EstopStationStatus.LEFT
        assert rig.newest_status.detail == "door has left"


async def test_a_station_that_leaves_repeats_its_report_until_the_supervisor_confirms_it() -> None:
    rig = Rig()
    async with robot(rig):
        async with station(rig) as door:
            await rig.pass_time(0.5)
            to_hub, _ = rig.network.link("door station")
            to_hub.loss = 1.0
            door.type("q")
            await rig.pass_time(0.1)
            to_hub.loss = 0.0
            await rig.pass_time(0.2)
        assert states(rig.newest_status)["door"] == EstopStationStatus.LEFT


async def test_a_lost_station_that_is_not_required_is_shown_and_stops_nothing() -> None:
    rig = Rig()
    async with robot(rig, section(gate=False)):
        async with station(rig, "gate") as gate:
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            gate.bus.die()
            await rig.pass_time(1.0)
        assert rig.output() == (0.5, 0.0)
        (shown,) = rig.newest_status.estop_stations
        assert (shown.words(), shown.is_missed) == ("lost", True)


async def test_a_closed_terminal_ends_the_station_without_a_goodbye() -> None:
    rig = Rig()
    async with robot(rig):
        async with station(rig) as person:
            await rig.pass_time(0.5)
            person.ended = True
            person.wake.set()
            await rig.pass_time(0.5)
        assert states(rig.newest_status) == {"door": EstopStationStatus.LOST}


async def test_one_lost_station_of_two_stops_the_robot_and_the_other_shows_it() -> None:
    rig = Rig()
    async with robot(rig, section(door=True, hall=True)), station(rig, "hall") as hall:
        async with station(rig) as door:
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            died_s = rig.loop.time()
            door.bus.die()
            assert await stop_time_s(rig, died_s) < 0.004
        assert hall.word is Word.STOPPED
        assert not (await reset(rig))[0]


async def test_a_second_program_of_the_same_name_is_not_heard_and_its_press_stops() -> None:
    rig = Rig()
    async with robot(rig), station(rig) as first, station(rig, node="second") as second:
        await rig.pass_time(0.5)
        assert {first.word, second.word} == {Word.HEARD, Word.NOT_HEARD}
        assert first.looks[-1].has_rival
        assert second.looks[-1].has_rival
        await rig.drive(0.5)
        (second if first.word is Word.HEARD else first).type(" ")
        await rig.pass_time(0.2)
        assert ESTOP in rig.newest_status.causes


async def test_a_supervisor_that_is_killed_during_the_latch_starts_latched_until_the_station_is_back_and_reset() -> (
    None
):
    rig, record = Rig(), MemoryRecord(problem="")
    async with robot(rig, record=record) as bus:
        async with station(rig) as person:
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            person.bus.die()
            await rig.pass_time(0.1)
        assert record.latched
        bus.die()
    async with robot(rig, record=record):
        await rig.pass_time(0.5)
        assert rig.newest_status.causes[:2] == [ESTOP, LOST]
        assert not (await reset(rig))[0]
        async with station(rig, node="another run"):
            await rig.pass_time(0.5)
            assert rig.newest_status.causes == [ESTOP]
            assert (await reset(rig))[0]
            assert not record.latched
            await rig.drive(0.5)


async def test_a_restart_of_the_supervisor_without_a_latch_needs_no_reset() -> None:
    rig, record = Rig(), MemoryRecord(problem="")
    async with station(rig) as person:
        async with robot(rig, record=record) as bus:
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            bus.die()
        await rig.pass_time(0.5)
        assert person.word is Word.NOT_HEARD
        async with robot(rig, record=record):
            rig.velocity = (0.0, 0.0)
            await rig.pass_time(0.5)
            assert person.word is Word.HEARD
            await rig.drive(0.5)


async def test_an_undecodable_presence_proves_nothing() -> None:
    rig = Rig()
    async with robot(rig):
        stranger = rig.network.open_joined("stranger")
        for _ in range(20):
            stranger.send(f"{topics.estop_presence('door').key}", b"\x00\x01\x00\x00", None)
            await rig.pass_time(0.05)
        assert states(rig.newest_status) == {"door": EstopStationStatus.UNHEARD}


async def test_without_stations_the_supervisor_sends_no_challenge() -> None:
    rig, sent = Rig(), list[str]()
    rig.network.tap = lambda _node, key, message, _stamp: (sent.append(key), encode(message))
    async with rig.supervisor():
        await rig.pass_time(1.0)
    assert not [key for key in sent if key.startswith("estop_station")]


class Shelf:
    """Keeps the black boxes instead of writing them."""

    def __init__(self) -> None:
        self.orders: list[Order] = []

    def submit(self, order: Order) -> None:
        self.orders.append(order)

    def close(self) -> None:
        """Nothing waits."""


async def test_a_recording_with_stations_replays_identically(tmp_path: Path) -> None:
    rig, shelf = Rig(), Shelf()
    config = section(door=True, gate=False)
    box = BlackBox(config.law(), shelf, window_s=60.0)
    async with (
        rig.supervisor(config, box),
        rig.lidar(),
        rig.source(),
        station(rig, "gate") as gate,
        station(rig) as door,
    ):
        await rig.pass_time(0.5)
        await rig.drive(0.5)
        door.bus.die()
        await rig.pass_time(0.5)
        gate.type(" ")
        await rig.pass_time(3.0)
    (order,) = shelf.orders
    path = write(order, tmp_path, max_files=5, max_bytes=1 << 30)
    assert json.dumps(order.header["stops"]).count(LOST) == 1
    found = replay(read(path))
    assert found.difference is None
    assert found.steps > 150
