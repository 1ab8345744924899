"""How a process reaches the bus of one robot (pure)."""

from dataclasses import dataclass
from pathlib import Path

from wire import tls
from wire.access import Contract
from wire.roles import Role

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


@dataclass(frozen=True, slots=True)
class BusConfig:
    """Endpoint of the hub, namespace of the robot, and lease of the links."""

    endpoint: str = DEFAULT_ENDPOINT
    namespace: str = "robot"
    lease_s: float = tls.LEASE_S
    """How long a silent link counts as alive."""
    keys: Path | None = None
    """The directory of this process's bundle (bundle.py), which endpoints with TLS need; unused with tcp."""
    part: Role | None = None
    """The role whose bundle this process takes, of several in that directory; None: any but supervisor."""
    contract: Contract = Contract()
    """The robot's own keys; only the hub uses them, for its access control."""
    unproven: tuple[Role, ...] = (Role.VIEWER,)
    """The roles of programs that have no certificate and do not use the hub's socket."""
    routers: tuple[str, ...] = ()
    """Endpoints of the Zenoh routers to which the hub connects; clients ignore them."""
    hub_user: str | None = None
    """The user, by name or number, who may run the hub on this machine beside this process's user and root."""

    @property
    def is_hub_secure(self) -> bool:
        """Whether the hub has links with certificates."""
        return any(map(tls.is_secure, (self.endpoint, *self.routers)))
