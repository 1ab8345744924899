"""Publishes any bytes: `{"hex": "00010000…", "times": 1}` publishes them as the payload of a message on one topic.

It prints `{"listeners": …}` when a subscription appears or disappears.
"""
# pyright: basic, reportMissingImports=false

import argparse
from contextlib import suppress
from importlib import import_module
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, qos, spin


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="raw")
    parser.add_argument("--topic", required=True)
    parser.add_argument("--type", required=True, help="such as std_msgs/msg/Bool")
    parser.add_argument(
        "--rate", type=float, default=0.0, metavar="HZ", help="repeats the last bytes; 0: not"
    )
    parser.add_argument("--transient", action="store_true", help="durability: transient local")
    options, ros_arguments = parser.parse_known_args()
    package, _, kind = options.type.split("/")
    node = make_node(options.name, ros_arguments)
    matched = PublisherEventCallbacks(matched=lambda event: say(listeners=event.current_count))
    publisher = node.create_publisher(
        getattr(import_module(f"{package}.msg"), kind),
        options.topic,
        qos(transient=options.transient),
        event_callbacks=matched,
    )

    payloads: list[bytes] = []

    def publish() -> None:
        for payload in payloads:
            with suppress(RuntimeError):  # longer than its type allows
                publisher.publish(payload)

    def send(line: dict[str, Any]) -> None:
        payloads[:] = [bytes.fromhex(one) for one in line["hex"].split()]
        say(sending=line["hex"][:80])
        publish()

    if options.rate > 0:
        node.create_timer(1.0 / options.rate, publish)

    spin(node, send)


if __name__ == "__main__":
    main()
