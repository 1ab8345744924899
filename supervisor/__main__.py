"""`python -m supervisor`: the safety supervisor, and the Zenoh hub of the robot."""

import argparse
import asyncio
import logging
import sys
from pathlib import Path

from supervisor.config import SupervisorSection
from supervisor.service import SupervisorService
from wire.config import BusSection, ConfigError, is_loopback, read_toml, section
from wire.process import run_process
from wire.zenoh_bus import open_bus

_log = logging.getLogger("supervisor")

EXIT_USAGE = 2


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m supervisor",
        description="The only writer of cmd_vel: passes the operator's commands to the robot while that is "
        "safe, and stops it otherwise. It is also the Zenoh hub that teleop and sim connect to.",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="robot.toml; without it, its defaults")
    parser.add_argument(
        "--endpoint", metavar="tcp/HOST:PORT", help="where to listen (default: tcp/127.0.0.1:7447)"
    )
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    try:
        document = read_toml(arguments.config)
        if arguments.endpoint is not None:
            document["bus"] = {**document.get("bus", {}), "endpoint": arguments.endpoint}
        bus_section = section(document, "bus", BusSection)
        config = section(document, "supervisor", SupervisorSection)
    except ConfigError as error:
        print(f"supervisor: {error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)

    async def run(stop: asyncio.Event) -> int:
        bus = await open_bus(bus_section.to_bus_config(), "hub")
        try:
            if not is_loopback(bus_section.endpoint):
                _log.warning(
                    "%s is open to the network: anyone who reaches it may drive", bus_section.endpoint
                )
            _log.info("listening on %s", bus_section.endpoint)
            await SupervisorService(bus, config).run(stop)
        finally:
            await bus.close()
        return 0

    run_process("supervisor", run)


if __name__ == "__main__":
    main()
