"""A command source of rmw_zenoh: it publishes a velocity 20 times a second, zero at first.

A line `{"v": 0.5, "w": 0.0}` sets the velocity and publishes it at once; `{"v": null}` makes it silent.
"""
# pyright: basic, reportMissingImports=false

import threading
import time
from typing import Any

from tests.ros2.peers.lines import READY, listen, say
from tests.ros2.peers.rmw_node import Node, made, parser

TWIST, VECTOR = "geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3"
PERIOD_S = 0.05


def main() -> None:
    arguments = parser("source")
    arguments.add_argument("--topic", required=True)
    arguments.add_argument("--silent", action="store_true", help="publish nothing before the first line")
    options = arguments.parse_args()
    publisher = Node(options).publisher(options.topic, TWIST)
    velocity: tuple[float, float] | None = None if options.silent else (0.0, 0.0)
    ended, due = threading.Event(), threading.Event()

    def obey(line: dict[str, Any]) -> None:
        nonlocal velocity
        velocity = None if line["v"] is None else (line["v"], line.get("w", 0.0))
        due.set()

    def end() -> None:
        ended.set()
        due.set()

    listen(obey, end)
    say(**{READY: options.name})
    while not ended.is_set():
        if velocity is not None:
            v, w = velocity
            at_ns = time.monotonic_ns()
            publisher.publish(
                linear=made(publisher, VECTOR, v, 0.0, 0.0), angular=made(publisher, VECTOR, 0.0, 0.0, w)
            )
            say(at_ns=at_ns, sent=(v, w))
        due.wait(PERIOD_S)
        due.clear()
    publisher.session_mgr.session.close()


if __name__ == "__main__":
    main()
