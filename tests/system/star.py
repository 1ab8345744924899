"""Network namespaces around one: each node has a link of its own to the centre, which can be cut (root)."""

import os
import subprocess
from collections.abc import Generator, Sequence
from contextlib import contextmanager

from bench.link.namespaces import inside

LIMIT_S = 10.0
PREFIX = "lifeline-star"


class Star:
    """The namespaces `centre` and the nodes."""

    def __init__(self, nodes: Sequence[str]) -> None:
        self.nodes = tuple(nodes)

    def name(self, node: str) -> str:
        return f"{PREFIX}-{os.getpid()}-{node}"

    def inside(self, node: str) -> tuple[str, ...]:
        """Return the prefix that runs a command in a namespace."""
        return inside(self.name(node))

    def centre_seen_by(self, node: str) -> str:
        """Return the address of the centre on the link of a node."""
        return f"10.97.{self.nodes.index(node) + 1}.1"

    def address(self, node: str) -> str:
        return f"10.97.{self.nodes.index(node) + 1}.2"

    def cut(self, node: str) -> None:
        """Lose every packet of a node from now on; nobody is notified."""
        _ip("-n", self.name("centre"), "link", "set", f"to-{node}", "down")

    def mend(self, node: str) -> None:
        _ip("-n", self.name("centre"), "link", "set", f"to-{node}", "up")


@contextmanager
def star(*nodes: str) -> Generator[Star]:
    """Make the namespaces and links, and remove them at the end."""
    made = Star(nodes)
    names = [made.name(node) for node in ("centre", *nodes)]
    try:
        for name in names:
            _ip("netns", "add", name)
            _ip("-n", name, "link", "set", "lo", "up")
        for node in nodes:
            here, there = made.name("centre"), made.name(node)
            _ip(
                "link",
                "add",
                f"to-{node}",
                "netns",
                here,
                "type",
                "veth",
                "peer",
                "name",
                "up0",
                "netns",
                there,
            )
            for name, device, address in (
                (here, f"to-{node}", made.centre_seen_by(node)),
                (there, "up0", made.address(node)),
            ):
                _ip("-n", name, "addr", "add", f"{address}/24", "dev", device)
                _ip("-n", name, "link", "set", device, "up")
        yield made
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True, timeout=LIMIT_S)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=LIMIT_S)
