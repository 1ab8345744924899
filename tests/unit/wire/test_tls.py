"""Endpoints with certificates: what they need, and which bundle fits."""

from pathlib import Path

import pytest

from wire import tls
from wire.bundle import Bundle
from wire.host.config import BusSection, ConfigError, read_toml, section
from wire.roles import ANY, SERVERS, Role

ENDS_S = 1_800_000_000.0


def bundle(role: Role = Role.SUPERVISOR, namespace: str = "robot") -> Bundle:
    hosts = ("robot7", "10.0.0.7", "0:0:0:0:0:0:0:1") if role in SERVERS else ()
    names = (Path(f"/k/{name}") for name in ("authority.pem", "x.pem", "x.key"))
    return Bundle("x", role, namespace, hosts, ENDS_S, *names)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7447", "tls/[::1]:7447", "quic/robot7:7447?mixed_rel=0"])
def test_the_port_of_an_endpoint_is_what_follows_its_host(endpoint: str) -> None:
    assert tls.port_of(endpoint) == "7447"


@pytest.mark.parametrize(
    ("endpoint", "for_zenoh"),
    [
        ("quic/robot7:7447", "quic/robot7:7447?mixed_rel=1"),
        ("quic/robot7:7447?mixed_rel=0", "quic/robot7:7447?mixed_rel=0"),
        ("tls/robot7:7447", "tls/robot7:7447"),
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"),
    ],
)
def test_only_quic_gets_mixed_reliability_unless_the_endpoint_decides(endpoint: str, for_zenoh: str) -> None:
    assert tls.zenoh_endpoint(endpoint) == for_zenoh
    assert section({"bus": {"endpoint": endpoint, "keys": "/k"}}, "bus", BusSection).endpoint == endpoint


@pytest.mark.parametrize(
    ("endpoint", "for_client"),
    [
        ("quic/0.0.0.0:7447", "quic/127.0.0.1:7447"),
        ("tls/[::]:7447", "tls/127.0.0.1:7447"),
        ("quic/0.0.0.0:7447?mixed_rel=0", "quic/127.0.0.1:7447?mixed_rel=0"),
        ("tcp/10.0.0.0:7447", "tcp/10.0.0.0:7447"),
        ("quic/robot7:7447", "quic/robot7:7447"),
    ],
)
def test_a_client_reaches_a_hub_that_listens_on_every_address_by_loopback(
    endpoint: str, for_client: str
) -> None:
    assert tls.client_endpoint(endpoint) == for_client


@pytest.mark.parametrize(
    "endpoint", ["tls/h:1?mixed_rel=1", "tcp/h:1?mixed_rel=1", "quic/h:1?mixed_rel=2", "quic/h:1?x=1"]
)
def test_other_options_of_an_endpoint_are_refused(endpoint: str) -> None:
    with pytest.raises(ConfigError, match="expected PROTOCOL/HOST:PORT"):
        section({"bus": {"endpoint": endpoint, "keys": "/k"}}, "bus", BusSection)


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_an_endpoint_with_tls_is_refused_without_keys(protocol: str) -> None:
    with pytest.raises(ConfigError, match=rf"{protocol}/h:1 needs certificates.*--keys"):
        section({"bus": {"endpoint": f"{protocol}/h:1"}}, "bus", BusSection)


def test_keys_with_tcp_are_allowed() -> None:
    assert section({"bus": {"keys": "/k"}}, "bus", BusSection).to_bus_config().keys == Path("/k")
    assert section({}, "bus", BusSection).to_bus_config().keys is None


def test_keys_in_a_file_are_beside_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    file = tmp_path / "robot.toml"

    def keys_of(text: str) -> Path | None:
        file.write_text(f"[bus]\nkeys = {text}\n")
        return section(read_toml(file), "bus", BusSection).to_bus_config().keys

    assert keys_of('"hub"') == tmp_path / "hub"
    assert keys_of('"/etc/keys"') == Path("/etc/keys")
    assert keys_of('"~/keys"') == Path("/home/someone/keys")
    for wrong in ('""', "7", '"~nobody-here/keys"'):
        with pytest.raises(ConfigError, match=r"bus\.keys"):
            keys_of(wrong)


def test_no_robot_has_the_name_that_stands_for_all() -> None:
    with pytest.raises(ConfigError, match="stands for all robots"):
        section({"bus": {"namespace": ANY}}, "bus", BusSection)


