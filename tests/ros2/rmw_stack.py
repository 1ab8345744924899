"""The supervisor and the ROS 2 process between a robot and its command sources with rmw_zenoh; without rclpy."""

import os
import sys
from pathlib import Path

from tests.ros2.host import ROOT, Host, Peer
from tests.ros2.stack import SOURCE, TOPIC, Stack, Watch
from tests.system.ports import free_endpoint

RMW_PYTHON = ROOT / ".rmw-zenoh/bin/python"
DOMAIN = 16

CONFIGURATION = """
[bus]
endpoint = "{hub}"
[supervisor]
mounts_confirmed = true
black_box_dir = "{folder}/blackbox"
sources = [{{ name = "{source}", priority = 90 }}]
[ros2]
rmw = "zenoh"
router = "{router}"
domain_id = {domain}
sources = [{{ name = "{source}", topic = "{topic}" }}]
"""


class RmwStack(Stack):
    """A router, a robot, the supervisor, the ROS 2 process and a watch. The robot is also the observer."""

    def __init__(self, host: Host, folder: Path) -> None:  # pyright: ignore[reportMissingSuperCall] - other processes
        self.host = host
        self.router_endpoint, self.endpoint = free_endpoint(), free_endpoint()
        self.config = folder / "robot.toml"
        self.config.write_text(
            CONFIGURATION.format(
                hub=self.endpoint,
                folder=folder,
                router=self.router_endpoint,
                domain=DOMAIN,
                source=SOURCE,
                topic=TOPIC,
            )
        )
        (folder / "state").mkdir()
        self._environment = {**os.environ, "LIFELINE_STATE_DIR": str(folder / "state")}
        self._sources: list[Peer] = []
        self.supervisor = self.start_supervisor()
        self.bridge = self.start_bridge()
        self.watch = Watch(self.endpoint)

    def start_router_and_robot(self) -> None:
        self.router = self.start_router()
        self.observer = self.node("rmw_robot")

    def start_router(self) -> Peer:
        self.router = self._run("zenoh_router", "--listen", self.router_endpoint)
        return self.router

    def start_supervisor(self) -> Peer:
        self.supervisor = self._start("supervisor")
        return self.supervisor

    def start_bridge(self) -> Peer:
        self.bridge = self._start("ros2")
        return self.bridge

    def source(self, *options: str, name: str = "source", topic: str = TOPIC) -> Peer:
        source = self.node("rmw_source", "--name", name, "--topic", topic, *options)
        self._sources.append(source)
        return source

    def end_sources(self) -> None:
        """End the sources that a failed test left."""
        for source in self._sources:
            if source.process.poll() is None:
                source.end()
        self._sources.clear()

    def node(self, peer: str, *options: str) -> Peer:
        """Start a peer as a node of rmw_zenoh."""
        return self._run(peer, "--domain", str(DOMAIN), "--router", self.router_endpoint, *options)

    def _run(self, peer: str, *options: str) -> Peer:
        command = [str(RMW_PYTHON), "-m", f"tests.ros2.peers.{peer}", *options]
        return self.host.run(peer, command, self._environment, ends_with_stdin=True).ready()

    def _start(self, module: str) -> Peer:
        command = [sys.executable, "-m", module, "--config", str(self.config)]
        return self.host.run(module, command, self._environment)
