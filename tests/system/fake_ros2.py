"""Stands for `python -m ros2` without ROS: holds the token, and reports what it was started with in its diagnostics.

Its interpreter is a script that runs this file: `interpreter` writes it.
"""

import asyncio
import json
import os
import sys
from pathlib import Path

from wire import topics
from wire.host.process import run_process
from wire.messages import DiagnosticArray, DiagnosticStatus, KeyValue, header
from wire.zenoh.bus import BusConfig, open_bus

OUTPUT = "FAKE_ROS2_OUTPUT"
"""The environment variable with the file to which it writes its arguments and its environment."""
PERIOD_S = 0.2


def interpreter(directory: Path) -> Path:
    """Write a program that takes the place of the Python with rclpy, and return its path."""
    path = directory / "ros-python"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{__file__}" "$@"\n')
    path.chmod(0o755)
    return path


def diagnostics() -> DiagnosticArray:
    source = DiagnosticStatus(
        1,
        "lifeline: source joy",
        "no program publishes on /joy/cmd_vel",
        "lifeline",
        [KeyValue("guards", "process 12 on this host, command timeout"), KeyValue("hold_s", "0.6")],
    )
    foreign = DiagnosticStatus(0, "other", "not of Lifeline", "other", [])
    hostile = DiagnosticStatus(2, "lifeline: scan", "\x1b[2J" + "x" * 5000, "lifeline", [])
    return DiagnosticArray(header(""), [source, foreign, hostile])


async def main(stop: asyncio.Event) -> int:
    bus = await open_bus(BusConfig(sys.argv[sys.argv.index("--endpoint") + 1]), "client")
    token = bus.declare_alive(topics.ROS2)
    out = bus.publisher(topics.DIAGNOSTICS)
    while not stop.is_set():
        out.put(diagnostics())
        await asyncio.wait({asyncio.ensure_future(stop.wait())}, timeout=PERIOD_S)
    token.withdraw()
    await bus.close()
    return 0


if __name__ == "__main__":
    if "--check-base" in sys.argv:
        print("checked", *sys.argv[1:])
        sys.exit(7)
    if OUTPUT in os.environ:
        written = Path(os.environ[OUTPUT])
        document = {"pid": os.getpid(), "arguments": sys.argv[1:], "environment": dict(os.environ)}
        written.with_suffix(".part").write_text(json.dumps(document))
        written.with_suffix(".part").replace(written)
    run_process("fake_ros2", main)
