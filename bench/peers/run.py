"""What is compared, how it is started, and how long a command and the notice of a death take, in interleaved rounds."""

import itertools
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Generator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.peers.results import RATES_HZ, Death, RoundTrip
from bench.rig.feed import Plan
from bench.rig.nodes import supervisor
from bench.rig.options import progress
from bench.rig.program import ROOT, Program, program, running, talking, wait_until_listening
from deploy.stack.launch import free_loopback_endpoint
from ros2.environment import dds_variables, ros_variables
from wire.bus_config import BusConfig

PEERS_PYTHON = ROOT / ".peers/bin/python"
ROS_PYTHON = ROOT / ".ros2/bin/python"
DOMAIN = 27
"""Of DDS; tests use those from 30 on."""
BROKER = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
TRIP_LIMIT_S, DEATH_LIMIT_S = 120.0, 20.0


@dataclass(frozen=True)
class Kind:
    """A transport that is compared: it passes commands on, and may have presence."""

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
        if self.link == "mqtt" and BROKER is None:
            return "mosquitto is not installed"
        return None

    def command(self, program: str, *arguments: str) -> list[str]:
        return [str(self.python), "-m", "bench.peers.programs", program, self.link, *arguments]

    @property
    def environment(self) -> dict[str, str]:
        if self.link != "ros":
            return dict(os.environ)
        own = {**ros_variables(self.python, os.environ), **dds_variables("localhost", {})}
        return {**os.environ, **own, "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}

    def program(self, name: str, *arguments: str) -> AbstractContextManager[Program]:
        """Run one of the programs that print lines."""
        return talking(f"{name} of {self.name}", self.command(name, *arguments), self.environment)

    @contextmanager
    def middle(self) -> Generator[str]:
        """Run what is between the driver and the robot, and yield the address of the driver.

        Raises:
            RuntimeError: it does not start.
        """
        with ExitStack() as ending:
            if self.link == "lifeline":
                endpoint = ending.enter_context(supervisor()).endpoint
                robot = Plan([(endpoint, BusConfig().namespace)], [])
                ending.enter_context(program("bench.rig.feed", arguments=robot.words()))
                yield endpoint
                return
            address = str(DOMAIN) if self.link in ("dds", "ros") else free_loopback_endpoint()
            if self.link == "mqtt":
                assert BROKER is not None
                config = Path(ending.enter_context(tempfile.TemporaryDirectory())) / "mosquitto.conf"
                config.write_text(
                    f"listener {address.rpartition(':')[2]} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\nuser root\n"
                    "persistence false\nlog_dest none\n"
                )
                ending.enter_context(running([BROKER, "-c", str(config)]))
                wait_until_listening(address)
            ending.enter_context(running(self.command("relay", address, self.mode), self.environment))
            if self.link == "zenoh":
                wait_until_listening(address)
            yield address

    def times_ms(self, count: int) -> list[list[float]]:
        """Return the times of the commands that arrived, for each rate [ms]."""
        pairs = [str(value) for rate_hz in RATES_HZ for value in (rate_hz, count)]
        found: list[list[float]] = []
        with self.middle() as address, self.program("driver", address, *pairs) as driver:
            while len(found) < len(RATES_HZ):
                line = driver.line(TRIP_LIMIT_S)
                if line.startswith("["):  # DDS prints its warnings there too
                    found.append(json.loads(line))
        return found

    def deaths_ms(self, kills: int) -> Generator[float]:
        """Kill holders, and yield how long after each SIGKILL the watcher knew it [ms]."""
        with ExitStack() as ending:
            address = ending.enter_context(self.middle())
            watcher = ending.enter_context(self.program("watcher", address))
            watcher.line(DEATH_LIMIT_S)
            for _ in range(kills):
                with self.program("holder", address) as holder:
                    holder.line(DEATH_LIMIT_S)
                    killed_ns = time.monotonic_ns()
                    holder.process.kill()
                    lost_ns = 0
                    while lost_ns < killed_ns:  # an earlier one is a stop that had another cause
                        lost_ns = int(watcher.line(DEATH_LIMIT_S))
                    yield (lost_ns - killed_ns) / 1e6


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
    ]


def measure(
    kinds: Sequence[Kind], rounds: int, count: int, kills: int
) -> tuple[list[RoundTrip], list[Death]]:
    """Measure all kinds in each round, so that a slow moment of the machine affects all of them.

    Args:
        kinds: what is compared.
        rounds: number of rounds.
        count: number of commands for each kind, rate and round.
        kills: number of kills for each kind that has presence, and round.

    Raises:
        RuntimeError: a process fails, or an end is not noticed within the limit.
    """
    trips, deaths = list[RoundTrip](), list[Death]()
    for number, kind in itertools.product(range(rounds), kinds):
        progress(f"round {number + 1}: {kind.name}")
        trips += [
            RoundTrip(kind.name, rate_hz, number, count, tuple(times_ms))
            for rate_hz, times_ms in zip(RATES_HZ, kind.times_ms(count), strict=True)
        ]
    for number, kind in itertools.product(range(rounds), kinds):
        if kind.has_presence:
            progress(f"round {number + 1}: SIGKILL, {kind.name}")
            deaths.append(Death(kind.name, number, tuple(kind.deaths_ms(kills))))
    return trips, deaths
