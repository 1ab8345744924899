# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""The ROS 2 node over DDS: the only file that imports rclpy. All messages are CDR bytes here.

rclpy spins on a thread of its own. Its callbacks take the time, call the given function, and return. Services run in a
second node on a second thread, because a handler may wait. An exception in a callback ends the process (`on_failure`):
otherwise its tokens would remain although it publishes nothing.
"""

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from ros2 import ros
from ros2.ros import Endpoint
from ros2.samples import Sample
from wire.host.pauses import wall_ahead_ns

TYPES: dict[str, Any] = {
    ros.TWIST: Twist,
    ros.TWIST_STAMPED: TwistStamped,
    ros.LASER_SCAN: LaserScan,
    ros.ODOMETRY: Odometry,
    ros.BOOL: Bool,
    ros.DIAGNOSTIC_ARRAY: DiagnosticArray,
    ros.DIAGNOSTIC_STATUS: DiagnosticStatus,
}
QUALITIES = {
    ros.Quality.BEST_EFFORT: QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT),
    ros.Quality.RELIABLE: QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE),
    ros.Quality.LATCHED: QoSProfile(
        depth=5, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    ),
}
MAX_SEQUENCE = 2**63 - 1
UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""The name of a node whose endpoints were discovered before its name."""


class RosNode:
    """Lifeline's node in a ROS 2 domain.

    Args:
        domain_id: the ROS domain.
        on_failure: called on any thread with an exception of a callback; it must end the process.
        name: of the node.
    """

    discovery = "discovery"

    def __init__(
        self, domain_id: int, on_failure: Callable[[BaseException], None], *, name: str = "lifeline"
    ) -> None:
        self._on_failure = on_failure
        # The process handles its signals itself (wire/host/process.py).
        rclpy.init(args=[], domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        # Fewer entities: each one costs time at every wake-up of the executor.
        self._node = Node(name, start_parameter_services=False, enable_rosout=False)
        self._services = Node(f"{name}_services", start_parameter_services=False, enable_rosout=False)

    def start(self) -> None:
        """Begin to receive; call it after all declarations."""
        for node in (self._node, self._services):
            threading.Thread(target=self._spin, args=(node,), daemon=True, name=node.get_name()).start()

    def _spin(self, node: Node) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            executor.spin()
        except ExternalShutdownException:
            return
        except BaseException as error:  # noqa: BLE001 - on_failure ends the process
            self._on_failure(error)

    def subscribe(
        self,
        topic: str,
        type_name: str,
        heard: Callable[[Sample], None],
        matched: Callable[[], None],
        *,
        quality: ros.Quality = ros.Quality.BEST_EFFORT,
    ) -> None:
        """Call `heard` for each message, and `matched` when a publisher appears or disappears; both on rclpy's thread."""
        arrivals = itertools.count(1)

        def on_message(payload: bytes, info: dict[str, Any]) -> None:
            arrival_ns = time.monotonic_ns()
            ahead_ns = wall_ahead_ns()
            sequence, arrived = info["publication_sequence_number"], next(arrivals)
            if sequence is None or not 0 < sequence <= MAX_SEQUENCE:  # the middleware does not support it
                sequence = arrived
            source_time_ns = info["source_timestamp"] - ahead_ns
            heard(Sample(payload, arrival_ns * 1e-9, source_time_ns, sequence, clock_ns=ahead_ns))

        self._node.create_subscription(
            TYPES[type_name],
            topic,
            on_message,
            QUALITIES[quality],
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(
                matched=lambda _: matched(), use_default_callbacks=False
            ),
        )

    def publisher(self, topic: str, type_name: str, matched: Callable[[], None]) -> Callable[[bytes], None]:
        """Return a function that publishes CDR bytes, reliable and volatile, without waiting.

        `matched` is called on rclpy's thread when a subscription appears or disappears.
        """
        publisher = self._node.create_publisher(
            TYPES[type_name],
            topic,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: matched(), use_default_callbacks=False),
        )
        return publisher.publish

    def serve(self, name: str, handler: Callable[[], tuple[bool, str]]) -> None:
        """Answer a `std_srvs/srv/Trigger` service; the handler may wait, on a thread of its own."""

        def on_request(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = handler()
            return response

        self._services.create_service(Trigger, name, on_request)

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return all publishers of a topic, this node's included."""
        return [_endpoint(e) for e in self._node.get_publishers_info_by_topic(topic)]

    def subscriptions(self, topic: str) -> list[Endpoint]:
        """Return all subscriptions of a topic, this node's included."""
        return [_endpoint(e) for e in self._node.get_subscriptions_info_by_topic(topic)]

    def problem(self, topic: str) -> str | None:  # noqa: ARG002 - as Ros
        """Return None: DDS stamps each message with its source time, so none is refused."""
        return None

    @property
    def name(self) -> str:
        return self._node.get_fully_qualified_name()

    def close(self) -> None:
        """Leave the domain, so that other nodes notice it at once."""
        rclpy.try_shutdown()


def _endpoint(info: Any) -> Endpoint:  # noqa: ANN401 - rclpy has no types
    name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
    return Endpoint(
        "a new node" if UNKNOWN in name else name,
        info.topic_type,
        bytes(info.endpoint_gid),
        info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
    )
