"""Pages of an e-stop station on a virtual network: the real relay and the real supervisor."""

import asyncio
import itertools
import math
from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest

from station.relay import MAX_PAGES, Relay
from teleop.station.state import Lease, Word, pressed, received, released, sent
from tests.component.rig import Rig
from tests.component.test_estop_stations import DOOR, ESTOP, LOST, reset, robot, section, states, stop_time_s
from wire.lease import LEASE_S
from wire.messages import EstopLease, EstopStationStatus

ANSWER_S = 0.005
"""How long a page takes to answer."""
challenges = itertools.count(1)
"""Of all pages: those of two never agree."""


class Phone:
    """A page that answers each challenge, until it hangs; its lease is that of the terminal station."""

    def __init__(self, rig: Rig, relay: Relay) -> None:
        self._rig, self._relay = rig, relay
        self.lease, self.hangs = Lease(), False
        self.view: Mapping[str, Any] = {}
        self.run = relay.enter(self)

    def show(self, kind: str, fields: Mapping[str, Any]) -> None:
        if kind == "view":
            self.view = fields
        elif not self.hangs:
            answer = EstopLease(int(fields["challenge"]), int(fields["response"]), stop=fields["stop"])
            self.lease = received(self.lease, answer)
            self._rig.loop.call_later(ANSWER_S, self.send)

    def send(self) -> bool:
        self.lease, message = sent(self.lease, next(challenges), self._rig.loop.time())
        return self._relay.hear(self.run, message)

    def press(self) -> None:
        if self.lease.is_pressed:
            self._relay.press(self.run)
        self.lease = pressed(self.lease, self._rig.loop.time())
        self.send()

    @property
    def word(self) -> Word:
        return self.lease.word(self._rig.loop.time())

    def leave(self) -> None:
        self.hangs = True
        self._relay.leave(self.run)


@asynccontextmanager
async def server(rig: Rig, *, joins: bool = True) -> AsyncGenerator[Relay]:
    relay, stop = Relay("door", "tcp/x:1"), asyncio.Event()
    if joins:
        relay.join(rig.network.open_joined("page server"))
    running = asyncio.create_task(relay.run(stop))
    try:
        yield relay
    finally:
        stop.set()
        await running


@asynccontextmanager
async def driving() -> AsyncGenerator[tuple[Rig, Relay, Phone]]:
    """A robot that drives at 0.5 m/s while its station's page is heard."""
    rig = Rig()
    async with robot(rig), server(rig) as relay:
        phone = Phone(rig, relay)
        await rig.pass_time(0.5)
        await rig.drive(0.5)
        yield rig, relay, phone


async def test_a_page_is_heard_and_the_robot_drives_while_it_answers() -> None:
    rig = Rig()
    async with robot(rig), server(rig) as relay:
        await rig.pass_time(1.0)
        assert LOST in rig.newest_status.causes
        phone = Phone(rig, relay)
        await rig.pass_time(0.5)
        assert phone.word is Word.HEARD
        assert phone.view["required"] is True
        await rig.drive(0.5)
        await rig.pass_time(20.0)
        assert (rig.output(), phone.word) == ((0.5, 0.0), Word.HEARD)


async def test_a_page_that_hangs_ends_the_lease_because_the_server_repeats_nothing() -> None:
    async with driving() as (rig, _, phone):
        hung_s = rig.loop.time()
        phone.hangs = True
        assert LEASE_S - 0.06 < await stop_time_s(rig, hung_s) < LEASE_S + 0.001
        assert rig.newest_status.causes == [LOST]
        phone.hangs = False
        await rig.pass_time(0.5)
        assert phone.word is not Word.NOT_HEARD
        assert rig.newest_status.causes == [LOST], "back, and not reset"
        assert (await reset(rig))[0]
        await rig.drive(0.5)


async def test_a_page_whose_connection_ends_stops_the_robot_at_once_and_a_new_one_is_another_run() -> None:
    async with driving() as (rig, relay, phone):
        left_s = rig.loop.time()
        phone.leave()
        assert await stop_time_s(rig, left_s) < 0.004
        assert states(rig.newest_status) == {"door": EstopStationStatus.LOST}
        assert not phone.send()
        again = Phone(rig, relay)
        assert again.run.presence is not None
        assert phone.run.presence is not None
        assert again.run.presence.epoch != phone.run.presence.epoch
        await rig.pass_time(0.5)
        assert again.word is Word.STOPPED
        phone.send()
        await rig.pass_time(0.5)
        assert states(rig.newest_status) == {"door": EstopStationStatus.HEARD}
        assert (await reset(rig))[0]
        await rig.drive(0.5)


async def test_a_server_that_dies_stops_the_robot_at_once() -> None:
    rig = Rig()
    async with robot(rig):
        bus = rig.network.open_joined("page server")
        async with server(rig, joins=False) as relay:
            relay.join(bus)
            Phone(rig, relay)
            await rig.pass_time(0.5)
            await rig.drive(0.5)
            died_s = rig.loop.time()
            bus.die()
            assert await stop_time_s(rig, died_s) < 0.004


async def test_a_press_stops_at_once_and_only_its_release_permits_the_reset() -> None:
    async with driving() as (rig, _, phone):
        pressed_s = rig.loop.time()
        phone.press()
        assert await stop_time_s(rig, pressed_s) < 0.004
        assert phone.lease.is_confirmed
        assert phone.word is Word.STOPPED
        assert await reset(rig) == (False, "the e-stop station door is pressed: release it there first")
        phone.lease = released(phone.lease)
        await rig.pass_time(0.5)
        assert (await reset(rig))[0]
        await rig.drive(0.5)
        phone.press()
        await rig.pass_time(0.5)
        assert ESTOP in rig.newest_status.causes, "a second press after a reset"


