"""The keys, tokens and hashes of rmw_zenoh: ROS 2 over Zenoh without DDS (pure).

A message of a topic is a sample on `<domain>/<topic>/<DDS type>/<hash of the type>`, with the attachment of
wire/stamp.py. Each endpoint of a node is announced by a liveliness token:

    @ros2_lv/<domain>/<session>/<node id>/<endpoint id>/<kind>/<enclave>/<namespace>/<node>/<topic>/<type>/<hash>/<QoS>

In its names, `%` replaces `/`; an empty QoS field is rmw_zenoh's default. Source: liveliness_utils.cpp of
github.com/ros2/rmw_zenoh.
"""

import hashlib
import re
from enum import StrEnum
from typing import NamedTuple

from ros2 import ros
from ros2.ros import Endpoint
from wire.stamp import GID_BYTES, Stamp, parse_stamp
from wire.text import printable

ADMIN_SPACE = "@ros2_lv"
TRIGGER = "std_srvs/srv/Trigger"
ANY_HASH = "*"
TYPE_HASHES = {
    ros.TWIST: "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    ros.TWIST_STAMPED: "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    ros.DIAGNOSTIC_ARRAY: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    ros.DIAGNOSTIC_STATUS: "RIHS01_b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4",
    ros.LASER_SCAN: "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    ros.ODOMETRY: "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    ros.BOOL: "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    TRIGGER: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
}
"""The hashes of the types that Lifeline uses, as ROS 2 Jazzy defines them (REP 2016)."""

RELIABLE, BEST_EFFORT, VOLATILE = "1", "2", "2"
MAX_TIME_NS = 1 << 62
"""In the year 2116; a stamp that is later is refused."""
MAX_NAME = 255
"""Maximum length of a name in ROS 2."""


class Kind(StrEnum):
    """What a token announces."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"


class Announced(NamedTuple):
    """A publisher or a subscription, as its token announces it."""

    kind: Kind
    topic: str
    type_hash: str
    endpoint: Endpoint


def dds_type(type_name: str) -> str:
    """Return `geometry_msgs::msg::dds_::Twist_` for `geometry_msgs/msg/Twist`."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def _ros_type(name: str) -> str:
    """Return the ROS type of a DDS type; other text unchanged."""
    found = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", name)
    return name if found is None else "/".join(found.groups())


def data_key(topic: str, type_name: str, type_hash: str) -> str:
    """Return the key of a topic or service, relative to the domain.

    Args:
        topic: absolute name.
        type_name: such as `geometry_msgs/msg/Twist`.
        type_hash: its hash, or `ANY_HASH`.
    """
    return f"{topic.strip('/')}/{dds_type(type_name)}/{type_hash}"


def is_of(key: str, expression: str) -> bool:
    """Return whether a sample's key is one of the expression's, and not itself an expression.

    Args:
        key: the full key of the sample.
        expression: a full key whose last chunk is `ANY_HASH`.
    """
    prefix = expression.removesuffix(ANY_HASH)
    return key.startswith(prefix) and re.fullmatch(r"\w+", key.removeprefix(prefix)) is not None


def tokens_on(domain_id: int, topic: str) -> str:
    """Return the expression for the tokens of all endpoints of a topic."""
    return f"{ADMIN_SPACE}/{domain_id}/*/*/*/*/*/*/*/{_mangled(topic)}/*/*/*"


def node_token(domain_id: int, session: str, node: str) -> str:
    """Return the token of a node with the id 0.

    Args:
        domain_id: the ROS domain.
        session: id of its Zenoh session.
        node: its full name, without a namespace.
    """
    return f"{ADMIN_SPACE}/{domain_id}/{session}/0/0/{Kind.NODE}/%/%/{node.strip('/')}"


def endpoint_token(
    domain_id: int,
    session: str,
    node: str,
    endpoint_id: int,
    kind: Kind,
    topic: str,
    type_name: str,
    type_hash: str,
    *,
    is_reliable: bool = True,
    depth: int = 10,
) -> str:
    """Return the token of a volatile endpoint of the node with the id 0.

    Args:
        domain_id: the ROS domain.
        session: id of its Zenoh session.
        node: full name of its node, without a namespace.
        endpoint_id: its number in the session.
        kind: publisher, subscription or service.
        topic: absolute name of its topic or service.
        type_name: such as `geometry_msgs/msg/Twist`.
        type_hash: the hash of the type.
        is_reliable: its reliability.
        depth: its history.
    """
    qos = f"{RELIABLE if is_reliable else BEST_EFFORT}:{VOLATILE}:,{depth}:,:,:,,"
    return (
        f"{ADMIN_SPACE}/{domain_id}/{session}/0/{endpoint_id}/{kind}/%/%/{node.strip('/')}"
        f"/{_mangled(topic)}/{dds_type(type_name)}/{type_hash}/{qos}"
    )


def announced_by(token: str) -> Announced | None:
    """Return the publisher or subscription of a token; None if it announces something else, or is not one."""
    parts = token.split("/")
    if len(parts) != 13 or parts[0] != ADMIN_SPACE:
        return None
    # The QoS does not matter: Zenoh connects endpoints of any.
    kind, _, namespace, node, topic, type_name, type_hash, _ = parts[5:]
    if kind not in {Kind.PUBLISHER, Kind.SUBSCRIPTION}:
        return None
    name = _shown(f"{_named(namespace).rstrip('/')}/{node}")
    endpoint = Endpoint(name, _shown(_ros_type(_named(type_name))), gid_of(token))
    return Announced(Kind(kind), _named(topic), type_hash, endpoint)


def with_hash(announced: Announced) -> Endpoint:
    """Return the endpoint of a subscription; its type also names a hash that differs from that of Lifeline's publisher."""
    endpoint, own = announced.endpoint, TYPE_HASHES.get(announced.endpoint.type_name)
    if own is None or announced.type_hash == own:
        return endpoint
    return endpoint._replace(
        type_name=f"{endpoint.type_name} of another ROS 2 release ({announced.type_hash})"
    )


def stamp_of(attachment: bytes | None) -> Stamp | None:
    """Return the stamp of a message, with its writer's wall clock; None if it has none, or impossible values."""
    stamp = parse_stamp(attachment)
    if stamp is None or stamp.sequence < 0 or not 0 < stamp.source_time_ns < MAX_TIME_NS:
        return None
    return stamp


def gid_of(token: str) -> bytes:
    """Return an identity for the endpoint that a token announces (16 bytes).

    rmw_zenoh uses another hash, XXH3. The two are never compared: an epoch is taken from the messages.
    """
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def _shown(name: str) -> str:
    """Return a name from the network for a report: at most as long as ROS names are, and printable."""
    return printable(name[:MAX_NAME])


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def _named(mangled: str) -> str:
    return mangled.replace("%", "/")
