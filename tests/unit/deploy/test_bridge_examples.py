"""The configurations of zenoh-bridge-ros2dds in deploy/examples use documented keys, and values that fit Lifeline's."""

import json
import re
from pathlib import Path
from typing import Any, cast

import pytest
import zenoh

from deploy.stack.launch import DEFAULT_CONFIG
from supervisor.config import SupervisorSection
from wire import topics
from wire.bus_config import BusConfig
from wire.zenoh import local_socket
from wire.zenoh.connect import TX_QUEUE

EXAMPLES = DEFAULT_CONFIG.parent / "examples"
SOURCES, CMD_VEL = EXAMPLES / "zenoh-bridge-sources.json5", EXAMPLES / "zenoh-bridge-cmd-vel.json5"

DOCUMENTED: dict[str, set[str]] = {
    "": {
        "nodename",
        "namespace",
        "domain",
        "ros_localhost_only",
        "ros_automatic_discovery_range",
        "ros_static_peers",
        "shm_enabled",
        "allow",
        "deny",
        "pub_max_frequencies",
        "pub_priorities",
        "reliable_routes_blocking",
        "queries_timeout",
        "transient_local_cache_multiplier",
        "work_thread_num",
        "max_block_thread_num",
    },
    "allow": {
        "publishers",
        "subscribers",
        "service_servers",
        "service_clients",
        "action_servers",
        "action_clients",
    },
    "queries_timeout": {"default", "transient_local_subscribers", "services", "actions"},
}
"""The keys of the plugin, by section.

Source: DEFAULT_CONFIG.json5 of github.com/eclipse-zenoh/zenoh-plugin-ros2dds, version 1.10.0 (commit 09d68c049936). The
plugin refuses any other key (`deny_unknown_fields` in zenoh-plugin-ros2dds/src/config.rs).
"""


def bridge(path: Path) -> dict[str, Any]:
    """Return the plugin's part of a configuration; Zenoh refuses keys that it does not know itself."""
    return json.loads(zenoh.Config.from_file(str(path)).get_json("plugins"))["ros2dds"]


def setting(path: Path, key: str) -> object:
    return json.loads(zenoh.Config.from_file(str(path)).get_json(key))


@pytest.mark.parametrize("path", [SOURCES, CMD_VEL])
def test_the_bridge_documents_every_key(path: Path) -> None:
    plugin = bridge(path)
    assert plugin.keys() <= DOCUMENTED[""]
    for section in ("allow", "queries_timeout"):
        assert plugin.get(section, {}).keys() <= DOCUMENTED[section]
    assert plugin["allow"].keys() == DOCUMENTED["allow"], "what is not named is not bridged either; say so"


@pytest.mark.parametrize("path", [SOURCES, CMD_VEL])
def test_a_bridge_uses_the_socket_since_any_user_can_play_the_hub_at_the_endpoint(path: Path) -> None:
    (socket,) = cast("list[str]", setting(path, "connect/endpoints"))
    port = BusConfig().endpoint.rpartition(":")[2]
    assert socket.startswith(f"{local_socket.PROTOCOL}//home/")
    assert socket.endswith(f"{local_socket.UNDER_HOME}/NETWORK-{port}.sock")


@pytest.mark.parametrize("path", [SOURCES, CMD_VEL])
def test_the_bridge_connects_as_every_client_of_the_hub(path: Path) -> None:
    config = BusConfig()
    assert setting(path, "mode") == "client"
    assert setting(path, "scouting/multicast/enabled") is False
    assert setting(path, "scouting/gossip/enabled") is False
    assert setting(path, "transport/link/tx/lease") == config.lease_s * 1000
    assert setting(path, "transport/link/tx/queue/size/real_time") == TX_QUEUE
    assert setting(path, "transport/shared_memory/enabled") is False
    assert bridge(path)["namespace"] == f"/{config.namespace}"


def test_only_keys_of_lifeline_are_bridged_and_cmd_vel_alone_to_the_base() -> None:
    sources, base = bridge(SOURCES)["allow"], bridge(CMD_VEL)["allow"]
    names = [source.name for source in SupervisorSection().sources]
    known = {topics.SCAN.key, topics.ODOM.key, topics.ESTOP.key, *(f"{name}/cmd_vel" for name in names)}
    assert {name.removeprefix("/") for name in sources.pop("publishers")} <= known
    assert sources.pop("service_clients") == [f"/{topics.SUPERVISOR_RESET.key}"]
    assert base.pop("subscribers") == [f"/{topics.CMD_VEL.key}"]
    assert not any(sources.values())
    assert not any(base.values())


def test_no_name_is_a_pattern_that_matches_another_name() -> None:
    """The bridge takes each name as a regular expression."""
    for path in (SOURCES, CMD_VEL):
        for names in bridge(path)["allow"].values():
            assert all(re.escape(name) == name for name in names)


def test_two_bridges_have_two_names() -> None:
    assert bridge(SOURCES)["nodename"] != bridge(CMD_VEL)["nodename"]
