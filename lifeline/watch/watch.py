"""`lifeline watch`: show the state of one or several robots until Ctrl-C. It publishes nothing."""

import asyncio
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn, Protocol

from rich.console import Console
from rich.live import Live

from deploy.stack.errors import EXIT_NOT_RUNNING, DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import run_command
from deploy.stack.table import Table
from lifeline.watch.rows import Lines, Row, Watched, row_at, table, to_json
from wire import topics
from wire.bus import Bus, BusError, Subscription, wait_until
from wire.messages import Odometry, SafetyStatus
from wire.zenoh.bus import BusConfig, open_bus

LOOK_PERIOD_S = 0.1
ONCE_LIMIT_S = 2.0
"""How long `--once` waits for the robots."""
RETRY_S = 1.0
CLOSE_LIMIT_S = 0.1
DEPTH = 64
"""Maximum number of statuses kept between two updates; the supervisor sends far fewer."""
EXIT_PARTLY = 1


def launches(configs: Sequence[Path], endpoints: Sequence[str], keys: Path | None = None) -> list[Launch]:
    """Return the robots that the options name, without repetitions.

    Args:
        configs: one file for each robot, or one file for all endpoints.
        endpoints: one for each robot.
        keys: the bundle for all of them; None: those of the files.

    Raises:
        DeployError: a file or an endpoint is refused, or several files meet endpoints.
    """
    if len(configs) > 1 and endpoints:
        raise DeployError("several --config and --endpoint together are ambiguous: repeat only one of them")
    config = configs[0] if configs else None
    if endpoints:
        found = [Launch.read(config, endpoint, keys) for endpoint in endpoints]
    else:
        found = [Launch.read(each, None, keys) for each in configs or [None]]
    return list({launch.bus: launch for launch in found}.values())


class Feed:
    """One robot: connects by itself, and never delays another."""

    def __init__(self, config: BusConfig) -> None:
        self._config = config
        self.bus: Bus | None = None
        self.robot = Watched(config.namespace, config.endpoint, since_s=time.monotonic())
        self._statuses: Subscription[SafetyStatus] | None = None
        self._odometry: Subscription[Odometry] | None = None

    async def connect(self) -> None:
        """Open the bus as soon as a supervisor answers; Zenoh itself connects again after that."""
        while self.bus is None:
            try:
                self.bus = await open_bus(self._config, "client")
            except BusError as error:  # such as a host name that cannot be resolved for now
                self.robot.problem = str(error)
                await asyncio.sleep(RETRY_S)
        self.robot.problem = ""
        self._statuses = self.bus.subscribe(topics.STATUS, depth=DEPTH)
        self._odometry = self.bus.subscribe(topics.ODOM)

    def rows(self) -> Iterator[tuple[Row, float]]:
        """Yield the row and its time [s] for each status since the last call, then the present row."""
        if self._odometry is not None and (odometry := self._odometry.latest()) is not None:
            self.robot.odometry, self.robot.odometry_s = odometry.message, odometry.arrival_s
        for status in self._statuses.take() if self._statuses is not None else ():
            if status.message is not None:
                self.robot.status, self.robot.status_s = status.message, status.arrival_s
                yield row_at(self.robot, status.arrival_s), status.arrival_s
        now_s = time.monotonic()
        yield row_at(self.robot, now_s), now_s

    async def close(self) -> None:
        if self.bus is not None:
            await self.bus.close()


def watch(robots: Sequence[Launch], *, as_json: bool, once: bool) -> NoReturn:
    """Show the robots until Ctrl-C, and exit 0; with `once`: 0 if all are heard, 1 if some are, 3 if none is."""

    async def main(stop: asyncio.Event) -> int:
        feeds = [Feed(launch.bus) for launch in robots]
        tasks = [asyncio.ensure_future(feed.connect()) for feed in feeds]
        try:
            if once:
                return await _once(stop, feeds, as_json=as_json)
            await (show_lines if as_json else show_live)(stop, lambda: feeds)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait([asyncio.ensure_future(feed.close()) for feed in feeds], timeout=CLOSE_LIMIT_S)
        return 0

    as_json = wants_lines(as_json=as_json)
    run_command(main)


async def _once(stop: asyncio.Event, feeds: Sequence[Feed], *, as_json: bool) -> int:
    latest: dict[Feed, Row] = {}

    def look() -> bool:
        for feed in feeds:
            for row, _ in feed.rows():
                latest[feed] = row
        return all(row.status is not None and row.twist is not None for row in latest.values())

    await until(stop, look, time.monotonic() + ONCE_LIMIT_S)
    return show_once([latest[feed] for feed in feeds], as_json=as_json)


def wants_lines(*, as_json: bool) -> bool:
    """Return whether the output is JSON lines: on request, or because a live table cannot be shown."""
    return as_json or not sys.stdout.isatty() or os.environ.get("TERM") == "dumb"


def show_once(rows: Sequence[Row], shared_endpoint: str | None = None, *, as_json: bool) -> int:
    """Print the rows; return the exit code: 0 if all robots are heard, 1 if some are, 3 if none is."""
    if as_json:
        for row in rows:
            print(to_json(row, time.time()), flush=True)
    else:
        Console().print(table(rows, shared_endpoint))
    heard = sum(row.status is not None for row in rows)
    return EXIT_NOT_RUNNING if not heard else 0 if heard == len(rows) else EXIT_PARTLY


class Shown(Protocol):
    """A robot that is shown."""

    robot: Watched

    def rows(self) -> Iterator[tuple[Row, float]]:
        """Yield the row and its time [s] for each status since the last call, then the present row."""
        ...


async def show_lines(stop: asyncio.Event, feeds: Callable[[], Sequence[Shown]]) -> None:
    """Print JSON lines of the robots until `stop` is set; there may be more of them each time."""
    lines: dict[Shown, Lines] = {}

    def look() -> bool:
        for feed in feeds():
            of_robot = lines.setdefault(feed, Lines(feed.robot.since_s))
            for row, now_s in feed.rows():
                if of_robot.due(row, now_s):
                    print(to_json(row, time.time() - (time.monotonic() - now_s)), flush=True)
        return False

    await until(stop, look)


async def show_live(
    stop: asyncio.Event, feeds: Callable[[], Sequence[Shown]], shared_endpoint: str | None = None
) -> None:
    """Show a live table of the robots until `stop` is set."""

    def page() -> Table:
        return table([list(feed.rows())[-1][0] for feed in feeds()], shared_endpoint)

    with Live(page(), console=Console(), auto_refresh=False) as screen:

        def look() -> bool:
            screen.update(page(), refresh=True)
            return False

        await until(stop, look)


async def until(
    stop: asyncio.Event,
    look: Callable[[], bool],
    limit_s: float = float("inf"),
    *,
    period_s: float = LOOK_PERIOD_S,
) -> None:
    """Call `look` every `period_s` until it returns True, `stop` is set or the clock reaches `limit_s`."""
    while not (look() or stop.is_set() or time.monotonic() >= limit_s):
        await wait_until(stop, time.monotonic() + period_s)
