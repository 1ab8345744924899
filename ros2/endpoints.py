"""The endpoints that ROS 2's discovery lists for a topic, and a sentence for each mismatch (pure)."""

from collections.abc import Sequence
from typing import NamedTuple

MOST_NAMES = 4


class Endpoint(NamedTuple):
    """A publisher or a subscription of any node."""

    node: str
    """Full name of its node."""
    type_name: str
    """Such as `geometry_msgs/msg/Twist`."""
    gid: bytes
    """Its identity (16 bytes): that of DDS, or with rmw_zenoh a hash of its token."""
    is_reliable: bool = True
    is_transient: bool = False
    """Whether a subscription requests, or a publisher offers, messages from before the match (transient local)."""


def names(endpoints: Sequence[Endpoint]) -> str:
    """Return the names of the nodes, as in "/a and /b"; of many, the first ones and how many more endpoints there are."""
    nodes = sorted(endpoint.node for endpoint in endpoints)
    if len(nodes) > MOST_NAMES:
        nodes[MOST_NAMES:] = [f"{len(nodes) - MOST_NAMES} more"]
    return " and ".join(nodes) or "none"


def clause(endpoints: Sequence[Endpoint], verb: str) -> str:
    """Return subject and verb, as in "/a listens" and "/a and /b listen"."""
    ending = "" if len(endpoints) > 1 else "es" if verb.endswith("sh") else "s"
    return f"{names(endpoints)} {verb}{ending}"


def wrong_types(topic: str, expected: str, endpoints: Sequence[Endpoint], option: str) -> str | None:
    """Return a sentence if an endpoint of a topic has another type, which DDS does not connect; None if none has.

    Args:
        topic: absolute name.
        expected: the type that the configuration names.
        endpoints: the publishers, or the subscriptions, of the topic.
        option: the key of `[ros2]` that selects Twist or TwistStamped; empty if there is no choice.
    """
    wrong = [e for e in endpoints if e.type_name != expected]
    if not wrong:
        return None
    kind = wrong[0].type_name
    advice = f"give it a topic with {expected}"
    if option and kind.removesuffix("Stamped") == expected.removesuffix("Stamped"):
        advice = f"set {option} = {'true' if kind.endswith('Stamped') else 'false'}"
    return f"{clause(wrong, 'use')} {kind} on {topic}, but {expected} is expected, so they are not connected: {advice}"


def wrong_qos(topic: str, subscriptions: Sequence[Endpoint]) -> str | None:
    """Return a sentence if a subscription requests more than our publisher offers (reliable, volatile); None if none does."""
    wrong = [s for s in subscriptions if s.is_transient]
    if not wrong:
        return None
    return (
        f"{clause(wrong, 'request')} {topic} with durability transient local, which would also deliver an old command, "
        "so they are not connected: set its durability to volatile"
    )
