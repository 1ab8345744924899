"""The page of an e-stop station in a real browser: touch, keys, closing, hiding, freezing, and SIGKILL."""

import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import median

import pytest

from tests.system.browser import Browser, Tab, browser, needs_chromium
from tests.system.harness import PATIENCE_S, Robot, patiently
from tests.system.pages import Server, line_to, served
from tests.system.test_estop_stations import ESTOP, LATE_S, drive, heard, state
from tests.system.test_station import lost
from wire import topics

pytestmark = [needs_chromium, pytest.mark.timeout(180), pytest.mark.timed]  # Chromium uses the whole machine

PRESSES = 5
REFUSED = """new Promise((refused) => {
  document.addEventListener("securitypolicyviolation", (event) => refused(event.effectiveDirective));
  fetch("http://127.0.0.1:9/").catch(() => {});
})"""
"""Which part of the policy refuses a connection to another server."""


@asynccontextmanager
async def phone(tmp_path: Path) -> AsyncGenerator[tuple[Robot, Server, Browser, Tab]]:
    """A supervisor, and a browser whose page is heard as its required station."""
    async with served(tmp_path) as (subject, server), browser(tmp_path / "profile") as chromium:
        tab = await chromium.open(await server.new_address())
        await tab.is_heard()
        await heard(subject, "phone")
        yield subject, server, chromium, tab


async def release(subject: Robot, tab: Tab, word: str = "STOPPED") -> None:
    """Hold the release until the page is released; a busy machine may hide it for a moment, and then again."""

    async def attempt() -> None:
        await tab.shows(word)
        if await tab.evaluate("document.body.dataset.pressed") == "true":
            place = await tab.middle_of("#release")
            await tab.mouse("mousePressed", *place)
            try:
                await tab.waits_for("document.body.dataset.pressed === 'false'", PATIENCE_S / 4)
            finally:
                await tab.mouse("mouseReleased", *place)

    await patiently(attempt)
    await heard(subject, "phone")


async def test_a_touch_stops_and_holding_the_release_permits_the_reset(tmp_path: Path) -> None:
    async with phone(tmp_path) as (subject, _, _, tab):
        assert await tab.evaluate("location.href.includes('#')") is False
        await tab.click(200, 300)
        await subject.until(lambda: ESTOP in subject.status.causes, "its press")
        await tab.shows("STOPPED", "Stopped from here, confirmed after")
        await tab.click(*await tab.middle_of("#release"))  # a touch releases nothing
        await subject.never(lambda: state(subject, "phone") == "heard", "released by a touch", 0.3)
        await release(subject, tab)
        await tab.shows("STOPPED", "The robot is stopped: the emergency stop is latched")


async def test_the_finger_that_has_held_the_release_presses_nothing_when_it_lifts(tmp_path: Path) -> None:
    """The release is hidden below the finger, which then lifts from the e-stop."""
    async with phone(tmp_path) as (subject, _, _, tab):
        await tab.do("Emulation.setTouchEmulationEnabled", enabled=True)
        await tab.touch("touchStart", (200, 300))
        await tab.touch("touchEnd")
        await tab.shows("STOPPED", "Stopped from here")
        await tab.touch("touchStart", await tab.middle_of("#release"))
        await tab.waits_for("document.body.dataset.pressed === 'false'")
        await heard(subject, "phone")
        await tab.touch("touchEnd")
        await subject.never(lambda: "pressed" in state(subject, "phone"), "pressed again", 1.0)


async def test_a_second_touch_ends_the_release_that_another_finger_holds(tmp_path: Path) -> None:
    async with phone(tmp_path) as (subject, _, _, tab):
        await tab.click(200, 300)
        await tab.shows("STOPPED", "Stopped from here")
        await subject.until(lambda: "pressed" in state(subject, "phone"), "its press")
        await tab.mouse("mousePressed", *await tab.middle_of("#release"))
        await tab.evaluate("document.getElementById('stop').dispatchEvent(new Event('pointerdown'))")
        await subject.never(lambda: state(subject, "phone") == "heard", "released beside a touch", 1.5)


async def test_a_key_stops_and_a_key_without_a_meaning_of_its_own_does_not(tmp_path: Path) -> None:
    async with phone(tmp_path) as (subject, _, _, tab):
        for key in ("Shift", "F11", "Tab"):
            await tab.press_key(key)
        await subject.never(lambda: ESTOP in subject.status.causes, "stopped by a modifier", 0.3)
        await tab.press_key("x")
        await subject.until(lambda: ESTOP in subject.status.causes, "its press")


async def test_a_page_that_is_hidden_is_lost_and_connects_again_when_it_is_seen(tmp_path: Path) -> None:
    async with phone(tmp_path) as (subject, _, chromium, tab):
        other = await chromium.open("about:blank")
        await lost(subject)
        await tab.shows("NOT HEARD", "The page was hidden: it connects again.")
        await other.close()
        await tab.do("Page.bringToFront")
        await heard(subject, "phone")
        await tab.shows("STOPPED", "a required e-stop station")


async def closed(_: Browser, tab: Tab) -> None:
    await tab.close()


async def frozen(_: Browser, tab: Tab) -> None:
    await tab.do("Page.setWebLifecycleState", state="frozen")


async def left(_: Browser, tab: Tab) -> None:
    await tab.do("Page.navigate", url="about:blank")


