"""A person's tools over rmw_zenoh: a line `{"call": "/lifeline/reset"}` calls a Trigger service, and prints the answer.

The package calculates the hash of the service. Each status on /diagnostics is printed.
"""
# pyright: basic, reportMissingImports=false

import threading
from typing import Any

from zenoh_ros2_sdk import ROS2ServiceClient

from tests.ros2.peers.lines import READY, listen, say
from tests.ros2.peers.rmw_node import Node, parser

RESPONSE = "bool success\nstring message\n"
PATIENCE_S = 5.0


def main() -> None:
    options = parser("person").parse_args()
    node = Node(options)

    def on_array(array: Any) -> None:  # noqa: ANN401 - the package has no types
        for status in array.status:
            say(report=status.name, level=status.level, message=status.message)

    subscriber = node.subscriber("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", on_array)

    def call(line: dict[str, Any]) -> None:
        client = ROS2ServiceClient(
            line["call"],
            "std_srvs/srv/Trigger",
            request_definition="uint8 structure_needs_at_least_one_member\n",
            response_definition=RESPONSE,
            timeout=PATIENCE_S,
            **node.common,
        )
        answer = client.call(structure_needs_at_least_one_member=0)
        client.close()
        if answer is None:
            say(answer=None)
        else:
            say(answer=answer.success, message=answer.message)

    ended = threading.Event()
    listen(call, ended.set)
    say(**{READY: options.name})
    ended.wait()
    subscriber.session_mgr.session.close()


if __name__ == "__main__":
    main()
