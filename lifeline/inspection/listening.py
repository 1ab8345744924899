"""Connects an inspection command to the hub, and runs it until it is done or interrupted.

These commands only listen: they hold no token, so no process waits for their end, and they need not close the session.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, NoReturn, ParamSpec

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import reach, run_command
from lifeline.inspection.keys import by_full_key, checked_key, topic_of
from lifeline.inspection.nodes import Node, addresses, claimed_pids, nodes_of
from lifeline.inspection.sockets import processes_at, processes_with
from lifeline.inspection.traffic import Traffic
from supervisor.config import SupervisorSection
from wire.bus import Inbox, Overheard, wait_until
from wire.topics import Topic
from wire.zenoh.bus import ZenohBus
from wire.zenoh.network import network_of

P = ParamSpec("P")
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
        return checked_key(name, self.namespace)

    def topic(self, key: str) -> Topic[Any] | None:
        """Return the topic of a full key; None if its type is unknown."""
        return topic_of(key, self.namespace, self.known)

    def overhear(self, expression: str, wake: asyncio.Event | None = None) -> Inbox[Overheard]:
        """Return an inbox for all samples that match an expression."""
        return self.bus.overhear(expression, depth=DEPTH, wake=wake)

    async def nodes(self) -> list[Node]:
        """Return all nodes except this command.

        Raises:
            DeployError: this program may not read the supervisor's report of them.
        """
        network = network_of(await self.bus.declarations())
        if not network.hub:
            raise DeployError(
                "the supervisor reports who reads and writes what only to programs of its own user, and to certificates other "
                "than a viewer's: run this command as that user on the supervisor's machine, or with such a certificate"
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


def inspection(
    run: Callable[Concatenate[Robot, P], Awaitable[int]],
) -> Callable[Concatenate[Launch, P], NoReturn]:
    """Turn a function that inspects a running robot into a command that exits with its code (`deploy.stack.reach.run_command`).

    The command raises a DeployError if the configuration is refused.
    """

    @wraps(run)
    def command(launch: Launch, /, *args: P.args, **options: P.kwargs) -> NoReturn:
        config = launch.section("supervisor", SupervisorSection)

        async def main(stop: asyncio.Event) -> int:
            bus = await reach(launch.bus, stop)
            if bus is None:
                return EXIT_INTERRUPTED
            return await run(robot_at(bus, launch, config, stop), *args, **options)

        run_command(main)

    return command


def robot_at(bus: ZenohBus, launch: Launch, config: SupervisorSection, stop: asyncio.Event) -> Robot:
    """Return the robot behind a bus, with the keys that its configuration names."""
    return Robot(bus, launch, config, by_full_key(launch.bus.namespace, config), stop)
