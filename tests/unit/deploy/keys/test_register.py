"""The register: who may get which certificate, and what a revocation changes."""

import json
import math
from typing import Any

import pytest

from deploy.keys.register import (
    SOON_S,
    Issued,
    RefusedError,
    Register,
    Request,
    from_json,
    rows,
    subject_of,
    to_json,
    warnings,
)
from wire.roles import Role

NOW_S = 1_800_000_000.0
DAY_S = 86400.0
ALICE = Issued("alice", Role.OPERATOR, "robot", (), "1", NOW_S + 30 * DAY_S)
HUB = Issued(
    "robot7", Role.SUPERVISOR, "robot", ("robot7", "localhost", "127.0.0.1", "::1"), "2", NOW_S + 30 * DAY_S
)
BOTH = Register((ALICE, HUB))


def request(
    name: str, role: Role | None = None, robot: str | None = None, hosts: tuple[str, ...] | None = None
) -> Request:
    return Request(name, role, robot, hosts)


def refusal(register: Register, asked: Request) -> str:
    with pytest.raises(RefusedError) as caught:
        subject_of(register, asked)
    return str(caught.value)


def test_a_new_name_needs_a_role_and_is_for_the_default_robot() -> None:
    assert subject_of(Register(), request("bob", Role.VIEWER)) == ("bob", Role.VIEWER, "robot", ())
    assert "give --role, one of supervisor, base, sensor" in refusal(Register(), request("bob"))


def test_a_renewal_needs_only_the_name() -> None:
    assert subject_of(BOTH, request("alice")) == ("alice", Role.OPERATOR, "robot", ())
    assert subject_of(BOTH, request("robot7")) == ("robot7", Role.SUPERVISOR, "robot", HUB.hosts)


def test_a_supervisor_is_always_reached_by_loopback_too() -> None:
    new = subject_of(BOTH, request("robot7", hosts=("10.0.0.7", "localhost")))
    assert new[3] == ("10.0.0.7", "localhost", "127.0.0.1", "::1")


def test_a_name_keeps_its_role_and_robot() -> None:
    assert "alice is operator@robot: choose another name for viewer@robot" in refusal(
        BOTH, request("alice", Role.VIEWER)
    )
    assert "operator@r2" in refusal(BOTH, request("alice", robot="r2"))


def test_a_revoked_name_gets_no_certificate_of_any_authority() -> None:
    revoked = BOTH.with_revoked("alice", NOW_S)
    assert "alice was revoked on 2027-01-15" in refusal(revoked, request("alice"))
    assert "alice was revoked" in refusal(Register((), revoked.revoked), request("alice", Role.OPERATOR))
    subject_of(revoked, request("robot7"))


def test_only_a_name_with_a_certificate_can_be_revoked_and_only_once() -> None:
    with pytest.raises(
        RefusedError, match="no certificate was issued to bob; names with a certificate: alice, robot7"
    ):
        BOTH.with_revoked("bob", NOW_S)
    with pytest.raises(RefusedError, match="names with a certificate: none"):
        Register().with_revoked("bob", NOW_S)
    with pytest.raises(RefusedError, match="alice was already revoked on 2027-01-15"):
        BOTH.with_revoked("alice", NOW_S).with_revoked("alice", NOW_S)


@pytest.mark.parametrize("name", ["", "Alice", "a b", "../a", ".a", "-a", "a" * 33, "é", "a\n"])
def test_a_name_that_is_no_file_name_is_refused(name: str) -> None:
    assert "is not a name" in refusal(Register(), request(name, Role.VIEWER))


@pytest.mark.parametrize("robot", ["", "R7", "a/b", "7", "*", "r" * 33])
def test_a_namespace_that_no_robot_can_have_is_refused(robot: str) -> None:
    if robot:
        assert "is not a robot's namespace" in refusal(Register(), request("bob", Role.VIEWER, robot))


@pytest.mark.parametrize("role", [Role.ESTOP, Role.OPERATOR])
def test_a_station_names_hosts_only_if_they_are_given_and_keeps_them(role: Role) -> None:
    assert subject_of(Register(), request("phone", role))[3] == ()
    hosts = subject_of(Register(), request("phone", role, hosts=("10.0.0.7",)))[3]
    assert hosts == ("10.0.0.7", "localhost", "127.0.0.1", "::1")
    issued = Issued("phone", role, "robot", hosts, "3", NOW_S + DAY_S)
    assert subject_of(Register((issued,)), request("phone"))[3] == hosts


