"""A bare relay: it publishes each Twist of one topic on another, as a node without any check would."""
# pyright: basic, reportMissingImports=false

import argparse

from geometry_msgs.msg import Twist

from tests.ros2.peers.ros_node import make_node, qos, spin


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--from", dest="source", required=True)
    parser.add_argument("--to", required=True)
    options, ros_arguments = parser.parse_known_args()
    node = make_node("relay", ros_arguments)
    publisher = node.create_publisher(Twist, options.to, qos(depth=1))
    node.create_subscription(Twist, options.source, publisher.publish, qos(depth=1))
    spin(node)


if __name__ == "__main__":
    main()
