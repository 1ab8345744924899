"""Publishes a std_msgs/msg/Bool on /estop for each line `{"estop": true}`.

Prints `{"listeners": …}` when a subscription appears or disappears.
"""
# pyright: basic, reportMissingImports=false

import argparse
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from std_msgs.msg import Bool

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, qos, spin


def main() -> None:
    _, ros_arguments = argparse.ArgumentParser().parse_known_args()
    node = make_node("estop_button", ros_arguments)
    matched = PublisherEventCallbacks(matched=lambda event: say(listeners=event.current_count))
    publisher = node.create_publisher(Bool, "estop", qos(), event_callbacks=matched)

    def press(line: dict[str, Any]) -> None:
        publisher.publish(Bool(data=line["estop"]))
        say(pressed=line["estop"])

    spin(node, press)


if __name__ == "__main__":
    main()
