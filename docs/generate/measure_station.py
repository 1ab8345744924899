"""Measures the page of a station, which drives the simulated robot: `python -m docs.generate.measure_station`, or `make bench-station`.

It needs Debian's package chromium. Each measurement is stored when it ends: the same command continues an interrupted one, and measures
nothing again that is stored from this commit, unless `--only` names it.
"""

import argparse
import asyncio
import io
import json
import math
import tempfile
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager, redirect_stdout, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

import numpy as np
import pytest
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from bench.rig.options import CommandLine, count, failing_in_a_sentence, positive, progress
from bench.rig.sheet import Times
from bench.rig.stored import this_run
from deploy.stack.provenance import commit
from docs.generate import station
from docs.generate.scripted_person import NOTHING, Keys, Look, Person
from docs.generate.station import Case, Drive, Gaps, Measured, Phase
from tests.system.browser import CHROMIUM, Browser, Tab, browser
from tests.system.harness import PATIENCE_S, Robot, is_zero, patiently, robot
from tests.system.pages import Server, served
from tests.system.test_estop_stations import config_with, heard
from tests.system.test_station_drive import key, may_drive, moves_after, takes
from wire import topics
from wire.messages import planar_twist, yaw_of
from wire.reasons import StopReason

RUNS, GAPS_S, DRIVE_S = 300, 60.0, 3600.0
REFERENCE, REFERENCE_M_S = "joy", 0.1
"""A source of the default configuration, which may move the robot while the page requests zero."""
ARMING_S, COMMAND_S = 0.3, 0.05
"""How long the reference sends zero before it counts, longer than the supervisor's command timeout; period of its commands."""
HOLD_S = (0.05, 0.1)
"""How long a key moves the robot before an event: at random, so that the event is at any time between two decisions."""
MOST_REPEATS = 30
"""Of one event."""
SLOW = (AssertionError, TimeoutError, ConnectionClosed, pytest.fail.Exception)
"""What the parts of the tests raise if the machine delays something for too long."""
STATIONS, ROUNDS, FRAME_S = ("phone", "door", "gate"), 2, 1.0 / 60.0
LOOK_S = 0.05
"""Period of the person's looks."""
NEWS = """(() => {
  const text = document.getElementById("drive-reason").textContent || document.getElementById("drive-ended").textContent;
  const news = text !== window.known ? text : "";
  window.known = text;
  return news;
})()"""
"""What the page says since the last look: a refused command, or the end of driving."""


class PlainSocket:
    """A websocket of the page that has no other use: what ends the page shows here first, without our programs."""

    def __init__(self) -> None:
        self._signs_s = list[float]()
        self.connect = ""
        """JavaScript by which a page connects, and then reports when it is hidden; empty before `served`."""

    @asynccontextmanager
    async def served(self) -> AsyncGenerator[None]:
        """Listen on loopback while the context is open."""

        async def take(socket: ServerConnection) -> None:
            with suppress(ConnectionClosed):
                async for _ in socket:
                    self._signs_s.append(time.monotonic())
            self._signs_s.append(time.monotonic())

        async with serve(take, "127.0.0.1", 0) as server:
            port = server.sockets[0].getsockname()[1]
            self.connect = f"""new Promise((resolve) => {{
              window.plain = new WebSocket("ws://127.0.0.1:{port}");
              addEventListener("pagehide", () => window.plain.send("hidden"));
              window.plain.onopen = () => resolve(true);
            }})"""
            yield

    def after_s(self, time_s: float) -> float | None:
        """Return the time from then to the first sign [s]; None if there was none yet."""
        return next((at_s - time_s for at_s in self._signs_s if at_s >= time_s), None)


