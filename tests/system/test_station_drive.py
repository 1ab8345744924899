"""A page drives the robot, in a real browser: only while something is held, and only while the person sees the robot."""

import time
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from statistics import median

import pytest

from recordings.incidents.incident import black_boxes
from supervisor.blackbox.reader import BlackBoxReader
from tests.system.browser import Browser, Tab, browser, needs_chromium
from tests.system.harness import PATIENCE_S, Robot, patiently
from tests.system.pages import Server, served
from tests.system.test_estop_stations import ESTOP, LATE_S, heard, state
from tests.system.test_station_browser import PRESSES, closed, killed, release
from tests.system.test_station_commands import SLOW_M_S, stands
from tests.system.test_station_picture import watched
from wire import topics

pytestmark = [needs_chromium, pytest.mark.timeout(240), pytest.mark.timed]  # Chromium uses the whole machine


@asynccontextmanager
async def wheel(
    tmp_path: Path, *, required: bool = True
) -> AsyncGenerator[tuple[Robot, Server, Browser, Tab]]:
    """A robot in its warehouse, and a page at which Anna has pressed Drive."""
    async with watched(tmp_path, teleop=False, drives=True, required=required) as (
        subject,
        server,
        chromium,
        tab,
    ):
        await takes(tab)
        yield subject, server, chromium, tab


async def takes(tab: Tab, name: str = "Anna") -> None:
    """Write a name, and press Drive."""
    await tab.waits_for("!document.getElementById('drive-offer').hidden")
    await tab.click(*await tab.middle_of("#name"))
    for letter in name:
        await tab.do("Input.dispatchKeyEvent", type="keyDown", key=letter, text=letter)
        await tab.do("Input.dispatchKeyEvent", type="keyUp", key=letter)
    await tab.click(*await tab.middle_of("#drive-begin"))
    await tab.waits_for("document.body.dataset.driving === 'true'")


async def shows(tab: Tab, place: str, text: str) -> None:
    """Wait until an element shows a text."""
    await tab.waits_for(f"document.getElementById({place!r}).textContent.includes({text!r})")


async def key(tab: Tab, code: str, *, down: bool) -> None:
    kind = "rawKeyDown" if down else "keyUp"
    await tab.do("Input.dispatchKeyEvent", type=kind, code=code, key=code[-1].lower())


async def press_w(tab: Tab) -> None:
    """Release and press it: on a busy machine, the page may have forgotten that it was released."""
    await release_w(tab)
    await key(tab, "KeyW", down=True)


async def release_w(tab: Tab) -> None:
    await key(tab, "KeyW", down=False)


async def pull_stick(tab: Tab) -> None:
    """Pull the stick ahead with the mouse."""
    x, y = await tab.middle_of("#stick")
    await tab.mouse("mousePressed", x, y)
    await tab.mouse("mouseMoved", x, y - 60)


async def release_stick(tab: Tab) -> None:
    await tab.mouse("mouseReleased", 10, 10)


async def drives(
    subject: Robot,
    tab: Tab,
    hold: Callable[[Tab], Awaitable[None]] = press_w,
    let_go: Callable[[Tab], Awaitable[None]] = release_w,
) -> None:
    """Hold something until the robot drives; on a busy machine, which may stop it, let go, reset and try again."""

    async def attempt() -> None:
        await let_go(tab)
        await may_drive(subject, tab)
        await hold(tab)
        await subject.until(lambda: subject.status.permitted.linear.x > SLOW_M_S, "motion", PATIENCE_S / 4)

    await patiently(attempt)


async def may_drive(subject: Robot, tab: Tab) -> None:
    """Press Drive again if a busy machine has ended it, reset the e-stop if it is latched, and wait until the robot stands ready."""
    await heard(subject, "phone")
    if await tab.evaluate("document.body.dataset.driving") != "true":
        await takes(tab, "")
    if {"ESTOP", "ESTOP_STATION_LOST"} & set(subject.status.reasons):
        await tab.click(*await tab.middle_of("#reset"))
    await subject.ready(PATIENCE_S / 4)


async def test_a_held_key_drives_and_its_release_stops(tmp_path: Path) -> None:
    async with wheel(tmp_path) as (subject, _, _, tab):
        await drives(subject, tab)
        assert ESTOP not in subject.status.reasons
        await release_w(tab)
        await stands(subject)
        await subject.ready()


async def test_the_stick_drives_while_the_mouse_holds_it_and_a_touch_of_the_picture_is_the_estop(
    tmp_path: Path,
) -> None:
    async with wheel(tmp_path) as (subject, _, _, tab):
        await drives(subject, tab, pull_stick, release_stick)
        await release_stick(tab)
        await stands(subject)
        await drives(subject, tab, pull_stick, release_stick)
        await release_stick(tab)
        await tab.click(*await tab.middle_of("#map"))
        await subject.until(lambda: ESTOP in subject.status.causes, "its press")


