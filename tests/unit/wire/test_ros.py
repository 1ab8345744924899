"""Our copy of ROS 2's messages is ROS 2's: the same fields, the same hash, the same bytes."""

from dataclasses import fields, is_dataclass
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from wire import messages, ros
from wire.messages import definition

TYPES: list[Any] = [t for t in vars(ros).values() if is_dataclass(t)]

_jazzy = get_typestore(Stores.ROS2_JAZZY)


def test_every_type_is_there() -> None:
    assert len(TYPES) == 18


@pytest.mark.parametrize("message_type", TYPES, ids=lambda message_type: message_type.__name__)
def test_a_type_is_what_rosbags_says_that_jazzy_has(message_type: Any) -> None:  # noqa: ANN401 - any of them
    name = message_type.__msgtype__
    constants, members = _jazzy.fielddefs[name]
    assert [field.name for field in fields(message_type)] == [name for name, _ in members]
    assert {constant: getattr(message_type, constant) for constant, _, _ in constants} == {
        constant: value for constant, _, value in constants
    }
    assert definition(name) == (
        _jazzy.generate_msgdef(name, ros_version=2)[0],
        _jazzy.hash_rihs01(name),
    )


def test_a_message_of_every_depth_has_the_bytes_that_rosbags_gives_it() -> None:
    message = messages.odometry((1.0, 2.0, 0.5), (0.3, -0.1), time_ns=1_500_000_000)
    assert messages.encode(message) == bytes(_jazzy.serialize_cdr(message, message.__msgtype__))
