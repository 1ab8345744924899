"""The program of `python -m ros2`: reads the configuration, opens session and node, and runs the service.

It runs in an environment with rclpy (`make ros2`); for a robot with rmw_zenoh, in any environment of Lifeline.
"""

import argparse
import asyncio
import logging
import os
from collections.abc import Callable, Coroutine
from typing import Any

from ros2.check_base import MakeNode, check_base
from ros2.config import Ros2Section, SupervisorValues, apart_from_hub, fit_to_lidars
from ros2.environment import OLD_DISCOVERY_RANGE, dds_variables, missing_middleware
from ros2.rmw_zenoh import RmwZenoh
from ros2.ros import Ros
from ros2.service import Ros2Service
from wire.host.command_line import log_to_stderr, read_document, refuse, service_parser
from wire.host.config import BusSection, ConfigError, Section, Sections, read_sections
from wire.host.notify import TURN_LIMIT_S, take_notifier
from wire.host.pauses import SuspendMeter
from wire.host.process import run_process
from wire.inbox import BusError
from wire.roles import Role
from wire.zenoh.connect import open_session
from wire.zenoh.hub_proof import HubProof
from wire.zenoh.session import ZenohSession

_log = logging.getLogger("ros2")

Serve = Callable[[ZenohSession, Ros], Coroutine[Any, Any, None]]
"""Runs on the session with the supervisor and the node; it returns when the process must end."""


def main() -> None:
    parser = service_parser(
        "ros2",
        description="Connect a ROS 2 robot to the supervisor: its scans and odometry, the topics of its command sources, "
        "and its command topic. The section [ros2] of the configuration names them.",
        epilog="exit code: 0 after SIGTERM or Ctrl-C, 1 after an error, 2 for a wrong configuration",
    )
    parser.add_argument(
        "--check-base",
        action="store_true",
        help="measure how long the base keeps its last command when its commands end; the robot turns on the spot",
    )
    parser.add_argument("--yes", action="store_true", help="with --check-base: move the robot without asking")
    arguments = parser.parse_args()
    try:
        sections = read(arguments)
        make_node = node_of(sections)
    except ConfigError as error:
        refuse("ros2", error)
    config, supervisor = sections[Ros2Section], sections[SupervisorValues]
    log_to_stderr()
    notifier = take_notifier(os.environ, TURN_LIMIT_S)

    if arguments.check_base:
        run_process("ros2", lambda stop: check_base(stop, config, make_node, ask=not arguments.yes))

    async def run(stop: asyncio.Event) -> int:
        async def serve(session: ZenohSession, node: Ros) -> None:
            service = Ros2Service(
                session,
                node,
                config,
                command_timeout_s=supervisor.command_timeout_s,
                lidar_topics=supervisor.lidar_topics,
                suspended_s=SuspendMeter().suspended_s,
                notifier=notifier,
            )
            where = config.router if config.rmw == "zenoh" else config.discovery_range
            _log.info("node %s in domain %d, %s", node.name, config.domain_id, where)
            await service.run(stop)

        await connect(sections, make_node, serve)
        return 0

    run_process("ros2", run)


def read(arguments: argparse.Namespace) -> Sections:
    """Return the sections of the configuration that the process needs.

    Args:
        arguments: of a `service_parser`.

    Raises:
        ConfigError: the configuration is refused.
    """
    models: dict[str, type[Section]] = {
        "bus": BusSection,
        "ros2": Ros2Section,
        "supervisor": SupervisorValues,
    }
    return read_sections(read_document(arguments), models, fit_to_lidars, apart_from_hub)


def node_of(sections: Sections) -> MakeNode:
    """Return the function that makes the node; over DDS, set the variables of this process for it.

    Raises:
        ConfigError: this Python has no rclpy, or not the chosen middleware.
    """
    config = sections[Ros2Section]
    return _over_zenoh(config, sections[BusSection]) if config.rmw == "zenoh" else _over_dds(config)


async def connect(sections: Sections, make_node: MakeNode, serve: Serve) -> None:
    """Open the session with the supervisor and the node, run `serve`, and close both.

    Raises:
        BusError: the session or the node cannot be opened.
        BaseException: of a callback of the node, which ends `serve`.
    """
    loop = asyncio.get_running_loop()
    failed: asyncio.Future[None] = loop.create_future()

    def on_failure(error: BaseException) -> None:
        loop.call_soon_threadsafe(lambda: failed.done() or failed.set_exception(error))

    bus = sections[BusSection].to_bus_config(Role.BASE)
    proof = HubProof(bus, _log.warning)
    session = await open_session(
        bus,
        "client",
        on_wait=lambda: _log.info("waiting for the supervisor on %s", bus.endpoint),
        proof=proof,
    )
    wire = ZenohSession(session, bus.namespace, proof=proof)
    node = await make_node(on_failure)
    try:
        running = asyncio.ensure_future(serve(wire, node))
        await asyncio.wait({running, failed}, return_when=asyncio.FIRST_COMPLETED)
        if failed.done():
            running.cancel()
            await asyncio.wait({running})
            failed.result()
        await running
    finally:
        await wire.close()
        await asyncio.to_thread(node.close)


def _over_dds(config: Ros2Section) -> MakeNode:
    """Return the function that makes the node over DDS.

    Raises:
        ConfigError: this Python has no rclpy, or not the chosen middleware.
    """
    os.environ.pop(OLD_DISCOVERY_RANGE, None)
    os.environ.update(dds_variables(config.discovery_range, os.environ))
    missing = missing_middleware(os.environ)
    if missing is not None:
        raise ConfigError(missing)
    try:
        from ros2.node import RosNode  # noqa: PLC0415 - after the environment is set
    except ImportError as error:
        raise ConfigError(
            f"this Python has no rclpy ({error}): create the environment with `make ros2`, or on a robot run "
            "`. /opt/ros/jazzy/setup.sh` first"
        ) from error

    async def make_node(on_failure: Callable[[BaseException], None]) -> Ros:
        try:
            return RosNode(config.domain_id, on_failure)
        except Exception as error:  # of rclpy, of several types
            first = str(error).strip().partition("\n")[0]
            raise BusError(
                f"rclpy cannot create a node: {first}: check the variables ROS_… and RMW_…"
            ) from error

    return make_node


def _over_zenoh(config: Ros2Section, bus: BusSection) -> MakeNode:
    """Return the function that makes the node over Zenoh; it waits for the robot's router without a time limit."""
    router = config.to_router_config(bus)

    async def make_node(on_failure: Callable[[BaseException], None]) -> Ros:
        session = await open_session(
            router,
            "client",
            on_wait=lambda: _log.info("waiting for the robot's router on %s", router.endpoint),
        )
        return RmwZenoh(ZenohSession(session, router.namespace), config.domain_id, on_failure)

    return make_node
