"""Connects a client to the hub, and observes a running robot: nodes, command sources, newest status, odometry and reports.

On another machine, the processes and records of this machine say nothing about the robot (`silence_of`).
"""

import asyncio
import re
import sys
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Collection, Iterable
from contextlib import asynccontextmanager
from typing import NoReturn

from deploy.stack.errors import EXIT_NOT_RUNNING, EXIT_REFUSED, DeployError
from deploy.stack.formatting import CHECK_NETWORK
from deploy.stack.ros2_reports import Report, reports_of
from wire import tls, topics
from wire.bundle import BundleError, choose_bundle
from wire.bus import Bus, BusError, Inbox, wait_until
from wire.host.connections import is_here
from wire.host.installation import runnable
from wire.host.process import Main, run_process
from wire.messages import Odometry, SafetyStatus
from wire.roles import Role
from wire.text import printable_lines
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus
from wire.zenoh.connect import refusal
from wire.zenoh.hub_proof import HubProof

CONNECT_LIMIT_S = 2.0
CLOSE_LIMIT_S = 0.1
STOPPERS = (Role.OPERATOR, Role.ESTOP)


class NotRunningError(DeployError):
    """No supervisor answers at the endpoint."""

    exit_code = EXIT_NOT_RUNNING


async def reach(config: BusConfig, stop: asyncio.Event, proof: HubProof | None = None) -> ZenohBus | None:
    """Open the bus, with a proof if the program takes part; return None if `stop` is set first.

    Raises:
        NotRunningError: no supervisor answers within 2 s.
        DeployError: the endpoint is invalid, or a certificate is refused.
    """
    opening = asyncio.ensure_future(open_bus(config, "client", proof=proof))
    stopping = asyncio.ensure_future(stop.wait())
    try:
        await asyncio.wait({opening, stopping}, timeout=CONNECT_LIMIT_S, return_when=asyncio.FIRST_COMPLETED)
        if opening.done():
            return opening.result()
        if stop.is_set():
            return None
        await check_refusal(config)
        silence = silence_of(config.endpoint)
        raise NotRunningError(
            f"no supervisor answers at {config.endpoint}: start the robot with `lifeline up`"
            if silence is None
            else f"{silence}: {CHECK_NETWORK}"
        )
    except BusError as error:
        raise DeployError(str(error)) from error
    finally:
        opening.cancel()
        stopping.cancel()


async def check_refusal(config: BusConfig) -> None:
    """Of an endpoint where nobody answers, find out whether a certificate is refused.

    Raises:
        DeployError: it is; the message says whose, and what to do.
    """
    if (refused := await refusal(config)) is not None:
        raise DeployError(refused)


def check_may_stop(config: BusConfig, issue: str = "") -> None:
    """Refuse a certificate whose role may not stop a robot: the supervisor would ignore its e-stop silently.

    Args:
        config: with the bundle.
        issue: the command that issues a certificate which may stop; empty: one for any name.

    Raises:
        DeployError: the role may not stop, or the bundle is refused.
    """
    issue = issue or f"`lifeline keys issue NAME --role estop --robot {config.namespace}`"
    _check_role(config, STOPPERS, f"stop: issue one with {issue}")


def check_may_drive(config: BusConfig, issue: str) -> None:
    """Refuse a certificate whose role may not drive a robot; the arguments are those of `check_may_stop`.

    Raises:
        DeployError: the role may not drive, or the bundle is refused.
    """
    _check_role(config, (Role.OPERATOR,), f"drive: issue one with {issue}")


def _check_role(config: BusConfig, roles: Collection[Role], what: str) -> None:
    if config.keys is None or not tls.is_secure(config.endpoint):
        return
    try:
        bundle = choose_bundle(config.keys, time.time(), part=config.part)
    except BundleError as error:
        raise DeployError(str(error)) from error
    if bundle.role not in roles:
        raise DeployError(
            f"the certificate of {bundle.name} has the role {bundle.role}, which may not {what}"
        )


def run_command(main: Main) -> NoReturn:
    """Run `main(stop)` in this process, and exit with its code, with 2 if it is refused, or 3 if nothing runs."""

    async def reporting(stop: asyncio.Event) -> int:
        try:
            return await main(stop)
        except (DeployError, BusError) as error:
            print(f"lifeline: {runnable(printable_lines(str(error)))}", file=sys.stderr)
            return error.exit_code if isinstance(error, DeployError) else EXIT_REFUSED
        except BrokenPipeError:  # the reader of a pipe has ended, as `head` does
            return 0

    run_process("lifeline", reporting)


