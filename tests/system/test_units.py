"""The units of deploy/systemd: systemd accepts them, and their commands run and report as the units expect."""

import itertools
import json
import os
import shlex
import shutil
import signal
import socket
import statistics
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.system import fake_ros2
from tests.system.harness import PATIENCE_S
from tests.system.operators import ROOT
from tests.system.ports import free_endpoint
from tests.system.process_state import state_of
from tests.system.systemd import Systemd, Unit, end
from wire.host.notify import TURN_LIMIT_S
from wire.zenoh import limits

UNITS = ROOT / "deploy" / "systemd"
EXPOSURE = {"lifeline-supervisor.service": 1.5, "lifeline-ros2.service": 2.0, "lifeline-guard@.service": 2.5}
"""The most that `systemd-analyze security` may find, of 10."""
needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd")

pytestmark = pytest.mark.timeout(120)


def unit(name: str, directory: Path) -> Unit:
    """Return a unit whose installation, configuration and state are in this checkout and a directory."""
    places = {
        "/opt/lifeline/bin": str(Path(sys.executable).parent),
        "/etc/lifeline": str(directory / "etc"),
        "/var/lib/lifeline": str(directory / "state"),
    }
    (directory / "etc" / "sources").mkdir(parents=True, exist_ok=True)
    (directory / "state").mkdir(exist_ok=True)
    return Unit(UNITS / name, places)


@contextmanager
def started(subject: Unit, systemd: Systemd) -> "Generator[subprocess.Popen[bytes]]":
    with subprocess.Popen(subject.command, env=subject.variables(systemd.name)) as process:
        try:
            yield process
        finally:
            end(process)


@pytest.fixture
def systemd(tmp_path: Path) -> Generator[Systemd]:
    receiver = Systemd(str(tmp_path / "notify"))
    yield receiver
    receiver.close()


@pytest.mark.smoke
@needs_systemd
def test_systemd_accepts_every_unit(tmp_path: Path) -> None:
    written: list[str] = []
    for name in EXPOSURE:
        subject = unit(name, tmp_path)
        text = subject.text.replace(f"{tmp_path}/etc/sources/%i", "/bin/true")
        (tmp_path / name).write_text(text)
        written.append(str(tmp_path / name))
    verify = ["systemd-analyze", "verify", *written]
    done = subprocess.run(verify, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.smoke
@needs_systemd
@pytest.mark.parametrize("name", EXPOSURE)
def test_a_service_can_do_little_else(name: str) -> None:
    threshold = str(round(10 * EXPOSURE[name]))
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={threshold}", str(UNITS / name)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr


def test_the_supervisor_of_the_unit_reports_in_time_and_not_while_it_is_stopped(
    systemd: Systemd, tmp_path: Path
) -> None:
    subject = unit("lifeline-supervisor.service", tmp_path)
    (tmp_path / "etc" / "robot.toml").write_text(f'[bus]\nendpoint = "{free_endpoint()}"\n')
    limit_s = subject.seconds("WatchdogSec")
    with started(subject, systemd) as process:
        systemd.await_ready()
        times = systemd.times_of(9)
        # The median: a busy machine delays some of them, also beyond the limit.
        gaps_s = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert statistics.median(gaps_s) < limit_s / 2
        assert list((tmp_path / "state").iterdir())  # where the e-stop's record is
        process.send_signal(signal.SIGSTOP)
        while state_of(process.pid) != "T":
            assert process.poll() is None
        systemd.all_until_silent(0.0)
        assert systemd.next(max(2 * limit_s, TURN_LIMIT_S)) is None  # systemd kills it now
        process.send_signal(signal.SIGCONT)
        assert process.wait(PATIENCE_S) == -signal.SIGALRM


@pytest.mark.parametrize(
    "name", ["lifeline-supervisor.service", "lifeline-ros2.service", "lifeline-guard@.service"]
)
def test_a_service_with_a_refused_configuration_exits_with_a_code_that_is_not_restarted(
    name: str, systemd: Systemd, tmp_path: Path
) -> None:
    subject = unit(name, tmp_path)
    (tmp_path / "etc" / "robot.toml").write_text("nonsense = 1\n[bus]\nlease_s = 0\n")
    with started(subject, systemd) as process:
        assert str(process.wait(PATIENCE_S)) in subject["RestartPreventExitStatus"].split()


@pytest.mark.parametrize("name", ["lifeline-supervisor.service", "lifeline-ros2.service"])
def test_only_a_service_that_could_not_start_waits_before_the_next_start(name: str, tmp_path: Path) -> None:
    subject, waited = unit(name, tmp_path), tmp_path / "waited"
    (tmp_path / "sleep").write_text(f'#!/bin/sh\necho "$1" >> {waited}\n')
    (tmp_path / "sleep").chmod(0o700)
    command = [word.replace("$$", "$") for word in shlex.split(subject["ExecStopPost"])]
    for status in ("0", "2", "KILL", "ABRT", "1"):
        assert not waited.exists()
        variables = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "EXIT_STATUS": status}
        subprocess.run(command, env=variables, check=True, timeout=PATIENCE_S)
    assert (
        subject.seconds("RestartSec") < 1.0 <= float(waited.read_text()) < subject.seconds("TimeoutStopSec")
    )
    assert (subject["Restart"], subject["StartLimitIntervalSec"]) == ("always", "0")


def test_a_supervisor_whose_port_is_taken_is_started_again_and_takes_it_when_it_is_free(
    systemd: Systemd, tmp_path: Path
) -> None:
    subject, endpoint = unit("lifeline-supervisor.service", tmp_path), free_endpoint()
    (tmp_path / "etc" / "robot.toml").write_text(f'[bus]\nendpoint = "{endpoint}"\n')
    with (
        socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))),
        started(subject, systemd) as process,
    ):
        code = process.wait(PATIENCE_S)
    assert code == 1  # the unit waits after it
    assert str(code) not in subject["RestartPreventExitStatus"].split()
    with started(subject, systemd):
        systemd.await_ready()


def test_the_kernel_ends_other_programs_before_the_supervisor_and_the_ros_2_process(tmp_path: Path) -> None:
    scores = [
        int(unit(f"lifeline-{name}.service", tmp_path)["OOMScoreAdjust"]) for name in ("supervisor", "ros2")
    ]
    assert max(scores) <= -900


def test_the_supervisor_of_the_unit_may_open_the_files_that_it_wants(tmp_path: Path) -> None:
    assert int(unit("lifeline-supervisor.service", tmp_path)["LimitNOFILE"]) == limits.WANTED_FILES


def test_ros2_run_is_the_process_that_reports(
    systemd: Systemd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It replaces itself: systemd would not accept the reports of another process."""
    subject, beside = (unit(f"lifeline-{name}.service", tmp_path) for name in ("ros2", "supervisor"))
    python, output = fake_ros2.interpreter(tmp_path), tmp_path / "started"
    (tmp_path / "etc" / "robot.toml").write_text(
        f'[bus]\nendpoint = "{free_endpoint()}"\n[ros2]\npython = "{python}"\n'
    )
    monkeypatch.setenv(fake_ros2.OUTPUT, str(output))
    with started(beside, systemd):
        systemd.await_ready()
        with started(subject, systemd) as process:
            while not output.exists():
                assert process.poll() is None
                systemd.next(PATIENCE_S)
            seen = json.loads(output.read_text())
            assert seen["pid"] == process.pid
            environment = seen["environment"]
            assert environment["NOTIFY_SOCKET"] == systemd.name
            assert environment["WATCHDOG_USEC"] == "2000000"
            assert environment["LIFELINE_STATE_DIR"] == str(tmp_path / "state")
