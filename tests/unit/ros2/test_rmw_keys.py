"""The keys, tokens and type hashes of rmw_zenoh."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc
from rosbags.typesys import Stores, get_typestore

from ros2 import ros
from ros2.reports import wrong_types
from ros2.rmw_keys import (
    ANY_HASH,
    TRIGGER,
    TYPE_HASHES,
    Kind,
    announced_by,
    data_key,
    dds_type,
    endpoint_token,
    gid_of,
    is_of,
    node_token,
    tokens_on,
    with_hash,
)

SESSION = "3c0cd9de34e45f7341800863af673f2"
# In the form that rmw_zenoh gives it in ROS 2 Jazzy; its node has a namespace.
FOREIGN = (
    "@ros2_lv/7/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%robot%arm/driver/%robot%scan/"
    "sensor_msgs::msg::dds_::LaserScan_/"
    "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828/2::,5:,:,:,,"
)
NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
TOPICS = st.lists(NAMES, min_size=1, max_size=3).map(lambda chunks: "/" + "/".join(chunks))
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
STORE = get_typestore(Stores.ROS2_JAZZY)


def test_the_key_of_a_topic_names_its_type_and_its_hash() -> None:
    assert (
        data_key("/robot/cmd_vel", ros.TWIST, ANY_HASH) == "robot/cmd_vel/geometry_msgs::msg::dds_::Twist_/*"
    )
    assert dds_type(TRIGGER) == "std_srvs::srv::dds_::Trigger_"


@pytest.mark.parametrize(
    "key",
    [
        "7/**",
        "7/scan/sensor_msgs::msg::dds_::LaserScan_/*",
        "7/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_$*",
        "7/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_1/more",
        "7/scan/sensor_msgs::msg::dds_::LaserScan_/",
        "7/other/sensor_msgs::msg::dds_::LaserScan_/RIHS01_1",
    ],
)
def test_a_sample_of_another_key_or_on_a_wildcard_is_not_of_the_topic(key: str) -> None:
    expression = f"7/{data_key('/scan', ros.LASER_SCAN, ANY_HASH)}"
    assert not is_of(key, expression)
    assert is_of("7/scan/sensor_msgs::msg::dds_::LaserScan_/TypeHashNotSupported", expression)


def test_a_token_of_a_foreign_node_is_read() -> None:
    announced = announced_by(FOREIGN)
    assert announced is not None
    assert (announced.kind, announced.topic) == (Kind.PUBLISHER, "/robot/scan")
    endpoint = announced.endpoint
    assert (endpoint.node, endpoint.type_name) == ("/robot/arm/driver", ros.LASER_SCAN)
    assert endpoint.gid == gid_of(FOREIGN)


@given(
    st.integers(0, 232),
    NAMES,
    st.integers(0, 999),
    st.sampled_from([Kind.PUBLISHER, Kind.SUBSCRIPTION]),
    TOPICS,
    st.sampled_from(sorted(TYPE_HASHES)),
    st.booleans(),
)
def test_a_token_is_read_back(
    domain_id: int,
    node: str,
    number: int,
    kind: Kind,
    topic: str,
    type_name: str,
    reliable: bool,  # noqa: FBT001
) -> None:
    token = endpoint_token(
        domain_id,
        SESSION,
        f"/{node}",
        number,
        kind,
        topic,
        type_name,
        "RIHS01_1",
        is_reliable=reliable,
        depth=1,
    )
    announced = announced_by(token)
    assert announced is not None
    assert announced[:3] == (kind, topic, "RIHS01_1")
    assert announced.endpoint == (f"/{node}", type_name, gid_of(token), False)
    assert token.rpartition("/")[2].startswith("1:" if reliable else "2:")
    assert all(
        expected in {"*", chunk}
        for expected, chunk in zip(tokens_on(domain_id, topic).split("/"), token.split("/"), strict=True)
    )


@given(st.text() | st.lists(st.text(max_size=3), min_size=13, max_size=13).map("/".join))
def test_any_other_text_announces_nothing(text: str) -> None:
    assert announced_by(text) is None


@pytest.mark.parametrize(
    "token",
    [
        node_token(7, SESSION, "/lifeline"),
        FOREIGN.replace("/MP/", "/SS/"),
        FOREIGN.replace("@ros2_lv", "@ros3_lv"),
        f"{FOREIGN}/more",
    ],
)
def test_a_token_that_is_none_of_a_topic_announces_nothing(token: str) -> None:
    assert announced_by(token) is None


def test_a_name_from_the_network_is_shown_printable_and_not_too_long() -> None:
    announced = announced_by(FOREIGN.replace("/driver/", f"/a\x1b[2J\n{'d' * 300}/"))
    assert announced is not None
    assert announced.endpoint.node.startswith("/robot/arm/a?[2J?ddd")
    assert len(announced.endpoint.node) == 255


def test_a_subscription_to_another_definition_of_a_type_is_shown_as_another_type() -> None:
    token = endpoint_token(
        7, SESSION, "/base", 1, Kind.SUBSCRIPTION, "/cmd_vel", ros.TWIST, "TypeHashNotSupported"
    )
    humble = announced_by(token)
    assert humble is not None
    shown = with_hash(humble)
    assert shown.type_name == "geometry_msgs/msg/Twist of another ROS 2 release (TypeHashNotSupported)"
    sentence = wrong_types("/cmd_vel", ros.TWIST, [shown], "stamped")
    assert sentence is not None
    assert "/base uses geometry_msgs/msg/Twist of another ROS 2 release" in sentence
    jazzy = announced_by(token.replace("TypeHashNotSupported", TYPE_HASHES[ros.TWIST]))
    assert jazzy is not None
    assert with_hash(jazzy) == jazzy.endpoint
    unknown = announced_by(token.replace("Twist_", "Wrench_"))
    assert unknown is not None
    assert with_hash(unknown) == unknown.endpoint


@pytest.mark.parametrize("name", [name for name in TYPE_HASHES if "/msg/" in name])
def test_the_hash_of_a_message_follows_from_its_definition(name: str) -> None:
    assert STORE.hash_rihs01(name) == TYPE_HASHES[name]


def test_the_hash_of_the_service_follows_from_its_request_response_and_event() -> None:
    def of(name: str) -> FieldDesc:
        return (Nodetype.NAME, name)

    def at_most_one(name: str) -> FieldDesc:
        return (Nodetype.SEQUENCE, ((Nodetype.NAME, name), 1))

    request, response, event = (f"{TRIGGER}_{part}" for part in ("Request", "Response", "Event"))
    store = get_typestore(Stores.ROS2_JAZZY)
    answer: list[tuple[str, FieldDesc]] = [
        ("success", (Nodetype.BASE, ("bool", 0))),
        ("message", (Nodetype.BASE, ("string", 0))),
    ]
    observed = [
        ("info", of(EVENT_INFO)),
        ("request", at_most_one(request)),
        ("response", at_most_one(response)),
    ]
    parts = [
        ("request_message", of(request)),
        ("response_message", of(response)),
        ("event_message", of(event)),
    ]
    # ROS 2 translates `char` of a .msg file to uint8; rosbags does not.
    constants, info = store.fielddefs[EVENT_INFO]
    octets: FieldDesc = (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16))
    info = [(name, octets if name == "client_gid" else kind) for name, kind in info]
    store.fielddefs |= {
        EVENT_INFO: (constants, info),
        request: ([], []),
        response: ([], answer),
        event: ([], observed),
        TRIGGER: ([], parts),
    }
    assert store.hash_rihs01(TRIGGER) == TYPE_HASHES[TRIGGER]
