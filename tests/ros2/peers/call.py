"""Calls a std_srvs/srv/Trigger service once for each line `{"service": "/name"}`, and prints the response."""
# pyright: basic, reportMissingImports=false

import argparse
from typing import Any

from std_srvs.srv import Trigger

from tests.ros2.peers.lines import say
from tests.ros2.peers.ros_node import make_node, spin


def main() -> None:
    _, ros_arguments = argparse.ArgumentParser().parse_known_args()
    node = make_node("caller", ros_arguments)
    clients: dict[str, Any] = {}

    def call(line: dict[str, Any]) -> None:
        name = line["service"]
        client = clients.setdefault(name, node.create_client(Trigger, name))
        client.wait_for_service(10.0)
        future = client.call_async(Trigger.Request())
        future.add_done_callback(
            lambda done: say(service=name, success=done.result().success, message=done.result().message)
        )

    spin(node, call)


if __name__ == "__main__":
    main()
