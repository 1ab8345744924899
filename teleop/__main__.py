"""`python -m teleop`: drive the robot by keyboard."""

import argparse
import asyncio
from collections.abc import Sequence
from typing import NoReturn

from teleop.config import TeleopSection
from teleop.keymap import Action, action_for, legend
from teleop.service import Teleop
from teleop.terminal import Terminal, is_terminal
from wire.bus import Bus
from wire.command_line import override, read_document, refuse, service_parser
from wire.config import BusSection, ConfigError, section
from wire.process import run_process
from wire.zenoh_bus import open_bus


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    args = _parser().parse_args(arguments)
    try:
        config, bus_section = _configuration(args)
    except ConfigError as error:
        refuse("teleop", error)
    if not is_terminal():
        refuse(
            "teleop",
            "keys need a terminal on standard input and output: run it in one, not in a pipe or a service",
        )
    run_process("teleop", lambda stop: _run(stop, config, bus_section))


async def _run(stop: asyncio.Event, config: TeleopSection, bus_section: BusSection) -> int:
    wake = asyncio.Event()
    bus: Bus | None = None
    try:
        with Terminal(wake) as terminal:
            for line in legend(config.linear_step_m_s, config.angular_step_rad_s):
                terminal.note(line)
            bus = await _connect(bus_section, terminal, wake, stop)
            if bus is not None:
                endpoint = bus_section.endpoint
                teleop = Teleop(bus, config, keys=terminal, screen=terminal, wake=wake, endpoint=endpoint)
                await teleop.run(stop)
                terminal.note("ended; the last command was zero")
    finally:
        if bus is not None:
            await bus.close()
    return 0


async def _connect(
    bus_section: BusSection, terminal: Terminal, wake: asyncio.Event, stop: asyncio.Event
) -> Bus | None:
    """The bus, as soon as the supervisor is there; None: the operator did not want to wait for it."""

    def on_wait() -> None:
        terminal.note(f"waiting for the supervisor at {bus_section.endpoint}; q quits")

    opening = asyncio.ensure_future(open_bus(bus_section.to_bus_config(), "client", on_wait=on_wait))
    stopping = asyncio.ensure_future(stop.wait())
    for task in (opening, stopping):
        task.add_done_callback(lambda _: wake.set())
    try:
        while not opening.done():
            actions = {action_for(key) for key in terminal.take()}
            if Action.ESTOP in actions:
                terminal.note("emergency stop NOT sent: there is no connection to the supervisor")
            if Action.QUIT in actions or terminal.ended or stop.is_set():
                return None
            await wake.wait()
            wake.clear()
        terminal.take()  # keys typed before there was anything to drive
        return opening.result()
    finally:
        opening.cancel()
        stopping.cancel()


def _configuration(args: argparse.Namespace) -> tuple[TeleopSection, BusSection]:
    """The configuration file, with what the command line says otherwise.

    Raises:
        ConfigError: naming every fault.
    """
    document = read_document(args)
    override(document, "teleop", "source", args.source)
    return section(document, "teleop", TeleopSection), section(document, "bus", BusSection)


def _parser() -> argparse.ArgumentParser:
    defaults = TeleopSection()
    keys = "\n".join(legend(defaults.linear_step_m_s, defaults.angular_step_rad_s))
    parser = service_parser(
        "teleop",
        description="Drive the robot by keyboard. Each press changes what is asked for, and it holds until the next:\n"
        "the supervisor decides what the robot does of it, and stops it when this program ends or hangs.",
        epilog=f"keys:\n{keys}\n\n"
        "After every stop the robot waits for s: nothing moves before you have let go.\n"
        "exit code: 0 after q, Ctrl-C or SIGTERM, 1 after an error, 2 for a wrong configuration or no terminal",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--source", metavar="NAME", help=f"the name of this command source (default: {defaults.source})"
    )
    return parser


if __name__ == "__main__":
    main()
