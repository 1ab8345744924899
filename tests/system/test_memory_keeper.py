"""The memory of a killed process is freed later, by its keeper, so that its sockets close immediately."""

import os
import select
import signal
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from deploy.stack import processes, takedown
from deploy.stack.processes import MARK, Process
from deploy.stack.statedir import StateDir
from tests.system.harness import free_endpoint
from tests.system.process_state import children_of, state_of
from wire.host.memory_keeper import KEEP_S, NAME, RENEW_S, is_keeper

LIMIT_S = 20.0
OBJECTS = 2_000_000
"""Some 50 MB of them."""
KILLS = 7
PROGRAM = """
import gc, os, socket, sys, time
from wire.host.memory_keeper import MemoryKeeper
port, kept, objects = int(sys.argv[1]), sys.argv[2] == "kept", int(sys.argv[3])
before = socket.create_connection(("127.0.0.1", port))
keeper = MemoryKeeper() if kept else None
after = socket.create_connection(("127.0.0.1", port))
held = [object() for _ in range(objects)]
after.sendall(f"{keeper.pid if keeper else 0}".encode())
while order := after.recv(1):
    if order == b"G":
        gc.disable()
        gc.collect()
        gc.set_threshold(1)
        ours, theirs = socket.socketpair()
        ours.settimeout(5.0)
        knot = [theirs]
        knot.append(knot)
        receive, nothing = ours.recv_into, bytearray(1)
        del theirs, knot
        gc.enable()
        receive(nothing)  # until another thread collects: nothing is allocated here
        before.sendall(b"closed")
    if order == b"E":
        os._exit(0)
    if order == b"K":
        keeper.end()
        os._exit(0)
"""


@dataclass(frozen=True)
class Running:
    """A process with or without a keeper, and our ends of its connections."""

    process: subprocess.Popen[bytes]
    keeper: int
    """Its pid; 0 without a keeper."""
    connections: tuple[socket.socket, socket.socket]
    """Opened before it had a keeper, and after."""

    def kill_s(self) -> float:
        """From SIGKILL to the end of both of its connections."""
        begin_s = time.perf_counter()
        self.process.kill()
        assert [connection.recv(1) for connection in self.connections] == [b"", b""]
        return time.perf_counter() - begin_s

    def order(self, what: bytes) -> None:
        """E: exit. K: the same, and the keeper ends first."""
        self.connections[1].sendall(what)

    @property
    def keepers(self) -> list[int]:
        """Return the keepers that run now."""
        return keepers_of(self.process.pid)


@contextmanager
def running(
    *, kept: bool = True, objects: int = 0, mark: Path | None = None, group: bool = False
) -> Generator[Running]:
    environment = None if mark is None else {MARK: str(mark)}
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        arguments = [port, "kept" if kept else "", str(objects), "-m", "sim"]
        command = [sys.executable, "-c", PROGRAM, *arguments]
        process = subprocess.Popen(command, env=environment, process_group=0 if group else None)
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


@contextmanager
def handle(pid: int) -> Generator[int]:
    pidfd = os.pidfd_open(pid)
    try:
        yield pidfd
    finally:
        os.close(pidfd)


