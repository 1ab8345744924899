"""What the children are started with, checked before anything starts."""

import errno
import socket
import sys
from dataclasses import dataclass
from pathlib import Path

from deploy.stack.errors import DeployError
from deploy.stack.processes import MARK
from deploy.stack.statedir import StateDir, read_json
from wire.config import BusSection, ConfigError, absolute, read_toml, section
from wire.state_directory import ENVIRONMENT
from wire.zenoh_bus import BusConfig

DEFAULT_CONFIG = Path(__file__).resolve().parents[1] / "robot.toml"


@dataclass(frozen=True, slots=True)
class Launch:
    """One robot: its configuration file, and how to reach it."""

    config: Path
    bus: BusConfig
    sim_options: str = ""

    @classmethod
    def read(cls, config: Path | None, endpoint: str | None, *, sim_options: str = "") -> "Launch":
        """Read the file's `[bus]`; an endpoint given here takes the place of the file's.

        Raises:
            DeployError: the file or the endpoint is refused.
        """
        try:
            path = absolute(config or DEFAULT_CONFIG).resolve()
            document = read_toml(path)
            if endpoint is not None:
                document["bus"] = {**document.get("bus", {}), "endpoint": endpoint}
            return cls(path, section(document, "bus", BusSection).to_bus_config(), sim_options)
        except ConfigError as error:
            raise DeployError(str(error)) from error

    @classmethod
    def running(cls, state: StateDir) -> "Launch | None":
        """What the stack of a state directory was started with; None where none was."""
        record = read_json(state.record)
        try:
            bus = BusConfig(record["endpoint"], record["namespace"], record["lease_s"])
            return cls(Path(record["config"]), bus)
        except (KeyError, TypeError):
            return None

    def to_record(self) -> dict[str, object]:
        """For `running`."""
        return {
            "endpoint": self.bus.endpoint,
            "namespace": self.bus.namespace,
            "lease_s": self.bus.lease_s,
            "config": str(self.config),
        }

    def environment(self, state: StateDir) -> dict[str, str]:
        """What supervisord.conf takes from the environment."""
        return {
            MARK: str(state.path),
            ENVIRONMENT: str(state.path),  # where the supervisor puts its black boxes
            "LIFELINE_PYTHON": sys.executable,
            "LIFELINE_CONFIG": str(self.config),
            "LIFELINE_ENDPOINT": self.bus.endpoint,
            "LIFELINE_SIM_OPTIONS": self.sim_options,
        }

    def command(self, module: str) -> list[str]:
        """One process of ours, with this interpreter."""
        options = ["--config", str(self.config), "--endpoint", self.bus.endpoint]
        return [sys.executable, "-m", module, *options]


def check_endpoint_is_free(endpoint: str) -> None:
    """Try to listen where the supervisor will.

    Raises:
        DeployError: somebody else listens there, or the address is not this machine's.
    """
    protocol, address = endpoint.split("/", 1)
    if protocol == "quic":  # not TCP: the supervisor itself will tell
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
    """An endpoint that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"
