"""Publishes a std_msgs/msg/Bool on /estop for each line `{"estop": true}`."""
# pyright: basic, reportMissingImports=false

import argparse
from typing import Any

from std_msgs.msg import Bool

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, qos, spin


def main() -> None:
    _, ros_arguments = argparse.ArgumentParser().parse_known_args()
    node = make_node("estop_button", ros_arguments)
    publisher = node.create_publisher(Bool, "estop", qos())

    def press(line: dict[str, Any]) -> None:
        publisher.publish(Bool(data=line["estop"]))
        say(pressed=line["estop"], listeners=publisher.get_subscription_count())

    spin(node, press)


if __name__ == "__main__":
    main()
