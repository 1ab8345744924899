"""What the peers have in common as ROS nodes."""
# pyright: basic, reportMissingImports=false

import threading
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from tests.ros2.peers.lines import READY, listen, say

SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


def qos(*, depth: int = 10, best_effort: bool = False, transient: bool = False) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if transient else DurabilityPolicy.VOLATILE,
    )


def make_node(name: str, ros_arguments: list[str]) -> Node:
    """Initialize ROS, with Python's own handling of signals, and return a node with few entities.

    Args:
        name: the name of the node.
        ros_arguments: the arguments that the peer did not take, such as `--ros-args -r cmd_vel:=teleop/cmd_vel`.
    """
    rclpy.init(args=ros_arguments, signal_handler_options=SignalHandlerOptions.NO)
    return Node(name, start_parameter_services=False, enable_rosout=False)


def spin(node: Node, obey: Callable[[dict[str, Any]], None] | None = None) -> None:
    """Run the node until stdin is closed; an error in a callback ends the process.

    Args:
        node: the node.
        obey: called in the executor for each line of stdin.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    ended = threading.Event()

    def pass_on(line: dict[str, Any]) -> None:
        if obey is not None:
            executor.create_task(obey, line)

    listen(pass_on, lambda: executor.create_task(ended.set))
    say(**{READY: node.get_name()})
    while not ended.is_set():
        executor.spin_once()
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()
