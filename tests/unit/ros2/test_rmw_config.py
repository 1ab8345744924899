"""`[ros2] rmw` and `router`."""

from typing import Any

import pytest

from ros2.config import Ros2Section, apart_from_hub
from wire.bus_config import BusConfig
from wire.host.config import BusSection, ConfigError, read_sections, same_endpoint


def read(document: dict[str, Any]) -> Ros2Section:
    return read_sections(document, {"bus": BusSection, "ros2": Ros2Section}, apart_from_hub)[Ros2Section]


def test_dds_is_the_default_and_its_router_is_ignored() -> None:
    assert read({"ros2": {"router": "tcp/127.0.0.1:7447"}}).rmw == "dds"


def test_the_session_has_the_domain_as_its_namespace_and_the_lease_of_the_bus() -> None:
    config = read({"ros2": {"rmw": "zenoh", "domain_id": 16}})
    assert config.to_router_config(BusSection(lease_s=0.2)) == BusConfig("tcp/127.0.0.1:7448", "16", 0.2)


@pytest.mark.parametrize("router", ["tcp/127.0.0.1:7447", "tcp/localhost:7447", "tcp/[::1]:7447"])
def test_the_router_and_the_hub_on_one_port_are_refused_with_the_key_to_change(router: str) -> None:
    with pytest.raises(ConfigError, match=r"give \[bus\] endpoint another port") as refused:
        read({"ros2": {"rmw": "zenoh", "router": router}})
    assert "ros2.router = " in str(refused.value)
    assert "[bus] endpoint = 'tcp/127.0.0.1:7447'" in str(refused.value)


@pytest.mark.parametrize(
    "router", ["127.0.0.1:7448", "tcp/127.0.0.1", "udp/127.0.0.1:7448", "tcp/127.0.0.1:0"]
)
def test_a_router_that_is_no_endpoint_is_refused(router: str) -> None:
    with pytest.raises(ConfigError, match=r"ros2\.router = .*expected PROTOCOL/HOST:PORT"):
        read({"ros2": {"rmw": "zenoh", "router": router}})


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("tcp/127.0.0.1:7447", "tcp/0.0.0.0:7447", True),
        ("tcp/[::]:7447", "tcp/localhost:7447", True),
        ("tcp/Robot:7447", "tcp/robot:7447", True),
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448", False),
        ("tcp/127.0.0.1:7447", "tcp/192.168.1.2:7447", False),
        ("tcp/192.168.1.3:7447", "tcp/192.168.1.2:7447", False),
    ],
)
def test_two_endpoints_are_the_same_if_both_cannot_be_listened_on(one: str, other: str, same: bool) -> None:  # noqa: FBT001 - a parameter
    assert same_endpoint(one, other) is same
    assert same_endpoint(other, one) is same
