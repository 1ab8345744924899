"""Arguments and environment of the stack's processes, and a check of the endpoint before the start."""

import errno
import os
import shlex
import socket
import sys
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, ConfigDict, Field, ValidationError

from deploy.stack.errors import DeployError
from deploy.stack.processes import MARK
from deploy.stack.statedir import StateDir, read_json
from supervisor.estop_record import is_recorded, pressed_by
from wire import topics
from wire.bus_config import BusConfig
from wire.host.command_line import bus_options, override
from wire.host.config import (
    Between,
    BusSection,
    ConfigError,
    Endpoint,
    Name,
    S,
    Section,
    absolute,
    read_toml,
    section,
)
from wire.host.installation import ENVIRONMENT

DEFAULT_CONFIG = Path(__file__).resolve().parents[1] / "robot.toml"
SIMULATED = (topics.SUPERVISOR, topics.SIM)
"""The nodes of a simulated robot."""
ANY_BASE = "base"
"""Stands for the base where nothing says which node it is: an endpoint was given without a configuration."""
MAX_PATH = 4096
"""Bytes, as the kernel permits."""
UNUSED = "false"
"""The command of a program that is not started."""


def _is_a_path(path: str) -> str:
    if len(os.fsencode(path)) > MAX_PATH:
        raise ValueError("is too long")
    return path


class _Record(Section):
    """The launch record of a state directory."""

    model_config = ConfigDict(extra="ignore")

    endpoint: Endpoint
    namespace: Name
    lease_s: Annotated[float, Between(0.001, 3600.0)]
    keys: str | None = None
    config: Annotated[str, AfterValidator(_is_a_path)]
    nodes: list[Name] = Field(default_factory=lambda: list(SIMULATED))


@dataclass(frozen=True, slots=True)
class Launch:
    """One robot: its configuration file, and how to reach it."""

    config: Path
    bus: BusConfig
    sim_options: str = ""
    nodes: tuple[str, ...] = SIMULATED
    """What `lifeline up` starts, and what a running robot needs; the hub first."""
    station: tuple[str, ...] = ()
    """The command line of an e-stop station's page that runs beside the nodes; empty: none."""
    station_name: str = ""
    """The name of this station. If the configuration does not name it, the supervisor requires it."""
    drives_on_page: bool = False
    """Whether this page drives instead of teleop."""

    @classmethod
    def read(
        cls,
        config: Path | None,
        endpoint: str | None,
        keys: Path | None = None,
        *,
        sim_options: str = "",
        with_sim: bool = True,
    ) -> "Launch":
        """Read the file's `[bus]`; `endpoint` and `keys` override the file's.

        With `[ros2]`, the base is a ROS 2 robot. Otherwise it is the sim, if `with_sim`.

        Raises:
            DeployError: the file or the endpoint is refused.
        """
        path, document, bus = _read(config, endpoint, keys)
        base = (topics.ROS2,) if topics.ROS2 in document else (topics.SIM,) if with_sim else ()
        return cls(path, bus, sim_options, (topics.SUPERVISOR, *base))

    @classmethod
    def find(cls, state: StateDir, config: Path | None, endpoint: str | None, keys: Path | None) -> "Launch":
        """Return a robot to inspect: the one that the arguments name, else the running one of the state directory, else the default.

        Its nodes are those of the launch record if that has the same endpoint and namespace, else those of a file with
        `[sim]` or `[ros2]`. An endpoint without a file says nothing about the base.

        Raises:
            DeployError: the file, the endpoint or the path of the keys is refused.
        """
        running = cls.running(state)
        if running is not None and config is None and endpoint is None:
            return running if keys is None else running.with_keys(keys)
        path, document, bus = _read(config, endpoint, keys)
        if running is not None and (running.bus.endpoint, running.bus.namespace) == (
            bus.endpoint,
            bus.namespace,
        ):
            nodes = running.nodes
        elif config is None and endpoint is not None:
            nodes = (topics.SUPERVISOR, ANY_BASE)
        else:
            base = next((name for name in (topics.ROS2, topics.SIM) if name in document), None)
            nodes = (topics.SUPERVISOR,) if base is None else (topics.SUPERVISOR, base)
        return cls(path, bus, nodes=nodes)

    def only(self, names: Collection[str]) -> "Launch":
        """Return the same robot, of which only some nodes start.

        Raises:
            DeployError: the robot has no such node.
        """
        for name in names:
            if name not in self.nodes:
                raise DeployError(
                    f"--only {name}: this robot has no such node to start, only {' and '.join(self.nodes)}"
                )
        return replace(self, nodes=tuple(node for node in self.nodes if node in names))

    @classmethod
    def running(cls, state: StateDir) -> "Launch | None":
        """Return the launch of the running stack of a state directory; None if there is no record."""
        try:
            record = _Record.model_validate(read_json(state.record))
        except ValidationError:
            return None
        keys = None if record.keys is None else Path(record.keys)
        bus = BusConfig(record.endpoint, record.namespace, record.lease_s, keys)
        return cls(Path(record.config), bus, nodes=tuple(record.nodes))

    def is_started(self, state: StateDir) -> bool:
        """Return whether the running stack of a state directory is of this robot; it may be only its base."""
        running = self.running(state)
        return running is not None and running.bus.endpoint == self.bus.endpoint

    def with_keys(self, keys: Path) -> "Launch":
        """Return the same robot, reached with another bundle.

        Raises:
            DeployError: the path begins with `~NAME` and there is no such user.
        """
        try:
            return replace(self, bus=replace(self.bus, keys=absolute(keys)))
        except ConfigError as error:
            raise DeployError(f"{error}, with --keys") from error

    def section(self, name: str, model: type[S]) -> S:
        """Return a section of the robot's configuration.

        Raises:
            DeployError: the file or the section is refused.
        """
        try:
            return section(read_toml(self.config), name, model)
        except ConfigError as error:
            raise DeployError(str(error)) from error

    def latched_sentence(self, state: StateDir) -> str | None:
        """Return a message that the robot starts with its e-stop latched and how to reset it, else None."""
        if not is_recorded(state.path, self.bus.namespace):
            return None
        service = f"{self.bus.namespace}/{topics.SUPERVISOR_RESET.key}"
        by = pressed_by(state.path, self.bus.namespace)
        return (
            f"the e-stop is still latched from an earlier run{by and f' ({by})'}, and the robot does not move until it is reset: "
            f"press {'Reset on the page' if self.drives_on_page else 'r in teleop'}, or call the service {service}"
        )

    def to_record(self) -> dict[str, object]:
        """Return the record that `running` reads."""
        return {
            "endpoint": self.bus.endpoint,
            "namespace": self.bus.namespace,
            "lease_s": self.bus.lease_s,
            "keys": None if self.bus.keys is None else str(self.bus.keys),
            "config": str(self.config),
            "nodes": self.nodes,
        }

    def environment(self, state: StateDir) -> dict[str, str]:
        """Return the environment variables that supervisord.conf uses.

        Raises:
            DeployError: the ROS 2 process cannot be started.
        """
        ros2 = UNUSED
        if topics.ROS2 in self.nodes:
            from deploy.stack import ros2_program  # noqa: PLC0415 - not without [ros2]

            ros2 = shlex.join(ros2_program.with_variables(state, self.config, self.bus))
        return {
            MARK: str(state.path),
            ENVIRONMENT: str(state.path),  # where the supervisor writes its black boxes
            "LIFELINE_PYTHON": sys.executable,
            "LIFELINE_CONFIG": str(self.config),
            "LIFELINE_BUS_OPTIONS": shlex.join(bus_options(self.bus)),
            "LIFELINE_SUPERVISOR_OPTIONS": f"--estop-station {self.station_name}" if self.station else "",
            "LIFELINE_SIM_OPTIONS": self.sim_options,
            "LIFELINE_ROS2_COMMAND": ros2,
            "LIFELINE_STATION_COMMAND": shlex.join(self.station) or UNUSED,
            "LIFELINE_START_STATION": str(bool(self.station)).lower(),
            **{
                f"LIFELINE_START_{node.upper()}": str(node in self.nodes).lower()
                for node in (topics.SUPERVISOR, topics.SIM, topics.ROS2)
            },
        }

    def command(self, module: str) -> list[str]:
        """Return the command line of a module, run with this interpreter."""
        return [sys.executable, "-m", module, "--config", str(self.config), *bus_options(self.bus)]

    @property
    def drive(self) -> str:
        """The shell command that starts teleop for this robot."""
        options, usual = (launch.command(topics.TELEOP)[3:] for launch in (self, Launch.read(None, None)))
        return shlex.join(["lifeline", topics.TELEOP, *([] if options == usual else options)])


