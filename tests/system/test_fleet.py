"""`lifeline fleet` on real supervisors behind a router."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

import pytest

from tests.system.authority import TestAuthority, secure_endpoint
from tests.system.ports import free_endpoint
from tests.system.process_state import state_of
from tests.system.routers import LIFELINE, router
from wire.host.notify import TURN_LIMIT_S
from wire.roles import ANY, Role

ROBOTS = ("robot1", "robot2")
ALL = [f"--expect={name}" for name in ROBOTS]
"""A command that expects no robot ends half a second after its start. On a busy machine, it may not have received everything."""
WITHIN_S = 60.0


def fleet(command: str, endpoint: str, *words: str) -> tuple[int, str, str]:
    """Run a command; return its exit code, its output and its errors."""
    done = subprocess.run(
        [LIFELINE, "fleet", command, "--endpoint", endpoint, *words],
        capture_output=True,
        text=True,
        timeout=WITHIN_S,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, done.stderr


@contextmanager
def robots(directory: Path, endpoint: str) -> Generator[dict[str, "subprocess.Popen[bytes]"]]:
    """Run a router and a supervisor of each robot until all are seen."""
    with ExitStack() as ending:
        ending.enter_context(router(endpoint, ROBOTS, None))
        started = {name: start_supervisor(directory, name, endpoint) for name in ROBOTS}
        ending.callback(lambda: [one.wait(WITHIN_S) for one in started.values()])
        ending.callback(lambda: [one.kill() for one in started.values()])
        deadline_s = time.monotonic() + WITHIN_S
        while fleet("list", endpoint, *ALL)[0] != 0:
            assert time.monotonic() < deadline_s, "not all robots are seen"
        yield started


def start_supervisor(directory: Path, name: str, endpoint: str) -> "subprocess.Popen[bytes]":
    config = directory / f"{name}.toml"
    config.write_text(
        f'[bus]\nnamespace = "{name}"\nendpoint = "{free_endpoint()}"\nrouters = ["{endpoint}"]\n'
        'without_certificate = "participant"\n'
    )
    return subprocess.Popen(
        [sys.executable, "-m", "supervisor", "--config", str(config)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"LIFELINE_STATE_DIR": str(directory / name)},
    )


def rows(output: str) -> dict[str, dict[str, Any]]:
    return {row["namespace"]: row for row in map(json.loads, output.splitlines())}


@pytest.mark.timeout(300)
def test_a_fleet_is_listed_and_stopped_and_a_robot_that_does_not_answer_is_named(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with robots(tmp_path, endpoint) as started:
        code, output, _ = fleet("list", endpoint, "--json", *ALL)
        assert (code, set(rows(output))) == (0, set(ROBOTS))
        assert not any("ESTOP" in row["reasons"] for row in rows(output).values())

        code, output, _ = fleet("list", endpoint, "--json", "--expect", "robot9")
        assert (code, rows(output)["robot9"]["up"], rows(output)["robot1"]["up"]) == (1, False, True)

        os.kill(started["robot2"].pid, signal.SIGSTOP)
        deadline_s = time.monotonic() + WITHIN_S
        while state_of(started["robot2"].pid) != "T":
            assert time.monotonic() < deadline_s
        stopped_s = time.monotonic()
        code, output, _ = fleet("stop", endpoint, "--expect", "robot2")
        assert code == 1
        assert "robot1: the e-stop is latched" in output
        assert "robot2: NOT CONFIRMED" in output

        # A supervisor that was stopped for longer than its limit is ended when it continues, and started again.
        while time.monotonic() < stopped_s + TURN_LIMIT_S:
            time.sleep(0.05)
        os.kill(started["robot2"].pid, signal.SIGCONT)
        assert started["robot2"].wait(WITHIN_S) == -signal.SIGALRM
        started["robot2"] = start_supervisor(tmp_path, "robot2", endpoint)
        while fleet("list", endpoint, "--expect", "robot2")[0] != 0:
            assert time.monotonic() < deadline_s
        code, output, _ = fleet("stop", endpoint, "--json", *ALL)
        result = json.loads(output)
        print(f"\n    measured: {result}")
        assert (code, set(result["stopped_ms"]), result["silent"]) == (0, set(ROBOTS), [])
        listed = rows(fleet("list", endpoint, "--json", *ALL)[1])
        assert [name for name, row in listed.items() if "ESTOP" in row["reasons"]] == list(ROBOTS)


@pytest.mark.smoke
@pytest.mark.timeout(300)
def test_a_watched_fleet_prints_the_end_of_one_robot_while_the_others_go_on(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with robots(tmp_path, endpoint) as started, watching(endpoint) as lines:
        until_row(lines, lambda row: row["namespace"] == "robot1" and row["up"])
        until_row(lines, lambda row: row["namespace"] == "robot2" and row["up"])
        started["robot2"].kill()
        until_row(lines, lambda row: row["namespace"] == "robot2" and not row["up"])
        until_row(lines, lambda row: row["namespace"] == "robot1" and row["up"])


@contextmanager
def watching(endpoint: str) -> Generator[IO[str]]:
    """Run `lifeline fleet watch`; yield its lines. It ends with Ctrl-C, silently."""
    process = subprocess.Popen(
        [LIFELINE, "fleet", "watch", "--endpoint", endpoint, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        yield process.stdout
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=WITHIN_S)
        assert (process.returncode, errors) == (0, "")
    finally:
        process.kill()
        process.wait()


def until_row(lines: IO[str], is_it: Callable[[dict[str, Any]], bool]) -> None:
    """Read rows until one is the right one; the test's own limit of time ends it otherwise."""
    assert any(is_it(json.loads(line)) for line in lines), "the command ended before"