@pytest.mark.parametrize(
    ("endpoint", "fits"),
    [
        ("quic/0.0.0.0:1", True),
        ("quic/[::]:1", True),
        ("quic/robot7:1", True),
        ("quic/ROBOT7:1?mixed_rel=1", True),
        ("quic/10.0.0.7:1", True),
        ("tls/[::1]:1", True),
        ("quic/robot8:1", False),
        ("tls/10.0.0.8:1", False),
    ],
)
def test_a_hub_listens_only_where_its_certificate_is_for(endpoint: str, fits: bool) -> None:  # noqa: FBT001 - a parameter
    sentence = tls.misfit(bundle(), endpoint, "robot", server=Role.SUPERVISOR)
    assert (sentence is None) is fits
    assert fits or "--host" in str(sentence)


@pytest.mark.parametrize("role", [role for role in Role if role not in SERVERS])
def test_only_a_supervisor_is_the_hub_but_each_role_connects(role: Role) -> None:
    assert f"has the role {role}" in str(
        tls.misfit(bundle(role), "quic/0.0.0.0:1", "robot", server=Role.SUPERVISOR)
    )
    assert tls.misfit(bundle(role), "quic/robot7:1", "robot", server=None) is None


def test_a_client_is_no_supervisor() -> None:
    for role in SERVERS:
        assert "--role base" in str(tls.misfit(bundle(role), "quic/robot7:1", "robot", server=None))


def test_a_router_and_a_supervisor_do_not_stand_in_for_each_other() -> None:
    for role, other in (SERVERS, SERVERS[::-1]):
        assert tls.misfit(bundle(role), "tls/robot7:1", "robot", server=role) is None
        assert f"--role {other}" in str(tls.misfit(bundle(role), "tls/robot7:1", "robot", server=other))


def test_a_hub_that_only_dials_with_its_certificate_listens_anywhere() -> None:
    assert tls.misfit(bundle(), "tcp/127.0.0.1:1", "robot", server=Role.SUPERVISOR) is None


def test_a_bundle_for_another_robot_does_not_fit() -> None:
    for server in (Role.SUPERVISOR, None):
        sentence = tls.misfit(bundle(namespace="r7"), "quic/robot7:1", "robot", server=server)
        assert "is for the robot r7, not for robot" in str(sentence)
        of_all = bundle(server or Role.VIEWER, ANY)
        assert tls.misfit(of_all, "quic/robot7:1", "robot", server=server) is None


def test_a_client_cannot_check_an_ipv6_address() -> None:
    assert "IPv6" in str(tls.misfit(bundle(Role.VIEWER), "quic/[::1]:1", "robot", server=None))


def test_a_certificate_that_ends_within_three_days_is_reported() -> None:
    assert tls.ends_soon(bundle(), ENDS_S - tls.SOON_S) is None
    assert "ends in 3.0 days" in str(tls.ends_soon(bundle(), ENDS_S - tls.SOON_S + 1.0))
    assert "ends in 12.0 hours" in str(tls.ends_soon(bundle(), ENDS_S - 43200.0))


def test_a_certificate_that_has_ended_names_the_next_step() -> None:
    assert "restart the supervisor" in tls.has_ended(bundle())
    assert "restart" not in tls.has_ended(bundle(Role.OPERATOR))


@pytest.mark.parametrize(
    ("name", "is_hub"),
    [
        ("supervisor@robot", True),
        ("router@any", True),
        ("router", False),
        ("operator@robot", False),
        ("www.example.org", False),
        (None, False),
    ],
)
def test_only_a_supervisor_or_a_router_is_accepted_as_the_hub(name: str | None, is_hub: bool) -> None:  # noqa: FBT001 - a parameter
    assert tls.is_hub_name(name) is is_hub


def test_every_setting_demands_certificates_on_both_sides() -> None:
    values = tls.settings(bundle())
    assert (
        values["enable_mtls"]
        is values["verify_name_on_connect"]
        is values["close_link_on_expiration"]
        is True
    )
    assert values["root_ca_certificate"] == "/k/authority.pem"
    assert values["connect_private_key"] == values["listen_private_key"] == "/k/x.key"
    assert values["connect_certificate"] == values["listen_certificate"] == "/k/x.pem"


@pytest.mark.parametrize(
    ("bus", "lease_s"),
    [
        ({}, 0.4),
        ({"endpoint": "tls/robot7:7447", "keys": "k"}, 0.4),
        ({"endpoint": "quic/robot7:7447", "keys": "k"}, 2.0),
        ({"keys": "k", "routers": ["quic/site:7448"]}, 2.0),
        ({"endpoint": "quic/robot7:7447", "keys": "k", "lease_s": 0.5}, 0.5),
    ],
)
def test_a_silent_link_over_quic_counts_as_alive_for_longer(bus: dict[str, object], lease_s: float) -> None:
    assert section({"bus": bus}, "bus", BusSection).to_bus_config().lease_s == lease_s
