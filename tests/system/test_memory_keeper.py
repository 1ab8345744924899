"""What a killed process held is freed by another, so that its sockets close at once."""

import os
import select
import signal
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from deploy import processes
from deploy.processes import MARK, Process
from wire.memory_keeper import NAME

LIMIT_S = 10.0
OBJECTS = 2_000_000
"""Some 50 MB of them."""
KILLS = 7
PROGRAM = """
import os, signal, socket, sys
from wire.memory_keeper import keep_memory
port, kept, ending = int(sys.argv[1]), sys.argv[2] == "kept", sys.argv[3]
before = socket.create_connection(("127.0.0.1", port))
pid = keep_memory() if kept else 0
after = socket.create_connection(("127.0.0.1", port))
held = [object() for _ in range(int(sys.argv[4]))]
after.sendall(f"{pid}".encode())
after.recv(1)
if ending == "os._exit":
    os._exit(0)
"""


@dataclass(frozen=True)
class Running:
    """A process, perhaps with a keeper, and our ends of its connections."""

    process: subprocess.Popen[bytes]
    keeper: int
    """Its pid; 0: none."""
    connections: tuple[socket.socket, socket.socket]
    """Opened before it had a keeper, and after."""

    def kill_s(self) -> float:
        """From SIGKILL to the end of both of its connections."""
        begin_s = time.perf_counter()
        self.process.kill()
        assert [connection.recv(1) for connection in self.connections] == [b"", b""]
        return time.perf_counter() - begin_s


@contextmanager
def running(
    *, kept: bool, ending: str = "", objects: int = 0, mark: Path | None = None
) -> Generator[Running]:
    environment = None if mark is None else {MARK: str(mark)}
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        arguments = [port, "kept" if kept else "", ending, str(objects), "-m", "sim"]
        process = subprocess.Popen([sys.executable, "-c", PROGRAM, *arguments], env=environment)
        try:
            server.settimeout(LIMIT_S)
            before, after = server.accept()[0], server.accept()[0]
            with before, after:
                for connection in (before, after):
                    connection.settimeout(LIMIT_S)
                yield Running(process, int(after.recv(20)), (before, after))
        finally:
            process.kill()
            process.wait()


def has_ended(pidfd: int) -> bool:
    """Waits for it."""
    return bool(select.select([pidfd], [], [], LIMIT_S)[0])


def test_a_large_process_that_is_killed_is_noticed_much_sooner_with_a_keeper() -> None:
    times_s: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(KILLS):
        for kept, seen in times_s.items():
            with running(kept=kept, objects=OBJECTS) as one:
                assert bool(one.keeper) is kept
                seen.append(one.kill_s())
    with_ms, without_ms = (1000 * statistics.median(times_s[kept]) for kept in (True, False))
    print(
        f"from SIGKILL to the end of the connections: {with_ms:.2f} ms with a keeper, {without_ms:.2f} without"
    )
    assert with_ms < without_ms / 2


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV, "os._exit"])
def test_the_keeper_ends_with_its_process_however_that_ends(ending: signal.Signals | str) -> None:
    with running(kept=True, ending=str(ending)) as one:
        pidfd = os.pidfd_open(one.keeper)
        try:
            if isinstance(ending, signal.Signals):
                one.process.send_signal(ending)
            else:
                one.connections[1].sendall(b"!")
            one.process.wait(LIMIT_S)
            assert has_ended(pidfd)
        finally:
            os.close(pidfd)


def test_a_keeper_outlives_what_a_terminal_or_a_service_manager_sends_to_a_whole_group() -> None:
    with running(kept=True) as one:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
            os.kill(one.keeper, number)
        state = Path(f"/proc/{one.keeper}/stat").read_text().rsplit(")", 1)[1].split()[0]
        assert state == "S"
        one.kill_s()


def test_a_process_whose_keeper_is_killed_goes_on() -> None:
    with running(kept=True, ending="os._exit") as one:
        pidfd = os.pidfd_open(one.keeper)
        try:
            os.kill(one.keeper, signal.SIGKILL)
            assert has_ended(pidfd)
        finally:
            os.close(pidfd)
        one.connections[1].sendall(b"!")
        assert one.process.wait(LIMIT_S) == 0


def test_a_keeper_holds_no_file_open_but_its_end_of_the_pipe() -> None:
    with running(kept=True) as one:
        assert [str(fd.readlink()).split(":")[0] for fd in Path(f"/proc/{one.keeper}/fd").iterdir()] == [
            "pipe"
        ]


def test_a_keeper_is_not_taken_for_the_process_that_it_keeps(tmp_path: Path) -> None:
    with running(kept=True, mark=tmp_path) as one:
        assert Path(f"/proc/{one.keeper}/comm").read_text() == f"{NAME}\n"
        assert processes.of(tmp_path) == [Process(one.process.pid, "sim")]


@pytest.mark.parametrize("service", ["supervisor", "sim"])
def test_each_service_has_a_keeper(service: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with subprocess.Popen([sys.executable, "-m", service, "--endpoint", f"tcp/127.0.0.1:{port}"]) as process:
        try:
            deadline_s = time.monotonic() + LIMIT_S
            while NAME not in _children(process.pid):
                assert process.poll() is None
                assert time.monotonic() < deadline_s
        finally:
            process.kill()


def _children(pid: int) -> list[str]:
    """What the children of a process are called, whichever of its threads made them."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    pids = [child for task in tasks for child in (task / "children").read_text().split()]
    return [Path(f"/proc/{child}/comm").read_text().strip() for child in pids]
