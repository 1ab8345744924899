"""robot.toml: every error names its path, its value and the permitted values."""

import time
from pathlib import Path

import pytest
from pydantic import ValidationError

from supervisor.config import SupervisorSection
from wire.access import LOCAL_ROLES
from wire.host.config import BusSection, ConfigError, absolute, read_toml, section
from wire.roles import Role
from wire.tls import is_loopback


def refusal(document: dict[str, object], name: str = "supervisor") -> str:
    with pytest.raises(ConfigError) as caught:
        section(document, name, SupervisorSection if name == "supervisor" else BusSection)
    return str(caught.value)


def test_every_key_has_a_default() -> None:
    assert section({}, "supervisor", SupervisorSection).command_timeout_s == 0.2
    assert section({}, "bus", BusSection).endpoint == "tcp/127.0.0.1:7447"


@pytest.mark.parametrize("value", [0, 0.0, -0.1, float("nan"), float("inf"), "0.2", True])
def test_nothing_is_switched_off_by_a_magic_value(value: object) -> None:
    message = refusal({"supervisor": {"command_timeout_s": value}})
    assert "supervisor.command_timeout_s" in message
    assert repr(value) in message


def test_all_faults_are_named_at_once() -> None:
    message = refusal({"supervisor": {"stop_distance_m": -1.0, "tick_hz": 0, "stop_distanse_m": 0.3}})
    assert all(f"supervisor.{key}" in message for key in ("stop_distance_m", "tick_hz", "stop_distanse_m"))


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"command_timeout_s": 0.02}, "command_timeout_s"),
        ({"scan_timeout_s": 0.01}, "scan_timeout_s"),
        ({"warning_distance_m": 0.2}, "warning_distance_m"),
        ({"footprint": {"radius_m": 0.2, "corners_m": [[0, 0], [1, 0], [0, 1]]}}, "footprint"),
        ({"footprint": {"corners_m": [[0, 0], [0, 1], [1, 0]]}}, "convex"),
        ({"sources": []}, "sources"),
        ({"sources": [{"name": "a", "priority": 1}, {"name": "a", "priority": 2}]}, "name of its own"),
        ({"sources": [{"name": "no/slash", "priority": 1}]}, "sources.0.name"),
    ],
)
def test_what_does_not_fit_together_is_refused(values: dict[str, object], key: str) -> None:
    assert key in refusal({"supervisor": values})


@pytest.mark.parametrize(
    "endpoint", ["", "127.0.0.1:7447", "tcp/127.0.0.1", "tcp/127.0.0.1:0", "udp/1.2.3.4:7"]
)
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    assert "tcp/127.0.0.1:7447" in refusal({"bus": {"endpoint": endpoint}}, "bus")


def test_loopback_is_distinguished_from_the_network() -> None:
    assert is_loopback("tcp/127.0.0.1:7447")
    assert is_loopback("tcp/[::1]:7447")
    assert is_loopback("tcp/localhost:7447")
    assert not is_loopback("tcp/0.0.0.0:7447")
    assert not is_loopback("tcp/robot.local:7447")


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xef\xbb\xbf[bus]\nlease_s = 2.0\n")
    assert read_toml(path) == {"bus": {"lease_s": 2.0}}


def test_the_home_of_nobody_is_no_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "/home/somebody")
    assert absolute(Path("a/b")) == tmp_path / "a/b"
    assert absolute(Path("~/b")) == Path("/home/somebody/b")
    with pytest.raises(ConfigError, match=r"^~no-such-user/b: there is no user ~no-such-user"):
        absolute(Path("~no-such-user/b"))


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read .* deploy/robot\.toml is a complete example"):
        read_toml(tmp_path / "absent.toml")


def test_a_file_that_is_no_toml_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[supervisor\n")
    with pytest.raises(ConfigError, match="is not TOML"):
        read_toml(path)


def test_a_section_that_nobody_reads_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[supervisr]\ntick_hz = 50\n")
    with pytest.raises(ConfigError, match=r"unknown section \[supervisr\]"):
        read_toml(path)


def test_an_entry_that_is_refused_is_not_also_missing() -> None:
    message = refusal({"supervisor": {"sources": [{"name": "scan", "priority": 1}]}})
    assert "supervisor.sources.0.name = 'scan'" in message
    assert "at least 1 item" not in message
    assert "at least 1 item" in refusal({"supervisor": {"sources": []}})


@pytest.mark.parametrize("key", ["camera/**", "camera/image", "map", "a/b/c_1"])
def test_the_key_of_another_topic_is_accepted(key: str) -> None:
    assert BusSection(more_keys=[key]).more_keys == [key]


@pytest.mark.parametrize(
    "key",
    [
        "**",
        "*",
        "camera/*",
        "ca$*",
        "/map",
        "map/",
        "cmd_vel",
        "a/cmd_vel",
        "a/holder",
        "scan",
        "supervisor/**",
        "alive/**",
        "m" * 65,
    ],
)
def test_a_key_that_would_reach_into_the_contract_is_refused(key: str) -> None:
    with pytest.raises(ValidationError, match="must be a key of another topic"):
        BusSection(more_keys=[key])


def test_a_program_without_a_certificate_is_a_participant_or_only_reads() -> None:
    assert BusSection().to_bus_config().unproven == (Role.VIEWER,)
    assert BusSection(without_certificate="participant").to_bus_config().unproven == LOCAL_ROLES


def test_a_file_with_any_number_of_faults_is_refused_at_once_in_a_short_message(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[bus]\n" + "".join(f"k{number} = 1\n" for number in range(20_000)))
    began_s = time.process_time()
    with pytest.raises(ConfigError, match="more faults") as refused:
        section(read_toml(path), "bus", BusSection)
    assert len(str(refused.value)) < 2000
    assert time.process_time() - began_s < 3.0, "quadratic time: 50,000 took more than 30 s"


def test_a_key_of_any_length_is_named_by_its_beginning() -> None:
    with pytest.raises(ConfigError, match="there is no such key") as refused:
        section({"bus": {"k" * 100_000: 1}}, "bus", BusSection)
    assert len(str(refused.value)) < 500
