"""`python -m supervisor`: the safety supervisor, and the Zenoh hub of the robot."""

import gc

if __name__ == "__main__":
    gc.disable()  # until run_process: what the imports create stays

import asyncio
import logging
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from supervisor.base_record import BaseFile, BaseRecord
from supervisor.blackbox.people import People
from supervisor.blackbox.recorder import BlackBox, ThreadWriter
from supervisor.config import SupervisorSection, fit_to_base, is_base_known, is_simulated
from supervisor.estop_record import EstopRecord, RecordFiles, record_path
from supervisor.law.model import LawConfig
from supervisor.service import SupervisorService
from wire.host.command_line import log_to_stderr, read_document, refuse, service_parser
from wire.host.config import BaseSection, BusSection, ConfigError, Section, read_sections
from wire.host.installation import state_directory
from wire.host.notify import TURN_LIMIT_S, take_notifier
from wire.host.pauses import SuspendMeter
from wire.host.process import run_process
from wire.host.process_limits import bound_memory
from wire.tls import is_loopback, is_secure
from wire.zenoh import limits
from wire.zenoh.bus import open_bus
from wire.zenoh.connect import start_log
from wire.zenoh.local_socket import identity, participants, socket_of
from wire.zenoh.log import report_refusals

_log = logging.getLogger("supervisor")

SOCKET_PERIOD_S = 1.0
"""Period of the checks that the supervisor's socket still exists."""


def open_record(directory: Path, namespace: str) -> EstopRecord:
    """Open the e-stop record of a namespace in a state directory, and log a warning if the e-stop is latched."""
    record = EstopRecord(RecordFiles(directory, namespace))
    if record.latched_at_start:
        _log.warning(
            "the e-stop is still latched from before this start (%s): reset it with key r in teleop",
            record_path(directory, namespace),
        )
    return record


def black_box(config: SupervisorSection, law: LawConfig, people: People | None = None) -> BlackBox:
    """Return the black box for a configuration."""
    directory = state_directory() / "blackbox" if config.black_box_dir is None else Path(config.black_box_dir)
    writer = ThreadWriter(directory, max_files=config.black_box_files)
    lidar_topics = [lidar.topic for lidar in config.all_lidars()]
    return BlackBox(law, writer, window_s=config.black_box_s, lidar_topics=lidar_topics, people=people)


def require_station(document: dict[str, Any], name: str) -> None:
    """Add a required e-stop station to a valid configuration that does not name it."""
    stations = document.setdefault("supervisor", {}).setdefault("estop_stations", [])
    if name not in [station["name"] for station in stations]:
        stations.append({"name": name})


def main() -> None:
    parser = service_parser(
        "supervisor",
        description="Pass the operator's commands to the robot while this is safe, and stop it otherwise. The supervisor "
        "is the only writer of cmd_vel, and the Zenoh hub to which teleop and sim connect.",
        epilog="exit code: 0 after SIGTERM or Ctrl-C, 1 after an error, 2 for a wrong configuration",
    )
    parser.add_argument(
        "--estop-station",
        metavar="NAME",
        help="require the e-stop station of this name, unless the configuration names it",
    )
    arguments = parser.parse_args()
    try:
        document = read_document(arguments)
        models: dict[str, type[Section]] = {"bus": BusSection, "supervisor": SupervisorSection}
        if "sim" in document:  # the base that this supervisor is configured for
            models["sim"] = BaseSection
        sections = read_sections(document, models, fit_to_base)
        if arguments.estop_station is not None:
            require_station(document, arguments.estop_station)
            sections = read_sections(document, models, fit_to_base)
        bus_section, config = sections[BusSection], sections[SupervisorSection]
        contract = config.contract(bus_section.more_keys)
        law = config.law(is_base_known=is_base_known(document), are_mounts_known=is_simulated(document))
        people = People()
        recorder, directory = black_box(config, law, people), state_directory()
    except ConfigError as error:
        refuse("supervisor", error)
    log_to_stderr()
    notifier = take_notifier(os.environ, TURN_LIMIT_S)

    async def run(stop: asyncio.Event) -> int:
        bus_config = replace(bus_section.to_bus_config(), contract=contract)
        if bus_config.is_hub_secure:
            report_refusals(start_log, _log.warning)
        bus = await open_bus(bus_config, "hub")
        try:
            _log.info("listening on %s%s", bus_section.endpoint, _who_takes_part(bus_section))
            if not is_loopback(bus_section.endpoint) and not is_secure(bus_section.endpoint):
                _log.warning("%s is open to the network: %s", bus_section.endpoint, _who_reaches(bus_section))
            if bus_section.routers:
                _log.info("connecting to the router %s", " and ".join(bus_section.routers))
            record = await asyncio.to_thread(open_record, directory, bus_section.namespace)
            suspended_s = SuspendMeter().suspended_s
            shown = await asyncio.to_thread(BaseRecord, BaseFile(directory, bus_section.namespace, law))
            service = SupervisorService(
                bus, config, recorder, record, suspended_s, notifier, law, shown, people
            )
            watching = asyncio.ensure_future(_is_socket_gone(bus_section.endpoint, stop))
            await service.run(stop)
            is_gone = watching.done() and watching.result()
            watching.cancel()
        finally:
            await bus.close()
        return int(is_gone)

    bound_memory(limits.MEMORY_BYTES)
    run_process("supervisor", run, memory_keeper=bus_section.memory_keeper)


async def _is_socket_gone(endpoint: str, stop: asyncio.Event) -> bool:
    """Wait until the socket of this supervisor is gone, and then end the supervisor: nobody else could stop the robot.

    A service manager starts it again, with a new socket. Return False at once if there was no socket.
    """
    path = socket_of(endpoint)
    made = None if path is None else identity(path)
    if path is None or made is None:
        return False
    while True:
        await asyncio.sleep(SOCKET_PERIOD_S)
        if await asyncio.to_thread(identity, path) != made:
            break
    _log.error("the socket %s was removed, so no program can stop the robot: the supervisor ends", path)
    stop.set()
    return True


def _who_takes_part(bus: BusSection) -> str:
    where = participants(bus.endpoint)
    if where is None or bus.without_certificate == "participant":
        return ""
    return f"; programs of this user take part at {where}, all others may only read (docs/access.md)"


def _who_reaches(bus: BusSection) -> str:
    may = "drive the robot" if bus.without_certificate == "participant" else "read everything"
    return f"anyone who can reach it can {may}"


if __name__ == "__main__":
    main()
