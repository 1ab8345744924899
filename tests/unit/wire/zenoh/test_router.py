"""The configuration of a router: who may send what to whom (the router itself: tests/system/test_router.py)."""

from pathlib import Path
from typing import Any, cast

import pytest

from tests.unit.wire.test_tls import bundle
from wire import topics
from wire.access import BEHIND_A_ROUTER, HUB_ENTRY, Contract, grants_of
from wire.host.config import BusSection, ConfigError, section
from wire.roles import ANY, Role, common_name
from wire.zenoh import limits
from wire.zenoh.router import RouterConfig, access_control, dial, nested, region_name, settings

ROBOTS = ("robot1", "robot2")
WRITES = {"put", "reply", "declare_queryable", "liveliness_token", "query"}


def allowed(*, has_local: bool = False) -> dict[str, list[dict[str, Any]]]:
    """Return the rules by subject."""
    config = RouterConfig((), ROBOTS, sources=("teleop",), stations=("door",))
    made: dict[str, Any] = access_control(config, has_local=has_local)
    assert (made["enabled"], made["default_permission"]) == (True, "deny")
    rules = {rule["id"]: rule for rule in made["rules"]}
    return {
        policy["subjects"][0]: [rules[name] for name in policy["rules"]]
        for policy in cast("list[dict[str, Any]]", made["policies"])
    }


def keys_in(rules: list[dict[str, Any]], flow: str, messages: set[str] = WRITES) -> set[str]:
    return {
        key
        for rule in rules
        if rule["flows"] == [flow] and messages & set(rule["messages"])
        for key in rule["key_exprs"]
    }


@pytest.mark.parametrize("role", [Role.OPERATOR, Role.ESTOP])
def test_a_station_of_one_robot_sends_nothing_to_another(role: Role) -> None:
    sent = keys_in(allowed()[common_name(role, "robot1")], "ingress")
    assert sent
    assert all(key.startswith("robot1/") for key in sent)


def test_an_operator_of_any_robot_writes_what_the_operators_of_each_may_and_no_wildcard_of_robots() -> None:
    rules = allowed()
    one_by_one = {key for robot in ROBOTS for key in keys_in(rules[f"operator@{robot}"], "ingress")}
    assert keys_in(rules["operator@any"], "ingress") == one_by_one
    assert not any(key.startswith("*") for key in one_by_one)


def test_an_operator_writes_no_key_of_the_supervisor_or_the_base() -> None:
    put = keys_in(allowed()["operator@any"], "ingress", {"put"})
    assert "robot1/teleop/cmd_vel" in put
    for key in (topics.CMD_VEL.key, topics.STATUS.key, topics.SCAN.key, topics.ODOM.key):
        assert f"robot1/{key}" not in put


def test_an_estop_station_proves_its_presence_and_hears_its_challenge() -> None:
    rules = allowed()["estop@robot1"]
    assert f"robot1/{topics.estop_presence('door').key}" in keys_in(rules, "ingress", {"put"})
    assert f"robot1/{topics.alive(topics.estop_node('door'))}/**" in keys_in(
        rules, "ingress", {"liveliness_token"}
    )
    assert f"robot1/{topics.estop_challenge('door').key}" not in keys_in(rules, "ingress", {"put"})


@pytest.mark.parametrize("namespace", ["robot1", ANY])
def test_a_viewer_only_reads(namespace: str) -> None:
    assert keys_in(allowed()[f"viewer@{namespace}"], "ingress") == set()


def test_a_hub_stays_in_its_namespace() -> None:
    rules = allowed()["supervisor@robot1"]
    assert keys_in(rules, "ingress") == keys_in(rules, "egress") == {"robot1/**"}


def test_a_reader_of_one_robot_receives_nothing_of_another() -> None:
    rules = allowed()
    assert keys_in(rules["viewer@robot1"], "egress") == {"robot1/**"}
    assert keys_in(rules["viewer@any"], "egress") == {"*/**"}


