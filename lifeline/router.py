"""`lifeline router`: pass messages between the hubs of robots and their operators, with Zenoh's own router."""

import asyncio
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, NoReturn

from pydantic import AfterValidator, Field

from deploy.stack.console import print_json, say
from deploy.stack.errors import DeployError
from wire import tls
from wire.access import Contract
from wire.bus import BusError
from wire.foreign import ForeignError, read_text
from wire.host.config import (
    ConfigError,
    Conflict,
    Endpoint,
    FreeName,
    Name,
    Section,
    absolute,
    is_one_robot,
    section,
)
from wire.host.process import run_process
from wire.host.process_limits import bound_memory
from wire.zenoh import limits
from wire.zenoh.connect import open_router, router_settings, start_log
from wire.zenoh.log import report_refusals
from wire.zenoh.router import RouterConfig, nested

CLOSE_LIMIT_S = 1.0
MAX_ROBOTS = 1000
"""More robots than this need routers by site (docs/fleet.md)."""


class RouterSection(Section):
    """The options of `lifeline router`."""

    listen: Annotated[tuple[Endpoint, ...], Field(min_length=1, max_length=8)]
    connect: Annotated[tuple[Endpoint, ...], Field(max_length=8)]
    robots: Annotated[
        tuple[Annotated[Name, AfterValidator(is_one_robot)], ...],
        Field(min_length=1, max_length=MAX_ROBOTS),
    ]
    sources: Annotated[tuple[FreeName, ...], Field(min_length=1, max_length=32)]
    stations: Annotated[tuple[Name, ...], Field(max_length=32)]
    has_keys: bool

    def conflicts(self) -> Iterator[Conflict]:
        for name in ("listen", "connect"):
            endpoints: tuple[str, ...] = getattr(self, name)
            for number, endpoint in enumerate(endpoints):
                if tls.is_secure(endpoint) and not self.has_keys:
                    yield Conflict((name, number), None, tls.without_keys(endpoint))
                if not tls.is_secure(endpoint) and not tls.is_loopback(endpoint):
                    yield Conflict((name, number), endpoint, tls.UNPROTECTED_ROUTER)


def router_config(
    listen: Sequence[str],
    connect: Sequence[str],
    keys: Path | None,
    robots: Sequence[str],
    robots_file: Path | None,
    sources: Sequence[str],
    stations: Sequence[str],
) -> RouterConfig:
    """Return the configuration that the options describe.

    Raises:
        DeployError: an option is refused.
    """
    named = [*robots, *(_read_names(robots_file) if robots_file is not None else ())]
    if not named:
        raise DeployError("name the robots whose messages the router passes on, with --robot NAMESPACE")
    values = {
        "listen": tuple(listen),
        "connect": tuple(connect),
        "robots": tuple(dict.fromkeys(named)),
        "sources": tuple(sources) or Contract().sources,
        "stations": tuple(stations),
        "has_keys": keys is not None,
    }
    try:
        found = section({"router": values}, "router", RouterSection)
        folder = None if keys is None else absolute(keys)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    return RouterConfig(found.listen, found.robots, folder, found.connect, found.sources, found.stations)


def _read_names(path: Path) -> list[str]:
    try:
        lines = read_text(path).splitlines()
    except (OSError, ForeignError) as error:
        raise DeployError(f"cannot read the names of the robots in {path}: {error}") from error
    return [name for line in lines if (name := line.partition("#")[0].strip())]


def print_settings(config: RouterConfig) -> int:
    """Print the configuration for `zenohd`, which reads JSON.

    Raises:
        DeployError: the bundle is refused.
    """
    try:
        print_json(nested(router_settings(config)))
    except BusError as error:
        raise DeployError(str(error)) from error
    return 0


def run_router(config: RouterConfig) -> NoReturn:
    """Run the router until SIGTERM or Ctrl-C."""

    async def main(stop: asyncio.Event) -> int:
        settings = router_settings(config)
        if any(map(tls.is_secure, (*config.listen, *config.connect))):
            report_refusals(start_log, lambda sentence: say(sentence.replace("supervisor", "router")))
        close = open_router(config, settings, say)
        robots = f"{len(config.robots)} robots" if len(config.robots) > 1 else "".join(config.robots)
        say(f"routing for {robots} at {' and '.join(config.listen)}; stop with Ctrl-C")
        await stop.wait()
        closing = asyncio.get_running_loop().run_in_executor(None, close)
        await asyncio.wait({closing}, timeout=CLOSE_LIMIT_S)
        return 0

    bound_memory(limits.MEMORY_BYTES)
    run_process("lifeline", main)
