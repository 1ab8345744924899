"""`lifeline fleet`: list, watch and stop all robots that are seen through one endpoint, usually a router's.

A robot is seen by the token of its supervisor, and by its status. Nothing else is received from it, so that many robots need
little.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

from deploy.stack.console import note, print_json, say
from deploy.stack.errors import EXIT_NOT_RUNNING, DeployError
from deploy.stack.reach import NotRunningError, check_may_stop, check_refusal, run_command
from lifeline.watch.rows import Row, Watched, row_at
from lifeline.watch.watch import EXIT_PARTLY, show_lines, show_live, show_once, until, wants_lines
from teleop.guards import Supervisors
from wire import topics
from wire.bus import Overheard
from wire.host.config import NAME, BusSection, ConfigError, section
from wire.messages import Bool, SafetyStatus, UndecodableError, decode
from wire.reasons import StopReason
from wire.roles import ANY
from wire.stamp import parse_stamp
from wire.zenoh.bus import BusConfig, Fleet, open_fleet
from wire.zenoh.hub_proof import HubProof

CONNECT_LIMIT_S = 5.0
FIND_S = 0.5
"""How long robots may take to be seen: a round trip of the tokens, and a period of the status."""
ANSWER_LIMIT_S = 3.0
"""How long a robot may take to confirm an e-stop, or to send a status."""
PERIOD_S = 0.1
"""Period of the e-stops to a robot that has not confirmed, and of the updates."""
MAX_ROBOTS = 1000
MAX_RUNS = 16
"""How many runs of a robot's supervisor are kept."""


class Robots:
    """The robots that are seen, and those that are expected."""

    def __init__(self, fleet: Fleet, endpoint: str, expected: Sequence[str]) -> None:
        self._fleet, self._endpoint = fleet, endpoint
        self.by_name: dict[str, Remote] = {}
        for name in expected:
            self._seen(name)

    def look(self) -> None:
        """Take what has arrived."""
        for change in self._fleet.tokens.take():
            if change.alive:
                self._seen(change.node)
        for sample in self._fleet.statuses.take():
            robot = self._seen(sample.key.partition("/")[0])
            if robot is not None:
                robot.heard(sample)

    def _seen(self, name: str) -> "Remote | None":
        robot = self.by_name.get(name)
        if robot is None and len(self.by_name) < MAX_ROBOTS and NAME.fullmatch(name):
            robot = self.by_name[name] = Remote(name, self._endpoint)
        return robot

    def rows(self) -> list[Row]:
        """Return the present row of each robot, in the order of their names."""
        now_s = time.monotonic()
        return [self.by_name[name].row_at(now_s) for name in sorted(self.by_name)]

    @property
    def all_heard(self) -> bool:
        return all(one.robot.status is not None for one in self.by_name.values())


class Remote:
    """One robot behind the endpoint, or several that share its namespace by mistake, such as copies of one disk."""

    def __init__(self, name: str, endpoint: str) -> None:
        self.robot = Watched(name, endpoint, since_s=time.monotonic())
        self._new: list[tuple[Row, float]] = []
        self._supervisors = Supervisors()
        self._latched: dict[bytes, tuple[float, bool]] = {}
        """By run of a supervisor: arrival of its newest status [s], and whether the e-stop is latched in it."""

    def heard(self, sample: Overheard) -> None:
        try:
            status = decode(sample.payload, SafetyStatus)
        except UndecodableError:
            return
        self.robot.status, self.robot.status_s = status, sample.arrival_s
        stamp = parse_stamp(sample.attachment)
        run = b"" if stamp is None else stamp.gid
        self._supervisors.heard(run, sample.arrival_s)
        if run not in self._latched and len(self._latched) >= MAX_RUNS:
            self._latched.pop(next(iter(self._latched)))
        self._latched[run] = sample.arrival_s, StopReason.ESTOP in status.reasons
        self._new.append((self.row_at(sample.arrival_s), sample.arrival_s))

    def row_at(self, now_s: float) -> Row:
        """Return the row at `now_s`; if several supervisors have this name, the link says so."""
        row = row_at(self.robot, now_s)
        return row._replace(link="2 supervisors") if self._supervisors.are_several(now_s) else row

    def rows(self) -> Iterator[tuple[Row, float]]:
        """Yield the row and its time [s] for each status since the last call, then the present row."""
        yield from self._new
        self._new.clear()
        now_s = time.monotonic()
        yield self.row_at(now_s), now_s

    def is_latched_since(self, time_s: float) -> bool:
        """Return whether a status after this time says that the e-stop is latched, from each supervisor that was heard."""
        latched = self._latched.values()
        return bool(latched) and all(last_s > time_s and is_latched for last_s, is_latched in latched)


