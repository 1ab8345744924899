"""`python -m sim`: the simulated warehouse robot."""

import argparse
import asyncio
import logging

from sim.config import SimSection
from sim.plant import Plant
from sim.service import SimService
from sim.viewer import NoDisplayError, has_display, open_viewer
from wire.command_line import log_to_stderr, read_document, refuse, service_parser
from wire.config import BusSection, ConfigError, section
from wire.process import run_process
from wire.zenoh_bus import open_bus

_log = logging.getLogger("sim")


def main() -> None:
    parser = service_parser(
        "sim",
        description="A differential-drive robot in a MuJoCo warehouse: it follows cmd_vel, publishes scan and "
        "odom, and brakes by itself when the supervisor falls silent.",
        epilog="exit code: 0 after SIGTERM or Ctrl-C, 1 after an error, 2 for a wrong configuration",
    )
    parser.add_argument(
        "--viewer",
        action=argparse.BooleanOptionalAction,
        default=has_display(),
        help="MuJoCo's window (default: where there is a display)",
    )
    arguments = parser.parse_args()
    try:
        document = read_document(arguments)
        bus_section = section(document, "bus", BusSection)
        config = section(document, "sim", SimSection)
        plant = Plant(limits=config.limits(), lidar=config.lidar(), seed=config.seed)
        on_frame = open_viewer(plant) if arguments.viewer else None
    except (ConfigError, NoDisplayError) as error:
        refuse("sim", error)
    log_to_stderr()

    async def run(stop: asyncio.Event) -> int:
        def on_wait() -> None:
            _log.info("waiting for the supervisor at %s", bus_section.endpoint)

        opening = asyncio.ensure_future(open_bus(bus_section.to_bus_config(), "client", on_wait=on_wait))
        stopping = asyncio.ensure_future(stop.wait())
        await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
        if not opening.done():
            return 0
        bus = opening.result()
        try:
            _log.info("connected to %s", bus_section.endpoint)
            await SimService(bus, config, plant, on_frame).run(stop)
        finally:
            await bus.close()
        return 0

    run_process("sim", run)


if __name__ == "__main__":
    main()
