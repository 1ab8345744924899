"""Connects an inspection command to the hub, and runs it until it is done or interrupted.

These commands only listen: they hold no token, so no process waits for their end, and they need not close the session.
"""

import asyncio
import sys
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, NoReturn

from deploy.stack.errors import EXIT_NOT_RUNNING, EXIT_REFUSED, DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import NotRunningError, reach
from lifeline.inspection.keys import by_full_key, full_key, is_key, topic_of
from lifeline.inspection.nodes import Node, addresses, claimed_pids, network_of, nodes_of
from lifeline.inspection.sockets import processes_at, processes_with
from lifeline.inspection.traffic import Traffic
from supervisor.config import SupervisorSection
from wire.bus import BusError, Inbox, Overheard, wait_until
from wire.host.config import ConfigError, read_toml, section
from wire.host.process import run_process
from wire.text import printable_lines
from wire.topics import Topic
from wire.zenoh.bus import ZenohBus

EXIT_INTERRUPTED = 130
DEPTH = 4096
"""Samples that wait while a command prints; beyond it, the oldest are dropped."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A running robot, and what its configuration says about its keys."""

    bus: ZenohBus
    launch: Launch
    config: SupervisorSection
    known: dict[str, Topic[Any]]
    """Its topics by full key."""
    stop: asyncio.Event
    """Set by Ctrl-C."""

    @property
    def sources(self) -> tuple[str, ...]:
        """The names of its command sources."""
        return tuple(source.name for source in self.config.sources)

    @property
    def namespace(self) -> str:
        return self.launch.bus.namespace

    def key(self, name: str) -> str:
        """Return the full key of a name.

        Raises:
            DeployError: it is not a key.
        """
        key = full_key(name, self.namespace)
        if not is_key(key):
            raise DeployError(
                f"{name!r} is not a key: use a name such as cmd_vel or /{self.namespace}/cmd_vel"
            )
        return key

    def topic(self, key: str) -> Topic[Any] | None:
        """Return the topic of a full key; None if its type is unknown."""
        return topic_of(key, self.namespace, self.known)

    def overhear(self, expression: str, wake: asyncio.Event | None = None) -> Inbox[Overheard]:
        """Return an inbox for all samples that match an expression."""
        return self.bus.overhear(expression, depth=DEPTH, wake=wake)

    async def nodes(self) -> list[Node]:
        """Return all nodes except this command.

        Raises:
            DeployError: the supervisor reports no connections.
        """
        network = network_of(await self.bus.declarations())
        if not network.hub:
            raise DeployError(
                "the supervisor does not report its connections: run the same version of Lifeline on both sides"
            )
        endpoint = self.launch.bus.endpoint
        processes = processes_at(addresses(network, endpoint)) | processes_with(claimed_pids(network))
        return nodes_of(network, processes, self.namespace, endpoint, self.bus.session_id)

    async def traffic(self, seconds: float, expression: str = "**") -> Traffic:
        """Listen for a time, or until Ctrl-C, and return what was heard."""
        traffic, heard = Traffic(), self.overhear(expression)
        loop = asyncio.get_running_loop()
        end_s = loop.time() + seconds
        while loop.time() < end_s and not self.stop.is_set():
            await wait_until(self.stop, min(end_s, loop.time() + 0.1))
            for sample in heard.take():
                traffic.add(sample)
        traffic.uncounted = heard.overflowed
        return traffic


def inspect(launch: Launch, body: Callable[[Robot], Awaitable[int]]) -> NoReturn:
    """Run a command on a running robot, and exit with its code, with 2 if it is refused, or 3 if nothing runs.

    Raises:
        DeployError: the configuration is refused.
    """
    try:
        config = section(read_toml(launch.config), "supervisor", SupervisorSection)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    run_process("lifeline", lambda stop: _run(launch, config, stop, body))


async def _run(
    launch: Launch,
    config: SupervisorSection,
    stop: asyncio.Event,
    body: Callable[[Robot], Awaitable[int]],
) -> int:
    try:
        bus = await reach(launch.bus, stop)
        if bus is None:
            return EXIT_INTERRUPTED
        sources = [source.name for source in config.sources]
        lidars = [lidar.topic for lidar in config.all_lidars()]
        known = by_full_key(launch.bus.namespace, sources, lidars, config.station_names())
        return await body(Robot(bus, launch, config, known, stop))
    except NotRunningError as error:
        print(f"lifeline: {error}", file=sys.stderr)
        return EXIT_NOT_RUNNING
    except (DeployError, BusError) as error:
        print(f"lifeline: {printable_lines(str(error))}", file=sys.stderr)
        return EXIT_REFUSED
    except BrokenPipeError:  # the reader of a pipe has ended, as `head` does
        return 0