async def test_of_two_controls_that_are_held_neither_drives_when_the_other_one_is_released(
    tmp_path: Path,
) -> None:
    async with wheel(tmp_path) as (subject, _, _, tab):
        await drives(subject, tab, pull_stick, release_stick)
        await press_w(tab)
        await stands(subject)
        await shows(tab, "drive-reason", "Two controls are held")
        await release_stick(tab)
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion by a release", 0.5)
        await drives(subject, tab)


async def test_a_driver_hands_over_to_the_person_who_asks_and_the_incident_names_both(tmp_path: Path) -> None:
    async with (
        wheel(tmp_path) as (subject, server, _, anna),
        browser(tmp_path / "second") as second,
    ):
        ben = await second.open(await server.new_address())
        await ben.waits_for("document.body?.dataset.picture === 'true'")
        await drives(subject, anna)
        await shows(ben, "drive-begin", "Anna drives. Ask to drive")
        await takes(ben, "Ben")
        await shows(ben, "drive-turn", "Wait for Anna, who loses control after")
        await shows(anna, "drive-turn", "Ben asks to drive:")
        assert subject.status.permitted.linear.x > 0.0, "a question stops nothing"
        assert ESTOP not in subject.status.reasons, "a name was typed"
        await press_w(ben)
        await anna.click(*await anna.middle_of("#hand-over"))
        await stands(subject)
        await shows(anna, "drive-ended", "You handed over to Ben. Press Drive to drive again.")
        await ben.waits_for("document.getElementById('drive-turn').textContent === ''")
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion by the hand-over", 1.0)
        await release_w(anna)
        await release_w(ben)
        await drives(subject, ben)
        await anna.click(*await anna.middle_of("#map"))
        await subject.until(lambda: ESTOP in subject.status.causes, "her press")
        await release_w(ben)

        def people() -> str:
            boxes = black_boxes(tmp_path / "blackbox")
            return str([act.text for act in BlackBoxReader(boxes[-1]).acts]) if boxes else ""

        await subject.until(lambda: "Anna pressed the e-stop" in people(), "the incident", PATIENCE_S)
        for act in (
            "Anna began to drive",
            "Ben asked to drive",
            "Anna handed over to Ben",
            "Ben began to drive",
        ):
            assert act in people()
        assert "pressed by phone" in people()


async def test_the_controls_stay_on_a_phones_screen_with_the_longest_refusal(tmp_path: Path) -> None:
    async with wheel(tmp_path) as (_, _, _, tab):
        for width, height in ((390, 760), (760, 360)):
            await tab.do(
                "Emulation.setDeviceMetricsOverride",
                width=width,
                height=height,
                deviceScaleFactor=1,
                mobile=True,
            )
            await tab.waits_for(f"innerWidth === {width}")
            refusal = "Not reset: the supervisor was stopped meanwhile: reset again in a second"
            await tab.evaluate(f"document.getElementById('drive-reason').textContent = {refusal!r}")
            for place in ("#reset", "#drive-end", "#stick", "#enable", "#drive-reason"):
                assert await tab.evaluate(
                    f"(({{ top, bottom }}) => top >= 0 && bottom > top && bottom <= innerHeight)"
                    f"(document.querySelector({place!r}).getBoundingClientRect())"
                ), (place, width)


