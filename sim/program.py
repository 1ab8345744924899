"""The program of `python -m sim`: the simulated warehouse robot."""

import argparse
import asyncio
import logging
import os
import sys
from collections.abc import Callable

from sim.config import SceneError, SimSection
from sim.layout import known
from sim.overlay import Shown
from sim.pace import TimeRequestError, parse_speed
from sim.plant import Plant
from sim.sensor_faults import FORMS, FaultError, parse_faults
from sim.service import SimService
from sim.viewer import NoDisplayError, has_display, open_viewer
from wire.host.command_line import log_to_stderr, read_document, refuse, service_parser
from wire.host.config import BusSection, ConfigError, section
from wire.host.notify import TURN_LIMIT_S, take_notifier
from wire.host.pauses import SuspendMeter
from wire.host.process import run_process
from wire.roles import Role
from wire.zenoh.bus import open_bus
from wire.zenoh.hub_proof import HubProof

_log = logging.getLogger("sim")


def main() -> None:
    parser = service_parser(
        "sim",
        description="Simulate a differential-drive robot in a MuJoCo warehouse. It follows cmd_vel, publishes scan, "
        "odom and imu, and brakes by itself when the supervisor stops sending.",
        epilog="exit code: 0 after SIGTERM or Ctrl-C, 1 after an error, 2 for a wrong configuration",
    )
    parser.add_argument(
        "--viewer",
        action=argparse.BooleanOptionalAction,
        help="open MuJoCo's window (default: if there is a display); closing it does not end the simulation",
    )
    parser.add_argument(
        "--speed",
        metavar="N",
        default="1",
        help="simulated seconds per real second, 0.1 to 100 (default: 1); the supervisor runs in real time, so above 1 "
        "its reactions take N times as long in simulated time",
    )
    parser.add_argument(
        "--faults",
        metavar="SPEC",
        default="none",
        help=f"sensor faults from the start: {FORMS} (default: none)",
    )
    parser.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help=f"the world: {', '.join(known())}, a layout (.toml) or an MJCF file (.xml)",
    )
    parser.add_argument(
        "--hull",
        metavar="SHAPE",
        help="round or rectangular; rectangular also needs corners_m in [supervisor.footprint]",
    )
    parser.add_argument("--payload-kg", type=float, metavar="KG", help="mass of the payload, 0 to 100 kg")
    parser.add_argument(
        "--wheel-slip", type=float, metavar="SHARE", help="share of the wheels' grip that is lost, 0 to 0.95"
    )
    parser.add_argument(
        "--moving",
        action=argparse.BooleanOptionalAction,
        help="let people and forklifts move (default: as configured)",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of all noise")
    arguments = parser.parse_args()
    try:
        document = read_document(arguments)
        document["sim"] = {**document.get("sim", {}), **_asked(arguments)}
        bus_section = section(document, "bus", BusSection)
        config = section(document, "sim", SimSection)
        names = [lidar.name for lidar in config.lidar_configs()]
        speed, faults = parse_speed(arguments.speed), parse_faults(arguments.faults, names)
        wants_window = has_display() if arguments.viewer is None else bool(arguments.viewer)
        options = config.build(scenery=wants_window)
        scene = config.scene if arguments.scene else config.scene_beside(arguments.config)
        plant = Plant(scene, config.limits(), config.lidar_configs(), config.seed, options)
        window = _open_window(plant, asked_for=arguments.viewer is not None) if wants_window else None
    except (ConfigError, TimeRequestError, FaultError, NoDisplayError, SceneError) as error:
        refuse("sim", error)
    log_to_stderr()
    notifier = take_notifier(os.environ, TURN_LIMIT_S)

    async def run(stop: asyncio.Event) -> int:
        def on_wait() -> None:
            _log.info("waiting for the supervisor at %s", bus_section.endpoint)

        bus_config = bus_section.to_bus_config(Role.BASE)
        opening = asyncio.ensure_future(
            open_bus(bus_config, "client", on_wait=on_wait, proof=HubProof(bus_config, _log.warning))
        )
        stopping = asyncio.ensure_future(stop.wait())
        await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
        if not opening.done():
            return 0
        bus = opening.result()
        try:
            _log.info("connected to %s", bus_section.endpoint)
            service = SimService(
                bus,
                config,
                plant,
                window,
                speed=speed,
                faults=faults,
                suspended_s=SuspendMeter().suspended_s,
                notifier=notifier,
            )
            await service.run(stop)
        finally:
            await bus.close()
        return 0

    run_process("sim", run)


def _open_window(plant: Plant, *, asked_for: bool) -> Callable[[Shown], None] | None:
    """Open the window; if it cannot be opened and was not requested, print a warning and go on without it.

    Raises:
        NoDisplayError: The window was requested and cannot be opened.
    """
    try:
        return open_viewer(plant)
    except NoDisplayError as error:
        if asked_for:
            raise NoDisplayError(f"{error}; leave out --viewer, or use --no-viewer") from error
        print(f"sim: {error}: the simulation goes on without one", file=sys.stderr)
        return None


def _asked(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the keys of [sim] that the command line overrides."""
    keys = ("scene", "hull", "payload_kg", "wheel_slip", "moving", "seed")
    return {key: value for key in keys if (value := getattr(arguments, key)) is not None}
