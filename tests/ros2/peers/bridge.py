"""A bridge between ROS and Zenoh, like zenoh-bridge-ros2dds: it forwards scans, odometry and commands as bytes, without an attachment.

The time of publication of a scan is lost. Only its header has a stamp.
"""
# pyright: basic, reportMissingImports=false

import argparse
import asyncio

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from tests.ros2.peers.ros_node import SENSOR, make_node, qos, spin
from wire import topics
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--endpoint", required=True)
    options, ros_arguments = parser.parse_known_args()
    config = BusConfig(options.endpoint)
    session = asyncio.run(open_session(config, "client"))
    node = make_node("bridge", ros_arguments)

    def forward(kind: type, topic: str, key: str) -> None:
        out = session.declare_publisher(f"{config.namespace}/{key}")
        node.create_subscription(kind, topic, out.put, SENSOR, raw=True)

    forward(LaserScan, "scan", topics.SCAN.key)
    forward(Odometry, "odom", topics.ODOM.key)
    commands = node.create_publisher(Twist, "cmd_vel", qos())
    subscriber = session.declare_subscriber(
        f"{config.namespace}/{topics.CMD_VEL.key}", lambda sample: commands.publish(sample.payload.to_bytes())
    )
    spin(node)
    subscriber.undeclare()
    session.close()


if __name__ == "__main__":
    main()