def test_without_robots_or_a_router_nothing_is_stopped_and_the_exit_code_says_so(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    code, _, errors = fleet("stop", endpoint)
    assert (code, "no router or robot answers" in errors) == (3, True)
    with router(endpoint, ROBOTS, None):
        code, output, _ = fleet("stop", endpoint)
        assert (code, "nothing was stopped" in output) == (3, True)
        code, output, _ = fleet("stop", endpoint, "--expect", "robot1", "--json")
        assert (code, json.loads(output)) == (1, {"stopped_ms": {}, "silent": ["robot1"]})


@pytest.mark.parametrize(
    ("role", "robot", "reason"),
    [(Role.VIEWER, ANY, "may not stop"), (Role.OPERATOR, "robot1", "is for the robot robot1, not for any")],
)
def test_a_bundle_that_cannot_stop_every_robot_is_refused(
    tmp_path: Path, role: Role, robot: str, reason: str
) -> None:
    bundle = TestAuthority(tmp_path).bundle("x", role, robot=robot)
    code, _, errors = fleet("stop", secure_endpoint("tls"), "--keys", str(bundle))
    assert (code != 0, reason in errors) == (True, True), errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--expect", "Robot 1"], "is not a robot's namespace"),
        (["--keys", "/nowhere"], "no bundle of keys"),
    ],
)
def test_wrong_options_are_refused_in_a_sentence(words: list[str], reason: str) -> None:
    code, _, errors = fleet(
        "list", secure_endpoint("tls"), *words, *([] if "--keys" in words else ["--keys", "/k"])
    )
    assert code == 2
    assert "no bundle of keys" in errors or reason in errors


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--robot", "robot1"], "needs certificates"),
        (["--robot", "any", "--keys", "/k"], "stands for all robots"),
        (["--keys", "/k"], "name the robots"),
        (["--robots", "/nowhere", "--keys", "/k"], "cannot read the names"),
    ],
)
def test_a_router_with_wrong_options_is_refused_in_a_sentence(words: list[str], reason: str) -> None:
    done = subprocess.run(
        [LIFELINE, "router", "--listen", "tls/0.0.0.0:7448", *words],
        capture_output=True,
        text=True,
        timeout=WITHIN_S,
        check=False,
    )
    assert (done.returncode, reason in done.stderr) == (2, True), done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("protocol", ["tcp", "tls", "quic"])
def test_a_router_whose_port_is_taken_says_so_in_one_sentence(tmp_path: Path, protocol: str) -> None:
    keys = TestAuthority(tmp_path).bundle("site", Role.ROUTER, robot=ANY)
    kind = socket.SOCK_DGRAM if protocol == "quic" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as other:
        other.bind(("127.0.0.1", 0))
        if kind is socket.SOCK_STREAM:
            other.listen()
        taken = f"{protocol}/127.0.0.1:{other.getsockname()[1]}"
        words = ["--listen", free_endpoint(), "--listen", taken, "--robot", "robot1", "--keys", str(keys)]
        done = subprocess.run(
            [LIFELINE, "router", *words], capture_output=True, text=True, timeout=WITHIN_S, check=False
        )
    sentence = f"lifeline: another program listens at {taken}: end it, or choose another port with --listen\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", sentence)


def test_the_configuration_for_zenohd_is_one_document(tmp_path: Path) -> None:
    keys = TestAuthority(tmp_path).bundle("site", Role.ROUTER, robot=ANY)
    words = ["--listen", "tls/0.0.0.0:7448", "--robot", "robot1", "--keys", str(keys), "--print-config"]
    done = subprocess.run(
        [LIFELINE, "router", *words], capture_output=True, text=True, timeout=WITHIN_S, check=True
    )
    document = json.loads(done.stdout)
    assert document["mode"] == "router"
    assert document["access_control"]["default_permission"] == "deny"
    assert document["transport"]["link"]["tls"]["enable_mtls"] is True
