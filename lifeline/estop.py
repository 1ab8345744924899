"""`lifeline estop`: press the emergency stop once, or act as an e-stop station (`--name door`)."""

import asyncio
import os
import sys
from typing import NoReturn

from deploy.stack.console import note, say
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.reach import NotRunningError, Observer, check_may_stop, reach
from teleop.station.service import Station
from teleop.station.state import Look, headline, picture
from teleop.terminal import Terminal, is_dumb, is_terminal
from wire import topics
from wire.host.config import NAME
from wire.host.process import run_process
from wire.messages import Bool
from wire.reasons import StopReason
from wire.zenoh.bus import ZenohBus, open_bus
from wire.zenoh.hub_proof import HubProof

CONFIRM_LIMIT_S = 1.0
PERIOD_S = 0.05
"""A press is one message, which a bad link may drop: it is repeated until a status confirms it."""
EXIT_NOT_CONFIRMED = 1
OTHER_MEANS = "stop it by other means: its own button, its power"


def run_station(launch: Launch, name: str) -> NoReturn:
    """Run the station until it leaves; exit 0 after q, Ctrl-C, SIGTERM or a closed terminal, 1 after an error.

    Raises:
        DeployError: there is no terminal, or the name or the role of the certificate is refused.
    """
    if NAME.fullmatch(name) is None:
        raise DeployError(
            f"{name!r} is not a name: use small letters, digits and _ as in [[supervisor.estop_stations]]"
        )
    check_may_stop(launch.bus)
    if not is_terminal():
        raise DeployError(
            "an e-stop station needs a terminal on standard input and output: run it in one, or leave out --name "
            "to press once"
        )
    run_process("lifeline", lambda stop: _run(stop, launch, name))


async def _run(stop: asyncio.Event, launch: Launch, name: str) -> int:
    wake = asyncio.Event()
    unicode = "utf" in sys.stdout.encoding.lower() and os.environ.get("TERM") != "linux"
    one_line = is_dumb()
    bus: ZenohBus | None = None
    try:
        with Terminal(wake, plain=one_line) as terminal:

            def show(look: Look) -> None:
                lines = [headline(look)] if one_line else picture(look, *terminal.size, unicode=unicode)
                terminal.show(lines)

            station = Station(name, launch.bus.endpoint, keys=terminal, show=show, wake=wake)
            opening = asyncio.ensure_future(
                open_bus(launch.bus, "client", say=terminal.note, proof=HubProof(launch.bus, terminal.note))
            )
            running = asyncio.ensure_future(station.run(stop))
            try:
                await asyncio.wait({opening, running}, return_when=asyncio.FIRST_COMPLETED)
                if opening.done():
                    bus = opening.result()
                    station.join(bus)
                await running
            finally:
                opening.cancel()
                running.cancel()
            terminal.note(station.farewell)
    finally:
        if bus is not None:
            await bus.close()
    return 0


def press(launch: Launch) -> int:
    """Press the emergency stop until the supervisor confirms it; exit 0 if it does, 1 if not, 2 if it is refused, 3 if none answers."""
    return asyncio.run(_press(launch))


async def _press(launch: Launch) -> int:
    try:
        check_may_stop(launch.bus)
        # It is sent to any hub: only the confirmation of a refused one does not count.
        bus = await reach(launch.bus, asyncio.Event(), HubProof(launch.bus, note, must_connect=True))
    except DeployError as error:
        reason = (
            f"no supervisor answers at {launch.bus.endpoint}; a base whose supervisor is silent brakes by itself"
            if isinstance(error, NotRunningError)
            else error
        )
        note(f"NOT stopped: {reason}. If the robot moves, {OTHER_MEANS}")
        return error.exit_code
    assert bus is not None  # nothing sets the event
    try:
        observer, button = Observer(bus), bus.publisher(topics.ESTOP)
        for _ in range(round(CONFIRM_LIMIT_S / PERIOD_S)):
            button.put(Bool(data=True))
            if await observer.until(_is_latched, PERIOD_S):
                say("the emergency stop is latched; reset it with r in teleop")
                return 0
        note(
            f"NOT confirmed: the emergency stop was sent, but no status shows it. If the robot moves, {OTHER_MEANS}"
        )
        return EXIT_NOT_CONFIRMED
    finally:
        await bus.close()


def _is_latched(robot: Observer) -> bool:
    return robot.status is not None and StopReason.ESTOP in robot.status.causes_and_latched()[0]