def test_a_host_is_a_name_or_an_address_and_only_for_what_listens() -> None:
    for host in ("robot7:7447", "a b", "", "-a", "robot7.", "é"):
        assert "is not a host" in refusal(Register(), request("r", Role.SUPERVISOR, hosts=(host,)))
    for host in ("robot7", "robot7.example.org", "192.168.1.7", "fe80::1"):
        assert host in subject_of(Register(), request("r", Role.SUPERVISOR, hosts=(host,)))[3]
    assert "--host is for the roles supervisor, router, estop, operator only" in refusal(
        Register(), request("b", Role.BASE, hosts=("a",))
    )


def test_a_name_ends_with_the_last_of_its_certificates() -> None:
    """A renewal does not end the certificate before it."""
    longer = Issued("alice", Role.OPERATOR, "robot", (), "0", NOW_S + 60 * DAY_S)
    register = Register((longer, ALICE))
    assert register.latest("alice") is ALICE
    assert register.ends_s("alice") == longer.ends_s
    assert register.ends_s("bob") == 0.0


def test_ended_certificates_are_forgotten_but_not_their_names() -> None:
    old = Issued("alice", Role.OPERATOR, "robot", (), "0", NOW_S)
    kept = Register((old, ALICE)).without_ended(NOW_S)
    assert kept.issued == (ALICE,)
    assert Register((old,)).without_ended(NOW_S + DAY_S).issued == (old,)
    assert kept.with_issued(HUB).issued == (ALICE, HUB)


def test_a_certificate_that_ends_within_three_days_gives_a_warning() -> None:
    just_before = rows(BOTH, math.nextafter(ALICE.ends_s - SOON_S, 0.0))
    assert warnings(just_before) == []
    soon = warnings(rows(BOTH, ALICE.ends_s - SOON_S + 1.0))
    assert len(soon) == 2
    assert soon[0].startswith("alice ends on 2027-02-14")
    assert "`lifeline keys issue alice`" in soon[0]
    assert warnings(rows(Register((ALICE,)), ALICE.ends_s + 1.0))[0].startswith("alice ended on 2027-02-14")
    assert warnings(rows(Register((ALICE,), {"alice": NOW_S}), ALICE.ends_s)) == []


def test_the_rows_are_sorted_and_show_what_is_revoked() -> None:
    table = rows(Register((HUB, ALICE), {"alice": NOW_S}), NOW_S)
    assert [row.name for row in table] == ["alice", "robot7"]
    assert table[0].revoked == "2027-01-15 08:00 UTC"
    assert table[1].revoked == ""
    assert table[1].days_left == 30.0


def test_the_register_can_be_read_from_its_file() -> None:
    register = Register((ALICE, HUB), {"carol": NOW_S})
    assert from_json(json.loads(json.dumps(to_json(register)))) == register


NO_REGISTERS: list[object] = [
    None,
    [],
    {},
    {"issued": [{}], "revoked": {}},
    {"issued": [], "revoked": []},
    {"issued": 1, "revoked": {}},
]


@pytest.mark.parametrize("document", NO_REGISTERS)
def test_what_is_no_register_is_refused(document: object) -> None:
    with pytest.raises(ValueError, match="register"):
        from_json(document)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", "\x1b[31m"),
        ("name", None),
        ("robot", "[red]"),
        ("ends_s", 1e18),
        ("ends_s", -1.0),
        ("ends_s", None),
    ],
)
def test_a_register_with_a_wrong_value_is_refused(key: str, value: object) -> None:
    document: dict[str, Any] = {
        "issued": [
            {"name": "alice", "role": "operator", "robot": "robot", "hosts": [], "serial": "1", "ends_s": 2e9}
        ],
        "revoked": {"eve": 1e9},
    }
    assert from_json(document).latest("alice") is not None
    document["issued"][0][key] = value
    with pytest.raises(ValueError, match="not a"):
        from_json(document)
