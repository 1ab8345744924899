"""The links that teleop and sim go through while one of them is to be cut: the campaign's end of the proxy."""

import json

from deploy.campaign.real.rig.helper_process import HelperProcess


class Links:
    """A running proxy.

    Args:
        hub: the endpoint of the supervisor, `tcp/HOST:PORT`.
        host: where it listens.
        names: of its links.
        environment: of its process.
    """

    def __init__(
        self, hub: str, names: tuple[str, ...], *, environment: dict[str, str], host: str = "127.0.0.1"
    ) -> None:
        hub_host, hub_port = hub.partition("/")[2].rsplit(":", 1)
        self._child = HelperProcess(
            "deploy.campaign.real.rig.proxy", hub_host, hub_port, host, *names, environment=environment
        )
        ports: dict[str, int] = json.loads(self._child.answer())
        self.endpoints = {name: f"tcp/{host}:{port}" for name, port in ports.items()}

    def open(self, link: str, *, up: bool = True, down: bool = True) -> None:
        """Open or shut each direction; `up` leads to the hub."""
        self._child.order({"link": link, "up": up, "down": down})

    def delay(self, link: str, low_s: float, high_s: float) -> None:
        """Make everything on this link so much slower, both ways."""
        self._child.order({"link": link, "delay_s": [low_s, high_s]})

    def heal(self, link: str) -> None:
        self._child.order({"link": link, "up": True, "down": True, "delay_s": [0.0, 0.0]})

    def close(self) -> None:
        self._child.close()
