"""The robot on the page of an e-stop station, in a real browser: what it shows is what the robot measures."""

import asyncio
import json
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection

from tests.system.browser import Browser, Tab, browser, needs_chromium
from tests.system.harness import DRIVE_TRIES, PATIENCE_S, Robot, patiently
from tests.system.pages import Code, Server, closing_code, served
from tests.system.test_estop_stations import ESTOP, config_with, drive, heard
from tests.unit.lifeline.test_own_passport import passport_of
from tests.unit.passport.test_reading import bundle
from wire import topics
from wire.bundle import AUTHORITY

pytestmark = pytest.mark.timeout(180)

FACTS = "document.getElementById('facts').textContent"


@asynccontextmanager
async def watched(
    tmp_path: Path,
    *,
    teleop: bool = True,
    drives: bool = False,
    required: bool = True,
    options: Sequence[str] = (),
) -> AsyncGenerator[tuple[Robot, Server, Browser, Tab]]:
    """A robot in its warehouse, and a browser whose page shows it."""
    async with (
        served(
            tmp_path,
            topics.SUPERVISOR,
            topics.SIM,
            teleop=teleop,
            drives=drives,
            required=required,
            options=options,
        ) as (subject, server),
        browser(tmp_path / "profile") as chromium,
    ):
        tab = await chromium.open(await server.new_address())
        await tab.waits_for("document.body?.dataset.picture === 'true'")
        yield subject, server, chromium, tab


@needs_chromium
@pytest.mark.timed  # Chromium uses the whole machine
async def test_a_page_shows_the_robot_while_it_drives_and_a_touch_of_the_picture_stops_it(
    tmp_path: Path,
) -> None:
    async with watched(tmp_path) as (subject, _, _, tab):
        await heard(subject, "phone")

        async def attempt() -> None:
            """On a busy machine, the page may lose its lease, and the robot stops."""
            await drive(subject, "phone")
            await tab.waits_for(f"{FACTS}.startsWith('DRIVING · driven by teleop')", PATIENCE_S / DRIVE_TRIES)
            await tab.waits_for(f"/if the link dies now: 0\\.[1-9]/.test({FACTS})", PATIENCE_S / DRIVE_TRIES)

        await patiently(attempt)
        assert await tab.evaluate(
            "new Set(document.getElementById('map').getContext('2d').getImageData(0, 0, 300, 300).data).size > 20"
        )
        await tab.click(*await tab.middle_of("#map"))
        await subject.until(lambda: ESTOP in subject.status.causes, "its press")
        await tab.waits_for(f"/last stop 0\\.\\d+ m, ghost 0\\.[1-9]/.test({FACTS})")
        await tab.waits_for(f"{FACTS}.includes('the emergency stop is latched')")


@needs_chromium
@pytest.mark.timed  # Chromium uses the whole machine
async def test_a_picture_that_gets_old_is_hidden(tmp_path: Path) -> None:
    async with watched(tmp_path) as (_, server, _, tab):
        server.process.kill()
        await tab.waits_for("document.body.dataset.picture === 'false'")
        await tab.shows("NOT HEARD", "No connection to the station's program: check that it runs.")


@needs_chromium
@pytest.mark.timed  # Chromium uses the whole machine
async def test_a_page_shows_the_sentence_of_the_passport_of_its_robot(tmp_path: Path) -> None:
    keys = bundle(tmp_path / "keys")
    passport = passport_of(config_with(tmp_path, phone=True), keys)
    options = ("--passport", str(passport), "--authority", str(keys / AUTHORITY))
    async with watched(tmp_path, teleop=False, options=options) as (_, _, _, tab):
        await tab.waits_for(
            "document.getElementById('passport').innerText.startsWith('After the one fault tested')"
        )


# --- without a browser


async def answers(socket: ClientConnection, *kinds: str) -> dict[str, Any]:
    """Wait for messages of these kinds in this order, and return the last one."""
    message = dict[str, Any]()
    for kind in kinds:
        message = json.loads(await asyncio.wait_for(socket.recv(), PATIENCE_S))
        assert message["kind"] == kind
    return message


@pytest.mark.smoke
async def test_the_next_picture_comes_when_the_page_has_drawn_this_one_and_shows_the_walls(
    tmp_path: Path,
) -> None:
    async with (
        served(tmp_path, topics.SUPERVISOR, topics.SIM) as (subject, server),
        server.heard_page(subject) as page,
        server.socket(path="picture") as socket,
    ):
        await socket.send(json.dumps({"token": page.token}))
        picture = await answers(socket, "robot", "picture")
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(socket.recv(), 0.5)
        while not picture["scans"]:
            await socket.send(json.dumps({"drawn": picture["number"]}))
            picture = await answers(socket, "picture")
        assert len(picture["scans"][0]["points"]) > 100
        assert picture["age_s"] < PATIENCE_S
        await socket.send(json.dumps({"drawn": picture["number"] + 1}))
        assert await closing_code(socket) == Code.BAD_MESSAGE


async def test_only_a_page_that_is_paired_and_connected_sees_the_robot(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server):
        async with server.heard_page(subject) as page:
            for hello in ({"token": "guessed"}, {"code": page.token}):
                async with server.socket(path="picture") as socket:
                    await socket.send(json.dumps(hello))
                    assert await closing_code(socket) == Code.NOT_PAIRED
            socket = await server.socket(path="picture")
            await socket.send(json.dumps({"token": page.token}))
            picture = await answers(socket, "robot", "picture")
        # The page has left, and its session is still valid for the lease.
        await socket.send(json.dumps({"drawn": picture["number"]}))
        await closing_code(socket)
        async with server.socket(path="picture") as late:
            await late.send(json.dumps({"token": page.token}))
            assert await closing_code(late) == Code.NOT_PAIRED