async def run_connected(
    config: BusConfig, stop: asyncio.Event, work: Callable[[ZenohBus], Awaitable[None]]
) -> None:
    """Connect as soon as a supervisor answers, and run `work`, until `stop`; Zenoh itself connects again after that.

    Args:
        config: the endpoint and the namespace.
        stop: `work` must end soon after it is set, and is abandoned otherwise.
        work: the session closes when it returns.

    Raises:
        BusError: the endpoint is invalid.
    """

    async def run() -> None:
        bus = await open_bus(config, "client")
        try:
            await work(bus)
        finally:
            await bus.close()

    running = asyncio.ensure_future(run())
    stopping = asyncio.ensure_future(stop.wait())
    await asyncio.wait({running, stopping}, return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    await asyncio.wait({running}, timeout=CLOSE_LIMIT_S)
    if running.done():
        running.result()


def silence_of(endpoint: str) -> str | None:
    """Return why nothing can be heard at an endpoint on another machine; None if it is on this machine."""
    host = tls.host_of(endpoint).strip("[]")
    try:
        return None if is_here(host) else f"nothing answers at {endpoint}, which is on another machine"
    except (OSError, UnicodeError):
        return f"the name {host} of the endpoint cannot be resolved"


DEPTH = 8
"""Diagnostics that wait: a base and the ROS 2 process may both write them."""


class Observer:
    """Keeps the newest of what a robot publishes; updated by `until`."""

    def __init__(self, bus: Bus) -> None:
        self.alive: set[str] = set()
        """The nodes that are alive."""
        self.status: SafetyStatus | None = None
        self.odometry: Odometry | None = None
        self.ros2: tuple[Report, ...] = ()
        """The reports of the ROS 2 process; empty without one."""
        self._wake = asyncio.Event()
        self._liveliness = bus.watch_alive(self._wake)
        self._statuses = bus.subscribe(topics.STATUS, wake=self._wake)
        self._odometry = bus.subscribe(topics.ODOM, wake=self._wake)
        self._diagnostics = bus.subscribe(topics.DIAGNOSTICS, depth=DEPTH, wake=self._wake)

    async def until(self, condition: Callable[["Observer"], bool], limit_s: float) -> bool:
        """Wait until the condition holds; return whether it did within `limit_s`."""

        def holds() -> bool:
            self._update()
            return condition(self)

        return await seen_within(limit_s, self._wake, holds)

    def _update(self) -> None:
        for change in self._liveliness.take():
            (self.alive.add if change.alive else self.alive.discard)(change.node)
        if (status := self._statuses.latest()) is not None:
            self.status = status.message
        if (odometry := self._odometry.latest()) is not None:
            self.odometry = odometry.message
        for diagnostics in self._diagnostics.take():
            if diagnostics.message is not None:
                self.ros2 = reports_of(diagnostics.message) or self.ros2


async def seen_within(limit_s: float, wake: asyncio.Event, is_seen: Callable[[], bool]) -> bool:
    """Check a condition at each wake-up; return whether it held in time. The loop's clock is `time.monotonic`."""
    deadline_s = time.monotonic() + limit_s
    while not is_seen():
        if time.monotonic() >= deadline_s:
            return False
        wake.clear()
        await wait_until(wake, deadline_s)
    return True


@asynccontextmanager
async def observing(config: BusConfig, limit_s: float) -> AsyncGenerator[Observer]:
    """Open an observer on a connection of its own.

    Raises:
        TimeoutError: no hub answers within `limit_s`.
        DeployError: the endpoint is invalid.
    """
    try:
        async with asyncio.timeout(limit_s):
            bus = await open_bus(config, "client")
    except BusError as error:
        raise DeployError(str(error)) from error
    try:
        yield Observer(bus)
    finally:
        await bus.close()


MAX_SOURCES = 16
"""Maximum number of sources, so that invented names do not fill the memory."""
NAME = re.compile(r"[a-z][a-z0-9_]*")


class HeardSources:
    """Collects the names of command sources.

    Args:
        heard: the inbox of `Bus.hear_sources`.
        known: the sources that are already known.
    """

    def __init__(self, heard: Inbox[str], known: Iterable[str]) -> None:
        self._heard = heard
        self._known = set(known)

    def take_new(self) -> list[str]:
        """Return the sources that were heard for the first time since the last call."""
        new: list[str] = []
        for source in self._heard.take():
            if source not in self._known and len(self._known) < MAX_SOURCES and NAME.fullmatch(source):
                self._known.add(source)
                new.append(source)
        return new
