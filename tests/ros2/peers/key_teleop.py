"""A keyboard teleop that publishes only when a key arrives, as teleop_twist_keyboard does.

i and , drive at 0.5 m/s, j and l turn at 1 rad/s, any other key stops; Ctrl-C sends zero and quits. While no key arrives,
it is silent: of a held key, it sees only the terminal's repeats.
"""
# pyright: basic, reportMissingImports=false

import sys
import termios
import tty

import rclpy
from geometry_msgs.msg import Twist

CTRL_C = "\x03"
VELOCITIES = {"i": (0.5, 0.0), ",": (-0.5, 0.0), "j": (0.0, 1.0), "l": (0.0, -1.0)}


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("key_teleop")
    publisher = node.create_publisher(Twist, "cmd_vel", 10)
    settings = termios.tcgetattr(sys.stdin)
    try:
        tty.setraw(sys.stdin.fileno())
        print("i , j l: drive, Ctrl-C: quit", end="\r\n", flush=True)
        key = ""
        while key != CTRL_C:
            key = sys.stdin.read(1)
            twist = Twist()
            twist.linear.x, twist.angular.z = VELOCITIES.get(key, (0.0, 0.0))
            publisher.publish(twist)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)


if __name__ == "__main__":
    main()