async def test_a_press_of_a_station_that_is_not_configured_stops_the_robot_too() -> None:
    rig = Rig()
    async with robot(rig, section()), server(rig) as relay:
        phone = Phone(rig, relay)
        await rig.drive(0.5)
        assert "has no station door" in phone.view["problem"]
        phone.press()
        await rig.pass_time(0.5)
        assert ESTOP in rig.newest_status.causes
        assert (phone.view["latched"], phone.word) == (True, Word.NOT_HEARD)
        assert (await reset(rig))[0]
        await rig.pass_time(1.0)
        assert ESTOP not in rig.newest_status.causes, "pressed once, stopped twice"


async def test_a_press_of_a_page_without_the_lease_lasts_until_it_is_released_there() -> None:
    """The person to whom another one hands over has no lease; a press by mistake must not end the driving."""
    rig = Rig()
    async with robot(rig), server(rig) as relay:
        first = Phone(rig, relay)
        await rig.pass_time(0.5)
        second = Phone(rig, relay)
        await rig.pass_time(0.5)
        for _ in range(2):
            await rig.drive(0.5)
            assert second.view["seen"] is False
            second.press()
            await rig.pass_time(0.5)
            assert second.lease.is_confirmed is False, "it has no lease"
            assert (first.view["seen"], second.view["seen"]) == (False, True)
            await reset(rig)
            await rig.pass_time(0.5)
            assert ESTOP in rig.newest_status.causes, "reset while it is pressed"
            second.lease = replace(second.lease, pressed_s=math.inf)
            await rig.pass_time(0.5)
            assert (await reset(rig))[0]


async def test_a_press_that_no_status_has_shown_is_not_seen() -> None:
    rig = Rig()
    async with robot(rig), server(rig) as relay:
        Phone(rig, relay)
        second = Phone(rig, relay)
        await rig.pass_time(0.5)
        rig.network.cut("page server", up=True, down=False)
        second.press()
        await rig.pass_time(0.25)
        assert second.view["seen"] is False


async def test_a_page_that_is_touched_again_after_a_reset_stops_the_robot_again() -> None:
    """The station is not configured, so nothing else than this touch stops the robot."""
    rig = Rig()
    async with robot(rig, section()), server(rig) as relay:
        phone = Phone(rig, relay)
        async with rig.every(0.1, phone.send):
            await rig.drive(0.5)
            phone.press()
            await rig.pass_time(0.5)
            assert (await reset(rig))[0]
            await rig.drive(0.5)
            phone.press()
            await rig.pass_time(0.5)
            assert ESTOP in rig.newest_status.causes


async def test_the_second_page_is_not_heard_but_its_press_counts_and_its_end_stops_nothing() -> None:
    rig = Rig()
    async with robot(rig), server(rig) as relay:
        first = Phone(rig, relay)
        await rig.pass_time(0.5)
        second = Phone(rig, relay)
        await rig.pass_time(1.0)
        assert (first.word, second.word) == (Word.HEARD, Word.NOT_HEARD)
        assert "Another page" in second.view["problem"]
        await rig.drive(0.5)
        second.press()
        await rig.pass_time(0.5)
        assert ESTOP in rig.newest_status.causes
        second.leave()
        await rig.pass_time(0.5)
        assert LOST not in rig.newest_status.causes
        assert first.word is Word.STOPPED
        first.leave()
        await rig.pass_time(0.5)
        assert LOST in rig.newest_status.causes


async def test_there_are_no_more_pages_than_permitted() -> None:
    rig = Rig()
    async with server(rig) as relay:
        phones = [Phone(rig, relay) for _ in range(MAX_PAGES)]
        assert relay.is_full
        phones[0].leave()
        phones[0].leave()
        assert not relay.is_full


async def test_before_the_supervisor_runs_a_page_waits_and_its_press_counts_later() -> None:
    rig = Rig()
    async with server(rig, joins=False) as relay:
        phone = Phone(rig, relay)
        await rig.pass_time(1.0)
        assert phone.view["problem"] == "Waiting for the supervisor at tcp/x:1: start it if it does not run."
        phone.press()
        relay.join(rig.network.open_joined("page server"))
        async with robot(rig, DOOR):
            await rig.pass_time(1.0)
            assert ESTOP in rig.newest_status.causes
            assert phone.lease.is_confirmed


@pytest.mark.parametrize("is_stop_lost", [False, True])
async def test_a_press_is_repeated_by_the_page_until_a_status_shows_it(is_stop_lost: bool) -> None:  # noqa: FBT001 - a parameter of the test
    async with driving() as (rig, _, phone):
        if is_stop_lost:
            rig.network.cut("page server", up=True, down=False)
        phone.press()
        rig.network.heal("page server")
        await rig.pass_time(1.0)
        assert ESTOP in rig.newest_status.causes
        assert phone.lease.is_confirmed


async def test_a_relay_that_is_asked_to_end_does_not_wait_for_its_next_message() -> None:
    rig, stop = Rig(), asyncio.Event()
    running = asyncio.create_task(Relay("door", "tcp/x:1").run(stop))
    await rig.pass_time(0.1)
    stop.set()
    await rig.pass_time(0.01)
    assert running.done()
