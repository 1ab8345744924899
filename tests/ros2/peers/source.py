"""A plain command source: it publishes a velocity at a rate, zero at first.

A line `{"v": 0.5, "w": 0.0}` sets the velocity and publishes it at once; `{"v": null}` makes it silent. Each message that
it sends is printed as `{"sent": [v, w]}`, with the time just before.
"""
# pyright: basic, reportMissingImports=false

import argparse
import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.duration import Duration

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, qos, spin


class Source:
    """Publishes on one topic; `publish` does nothing while it is silent."""

    def __init__(self, options: argparse.Namespace, ros_arguments: list[str]) -> None:
        self.node = make_node(options.name, ros_arguments)
        self._stamped, self._late = options.stamped, Duration(seconds=options.late)
        profile = qos(depth=options.depth, best_effort=options.best_effort, transient=options.transient)
        self._publisher = self.node.create_publisher(
            TwistStamped if options.stamped else Twist, options.topic, profile
        )
        self._velocity: tuple[float, float] | None = None if options.silent else (0.0, 0.0)
        if options.rate > 0:
            self.node.create_timer(1.0 / options.rate, self.publish)

    def obey(self, line: dict[str, Any]) -> None:
        self._velocity = None if line["v"] is None else (line["v"], line.get("w", 0.0))
        self.publish()

    def publish(self) -> None:
        if self._velocity is None:
            return
        twist = Twist()
        twist.linear.x, twist.angular.z = self._velocity
        message = twist
        if self._stamped:
            message = TwistStamped(twist=twist)
            message.header.stamp = (self.node.get_clock().now() - self._late).to_msg()
        at_ns = time.monotonic_ns()
        self._publisher.publish(message)
        say(at_ns=at_ns, sent=self._velocity)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="source")
    parser.add_argument("--topic", default="cmd_vel")
    parser.add_argument("--stamped", action="store_true", help="publish TwistStamped")
    parser.add_argument("--late", type=float, default=0.0, metavar="SECONDS", help="age of the headers")
    parser.add_argument("--rate", type=float, default=20.0, metavar="HZ", help="0: only when a line arrives")
    parser.add_argument("--silent", action="store_true", help="publish nothing before the first line")
    parser.add_argument("--best-effort", action="store_true", help="reliability")
    parser.add_argument("--transient", action="store_true", help="durability: transient local")
    parser.add_argument("--depth", type=int, default=10)
    source = Source(*parser.parse_known_args())
    spin(source.node, source.obey)


if __name__ == "__main__":
    main()
