"""A small differential-drive robot: /odom at 50 Hz, /scan at 20 Hz in a room with a pillar, moved by /cmd_vel.

`--timeout none` keeps the last command. With `--stamped`, it treats stamps as diff_drive_controller does: zero is the present
time, a command older than its timeout is ignored, and the timeout counts from the stamp. `--ahead S` sets its clock ahead.
`--scan-stamps NAME` stamps its scans as tests/scan_stamps.py does. A line `{"reset": true}` puts it back at its start, at rest;
`{"ahead": 2.0}` steps its clock. Its odometry is exact, and is also published as /odom/truth, under the name that the simulated
robot uses.
"""
# pyright: basic, reportMissingImports=false

import argparse
import math
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.time import Time
from sensor_msgs.msg import LaserScan

from tests.ros2.peers import room
from tests.ros2.peers.drive import Drive
from tests.ros2.peers.ros_node import SENSOR, make_node, qos, spin
from tests.scan_stamps import STAMPS

ODOM_HZ, SCAN_HZ = 50.0, 20.0
NOISE_M = 0.002
STEP_S = 1.0 / ODOM_HZ


def timeout(text: str) -> float | None:
    return None if text == "none" else float(text)


class Robot:
    """The base and its lidar as a node."""

    def __init__(self, options: argparse.Namespace, ros_arguments: list[str]) -> None:
        self.node = make_node("diff_drive", ros_arguments)
        self._timeout_s, self._ahead_ns = options.timeout, round(options.ahead * 1e9)
        self._scan_stamp_ns = STAMPS.get(options.scan_stamps, lambda now_ns: now_ns)
        self._drive = Drive(options.timeout, x_m=options.x)
        self._stepped_s = time.monotonic()
        self._odom = self.node.create_publisher(Odometry, "odom", qos())
        self._truth = self.node.create_publisher(Odometry, "odom/truth", qos())
        self._random = np.random.default_rng()
        self._scan = self.node.create_publisher(LaserScan, "scan", SENSOR)
        if options.stamped:
            self.node.create_subscription(TwistStamped, "cmd_vel", self._follow_stamped, qos())
        else:
            self.node.create_subscription(Twist, "cmd_vel", self._follow, qos())
        self.node.create_timer(STEP_S, self._step)
        self.node.create_timer(1.0 / SCAN_HZ, self._look)

    def obey(self, line: dict[str, Any]) -> None:
        if "ahead" in line:
            self._ahead_ns = round(line["ahead"] * 1e9)
        else:
            self._drive = Drive(self._timeout_s)

    def _follow(self, twist: Twist, age_s: float = 0.0) -> None:
        self._drive.command(time.monotonic() - age_s, twist.linear.x, twist.angular.z)

    def _follow_stamped(self, command: TwistStamped) -> None:
        stamp = Time.from_msg(command.header.stamp)
        age_s = 0.0 if stamp.nanoseconds == 0 else (self._now().nanoseconds - stamp.nanoseconds) * 1e-9
        if self._timeout_s is None or age_s <= self._timeout_s:
            self._follow(command.twist, age_s)

    def _now(self) -> Time:
        """Return the time by the base's clock."""
        now = self.node.get_clock().now()
        return Time(nanoseconds=now.nanoseconds + self._ahead_ns, clock_type=now.clock_type)

    def _step(self) -> None:
        now_s = time.monotonic()
        self._drive.step(now_s, now_s - self._stepped_s)
        self._stepped_s = now_s
        drive, odom = self._drive, Odometry()
        odom.header.stamp = self._now().to_msg()
        odom.header.frame_id, odom.child_frame_id = "odom", "base_link"
        odom.pose.pose.position.x, odom.pose.pose.position.y = drive.x_m, drive.y_m
        odom.pose.pose.orientation.z = math.sin(drive.yaw_rad / 2)
        odom.pose.pose.orientation.w = math.cos(drive.yaw_rad / 2)
        odom.twist.twist.linear.x, odom.twist.twist.angular.z = drive.v_m_s, drive.w_rad_s
        self._odom.publish(odom)
        self._truth.publish(odom)

    def _look(self) -> None:
        drive, scan = self._drive, LaserScan()
        scan.header.stamp = Time(nanoseconds=self._scan_stamp_ns(self._now().nanoseconds)).to_msg()
        scan.header.frame_id = "lidar"
        scan.angle_increment = math.tau / room.BEAMS
        scan.angle_min = -math.pi
        scan.angle_max = math.pi - scan.angle_increment
        scan.scan_time = 1.0 / SCAN_HZ
        scan.range_min, scan.range_max = 0.1, 12.0
        ranges = room.ranges_m(drive.x_m, drive.y_m, drive.yaw_rad)
        # Two equal scans of a real lidar are a frozen one.
        ranges += self._random.normal(0.0, NOISE_M, len(ranges))
        scan.ranges = np.where(ranges <= scan.range_max, ranges, np.inf).astype(np.float32).tolist()
        self._scan.publish(scan)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--timeout", type=timeout, default=0.5, metavar="SECONDS|none")
    parser.add_argument("--stamped", action="store_true", help="cmd_vel is a TwistStamped")
    parser.add_argument(
        "--ahead", type=float, default=0.0, metavar="SECONDS", help="its clock less the host's"
    )
    parser.add_argument(
        "--x", type=float, default=0.0, metavar="M", help="where it starts, ahead of the middle"
    )
    parser.add_argument(
        "--scan-stamps", choices=STAMPS, help="stamps of scans that do not run like real time"
    )
    robot = Robot(*parser.parse_known_args())
    spin(robot.node, robot.obey)


if __name__ == "__main__":
    main()