class Rig:
    """A robot in its warehouse, and the page that drives it. What an event ends is replaced before the next run."""

    def __init__(self, subject: Robot, server: Server, plain: PlainSocket) -> None:
        assert subject.bus is not None
        self.robot, self._server, self.plain = subject, server, plain
        self.statuses = subject.bus.subscribe(topics.STATUS, depth=500)
        self._reference = subject.bus.publisher(topics.source_cmd_vel(REFERENCE))
        self.ending = AsyncExitStack()
        self.chromium: Browser
        self.tab: Tab
        self._code = "KeyW"

    async def fresh_browser(self) -> None:
        async def attempt() -> None:
            await self.ending.aclose()
            folder = tempfile.TemporaryDirectory(prefix="lifeline-", ignore_cleanup_errors=True)
            profile = Path(self.ending.enter_context(folder)) / "profile"
            try:
                self.chromium = await self.ending.enter_async_context(browser(profile))
                await self.fresh_page()
            except SLOW as error:
                raise AssertionError(_first(error)) from error

        await patiently(attempt)

    async def fresh_page(self) -> None:
        """Open another page, and let it drive."""
        self.tab = await self.chromium.open(await self._server.new_address(), any_server=True)
        await self.tab.waits_for("document.body?.dataset.picture === 'true'")
        await takes(self.tab)
        await self.tab.waits_for("document.body.dataset.drives === 'true'")
        await self.tab.evaluate(self.plain.connect)

    async def ready(self) -> None:
        """Press Drive if the page does not drive, and reset until the robot is ready; a busy machine may stop it again."""

        async def attempt() -> None:
            if await self.tab.evaluate("document.body.dataset.driving") != "true":
                await takes(self.tab, "")
            await may_drive(self.robot, self.tab)

        await patiently(attempt)

    async def reference_s(self) -> tuple[float, float]:
        """Return the times from a put of motion and from a put of zero to cmd_vel [s]; the page then owns the robot again."""
        for _ in range(math.ceil(ARMING_S / COMMAND_S)):
            self._reference.put(planar_twist(0.0, 0.0))
            await asyncio.sleep(COMMAND_S)
        begun_s = time.monotonic()
        self._reference.put(planar_twist(REFERENCE_M_S, 0.0))
        to_motion_s = await moves_after(self.robot, begun_s)
        ended_s = time.monotonic()
        self._reference.put(planar_twist(0.0, 0.0))
        to_zero_s = await self.robot.zero_after(ended_s)
        await self.robot.until(lambda: self.robot.status.owner == topics.TELEOP, "the page owns the robot")
        return to_motion_s, to_zero_s

    async def press_s(self) -> float:
        """Press a key, for forward and back in turn; return the time to motion on cmd_vel [s]."""
        self._code = "KeyS" if self._code == "KeyW" else "KeyW"
        pressed_s = time.monotonic()
        await key(self.tab, self._code, down=True)
        return await moves_after(self.robot, pressed_s)

    async def was_late(self) -> bool:
        """Return whether the supervisor was late since the run began."""
        await asyncio.sleep(LOOK_S)  # the status of the newest stop arrives
        found = [arrival.message for arrival in self.statuses.take()]
        return any(one is not None and StopReason.OVERRUN in one.reasons for one in found)

    # --- the events, and what permits the next run

    async def lift(self) -> None:
        await key(self.tab, self._code, down=False)

    async def blur(self) -> None:
        await self.tab.evaluate("dispatchEvent(new Event('blur'))")

    async def close(self) -> None:
        await self.tab.close()

    async def kill(self) -> None:
        # In a thread, because it waits for the processes, and the plain socket is read meanwhile.
        await asyncio.to_thread(self.chromium.kill)

    async def freeze(self) -> None:
        await self.tab.begin("while (true) {}")

    async def touch(self) -> None:
        await self.tab.mouse("mousePressed", *await self.tab.middle_of("#map"))

    async def release(self) -> None:
        """Lift the key and the touch, and hold the release until the page is released."""
        await self.lift()
        await self.tab.mouse("mouseReleased", 10, 10)
        await self.tab.waits_for("document.getElementById('release').offsetWidth > 0")
        await self.tab.mouse("mousePressed", *await self.tab.middle_of("#release"))
        await self.tab.waits_for("document.body.dataset.pressed === 'false'")
        await self.tab.mouse("mouseReleased", 10, 10)