async def killed(browser: Browser, _: Tab) -> None:
    browser.kill()


@pytest.mark.parametrize("end", [closed, frozen, left, killed])
async def test_a_page_that_ends_is_the_loss_of_the_station(
    tmp_path: Path, end: Callable[[Browser, Tab], Awaitable[None]]
) -> None:
    async with phone(tmp_path) as (subject, _, chromium, tab):
        await end(chromium, tab)
        await lost(subject)


@pytest.mark.parametrize("script", ["while (true) {}", "alert()"])
async def test_a_page_whose_script_hangs_is_lost_although_its_connection_is_open(
    tmp_path: Path, script: str
) -> None:
    async with phone(tmp_path) as (subject, _, _, tab):
        await tab.begin(script)
        await lost(subject)


PARTS = ["", "--type=gpu-process", "--type=renderer", "--utility-sub-type=network.mojom.NetworkService"]


@pytest.mark.parametrize("part", PARTS)
async def test_a_page_is_lost_while_any_process_hangs_that_draws_it_or_carries_its_touches(
    tmp_path: Path, part: str
) -> None:
    async with phone(tmp_path) as (subject, _, chromium, _):
        chromium.stop_part(part)
        await lost(subject)
        await subject.never(lambda: state(subject, "phone") == "heard", "heard while a part of it hangs", 1.0)


async def test_a_page_that_something_covers_on_a_touch_screen_is_lost_until_it_is_touched(
    tmp_path: Path,
) -> None:
    async with phone(tmp_path) as (subject, _, _, tab):
        await tab.evaluate("dispatchEvent(new Event('blur'))")
        await subject.never(lambda: state(subject, "phone") != "heard", "lost with a mouse", 0.3)
        await tab.do("Emulation.setTouchEmulationEnabled", enabled=True)
        await tab.evaluate("dispatchEvent(new Event('blur'))")
        await lost(subject)
        await subject.never(lambda: state(subject, "phone") == "heard", "heard without the focus", 1.0)
        await tab.shows("NOT HEARD", "Something else has the focus: touch the page.")
        await tab.click(200, 300)
        await tab.shows("STOPPED", "Stopped from here")


async def test_a_page_whose_connection_is_dead_makes_a_new_one(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server), line_to(int(server.port)) as line:
        rules = f"--host-resolver-rules=MAP 127.0.0.1:{server.port} 127.0.0.1:{line.port}"
        async with browser(tmp_path / "profile", rules) as chromium:
            tab = await chromium.open(await server.new_address())
            await tab.is_heard()
            await heard(subject, "phone")
            line.lose()
            await lost(subject)
            await heard(subject, "phone")


async def test_a_page_says_when_the_supervisor_is_gone_and_keeps_a_press(tmp_path: Path) -> None:
    async with phone(tmp_path) as (subject, server, _, tab):
        subject.kill(topics.SUPERVISOR)
        await tab.shows("NOT HEARD", "Waiting for the supervisor")
        await tab.click(200, 300)
        await tab.shows("NOT HEARD", "PRESSED, not confirmed. Waiting for the supervisor")
        subject.start(topics.SUPERVISOR, "--config", str(tmp_path / "robot.toml"))
        await tab.shows("STOPPED", "Stopped from here")
        server.process.kill()
        await tab.shows("NOT HEARD", "No connection to the station's program: check that it runs.")


async def test_a_page_without_a_code_or_with_a_used_one_says_so(tmp_path: Path) -> None:
    async with phone(tmp_path) as (_, server, chromium, _):
        used = await chromium.open((await server.address()).partition("#")[0])
        await used.shows("NOT HEARD", "Not paired: open the address with its code.")
        again = await chromium.open(await server.address())
        await again.shows("NOT HEARD", "Not paired: open the address with a new code")


async def test_the_page_loads_nothing_from_elsewhere_and_its_policy_refuses_nothing_of_its_own(
    tmp_path: Path,
) -> None:
    async with phone(tmp_path) as (_, server, _, tab):
        loaded = await tab.evaluate("performance.getEntriesByType('resource').map((one) => one.name)")
        assert {name.removeprefix(server.origin) for name in loaded} >= {
            "/lease.js",
            "/station.js",
            "/style.css",
        }
        assert all(name.startswith(server.origin) for name in loaded)
        assert await tab.evaluate("getComputedStyle(document.getElementById('stop')).position") == "fixed"
        assert await tab.evaluate(REFUSED) == "connect-src"


@pytest.mark.timeout(120 + 30 * PRESSES)
async def test_from_a_touch_to_zero_on_cmd_vel(tmp_path: Path) -> None:
    async with (
        served(tmp_path, topics.SUPERVISOR, topics.SIM, teleop=True) as (subject, server),
        browser(tmp_path / "profile") as chromium,
    ):
        tab = await chromium.open(await server.new_address())
        times_s: list[float] = []
        for _ in range(PRESSES):
            await drive(subject, "phone", keys="w", speed_m_s=0.1)
            touched_s = time.monotonic()
            await tab.mouse("mousePressed", 200, 300)
            times_s.append(await subject.zero_after(touched_s))
            await tab.mouse("mouseReleased", 200, 300)
            await tab.shows("STOPPED", "Stopped from here")
            await release(subject, tab)
        assert median(times_s) < LATE_S
