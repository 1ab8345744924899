"""Makes the endpoints of the peers that are nodes of rmw_zenoh, with the package zenoh-ros2-sdk.

These peers run in the environment `.rmw-zenoh`. Rosbags supplies the definition and the hash of each type.
"""
# pyright: basic, reportMissingImports=false

import argparse
from collections.abc import Callable
from typing import Any

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

_STORE = get_typestore(Stores.ROS2_JAZZY)


class Node:
    """Makes the endpoints of a node.

    Args:
        options: the parsed options of `parser`.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        host, _, port = options.router.partition("/")[2].rpartition(":")
        self.common: dict[str, Any] = {
            "node_name": options.name,
            "domain_id": options.domain,
            "router_ip": host,
            "router_port": int(port),
        }

    def publisher(self, topic: str, type_name: str) -> ROS2Publisher:
        return ROS2Publisher(topic, type_name, **self._type(type_name), **self.common)

    def subscriber(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> ROS2Subscriber:
        return ROS2Subscriber(topic, type_name, callback, **self._type(type_name), **self.common)

    @staticmethod
    def _type(type_name: str) -> dict[str, str]:
        definition, _ = _STORE.generate_msgdef(type_name, ros_version=2)
        return {"msg_definition": definition, "type_hash": _STORE.hash_rihs01(type_name)}


def made(publisher: ROS2Publisher, type_name: str, *values: Any) -> Any:  # noqa: ANN401 - any values of a message
    """Return a message of a type that a publisher's message contains."""
    return publisher.session_mgr.store.types[type_name](*values)


def parser(name: str) -> argparse.ArgumentParser:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--name", default=name)
    arguments.add_argument("--domain", type=int, required=True)
    arguments.add_argument("--router", required=True, metavar="ENDPOINT")
    return arguments
