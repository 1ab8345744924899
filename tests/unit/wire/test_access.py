"""The allow-list: what it contains, and what no rule may ever permit (the hub itself: tests/system/test_access.py)."""

from fnmatch import fnmatchcase
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wire import topics
from wire.access import LOCAL_ROLES, Contract, access_control, grants_of
from wire.roles import ANY, Role, common_name

CONTRACT = Contract(("teleop", "joy"), ("scan", "rear/scan"), ("camera/**",))
PROTECTED = (
    topics.CMD_VEL.key,
    topics.STATUS.key,
    topics.alive(topics.SUPERVISOR),
    topics.SUPERVISOR_RESET.key,
)
WRITES = {"put", "delete", "declare_queryable", "reply", "liveliness_token"}


def rules_of(configuration: dict[str, object]) -> list[dict[str, Any]]:
    return cast("list[dict[str, Any]]", configuration["rules"])


def test_what_is_not_listed_is_refused() -> None:
    configuration = access_control("robot", CONTRACT)
    assert (configuration["enabled"], configuration["default_permission"]) == (True, "deny")
    assert {rule["permission"] for rule in rules_of(configuration)} == {"allow"}


def test_each_rule_has_its_own_name_and_belongs_to_one_subject() -> None:
    configuration = access_control("robot", CONTRACT)
    names = [rule["id"] for rule in rules_of(configuration)]
    policies = cast("list[dict[str, Any]]", configuration["policies"])
    used = [name for policy in policies for name in policy["rules"]]
    assert sorted(names) == sorted(used)
    assert len(set(names)) == len(names)


def test_a_role_is_the_common_name_of_a_certificate_and_local_programs_have_none() -> None:
    subjects = cast("list[dict[str, Any]]", access_control("robot7", CONTRACT)["subjects"])
    by_name = {subject["id"]: subject for subject in subjects}
    assert by_name["operator"]["cert_common_names"] == ["operator@robot7", common_name(Role.OPERATOR, ANY)]
    assert not any("cert_common_names" in by_name[name] for name in ("local", "unproven"))
    assert "supervisor" not in by_name


@pytest.mark.parametrize("role", [role for role in Role if role is not Role.SUPERVISOR])
def test_no_role_writes_what_is_the_supervisors(role: Role) -> None:
    for grant in grants_of(role, "robot", CONTRACT):
        if grant.flow == "ingress" and WRITES & {*grant.messages}:
            for key in grant.keys:
                pattern = key.replace("$*", "*").replace("**", "*")
                assert not any(fnmatchcase(f"robot/{own}", pattern) for own in PROTECTED), key


@given(st.sampled_from(LOCAL_ROLES))
def test_nobody_deletes(role: Role) -> None:
    assert not any("delete" in grant.messages for grant in grants_of(role, "robot", CONTRACT))


def test_a_viewer_only_reads() -> None:
    for grant in grants_of(Role.VIEWER, "robot", CONTRACT):
        assert grant.flow == "egress" or not WRITES & {*grant.messages}


@pytest.mark.parametrize(
    ("unproven", "may"), [((Role.VIEWER,), {"local"}), (LOCAL_ROLES, {"local", "unproven"})]
)
def test_only_participants_of_this_machine_may_be_unknown_sources(
    unproven: tuple[Role, ...], may: set[str]
) -> None:
    unknown = f"robot/{topics.source_cmd_vel('*').key}"
    rules = rules_of(access_control("robot", CONTRACT, unproven))
    assert {rule["id"].split()[0] for rule in rules if unknown in rule["key_exprs"]} == may


def test_the_socket_makes_a_participant_and_tcp_alone_a_viewer() -> None:
    configuration = access_control("robot", CONTRACT)
    subjects = cast("list[dict[str, Any]]", configuration["subjects"])
    links = {subject["id"]: subject.get("link_protocols") for subject in subjects}
    assert (links["local"], links["unproven"]) == (["unixsock-stream"], ["tcp"])
    writers = {
        rule["id"].split()[0]
        for rule in rules_of(configuration)
        if rule["flows"] == ["ingress"] and WRITES & {*rule["messages"]}
    }
    assert "local" in writers
    assert "unproven" not in writers


def test_every_topic_but_the_supervisors_has_a_role_that_writes_it() -> None:
    for topic in topics.TOPICS:
        assert bool(topic.roles) == (not topics.is_supervisors(topic.key)), topic.key
    for service in topics.SERVICES:
        assert bool(service.roles) == (service is not topics.SUPERVISOR_RESET), service.key
