"""A robot whose nodes use rmw_zenoh: /odom at 50 Hz, /scan at 20 Hz in a room with a pillar, moved by /cmd_vel.

It keeps a command for 0.5 s. Each message on /cmd_vel and each odometry is printed, as tests/ros2/peers/observer.py does.
"""
# pyright: basic, reportMissingImports=false

import math
import threading
import time
from typing import Any

import numpy as np

from tests.ros2.peers import room
from tests.ros2.peers.drive import Drive
from tests.ros2.peers.lines import READY, listen, say
from tests.ros2.peers.rmw_node import Node, made, parser

STEP_S, STEPS_OF_A_SCAN = 0.02, 3
TIMEOUT_S = 0.5
NOISE_M = 0.002
COVARIANCE = np.zeros(36)


def main() -> None:
    options = parser("base").parse_args()
    node = Node(options)
    odom = node.publisher("/odom", "nav_msgs/msg/Odometry")
    scan = node.publisher("/scan", "sensor_msgs/msg/LaserScan")
    noise = np.random.default_rng(0)
    drive, lock = Drive(TIMEOUT_S), threading.Lock()

    def on_twist(twist: Any) -> None:  # noqa: ANN401 - the package has no types
        at_s = time.monotonic()
        say(at_ns=round(at_s * 1e9), topic="cmd_vel", v=twist.linear.x, w=twist.angular.z)
        with lock:
            drive.command(at_s, twist.linear.x, twist.angular.z)

    def vector(x: float, y: float, z: float) -> Any:  # noqa: ANN401 - as above
        return made(odom, "geometry_msgs/msg/Vector3", x, y, z)

    def header(frame: str) -> Any:  # noqa: ANN401 - as above
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        return made(
            odom,
            "std_msgs/msg/Header",
            made(odom, "builtin_interfaces/msg/Time", seconds, nanoseconds),
            frame,
        )

    def show_odometry() -> None:
        half_rad = drive.yaw_rad / 2
        turn = made(odom, "geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
        place = made(odom, "geometry_msgs/msg/Point", drive.x_m, drive.y_m, 0.0)
        pose = made(odom, "geometry_msgs/msg/Pose", place, turn)
        twist = made(
            odom, "geometry_msgs/msg/Twist", vector(drive.v_m_s, 0.0, 0.0), vector(0.0, 0.0, drive.w_rad_s)
        )
        odom.publish(
            header=header("odom"),
            child_frame_id="base_link",
            pose=made(odom, "geometry_msgs/msg/PoseWithCovariance", pose, COVARIANCE),
            twist=made(odom, "geometry_msgs/msg/TwistWithCovariance", twist, COVARIANCE),
        )
        say(topic="odom", v=drive.v_m_s, w=drive.w_rad_s, x=drive.x_m, y=drive.y_m, yaw=drive.yaw_rad)

    def show_scan() -> None:
        # Without noise, the scans of a robot at rest would be those of a frozen lidar.
        ranges = room.ranges_m(drive.x_m, drive.y_m, drive.yaw_rad) + noise.normal(0.0, NOISE_M, room.BEAMS)
        increment = math.tau / room.BEAMS
        scan.publish(
            header=header("lidar"),
            angle_min=-math.pi,
            angle_max=math.pi - increment,
            angle_increment=increment,
            time_increment=0.0,
            scan_time=STEP_S * STEPS_OF_A_SCAN,
            range_min=0.1,
            range_max=12.0,
            ranges=np.where(ranges <= 12.0, ranges, np.inf).astype(np.float32),
            intensities=np.zeros(0, np.float32),
        )

    subscriber = node.subscriber("/cmd_vel", "geometry_msgs/msg/Twist", on_twist)
    ended = threading.Event()
    listen(lambda _: None, ended.set)
    say(**{READY: options.name})
    step, next_s = 0, time.monotonic()
    while not ended.wait(max(0.0, next_s - time.monotonic())):
        next_s = max(next_s + STEP_S, time.monotonic())
        with lock:
            drive.step(time.monotonic(), STEP_S)
        show_odometry()
        if step % STEPS_OF_A_SCAN == 0:
            show_scan()
        step += 1
    subscriber.session_mgr.session.close()


if __name__ == "__main__":
    main()