def _read(
    config: Path | None, endpoint: str | None, keys: Path | None
) -> tuple[Path, dict[str, Any], BusConfig]:
    """Return the path of a configuration, its content, and how to reach the robot."""
    try:
        path = Path(os.path.realpath(absolute(config or DEFAULT_CONFIG)))
        document = read_toml(path)
        override(document, "bus", "endpoint", endpoint)
        override(document, "bus", "keys", None if keys is None else str(keys))
        return path, document, section(document, "bus", BusSection).to_bus_config()
    except ConfigError as error:
        raise DeployError(str(error)) from error


def check_endpoint_is_free(endpoint: str) -> None:
    """Check that the supervisor can listen on its endpoint.

    Raises:
        DeployError: the port is in use, or the address does not belong to this machine.
    """
    protocol, _, address = endpoint.partition("/")
    if protocol == "quic":  # not TCP: the supervisor reports the error itself
        return
    host, port = address.rsplit(":", 1)
    try:
        family, kind, number, _, target = socket.getaddrinfo(
            host.strip("[]"), int(port), type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, number) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(target)
            probe.listen()
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise DeployError(
                f"port {port} on {host} is in use by another program: stop it (`lifeline down` stops an earlier "
                "Lifeline), or choose another port with --endpoint tcp/127.0.0.1:PORT"
            ) from error
        raise DeployError(
            f"cannot listen on {endpoint} ({error.strerror or error}): choose an address of this machine with "
            "--endpoint tcp/127.0.0.1:PORT"
        ) from error


def free_loopback_endpoint() -> str:
    """Return an endpoint on a free port of the loopback interface."""
    return f"tcp/127.0.0.1:{free_port()}"


def free_port() -> int:
    """Return a port of the loopback interface that is free at present."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
