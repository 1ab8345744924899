"""`lifeline estop --name door`: an e-stop station in this terminal."""

import asyncio
import os
import sys
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from teleop.station.face import Look, headline, picture
from teleop.station.service import Station
from teleop.terminal import Terminal, is_dumb, is_terminal
from wire.host.config import NAME
from wire.host.process import run_process
from wire.zenoh.bus import ZenohBus, open_bus


def run_station(launch: Launch, name: str) -> NoReturn:
    """Run the station until it leaves; exit 0 after q, Ctrl-C, SIGTERM or a closed terminal, 1 after an error.

    Raises:
        DeployError: there is no terminal, or the name is refused.
    """
    if NAME.fullmatch(name) is None:
        raise DeployError(
            f"{name!r} is not a name: use small letters, digits and _ as in [[supervisor.estop_stations]]"
        )
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
                open_bus(launch.bus, "client", say=terminal.note, on_read_only=terminal.note)
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
