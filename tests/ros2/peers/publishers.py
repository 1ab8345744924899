"""Prints the number of publishers that discovery lists on a topic, at each change: `{"publishers": 1, "at_ns": …}`."""
# pyright: basic, reportMissingImports=false

import argparse
import time

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, spin

LOOK_PERIOD_S = 0.01


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="publishers")
    parser.add_argument("--topic", default="cmd_vel")
    options, ros_arguments = parser.parse_known_args()
    node = make_node(options.name, ros_arguments)
    before = -1

    def look() -> None:
        nonlocal before
        count = node.count_publishers(options.topic)
        if count != before:
            before = count
            say(at_ns=time.monotonic_ns(), publishers=count)

    node.create_timer(LOOK_PERIOD_S, look)
    spin(node)


if __name__ == "__main__":
    main()
