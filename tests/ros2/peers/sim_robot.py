"""Lifeline's simulated robot as a ROS 2 robot: /scan, /odom, /odom/truth and /cmd_vel, for an unmodified `python -m sim`.

It is the hub of the endpoint that the sim connects to, and replaces the supervisor: it declares the supervisor's token, and
repeats the last command of /cmd_vel to the sim at 50 Hz. Messages are passed on as bytes. With `--timeout none` it
keeps the last command. A line `{"reset": true}` forgets the command and puts the robot back at its start; it answers
`{"reset": true}` once that is done.
"""
# pyright: basic, reportMissingImports=false

import argparse
import asyncio
import os
import threading
import time
import traceback
from typing import Any

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import LaserScan

from tests.ros2.peers.diff_drive import timeout
from tests.ros2.peers.lines import READY, listen, say
from tests.ros2.peers.ros_node import SENSOR, make_node, qos
from wire import cdr, topics
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

PERIOD_S = 0.02
RESET_LIMIT_S = 5.0


class Base:
    """The last command of /cmd_vel, and how long it holds."""

    def __init__(self, timeout_s: float | None, *, stamped: bool) -> None:
        self._timeout_s = timeout_s
        self._stamped = stamped
        self.forget()

    def forget(self) -> None:
        self._twist = cdr.twist(cdr.STANDSTILL)
        self._arrival_s = 0.0

    def command(self, payload: bytes) -> None:
        twist = cdr.twist_of(payload, stamped=self._stamped)
        if twist is not None:
            self._twist, self._arrival_s = twist, time.monotonic()

    def output(self) -> bytes:
        """Return the Twist to send now."""
        silent = self._timeout_s is not None and time.monotonic() - self._arrival_s > self._timeout_s
        return cdr.twist(cdr.STANDSTILL) if silent else self._twist


def spin_or_exit(executor: SingleThreadedExecutor) -> None:
    """Run the executor; an error in a callback ends the process."""
    try:
        executor.spin()
    except Exception:  # noqa: BLE001 - any
        traceback.print_exc()
        os._exit(1)


async def run(options: argparse.Namespace, ros_arguments: list[str]) -> None:
    loop, ended, due = asyncio.get_running_loop(), asyncio.Event(), asyncio.Event()
    session = ZenohSession(await open_session(BusConfig(options.endpoint), "hub"), BusConfig().namespace)
    node = make_node("sim_robot", ros_arguments)
    base = Base(options.timeout, stamped=options.stamped)

    for key, topic, kind, profile in (
        (topics.SCAN.key, "scan", LaserScan, SENSOR),
        (topics.ODOM.key, "odom", Odometry, qos()),
        (topics.TRUTH.key, "odom/truth", Odometry, qos()),
    ):
        publisher = node.create_publisher(kind, topic, profile)

        def pass_on(payload: bytes, _: bytes | None, __: float, publisher: Any = publisher) -> None:  # noqa: ANN401 - rclpy has no types
            publisher.publish(payload)

        session.subscribe_raw(key, pass_on)

    def on_command(payload: bytes) -> None:
        base.command(payload)
        loop.call_soon_threadsafe(due.set)

    kind = TwistStamped if options.stamped else Twist
    node.create_subscription(kind, "cmd_vel", on_command, qos(), raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=spin_or_exit, args=(executor,), daemon=True, name="ros").start()

    async def reset() -> None:
        base.forget()
        while True:
            done, _ = await session.call_raw(
                topics.SIM_RESET.key, None, cdr.trigger_reply, timeout_s=RESET_LIMIT_S
            )
            if done:
                return say(reset=True)

    def obey(_: dict[str, Any]) -> None:
        asyncio.run_coroutine_threadsafe(reset(), loop)

    listen(obey, lambda: loop.call_soon_threadsafe(ended.set))
    session.declare_alive(topics.SUPERVISOR)
    out = session.publisher_raw(topics.CMD_VEL)
    say(**{READY: node.get_name()})
    while not ended.is_set():
        due.clear()
        out.put_bytes(base.output())
        try:
            await asyncio.wait_for(due.wait(), PERIOD_S)
        except TimeoutError:
            continue
    await session.close()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--endpoint", required=True)
    parser.add_argument("--timeout", type=timeout, default=None, metavar="SECONDS|none")
    parser.add_argument("--stamped", action="store_true", help="cmd_vel is a TwistStamped")
    asyncio.run(run(*parser.parse_known_args()))


if __name__ == "__main__":
    main()
