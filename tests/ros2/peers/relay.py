"""A bare relay: it publishes each message of one topic on another, as a node without any check would.

A line `{"period_s": 0.1}` makes it publish one message for each period from then on, the oldest first.
"""
# pyright: basic, reportMissingImports=false

import argparse
from collections import deque
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from tests.ros2.peers.ros_node import make_node, qos, spin


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--from", dest="source", required=True)
    parser.add_argument("--to", required=True)
    parser.add_argument("--stamped", action="store_true", help="the messages are TwistStamped")
    options, ros_arguments = parser.parse_known_args()
    node = make_node("relay", ros_arguments)
    kind = TwistStamped if options.stamped else Twist
    publisher = node.create_publisher(kind, options.to, qos(depth=1))
    backlog: deque[Any] = deque()
    period_s: float | None = None

    def publish() -> None:
        if backlog:
            publisher.publish(backlog.popleft())

    def pass_on(message: Any) -> None:  # noqa: ANN401 - no types of rclpy here
        backlog.append(message)
        if period_s is None:
            publish()

    def slow_down(line: dict[str, Any]) -> None:
        nonlocal period_s
        period_s = line["period_s"]
        node.create_timer(line["period_s"], publish)

    node.create_subscription(kind, options.source, pass_on, qos(depth=1))
    spin(node, slow_down)


if __name__ == "__main__":
    main()
