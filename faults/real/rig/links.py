"""The campaign's interface to the proxy: the links of teleop and sim that can be cut."""

import json

from faults.real.rig.helper_process import HelperProcess


class Links:
    """A running proxy.

    Args:
        hub: the endpoint of the supervisor, `tcp/HOST:PORT`.
        host: the address on which it listens.
        names: the names of its links.
        environment: additional environment of its process.
    """

    def __init__(
        self, hub: str, names: tuple[str, ...], *, environment: dict[str, str], host: str = "127.0.0.1"
    ) -> None:
        hub_host, hub_port = hub.partition("/")[2].rsplit(":", 1)
        self._child = HelperProcess(
            "faults.real.rig.proxy", hub_host, hub_port, host, *names, environment=environment
        )
        ports: dict[str, int] = json.loads(self._child.answer())
        self.endpoints = {name: f"tcp/{host}:{port}" for name, port in ports.items()}

    def open(self, link: str, *, up: bool = True, down: bool = True) -> None:
        """Open or close each direction; `up` leads to the hub."""
        self._child.order({"link": link, "up": up, "down": down})

    def delay(self, link: str, low_s: float, high_s: float) -> None:
        """Delay all data on this link, in both directions."""
        self._child.order({"link": link, "delay_s": [low_s, high_s]})

    def heal(self, link: str) -> None:
        self._child.order({"link": link, "up": True, "down": True, "delay_s": [0.0, 0.0]})

    def close(self) -> None:
        self._child.close()