Act = Callable[[Rig], Awaitable[None]]
Origin = Callable[[], dict[str, str]]
"""Returns command, date, machine and commit of a measurement that has just ended."""
KEYS, GAPS, DRIVE = "keys", "gaps", "drive"
ACTS: dict[str, tuple[Act, Act]] = {
    KEYS: (Rig.lift, Rig.lift),
    "blur": (Rig.blur, Rig.lift),
    "touch": (Rig.touch, Rig.release),
    "closed": (Rig.close, Rig.fresh_page),
    "killed": (Rig.kill, Rig.fresh_browser),
    "frozen": (Rig.freeze, Rig.fresh_browser),
}
ENDS = frozenset({Rig.close, Rig.kill})
"""What ends the connections of the page."""
PARTS = (*ACTS, GAPS, DRIVE)


@asynccontextmanager
async def rig(folder: Path) -> AsyncGenerator[Rig]:
    plain = PlainSocket()
    async with (
        plain.served(),
        served(folder, topics.SUPERVISOR, topics.SIM, drives=True) as (subject, server),
    ):
        made = Rig(subject, server, plain)
        try:
            await made.fresh_browser()
            yield made
        finally:
            await made.ending.aclose()


class Run(NamedTuple):
    """The times of one run [s]."""

    to_motion_s: float
    """From the key."""
    to_zero_s: float
    """From the event."""
    reference_s: tuple[float, float]
    """Of the reference: to motion, and to zero."""
    browser_s: float | None
    """From the event to its first sign at the plain socket; None if the event does not end the connection."""


async def run(one: Rig, act: Act, hold_s: float) -> Run:
    """Measure the reference, then drive, and do what ends the motion.

    Raises:
        AssertionError: the robot did not drive before the event.
        RuntimeError: it did not stop.
    """
    subject = one.robot
    await one.ready()
    subject.outputs.clear()
    subject.travel.clear()
    one.statuses.take()
    reference_s = await one.reference_s()
    await subject.ready(PATIENCE_S / 4)
    down_s = await one.press_s()
    await asyncio.sleep(hold_s)
    subject.look()
    assert not is_zero(subject.outputs[-1][1]), "the robot stopped before the event"
    began_s = time.monotonic()
    await act(one)
    try:
        to_zero_s = await subject.zero_after(began_s)
    except AssertionError as error:
        raise RuntimeError(f"the robot did not stop: {_first(error)}") from error
    if act in ENDS:
        await subject.until(lambda: one.plain.after_s(began_s) is not None, "the end of the plain websocket")
    return Run(down_s, to_zero_s, reference_s, one.plain.after_s(began_s))


def _first(error: BaseException) -> str:
    return str(error).partition(";")[0].partition("\n")[0] or type(error).__name__


async def events(folder: Path, name: str, wanted: int, origin: Origin) -> list[Measured]:
    """Repeat an event; return its case, or the two of the keys.

    Raises:
        RuntimeError: the robot did not stop, or too many runs were repeated.
    """
    act, then = ACTS[name]
    runs, repeated, chance = list[Run](), dict[str, int](), Random(0)  # noqa: S311 - a delay, not a secret
    async with rig(folder) as one:
        while len(runs) < wanted:
            made, why = None, ""
            try:
                made = await run(one, act, chance.uniform(*HOLD_S))
                why = str(StopReason.OVERRUN) if await one.was_late() else ""
                await then(one)
            except SLOW as error:  # also after a complete run, which counts
                why = _first(error) if made is None else why
                await one.fresh_browser()
            if made is not None and not why:
                runs.append(made)
                if len(runs) % 10 == 0:
                    progress(f"{name}: {len(runs)} of {wanted}")
                continue
            station.count(repeated, why)
            progress(f"{name}: a run is repeated: {why}")
            if sum(repeated.values()) > MOST_REPEATS:
                raise RuntimeError(f"{name}: more than {MOST_REPEATS} runs had to be repeated: {repeated}")
    ended = origin()

    def case(named: str, times_s: Iterable[float], which: int) -> Case:
        times_ms = tuple(1e3 * time_s for time_s in times_s)
        reference_ms = tuple(1e3 * one.reference_s[which] for one in runs)
        browser_ms = tuple(1e3 * one.browser_s for one in runs if one.browser_s is not None)
        return Case(named, times_ms, reference_ms, repeated, ended, browser_ms)

    to_zero_s = [one.to_zero_s for one in runs]
    if name != KEYS:
        return [case(name, to_zero_s, 1)]
    return [case("key-down", [one.to_motion_s for one in runs], 0), case("key-up", to_zero_s, 1)]