def fleet_config(endpoint: str, keys: Path | None, *, stops: bool) -> BusConfig:
    """Return how to connect.

    Args:
        endpoint: of a router, or of a robot.
        keys: the bundle, which must be for all robots.
        stops: whether it must also have a role that may stop.

    Raises:
        DeployError: the endpoint or the bundle is refused.
    """
    values = {"endpoint": endpoint} | ({} if keys is None else {"keys": str(keys)})
    try:
        config = section({"bus": values}, "bus", BusSection).to_bus_config()
    except ConfigError as error:
        raise DeployError(str(error)) from error
    config = BusConfig(config.endpoint, ANY, config.lease_s, config.keys)
    if stops:
        check_may_stop(config)
    return config


def _run(
    config: BusConfig,
    expected: Sequence[str],
    work: Callable[[asyncio.Event, Robots, Fleet], Awaitable[int]],
    *,
    stops: bool = False,
) -> NoReturn:
    """Connect, and run `work` in this process; if it stops robots, it hears nothing of another user's router or hub."""
    for name in expected:
        if not NAME.fullmatch(name) or name == ANY:
            raise DeployError(
                f"{name!r} is not a robot's namespace: use small letters, digits and _, such as robot7"
            )

    async def main(stop: asyncio.Event) -> int:
        try:
            proof = HubProof(config, note, must_connect=True) if stops else None
            async with asyncio.timeout(CONNECT_LIMIT_S):
                fleet = await open_fleet(config, proof)
        except TimeoutError as error:
            await check_refusal(config)
            raise NotRunningError(f"no router or robot answers at {config.endpoint}") from error
        try:
            return await work(stop, Robots(fleet, config.endpoint, expected), fleet)
        finally:
            await fleet.close()

    run_command(main)


def list_robots(config: BusConfig, expected: Sequence[str], *, as_json: bool) -> NoReturn:
    """Print the robots once; exit 0 if each is heard, 1 if one is not, 3 if there is none."""

    async def work(stop: asyncio.Event, robots: Robots, _: Fleet) -> int:
        found_s = time.monotonic() + FIND_S

        def is_complete() -> bool:
            robots.look()
            return time.monotonic() >= found_s and robots.all_heard

        await until(stop, is_complete, time.monotonic() + ANSWER_LIMIT_S)
        return show_once(robots.rows(), config.endpoint, as_json=as_json)

    _run(config, expected, work)


def watch_robots(config: BusConfig, expected: Sequence[str], *, as_json: bool) -> NoReturn:
    """Show the robots until Ctrl-C."""
    as_json = wants_lines(as_json=as_json)

    async def work(stop: asyncio.Event, robots: Robots, _: Fleet) -> int:
        def feeds() -> list[Remote]:
            robots.look()
            return [robots.by_name[name] for name in sorted(robots.by_name)]

        await (show_lines(stop, feeds) if as_json else show_live(stop, feeds, config.endpoint))
        return 0

    _run(config, expected, work)


def stop_robots(config: BusConfig, expected: Sequence[str], *, as_json: bool) -> NoReturn:
    """Send an e-stop to each robot until its status confirms it; exit 0 if each has, 1 if one has not, 3 if there is none."""

    async def work(stop: asyncio.Event, robots: Robots, fleet: Fleet) -> int:
        began_s = time.monotonic()
        asked_s: dict[str, float] = {}
        next_s: dict[str, float] = {}
        took_s: dict[str, float] = {}

        def look() -> bool:
            robots.look()
            for name, robot in robots.by_name.items():
                if name in asked_s and name not in took_s and robot.is_latched_since(asked_s[name]):
                    took_s[name] = robot.robot.status_s - asked_s[name]
                now_s = time.monotonic()
                if name not in took_s and now_s >= next_s.get(name, 0.0):
                    asked_s.setdefault(name, now_s)
                    next_s[name] = now_s + PERIOD_S
                    fleet.put(name, topics.ESTOP, Bool(data=True))
            return time.monotonic() >= began_s + FIND_S and len(took_s) == len(robots.by_name)

        await until(stop, look, began_s + ANSWER_LIMIT_S, period_s=PERIOD_S / 10)
        silent = sorted(set(robots.by_name) - set(took_s))
        if as_json:
            stopped_ms = {name: round(took_s[name] * 1e3, 1) for name in sorted(took_s)}
            print_json({"stopped_ms": stopped_ms, "silent": silent})
        else:
            _report(took_s, silent)
        return EXIT_NOT_RUNNING if not robots.by_name else EXIT_PARTLY if silent else 0

    _run(config, expected, work, stops=True)


def _report(took_s: dict[str, float], silent: Sequence[str]) -> None:
    for name in sorted(took_s):
        say(f"{name}: the e-stop is latched, confirmed after {took_s[name] * 1e3:.0f} ms")
    for name in silent:
        say(f"{name}: NOT CONFIRMED within {ANSWER_LIMIT_S:g} s: stop it by other means")
    if not took_s and not silent:
        say("no robot is seen through this endpoint: nothing was stopped")
