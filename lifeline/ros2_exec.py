"""`lifeline ros2 exec`: run a program that commands the robot, and hold a token exactly while it runs.

The ROS 2 process watches the token: when it disappears, the source is lost at once, on any host and with any middleware. The
token disappears when the program ends, also by SIGKILL, and when this process is killed, because the kernel closes its connection.
"""

import asyncio
import os
import sys
from functools import partial
from typing import NoReturn

from pydantic import TypeAdapter, ValidationError

from deploy.stack.bound_child import BoundChild, end, take_signals
from deploy.stack.errors import EXIT_REFUSED, DeployError
from deploy.stack.launch import Launch
from lifeline.inspection.network import network_of
from ros2.config import Ros2Section
from wire import topics
from wire.bus_config import BusConfig
from wire.host.config import BusSection, ConfigError, FreeName, Section, read_sections, read_toml
from wire.host.notify import Notifier, take_notifier
from wire.inbox import BusError, Token
from wire.text import printable
from wire.zenoh.connect import open_session
from wire.zenoh.local_socket import pid_in
from wire.zenoh.session import ZenohSession

EXIT_NOT_FOUND, EXIT_NOT_EXECUTABLE = 127, 126
"""The exit codes of a shell for the same failures."""
REPORT_PERIOD_S = 0.1
"""Time between two turns of the loop that may report to systemd."""


def run(launch: Launch, source: str, command: list[str]) -> NoReturn:
    """Run a command, and exit with its code, or 128 + N if signal N ended it; 2 if it is refused.

    Raises:
        DeployError: the configuration is refused, or has no such source.
    """
    try:
        document = read_toml(launch.config)
        models: dict[str, type[Section]] = {"bus": BusSection}
        if topics.ROS2 in document:
            models[topics.ROS2] = Ros2Section
        sections = read_sections(document, models)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    check_source(source, sections.get(Ros2Section), str(launch.config))
    notifier = take_notifier(os.environ)  # before the program inherits the environment
    child = BoundChild(command)  # before the threads of Zenoh
    code = EXIT_REFUSED
    try:
        code = asyncio.run(_hold(launch.bus, source, command[0], child, notifier))
    except BusError as error:
        print(f"lifeline: {error}", file=sys.stderr)
    finally:
        end(code)


def check_source(source: str, ros2: Ros2Section | None, config: str) -> None:
    """Refuse a name that the ROS 2 process would not watch; without `[ros2]`, which may be on another host, any name is accepted.

    Raises:
        DeployError: `[ros2]` has no such source.
    """
    try:
        TypeAdapter(FreeName).validate_python(source)
    except ValidationError as error:
        raise DeployError(
            f"{printable(source)!r} is no name of a command source: use lowercase letters, digits and _, and not the name "
            "of a node or topic"
        ) from error
    if ros2 is None or source in (names := [one.name for one in ros2.sources]):
        return
    there = f"there are {', '.join(names)}" if names else "there are none"
    raise DeployError(f"{printable(source)!r} is no source of [ros2] in {config}: {there}")


async def _hold(bus: BusConfig, source: str, program: str, child: BoundChild, notifier: Notifier) -> int:
    """Hold the token while the child runs, and return its exit code."""
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()
    is_running = False

    def on_signal(number: int, is_from_kernel: bool) -> None:  # noqa: FBT001 - a callback
        if not is_running:
            if not stopped.done():
                stopped.set_result(128 + number)
        elif not is_from_kernel:
            child.send(number)

    take_signals(lambda number, kernel: loop.call_soon_threadsafe(on_signal, number, kernel) and None)
    opening = asyncio.ensure_future(_session(bus))
    await asyncio.wait({opening, stopped}, return_when=asyncio.FIRST_COMPLETED)
    if stopped.done():
        child.abandon()
        return stopped.result()
    session = opening.result()
    token = session.declare_alive(f"{source}{topics.EXEC_SUFFIX}")
    await _check_alone(session, bus, source)
    ended = asyncio.Event()
    loop.add_reader(child.descriptor, partial(_on_end, token, ended))
    if stopped.done():
        child.abandon()
        return stopped.result()
    failure = child.start()
    is_running = True
    if failure is not None:
        print(f"lifeline: cannot run {printable(program)}: {failure.strerror}", file=sys.stderr)
    else:
        _report(notifier, ended)
    await ended.wait()
    notifier.stopping()
    await session.close()
    if failure is not None:
        return EXIT_NOT_FOUND if isinstance(failure, FileNotFoundError) else EXIT_NOT_EXECUTABLE
    return child.exit_code()


async def _session(bus: BusConfig) -> ZenohSession:
    def on_wait() -> None:
        print(f"lifeline: waiting for the supervisor at {bus.endpoint}", file=sys.stderr, flush=True)

    return ZenohSession(await open_session(bus, "client", on_wait=on_wait), bus.namespace)


def _report(notifier: Notifier, ended: asyncio.Event) -> None:
    """Report to systemd until the program has ended; in the loop, because only the loop can withdraw the token."""
    loop = asyncio.get_running_loop()
    if not ended.is_set():
        notifier.running(loop.time())
        loop.call_later(REPORT_PERIOD_S, _report, notifier, ended)


def _on_end(token: Token, ended: asyncio.Event) -> None:
    if not ended.is_set():
        token.withdraw()
        ended.set()


async def _check_alone(session: ZenohSession, bus: BusConfig, source: str) -> None:
    """Refuse to be the second holder of a token: the token would remain when the first holder ends.

    Raises:
        BusError: another session holds it.
    """
    key = f"{bus.namespace}/{topics.alive(f'{source}{topics.EXEC_SUFFIX}')}"
    network = network_of(await session.declarations())
    holders = [s for s in network.sessions if key in s.tokens and s.session_id != session.session_id]
    if holders:
        holder = holders[0]
        where = f"as process {pid_in(holder.session_id)}" if holder.is_at_socket else f"at {holder.address}"
        raise BusError(f"another `lifeline ros2 exec --source {source}` runs already, {where}: end it first")