# --- gaps of cmd_vel


class Watcher:
    """A page without a browser: it reports each picture as drawn after the time of one frame."""

    def __init__(self) -> None:
        self.pictures = 0

    async def draw(self, socket: ClientConnection) -> None:
        with suppress(ConnectionClosed):
            async for text in socket:
                message = json.loads(text)
                if message["kind"] == "picture":
                    await asyncio.sleep(FRAME_S)
                    await socket.send(json.dumps({"drawn": message["number"]}))
                    self.pictures += 1

    @asynccontextmanager
    async def watches(self, subject: Robot, config: Path, name: str) -> AsyncGenerator[None]:
        """Hold the lease of a station while the context is open."""
        server = Server(subject.endpoint, config, name=name)
        try:
            await server.address()
            async with server.page() as page, server.socket(path="picture") as socket:
                await heard(subject, name)
                await socket.send(json.dumps({"token": page.token}))
                drawing = asyncio.ensure_future(self.draw(socket))
                yield
            await drawing
        finally:
            server.close()


async def gaps(folder: Path, seconds: float, origin: Origin) -> list[Measured]:
    """Measure the gaps of cmd_vel without stations and beside them, in turn."""
    config, phases = config_with(folder, **dict.fromkeys(STATIONS, False)), list[Phase]()
    async with robot(folder, topics.SUPERVISOR, topics.SIM, teleop=False, config=config) as subject:
        await subject.until(lambda: bool(subject.travel), "odometry")
        for names in ((), STATIONS) * ROUNDS:
            async with AsyncExitStack() as ending:
                watcher = Watcher()
                for name in names:
                    await ending.enter_async_context(watcher.watches(subject, config, name))
                before, began_s = watcher.pictures, time.monotonic()
                end_s = began_s + seconds
                await subject.until(lambda end_s=end_s: time.monotonic() >= end_s, "the end", math.inf)
                arrivals_s = [at_s for at_s, _ in subject.outputs if began_s <= at_s < end_s]
                found = Times.of(1e3 * np.diff(arrivals_s))
                phases.append(Phase(len(names), watcher.pictures - before, found))
            progress(f"{GAPS}: {len(phases)} of {2 * ROUNDS} phases")
    return [Gaps(GAPS, seconds, tuple(phases), origin())]


# --- driving


class Hands:
    """The keys that are held on a page."""

    def __init__(self, tab: Tab) -> None:
        self._tab, self._held, self.presses = tab, NOTHING, 0

    async def hold(self, keys: Keys) -> None:
        for code in sorted(self._held ^ keys):
            self.presses += code in keys
            await key(self._tab, code, down=code in keys)
        self._held = keys


