"""Prints each message of the robot's topics with its arrival time.

`{"topic": "cmd_vel", "at_ns": …, "v": m/s, "w": rad/s}`, for `odom` also the pose `x`, `y`, `yaw`, for `scan` also the
number of `beams` and the `nearest` return [m].
"""
# pyright: basic, reportMissingImports=false

import argparse
import math
import time

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import SENSOR, make_node, qos, spin


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="observer")
    parser.add_argument("--cmd-vel", default="cmd_vel", help="its topic")
    parser.add_argument("--stamped", action="store_true", help="cmd_vel is a TwistStamped")
    parser.add_argument("--odom", default="odom", help="its topic")
    parser.add_argument("--scan", action="store_true", help="also print the scans")
    options, ros_arguments = parser.parse_known_args()
    node = make_node(options.name, ros_arguments)

    def on_twist(twist: Twist) -> None:
        say(at_ns=time.monotonic_ns(), topic="cmd_vel", v=twist.linear.x, w=twist.angular.z)

    def on_stamped(message: TwistStamped) -> None:
        on_twist(message.twist)

    def on_odom(odom: Odometry) -> None:
        at_ns = time.monotonic_ns()
        place, turn = odom.pose.pose.position, odom.pose.pose.orientation
        yaw = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        twist = odom.twist.twist
        say(at_ns=at_ns, topic="odom", v=twist.linear.x, w=twist.angular.z, x=place.x, y=place.y, yaw=yaw)

    def on_scan(scan: LaserScan) -> None:
        at_ns = time.monotonic_ns()
        returns = [one for one in scan.ranges if math.isfinite(one)]
        say(at_ns=at_ns, topic="scan", beams=len(scan.ranges), nearest=min(returns, default=None))

    reliable = qos(depth=1000)
    if options.stamped:
        node.create_subscription(TwistStamped, options.cmd_vel, on_stamped, reliable)
    else:
        node.create_subscription(Twist, options.cmd_vel, on_twist, reliable)
    node.create_subscription(Odometry, options.odom, on_odom, reliable)
    if options.scan:
        node.create_subscription(LaserScan, "scan", on_scan, SENSOR)
    spin(node)


if __name__ == "__main__":
    main()