async def test_two_thumbs_drive_and_a_third_finger_stops(tmp_path: Path) -> None:
    async with wheel(tmp_path) as (subject, _, _, tab):
        await tab.do("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
        await tab.waits_for("document.getElementById('enable').offsetWidth > 0")

        async def hold(tab: Tab) -> None:
            enable, (x, y) = await tab.middle_of("#enable"), await tab.middle_of("#stick")
            await tab.touch("touchStart", enable)
            await tab.touch("touchStart", enable, (x, y))
            await tab.touch("touchMove", enable, (x, y - 40))

        async def let_go(tab: Tab) -> None:
            with suppress(AssertionError):  # nothing touches
                await tab.touch("touchEnd")

        await drives(subject, tab, hold, let_go)
        enable, (x, y) = await tab.middle_of("#enable"), await tab.middle_of("#stick")
        await tab.touch("touchStart", enable, (x, y - 40), await tab.middle_of("#speed"))
        await stands(subject)
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion again", 0.5)


async def test_a_finger_that_lifts_from_a_control_which_is_hidden_meanwhile_presses_nothing(
    tmp_path: Path,
) -> None:
    """The turn ends while a finger is on the screen; when the finger lifts, the e-stop is below it."""
    async with wheel(tmp_path) as (subject, _, _, tab):
        await tab.do("Emulation.setTouchEmulationEnabled", enabled=True)
        for place in ("#enable", "#stick", "#drive-end"):
            await tab.waits_for("document.getElementById('enable').offsetWidth > 0")
            await tab.touch("touchStart", await tab.middle_of(place))
            await tab.evaluate("document.getElementById('drive-end').click()")
            await tab.waits_for("document.getElementById('drive').hidden")
            await tab.touch("touchEnd")
            await subject.never(lambda: "pressed" in state(subject, "phone"), f"pressed below {place}", 1.0)
            await takes(tab, "")


async def blurred(_: Browser, tab: Tab) -> None:
    await tab.evaluate("dispatchEvent(new Event('blur'))")


async def hidden(chromium: Browser, _: Tab) -> None:
    await chromium.open("about:blank")


async def hangs(_: Browser, tab: Tab) -> None:
    await tab.begin("while (true) {}")


async def stopped(chromium: Browser, _: Tab) -> None:
    chromium.stop_part("--type=renderer")


@pytest.mark.parametrize("lose", [blurred, hidden, closed, killed, hangs, stopped])
async def test_a_robot_that_drives_stops_when_the_page_loses_its_driver(
    tmp_path: Path, lose: Callable[[Browser, Tab], Awaitable[None]]
) -> None:
    async with wheel(tmp_path) as (subject, _, chromium, tab):
        await drives(subject, tab)
        await lose(chromium, tab)
        await stands(subject)
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion again", 1.0)


async def test_a_key_is_held_no_more_when_the_process_of_the_browser_hangs_that_carries_it(
    tmp_path: Path,
) -> None:
    """Also if the robot does not depend on the lease of this page, as after a hand-over."""
    async with wheel(tmp_path, required=False) as (subject, _, chromium, tab):
        await drives(subject, tab)
        chromium.stop_part("")
        await stands(subject)
        assert not {"OBSTACLE", "COMMAND_TIMEOUT"} & set(subject.status.reasons), "something else stopped it"
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion again", 1.0)


async def test_the_press_of_a_driver_without_the_lease_is_released_at_the_same_page(tmp_path: Path) -> None:
    """Another page of the same server holds the lease, without a browser: on a busy machine, a browser could lose it to the driver's page."""
    async with (
        served(tmp_path, topics.SUPERVISOR, topics.SIM, drives=True) as (subject, server),
        server.heard_page(subject),
        browser(tmp_path / "profile") as chromium,
    ):
        ben = await chromium.open(await server.new_address())
        await ben.waits_for("document.body?.dataset.picture === 'true'")
        await takes(ben, "Ben")
        await drives(subject, ben)
        await release_w(ben)
        await ben.click(*await ben.middle_of("#map"))
        await subject.until(lambda: ESTOP in subject.status.causes, "his press")
        await ben.shows("NOT HEARD", "Pressed, and the robot is stopped.")
        await ben.waits_for("!document.getElementById('release').hidden")
        await release(subject, ben, "NOT HEARD")
        await drives(subject, ben)


async def test_a_killed_server_stops_the_robot(tmp_path: Path) -> None:
    async with wheel(tmp_path) as (subject, server, _, tab):
        await drives(subject, tab)
        server.process.kill()
        await stands(subject)
        await subject.never(lambda: subject.status.permitted.linear.x > 0.0, "motion again", 1.0)


@pytest.mark.timeout(240 + 2 * PRESSES)
async def test_from_a_key_to_cmd_vel(tmp_path: Path) -> None:
    """Forward and back in turn, so that the robot stays where it is."""
    async with wheel(tmp_path) as (subject, _, _, tab):
        await drives(subject, tab)
        await release_w(tab)
        await stands(subject)
        down_s, up_s = list[float](), list[float]()
        for number in range(PRESSES):
            code = "KeyS" if number % 2 == 0 else "KeyW"

            async def press(code: str = code) -> None:
                await may_drive(subject, tab)
                pressed_s = time.monotonic()
                await key(tab, code, down=True)
                try:
                    moves_s = await moves_after(subject, pressed_s)
                finally:
                    lifted_s = time.monotonic()
                    await key(tab, code, down=False)
                down_s.append(moves_s)
                up_s.append(await subject.zero_after(lifted_s))

            await patiently(press)
        assert median(down_s) < LATE_S
        assert median(up_s) < LATE_S


async def moves_after(subject: Robot, time_s: float) -> float:
    """Return the time from then to the first motion on cmd_vel [s]."""

    def arrivals_s() -> list[float]:
        return [at for at, twist in subject.outputs if at >= time_s and twist.linear.x != 0.0]

    await subject.until(lambda: bool(arrivals_s()), "motion on cmd_vel", PATIENCE_S / 4)
    return arrivals_s()[0] - time_s
