"""An authority with bundles for tests: as `lifeline keys` makes them, with lifetimes of any length."""

from pathlib import Path

from deploy.keys.commands import init, issue
from deploy.keys.register import Request
from tests.system.ports import free_endpoint
from wire.roles import Role

MONTH_S = 30 * 86400.0


class TestAuthority:
    """Issues bundles into a directory of its own."""

    __test__ = False

    def __init__(self, directory: Path) -> None:
        self._keys = directory / "keys"
        init(self._keys, replace=False)

    def bundle(
        self,
        name: str,
        role: Role,
        lifetime_s: float = MONTH_S,
        *,
        robot: str = "robot",
        hosts: tuple[str, ...] | None = None,
    ) -> Path:
        """Issue or renew a certificate, and return its bundle."""
        return Path(issue(self._keys, Request(name, role, robot, hosts), lifetime_s)["bundle"])


def secure_endpoint(protocol: str) -> str:
    """Return a free loopback endpoint for `tls` or `quic`."""
    return free_endpoint().replace("tcp", protocol)