@contextmanager
def busy() -> Generator[None]:
    """Keep every processor busy."""
    hogs = [subprocess.Popen(["/bin/sh", "-c", "while :; do :; done"]) for _ in os.sched_getaffinity(0)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def ends_within(pidfd: int, limit_s: float) -> bool:
    return bool(select.select([pidfd], [], [], limit_s)[0])


def outlives(pidfd: int, ended_s: float) -> bool:
    """Return whether a keeper exists, or enough time has passed that it may have ended."""
    return not ends_within(pidfd, 0.0) or time.monotonic() > ended_s + KEEP_S - RENEW_S


def keepers_of(pid: int) -> list[int]:
    """Return the keeper among the child processes of all threads."""
    return [child for child in children_of(pid) if is_keeper(child)]


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


@pytest.mark.timed
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


def test_the_keeper_ends_a_while_after_its_process_however_that_ended() -> None:
    endings: list[Callable[[Running], None]] = [
        lambda one: one.process.kill(),
        lambda one: one.process.terminate(),
        lambda one: one.process.send_signal(signal.SIGSEGV),
        lambda one: one.order(b"E"),
    ]
    with ExitStack() as stack:
        pidfds: list[int] = []
        ended_s = 0.0
        for end in endings:
            one = stack.enter_context(running())
            pidfds.append(stack.enter_context(handle(one.keeper)))
            ended_s = time.monotonic()
            end(one)
            one.process.wait(LIMIT_S)
        assert outlives(pidfds[-1], ended_s), "the last one cannot be over yet"
        assert all(ends_within(pidfd, KEEP_S + LIMIT_S) for pidfd in pidfds)


def test_a_process_that_ends_in_order_ends_its_keeper_first() -> None:
    with running() as one, handle(one.keeper) as pidfd:
        one.order(b"K")
        assert one.process.wait(LIMIT_S) == 0
        assert ends_within(pidfd, KEEP_S / 2)


def test_a_keeper_outlives_what_a_terminal_or_a_service_manager_sends_to_a_whole_group() -> None:
    with running() as one:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
            os.kill(one.keeper, number)
        until(lambda: state_of(one.keeper) == "S")


def test_a_service_that_is_stopped_with_its_group_and_then_killed_leaves_no_stopped_keeper() -> None:
    with running(group=True) as one, handle(one.keeper) as pidfd:
        os.killpg(one.process.pid, signal.SIGSTOP)
        until(lambda: state_of(one.process.pid) == "T")
        until(lambda: state_of(one.keeper) == "S")
        one.kill_s()
        assert ends_within(pidfd, KEEP_S + LIMIT_S)


def test_a_service_that_was_stopped_for_longer_than_its_keeper_sleeps_gets_another() -> None:
    with running() as one, handle(one.keeper) as pidfd:
        one.process.send_signal(signal.SIGSTOP)
        assert ends_within(pidfd, KEEP_S + LIMIT_S)
        one.process.send_signal(signal.SIGCONT)
        until(lambda: one.keepers not in ([], [one.keeper]))
        (second,) = one.keepers
        with handle(second) as new:
            assert not ends_within(new, 1.5 * KEEP_S)


def test_what_is_collected_in_any_thread_closes_in_the_table_of_the_process() -> None:
    """The keeper's thread has its own file table: descriptors closed there by a collection remained open here."""
    with running() as one:
        one.order(b"G")
        assert one.connections[0].recv(20) == b"closed"


def test_as_long_as_its_process_runs_the_keeper_stays() -> None:
    with running() as one, handle(one.keeper) as pidfd:
        assert not ends_within(pidfd, 1.5 * KEEP_S)
        assert one.keepers == [one.keeper]


def test_a_process_whose_keeper_has_ended_gets_another() -> None:
    with running() as one, handle(one.keeper) as pidfd:
        os.kill(one.keeper, signal.SIGKILL)
        assert ends_within(pidfd, LIMIT_S)
        until(lambda: one.keepers not in ([], [one.keeper]))
        (second,) = one.keepers
        until(lambda: state_of(second) == "S")
        one.kill_s()


def test_a_keeper_holds_no_file_open_but_its_timer_and_no_directory() -> None:
    with running() as one:
        process = Path(f"/proc/{one.keeper}")
        assert [str(fd.readlink()) for fd in (process / "fd").iterdir()] == ["anon_inode:[timerfd]"]
        assert (process / "cwd").readlink() == Path("/")


def test_a_keeper_is_not_taken_for_the_process_that_it_keeps(tmp_path: Path) -> None:
    with running(mark=tmp_path) as one:
        assert one.keepers == [one.keeper]
        assert processes.of(tmp_path) == [Process(one.process.pid, "sim")]
        assert processes.keepers(tmp_path) == [Process(one.keeper, NAME)]


def test_a_stop_also_ends_the_keeper_of_a_process_that_was_killed_before(tmp_path: Path) -> None:
    with running(mark=tmp_path) as one, handle(one.keeper) as pidfd:
        ended_s = time.monotonic()
        one.process.kill()
        one.process.wait(LIMIT_S)
        assert outlives(pidfd, ended_s), "it must outlive its process"
        takedown.stop(StateDir(tmp_path))
        assert ends_within(pidfd, 0.0), "the stop has returned, and the keeper still runs"


def test_a_stop_also_ends_the_keeper_of_a_process_that_only_sigkill_ends(tmp_path: Path) -> None:
    with running(mark=tmp_path) as one, handle(one.keeper) as pidfd:
        os.kill(one.process.pid, signal.SIGSTOP)
        # A SIGTERM that came before the process has stopped would end it.
        until(lambda: state_of(one.process.pid) == "T")
        takedown.stop(StateDir(tmp_path))
        assert one.process.wait(LIMIT_S) == -signal.SIGKILL
        assert ends_within(pidfd, 0.0), "the stop has returned, and the keeper still runs"


def test_a_stop_leaves_the_keeper_of_another_state_directory_alone(tmp_path: Path) -> None:
    with running(mark=tmp_path / "other") as one, handle(one.keeper) as pidfd:
        takedown.stop(StateDir(tmp_path))
        assert not ends_within(pidfd, 0.0)


@pytest.mark.timed
def test_a_stop_ends_a_keeper_also_where_the_processor_is_busy(tmp_path: Path) -> None:
    """A keeper runs at idle priority: beside a busy process it would run for some milliseconds per second."""
    with running(mark=tmp_path, objects=OBJECTS) as one, handle(one.keeper) as pidfd, busy():
        one.process.kill()
        one.process.wait(LIMIT_S)
        takedown.stop(StateDir(tmp_path))
        assert ends_within(pidfd, 0.0), "the stop has returned, and the keeper still runs"


def test_the_keeper_of_a_running_process_is_reported_after_the_limit(tmp_path: Path) -> None:
    """The process replaces each keeper that ends."""
    with running(mark=tmp_path) as one:
        assert processes.end_keepers(tmp_path, 0.0) == [Process(one.keeper, NAME)]


@pytest.mark.smoke
def test_the_supervisor_has_a_keeper_and_takes_it_along_when_it_ends() -> None:
    with subprocess.Popen([sys.executable, "-m", "supervisor", "--endpoint", free_endpoint()]) as process:
        try:
            until(lambda: bool(keepers_of(process.pid)))
            (keeper,) = keepers_of(process.pid)
            with handle(keeper) as pidfd:
                process.terminate()
                assert process.wait(LIMIT_S) == 0
                assert ends_within(pidfd, KEEP_S / 2)
        finally:
            process.kill()


SERVICE = """
import sys
from wire.host.process import run_process

async def main(stop):
    print("up", flush=True)
    await stop.wait()
    return 0

run_process("service", main, memory_keeper=sys.argv[1] == "kept")
"""


@pytest.mark.parametrize("kept", [True, False])
def test_a_service_has_a_keeper_unless_the_configuration_forbids_it(*, kept: bool) -> None:
    command = [sys.executable, "-c", SERVICE, "kept" if kept else ""]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        assert len(keepers_of(process.pid)) == kept
        process.terminate()
        assert process.wait(LIMIT_S) == 0
