"""What is compared, and how the process in the middle is started."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.rig.feed import supervisor
from bench.rig.program import ROOT, wait_until_listening
from bench.rig.terminal import end, sparing_from_ctrl_c
from deploy.stack.launch import free_loopback_endpoint
from ros2.environment import dds_variables, ros_variables

PEERS_PYTHON = ROOT / ".peers/bin/python"
ROS_PYTHON = ROOT / ".ros2/bin/python"
DOMAIN = 27
"""Of DDS; tests use those from 30 on."""
BROKER = "/usr/sbin/mosquitto"


@dataclass(frozen=True)
class Kind:
    """One way to pass a command on, and perhaps to notice a death."""

    name: str
    link: str
    python: Path
    mode: str = "asyncio"
    """Of the relay: `asyncio` or `callback`."""
    has_presence: bool = True
    """Whether the link can show that a process has ended."""

    def missing(self) -> str | None:
        """Return what this machine lacks for it; None if nothing."""
        if not self.python.exists():
            return f"no environment {self.python.parent.parent.name}"
        if self.link == "mqtt" and broker() is None:
            return "mosquitto is not installed"
        return None

    def command(self, program: str, *arguments: str) -> list[str]:
        """Return the command of one of this package's programs."""
        return [str(self.python), "-m", f"bench.peers.{program}", self.link, *arguments]

    @property
    def environment(self) -> dict[str, str]:
        if self.link != "ros":
            return dict(os.environ)
        own = {**ros_variables(self.python, os.environ), **dds_variables("localhost", {})}
        return {**os.environ, **own, "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}

    @contextmanager
    def middle(self) -> Generator[str]:
        """Run what is between the driver and the robot, and yield the address of the driver.

        Raises:
            RuntimeError: it does not start.
        """
        with ExitStack() as ending:
            if self.link == "lifeline":
                process = ending.enter_context(supervisor())
                command = [str(self.python), "-m", "bench.peers.feeder", process.endpoint]
                ending.enter_context(running(command, self.environment))
                yield process.endpoint
                return
            address = str(DOMAIN) if self.link in ("dds", "ros") else free_loopback_endpoint()
            if self.link == "mqtt":
                ending.enter_context(_broker(address))
            ending.enter_context(running(self.command("relay", address, self.mode), self.environment))
            if self.link in ("zenoh", "tcp"):
                wait_until_listening(address)
            yield address


def kinds() -> list[Kind]:
    """Return all kinds; the second one is the reference of the ratios."""
    own = Path(sys.executable)
    return [
        Kind("Lifeline's supervisor", "lifeline", own),
        Kind("bare Zenoh relay, asyncio", "zenoh", PEERS_PYTHON),
        Kind("bare Zenoh relay, in the callback", "zenoh", PEERS_PYTHON, "callback", has_presence=False),
        Kind("MQTT (mosquitto, paho), asyncio", "mqtt", PEERS_PYTHON),
        Kind("CycloneDDS, asyncio", "dds", PEERS_PYTHON, has_presence=False),
        Kind("rclpy over Fast DDS, in the callback", "ros", ROS_PYTHON, "callback", has_presence=False),
        Kind("TCP, asyncio", "tcp", PEERS_PYTHON),
    ]


REFERENCE = 1
"""Index of the kind to which the others are compared."""


@contextmanager
def running(command: Sequence[str], environment: dict[str, str]) -> Generator["subprocess.Popen[bytes]"]:
    """Run a program while the context is open; its errors are shown."""
    with sparing_from_ctrl_c():
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        end(process)


def broker() -> str | None:
    """Return the MQTT broker of this machine; None if there is none."""
    return shutil.which("mosquitto") or (BROKER if os.access(BROKER, os.X_OK) else None)


@contextmanager
def _broker(address: str) -> Generator[None]:
    path = broker()
    assert path is not None
    port = address.rpartition(":")[2]
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "mosquitto.conf"
        config.write_text(
            f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\nuser root\npersistence false\nlog_dest none\n"
        )
        with running([path, "-c", str(config)], dict(os.environ)):
            wait_until_listening(address)
            yield
