"""The robot's node in ROS 2: `python -m faults.grade.ros_robot ENDPOINT DOMAIN`, with the Python of the process `ros2`.

It passes `/cmd_vel` to the robot, and the robot's `/scan` and `/odom` to ROS 2, as bytes, until the end of its stdin.
"""

import asyncio
import os
import sys
import traceback
from typing import Any

from ros2 import ros
from ros2.node import RosNode
from wire import topics
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

NAME = "robot"
READY = "ready"


async def run(endpoint: str, domain: int) -> None:
    config = BusConfig(endpoint)
    session = ZenohSession(await open_session(config, "client"), config.namespace)
    node = RosNode(domain, _fail, name=NAME)
    commands = session.publisher_raw(topics.CMD_VEL)
    node.subscribe("cmd_vel", ros.TWIST, lambda sample: commands.put_bytes(sample.payload), lambda: None)
    for topic, kind in ((topics.SCAN, ros.LASER_SCAN), (topics.ODOM, ros.ODOMETRY)):
        publish = node.publisher(topic.key, kind, lambda: None)

        def pass_on(payload: bytes, *_: Any, publish: Any = publish) -> None:  # noqa: ANN401 - the stamp is not needed
            publish(payload)

        session.subscribe_raw(topic.key, pass_on)
    node.start()
    print(READY, flush=True)
    await asyncio.to_thread(sys.stdin.buffer.read)
    await session.close()
    node.close()


def _fail(error: BaseException) -> None:
    traceback.print_exception(error)
    os._exit(1)


if __name__ == "__main__":
    asyncio.run(run(sys.argv[1], int(sys.argv[2])))
