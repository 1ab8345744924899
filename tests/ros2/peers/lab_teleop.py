"""A student's teleop node: it publishes `/cmd_vel` directly, ten times per second.

w and x change the forward velocity, a and d the turn rate, s stops, q quits.
"""
# pyright: basic, reportMissingImports=false

import os
import select
import sys
import termios
import tty

import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

LINEAR_STEP_M_S, ANGULAR_STEP_RAD_S = 0.1, 0.2
MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 1.0, 2.0
PERIOD_S = 0.1


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


class Teleop(Node):
    """Keeps the velocity that the keys have set."""

    def __init__(self) -> None:
        super().__init__("teleop")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        self.twist = Twist()

    def press(self, key: str) -> None:
        linear, angular = self.twist.linear, self.twist.angular
        if key == "w":
            linear.x = clamp(linear.x + LINEAR_STEP_M_S, MAX_LINEAR_M_S)
        elif key == "x":
            linear.x = clamp(linear.x - LINEAR_STEP_M_S, MAX_LINEAR_M_S)
        elif key == "a":
            angular.z = clamp(angular.z + ANGULAR_STEP_RAD_S, MAX_ANGULAR_RAD_S)
        elif key == "d":
            angular.z = clamp(angular.z - ANGULAR_STEP_RAD_S, MAX_ANGULAR_RAD_S)
        elif key == "s":
            linear.x = angular.z = 0.0

    def publish(self) -> None:
        self.publisher.publish(self.twist)


def main() -> None:
    rclpy.init()
    node = Teleop()
    settings = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin.fileno())
        print("w x: velocity, a d: turn rate, s: stop, q: quit")
        while rclpy.ok():
            ready, _, _ = select.select([sys.stdin], [], [], PERIOD_S)
            if ready:
                key = os.read(sys.stdin.fileno(), 1).decode()
                if key == "q":
                    break
                node.press(key)
            node.publish()
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)
        node.publisher.publish(Twist())


if __name__ == "__main__":
    main()