async def drive(folder: Path, seconds: float, origin: Origin) -> list[Measured]:
    """Drive by keys, and count stops and refusals."""
    person, stops, refusals = Person(Random(0)), station.Stops(), dict[str, int]()  # noqa: S311 - manoeuvres
    driven_m, look, next_s = 0.0, None, 60.0
    async with rig(folder) as one:
        assert one.robot.bus is not None
        truth = one.robot.bus.subscribe(topics.TRUTH)  # what a person sees around the robot
        await one.ready()
        hands, began_s = Hands(one.tab), time.monotonic()
        one.statuses.take()
        await one.tab.evaluate(NEWS)
        while (now_s := time.monotonic()) < began_s + seconds:
            statuses = [arrival.message for arrival in one.statuses.take()]
            stopped = [status for status in statuses if status is not None and stops.hear(status)]
            news = await one.tab.evaluate(NEWS)
            if news:
                station.count(refusals, news)
            if stopped or news:
                progress(f"{DRIVE}: after {now_s - began_s:.0f} s: {news or stopped[0].why()}")
                await hands.hold(NOTHING)
                await one.ready()
                await one.tab.evaluate(NEWS)
                person.begin_anew(time.monotonic())
            place = truth.latest()
            if place is not None and place.message is not None:
                pose = place.message.pose.pose
                before, look = look, Look(now_s, pose.position.x, pose.position.y, yaw_of(pose.orientation))
                driven_m += 0.0 if before is None else math.dist(before[1:3], look[1:3])
            await hands.hold(NOTHING if look is None else person.keys(look))
            await asyncio.sleep(LOOK_S)
            if now_s - began_s > next_s:
                progress(f"{DRIVE}: {driven_m:.0f} m in {next_s:.0f} of {seconds:.0f} s")
                next_s += 60.0
    found = Drive(DRIVE, seconds, driven_m, hands.presses, stops.counts, refusals, origin())
    return [found]


# --- the command line


def _part(text: str) -> str:
    if text not in PARTS:
        raise argparse.ArgumentTypeError(f"must be one of {', '.join(PARTS)}, not {text!r}")
    return text


async def measure(part: str, wanted: float, origin: Origin) -> list[Measured]:
    """Measure one of `PARTS`."""
    with tempfile.TemporaryDirectory(prefix="lifeline-", ignore_cleanup_errors=True) as name:
        try:
            if part in ACTS:
                return await events(Path(name), part, int(wanted), origin)
            return await (gaps if part == GAPS else drive)(Path(name), wanted, origin)
        except SLOW as error:
            raise RuntimeError(f"{part}: {_first(error)}") from error


def main() -> None:
    line = CommandLine(
        "docs.generate.measure_station",
        "Measure the times from the page of a station to cmd_vel, the gaps of cmd_vel beside stations, and the stops of a scripted drive.",
        "exit code: 0, even if a target is missed; 1 if a process fails; 130 after Ctrl-C",
    )
    line.option("runs", count, RUNS, "runs of each event")
    line.option("gaps", positive, GAPS_S, "duration of each phase without or beside stations [s]")
    line.option("drive", positive, DRIVE_S, "duration of the drive [s]")
    line.option("only", _part, None, f"measure only these, also if stored: {', '.join(PARTS)}", many=True)
    line.file("json", f"store the results in FILE (default: docs/campaign/{station.STORED.name})")
    options = line.parse()
    command, now = line.repeat(options), commit()
    path: Path = options.json or station.STORED
    with failing_in_a_sentence(
        "measure_station", "what was complete is stored, and the same command continues"
    ):
        if CHROMIUM is None:
            raise RuntimeError("Chromium is missing: install Debian's package chromium")
        for part in options.only or PARTS:
            stored = station.read(path)
            wanted = {GAPS: options.gaps, DRIVE: options.drive}.get(part, options.runs)
            known = stored.get("key-up" if part == KEYS else part)
            if not options.only and station.is_stored(known, wanted, now):
                progress(f"{part}: is stored")
                continue
            with redirect_stdout(io.StringIO()):  # the screens that the parts of the tests print
                found = asyncio.run(measure(part, wanted, lambda: this_run(command) | {"commit": now}))
            station.write(path, stored | {one.name: one for one in found}, found[0].run)
    print(station.part(station.read(path)))


if __name__ == "__main__":
    main()
