"""The checks before the start."""

import json
import shlex
import socket
from pathlib import Path

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import (
    ANY_BASE,
    DEFAULT_CONFIG,
    SIMULATED,
    Launch,
    check_endpoint_is_free,
    free_loopback_endpoint,
)
from deploy.stack.statedir import StateDir
from deploy.stack.supervisord import find_uv


def test_without_a_file_the_example_is_the_configuration() -> None:
    launch = Launch.read(None, None)
    assert launch.config == DEFAULT_CONFIG
    assert launch.bus.endpoint == "tcp/127.0.0.1:7447"


def test_an_endpoint_given_here_takes_the_place_of_the_files(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[bus]\nendpoint = "tcp/127.0.0.1:1111"\nnamespace = "r2"\n')
    launch = Launch.read(config, "tcp/127.0.0.1:2222")
    assert (launch.bus.endpoint, launch.bus.namespace) == ("tcp/127.0.0.1:2222", "r2")


def test_a_wrong_endpoint_is_refused() -> None:
    with pytest.raises(DeployError, match=r"bus\.endpoint = 'nonsense': expected PROTOCOL/HOST:PORT"):
        Launch.read(None, "nonsense")


def test_a_configuration_that_is_a_link_to_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").symlink_to("robot.toml")
    with pytest.raises(DeployError, match=r"cannot read the configuration .*symbolic links"):
        Launch.read(tmp_path / "robot.toml", None)


def test_a_stack_is_found_again_by_its_record(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    assert Launch.running(state) is None
    launch = Launch.read(None, "tcp/127.0.0.1:2222")
    state.record.write_text(json.dumps(launch.to_record()))
    assert Launch.running(state) == launch


def test_keys_reach_every_process_of_the_stack(tmp_path: Path) -> None:
    state, keys = StateDir(tmp_path), tmp_path / "my keys"
    launch = Launch.read(None, "quic/127.0.0.1:2222", keys)
    options = ["--endpoint", "quic/127.0.0.1:2222", "--keys", str(keys)]
    assert launch.command("teleop")[-4:] == options
    assert shlex.split(launch.environment(state)["LIFELINE_BUS_OPTIONS"]) == options
    state.record.write_text(json.dumps(launch.to_record()))
    assert Launch.running(state) == launch
    assert launch.with_keys(Path("/other")).bus.keys == Path("/other")
    with pytest.raises(DeployError, match=r"needs certificates.*--keys"):
        Launch.read(None, "quic/127.0.0.1:2222")
    with pytest.raises(DeployError, match=r"no user ~nobody-here.*--keys"):
        launch.with_keys(Path("~nobody-here/k"))


def test_a_free_endpoint_is_free() -> None:
    check_endpoint_is_free(free_loopback_endpoint())


def test_a_port_in_use_is_reported_with_a_way_out() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(DeployError, match=f"port {port} on 127.0.0.1 is in use .* --endpoint"):
            check_endpoint_is_free(f"tcp/127.0.0.1:{port}")


def test_an_address_of_another_machine_is_reported() -> None:
    with pytest.raises(DeployError, match=r"cannot listen on tcp/192\.0\.2\.1:7447"):
        check_endpoint_is_free("tcp/192.0.2.1:7447")


def test_a_missing_uv_is_reported_with_a_way_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UV", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("deploy.stack.supervisord.checkout", lambda: tmp_path)
    with pytest.raises(DeployError, match=r"uv, .* is missing: run `make setup`"):
        find_uv()


def test_the_uv_of_make_setup_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UV", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("deploy.stack.supervisord.checkout", lambda: tmp_path)
    uv = tmp_path / ".uv" / "bin" / "uv"
    uv.parent.mkdir(parents=True)
    uv.touch(mode=0o755)
    assert find_uv() == str(uv)


def test_what_starts_follows_the_configuration_and_the_option(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[sim]\n")
    assert Launch.read(config, None).nodes == SIMULATED == ("supervisor", "sim")
    assert Launch.read(config, None, with_sim=False).nodes == ("supervisor",)
    config.write_text("[sim]\n[ros2]\n")
    for with_sim in (True, False):
        assert Launch.read(config, None, with_sim=with_sim).nodes == ("supervisor", "ros2")


def test_the_nodes_of_a_stack_are_in_its_record_and_an_older_record_is_of_a_simulated_robot(
    tmp_path: Path,
) -> None:
    state = StateDir(tmp_path)
    launch = Launch.read(None, None, with_sim=False)
    state.record.write_text(json.dumps(launch.to_record()))
    assert Launch.running(state) == launch
    older = {key: value for key, value in launch.to_record().items() if key != "nodes"}
    state.record.write_text(json.dumps(older))
    running = Launch.running(state)
    assert running is not None
    assert running.nodes == SIMULATED


def test_only_nodes_that_the_robot_has_can_be_started_alone(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text("[ros2]\n")
    launch = Launch.read(config, None)
    assert launch.only(["supervisor"]).nodes == ("supervisor",)
    assert launch.only(["ros2", "supervisor"]).nodes == ("supervisor", "ros2")
    with pytest.raises(
        DeployError, match="--only sim: this robot has no such node to start, only supervisor and ros2"
    ):
        launch.only(["sim"])


def test_the_nodes_to_inspect_come_from_the_record_of_the_same_endpoint_else_from_the_file(
    tmp_path: Path,
) -> None:
    state, config = StateDir(tmp_path), tmp_path / "robot.toml"
    config.write_text("[bus]\n")
    assert Launch.find(state, config, None, None).nodes == ("supervisor",)
    for base in ("sim", "ros2"):
        config.write_text(f"[{base}]\n")
        assert Launch.find(state, config, None, None).nodes == ("supervisor", base)
    assert Launch.find(state, None, None, None).nodes == SIMULATED
    assert Launch.find(state, None, "tcp/127.0.0.1:2222", None).nodes == ("supervisor", ANY_BASE)

    started = Launch.read(None, "tcp/127.0.0.1:2222", with_sim=False)
    state.record.write_text(json.dumps(started.to_record()))
    assert Launch.find(state, None, None, None) == started
    assert started.is_started(state)
    assert not Launch.read(None, "tcp/127.0.0.1:3333").is_started(state)
    assert Launch.find(state, None, "tcp/127.0.0.1:2222", None).nodes == ("supervisor",)
    assert Launch.find(state, None, "tcp/127.0.0.1:3333", None).nodes == ("supervisor", ANY_BASE)
    config.write_text('[bus]\nnamespace = "other"\n[sim]\n')
    assert Launch.find(state, config, "tcp/127.0.0.1:2222", None).nodes == SIMULATED


def test_programs_that_are_not_wanted_do_not_start(tmp_path: Path) -> None:
    alone = Launch.read(None, None).only(["sim"]).environment(StateDir(tmp_path))
    assert (alone["LIFELINE_START_SUPERVISOR"], alone["LIFELINE_START_SIM"]) == ("false", "true")
    for with_sim, wanted in ((True, "true"), (False, "false")):
        variables = Launch.read(None, None, with_sim=with_sim).environment(StateDir(tmp_path))
        assert variables["LIFELINE_START_SIM"] == wanted
        assert (variables["LIFELINE_START_ROS2"], variables["LIFELINE_ROS2_COMMAND"]) == ("false", "false")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("endpoint", None),
        ("endpoint", ["tcp/127.0.0.1:1"]),
        ("endpoint", "\x1b[31m"),
        ("namespace", "a/b"),
        ("lease_s", "soon"),
        ("lease_s", 2**63),
        ("keys", 1),
        ("config", None),
        ("config", "x" * 70_000),
        ("config", "\ud800"),
        ("nodes", "sim"),
        ("nodes", [None]),
    ],
)
def test_a_record_with_a_wrong_value_is_no_running_stack(tmp_path: Path, key: str, value: object) -> None:
    state = StateDir(tmp_path)
    record = Launch.read(None, "tcp/127.0.0.1:2222").to_record()
    state.record.write_text(json.dumps(record | {key: value}))
    assert Launch.running(state) is None


def test_a_record_of_an_older_version_without_nodes_is_a_simulated_robot(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    record = Launch.read(None, "tcp/127.0.0.1:2222").to_record()
    del record["nodes"]
    state.record.write_text(json.dumps(record | {"added_later": 1}))
    launch = Launch.running(state)
    assert launch is not None
    assert launch.nodes == SIMULATED