def test_only_the_listed_robots_have_rights_and_programs_of_this_machine_if_they_need_no_certificate() -> (
    None
):
    assert set(allowed()) == {
        *(f"{role}@{robot}" for role in ("supervisor", "operator", "estop", "viewer") for robot in ROBOTS),
        *(f"{role}@any" for role in ("operator", "estop", "viewer", "router")),
    }
    assert keys_in(allowed(has_local=True)["local"], "ingress") >= {"robot1/**", "robot2/**"}


def test_nobody_deletes() -> None:
    rules = [rule for of_subject in allowed(has_local=True).values() for rule in of_subject]
    assert not any("delete" in rule["messages"] for rule in rules)


def test_the_hub_takes_from_its_router_what_operators_and_stations_may_send_and_nothing_else() -> None:
    contract = Contract(("teleop", "joy"), ("scan",), ("camera/**",))

    def sent(role: Role) -> set[tuple[str, str]]:
        return {
            (message, key)
            for grant in grants_of(role, "robot1", contract)
            if grant.flow == "ingress"
            for message in grant.messages
            if message in WRITES
            for key in grant.keys
            if key != HUB_ENTRY
        }

    assert sent(Role.ROUTER) == set[tuple[str, str]]().union(*map(sent, BEHIND_A_ROUTER))
    assert ("put", "robot1/scan") not in sent(Role.ROUTER)


def test_no_router_of_others_is_above_a_hub() -> None:
    assert limits.gateway(None) == {"south": [{"filters": [{"modes": ["router", "peer", "client"]}]}]}
    filters = cast("Any", limits.gateway("ours"))["south"][0]["filters"]
    assert filters == [{"modes": ["peer", "client"]}, {"region_names": ["ours"], "negated": True}]


def test_the_region_name_belongs_to_the_authority_and_fits_into_zenohs_limit() -> None:
    names = {region_name(authority) for authority in (None, b"one", b"other")}
    assert len(names) == 3
    assert all(len(name) <= 32 for name in names)


def test_a_router_without_certificates_has_no_tls_and_one_with_them_demands_both_sides() -> None:
    config = RouterConfig(("tcp/127.0.0.1:1",), ROBOTS)
    assert "transport/link/tls" not in settings(config, None, "x")
    values: dict[str, Any] = settings(
        RouterConfig(("quic/h:1",), ROBOTS, Path("/k")), bundle(Role.ROUTER), "x"
    )
    assert values["transport/link/tls"]["enable_mtls"] is True
    assert values["listen/endpoints"] == ["quic/h:1?mixed_rel=1"]
    assert values["transport/unicast/max_sessions"] == limits.MAX_SESSIONS
    few: dict[str, Any] = settings(config, None, "x", 300)
    assert few["transport/unicast/max_sessions"] < limits.MAX_SESSIONS


def test_the_document_for_zenohd_has_the_same_values() -> None:
    document = nested({"mode": "router", "a/b": 1, "a/c/d": [2]})
    assert document == {"mode": "router", "a": {"b": 1, "c": {"d": [2]}}}


def test_a_hub_dials_in_the_background() -> None:
    assert dial(["quic/site:1"])["connect/endpoints"] == ["quic/site:1?mixed_rel=1"]
    assert dial([])["connect/exit_on_failure"] is False


def test_routers_on_other_computers_need_certificates() -> None:
    def refusal(**bus: object) -> str:
        with pytest.raises(ConfigError) as caught:
            section({"bus": bus}, "bus", BusSection)
        return str(caught.value)

    assert "bus.routers.0" in refusal(routers=["tls/site:7448"])
    assert "tls/ or quic/" in refusal(routers=["tcp/10.0.0.1:7448"], keys="/k")
    assert "expected PROTOCOL/HOST:PORT" in refusal(routers=["site"])
    assert "passes no command on" in refusal(routers=["tcp/127.0.0.1:7448"])
    local = {"routers": ["tcp/127.0.0.1:7448"], "without_certificate": "participant"}
    here = section({"bus": local}, "bus", BusSection).to_bus_config()
    assert (here.routers, here.is_hub_secure) == (("tcp/127.0.0.1:7448",), False)
    site = section({"bus": {"routers": ["tls/site:7448"], "keys": "/k"}}, "bus", BusSection).to_bus_config()
    assert site.is_hub_secure
