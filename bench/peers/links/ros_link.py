"""rclpy over Fast DDS, reliable with depth 1, as CDR bytes; the address is a ROS domain."""
# pyright: basic, reportMissingImports=false

import threading
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from bench.peers.links import CDR_HEADER, PAYLOAD_BYTES

RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    rclpy.init(args=[], domain_id=int(address), signal_handler_options=SignalHandlerOptions.NO)
    node = Node(f"bench_{role}", start_parameter_services=False, enable_rosout=False)
    hears, says = ("command", "output") if role == "relay" else ("output", "command")
    publisher = node.create_publisher(Twist, says, RELIABLE)
    node.create_subscription(
        Twist, hears, lambda payload: heard(payload[len(CDR_HEADER) :][:PAYLOAD_BYTES]), RELIABLE, raw=True
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    return lambda payload: publisher.publish(CDR_HEADER + payload)
