"""What the real processes report to systemd: ready once they serve, running while their loop decides, and their end."""

import itertools
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.system.harness import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.system.process_state import state_of
from tests.system.systemd import STOPPING, Systemd, end
from wire import topics
from wire.host.installation import ENVIRONMENT
from wire.host.notify import TURN_LIMIT_S

LIMIT_S = 1.0
"""`WatchdogSec` of the supervisor's unit."""
PERIOD_S = LIMIT_S / 4
SILENT_S = TURN_LIMIT_S + LIMIT_S
"""How long a hang lasts: longer than the times after which systemd and the kernel end the service."""

HANGS_ON_REQUEST = """
import pathlib, sys, time
import supervisor.service as service
law, request = service.step, pathlib.Path(sys.argv.pop(1))
def step(*inputs):
    if request.exists():
        request.unlink()
        time.sleep(60)
    return law(*inputs)
service.step = step
from supervisor.__main__ import main
main()
"""
"""The supervisor, whose loop removes a file if it exists, and then hangs in the law; its threads continue."""


@pytest.fixture(params=["path", "abstract"])
def systemd(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Systemd]:
    is_path = request.param == "path"
    receiver = Systemd(str(tmp_path / "notify") if is_path else f"@lifeline-notify-{os.getpid()}")
    yield receiver
    receiver.close()


@contextmanager
def started(systemd: Systemd, directory: Path, *command: str) -> "Generator[subprocess.Popen[bytes]]":
    """Start a program of Lifeline as systemd does."""
    variables = {
        ENVIRONMENT: str(directory),
        "NOTIFY_SOCKET": systemd.name,
        "WATCHDOG_USEC": str(round(LIMIT_S * 1e6)),
    }
    with (
        (directory / "service.log").open("ab") as log,
        subprocess.Popen([sys.executable, *command], env=os.environ | variables, stderr=log) as process,
    ):
        try:
            yield process
        finally:
            end(process)


def accepts(endpoint: str) -> bool:
    host, port = endpoint.removeprefix("tcp/").split(":")
    with socket.socket() as client:
        return client.connect_ex((host, int(port))) == 0


@pytest.mark.timed
def test_the_supervisor_is_ready_once_it_listens_and_reports_four_times_within_the_limit(
    systemd: Systemd, tmp_path: Path
) -> None:
    endpoint = free_endpoint()
    with started(systemd, tmp_path, "-m", topics.SUPERVISOR, "--endpoint", endpoint) as process:
        systemd.await_ready()
        assert accepts(endpoint)
        times = systemd.times_of(13)
        gaps_s = [later - earlier for earlier, later in itertools.pairwise(times)]
        # A tick takes 20 ms. The mean tolerates a late reader; the limit itself is kept by every report.
        assert PERIOD_S - 0.01 < sum(gaps_s) / len(gaps_s) < PERIOD_S + 0.03, gaps_s
        assert max(gaps_s) < LIMIT_S, gaps_s
        process.send_signal(signal.SIGTERM)
        reports = systemd.all_until_silent(2 * PERIOD_S)
        assert process.wait(PATIENCE_S) == 0
        assert reports[-1] == STOPPING
        assert reports.count(STOPPING) == 1


def test_a_stopped_process_reports_nothing_and_is_ended_when_it_continues(
    systemd: Systemd, tmp_path: Path
) -> None:
    with started(systemd, tmp_path, "-m", topics.SUPERVISOR, "--endpoint", free_endpoint()) as process:
        systemd.await_ready()
        process.send_signal(signal.SIGSTOP)
        while state_of(process.pid) != "T":
            assert process.poll() is None
        systemd.all_until_silent(0.0)
        assert systemd.next(SILENT_S) is None
        assert process.poll() is None
        process.send_signal(signal.SIGCONT)
        assert process.wait(PATIENCE_S) == -signal.SIGALRM


def test_a_loop_that_hangs_in_a_decision_reports_nothing_although_its_threads_run_and_is_ended(
    systemd: Systemd, tmp_path: Path
) -> None:
    request, endpoint = tmp_path / "hang", free_endpoint()
    command = ("-c", HANGS_ON_REQUEST, str(request), "--endpoint", endpoint)
    with started(systemd, tmp_path, *command) as process:
        systemd.await_ready()
        systemd.times_of(1)
        request.touch()
        while request.exists():
            assert process.poll() is None
        systemd.all_until_silent(0.0)
        assert accepts(endpoint)  # Zenoh's own threads do not hang
        assert systemd.next(SILENT_S) is None
        assert process.wait(PATIENCE_S) == -signal.SIGALRM


def test_a_program_under_exec_is_reported_while_it_runs_and_cannot_report_itself(
    systemd: Systemd, tmp_path: Path
) -> None:
    endpoint, beside = free_endpoint(), tmp_path / "supervisor"
    beside.mkdir()
    silent = Systemd(f"@lifeline-unused-{os.getpid()}")
    program = 'test -z "$NOTIFY_SOCKET$WATCHDOG_USEC" && read line < "$0"; exit 4'
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    words = ("ros2", "exec", "--source", "joy", "--endpoint", endpoint, "--", "sh", "-c", program, str(gate))
    with started(systemd, tmp_path, "-m", "lifeline.cli.app", *words) as guard:
        assert systemd.next(2 * PERIOD_S) is None  # it waits for the supervisor
        with started(silent, beside, "-m", topics.SUPERVISOR, "--endpoint", endpoint):
            systemd.await_ready()
            systemd.times_of(3)
            gate.write_text("end\n")
            assert guard.wait(PATIENCE_S) == 4
            assert systemd.all_until_silent(2 * PERIOD_S)[-1] == STOPPING
    silent.close()


@pytest.mark.smoke
def test_a_receiver_that_never_reads_does_not_delay_the_robot(systemd: Systemd, tmp_path: Path) -> None:
    """The queue of the socket fills up, and the supervisor still ends on request."""
    with started(systemd, tmp_path, "-m", topics.SUPERVISOR, "--endpoint", free_endpoint()) as process:
        systemd.await_ready()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as filler:
            while True:
                try:
                    filler.sendto(b"x", systemd.name.replace("@", "\0"))
                except BlockingIOError:
                    break
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
