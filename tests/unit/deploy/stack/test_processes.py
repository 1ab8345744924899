"""Only our own programs with the mark of a state directory are signalled."""

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from deploy.stack import processes
from deploy.stack.processes import MARK, Process

SLEEP = "import time; time.sleep(60)"


@contextmanager
def _running(arguments: list[str], mark: Path | None) -> Generator[subprocess.Popen[bytes]]:
    environment = {k: v for k, v in os.environ.items() if k != MARK}
    if mark is not None:
        environment[MARK] = str(mark)
    child = subprocess.Popen([sys.executable, "-c", SLEEP, *arguments], env=environment)
    try:
        # Until exec, the child has our environment.
        deadline_s = time.monotonic() + 5
        while SLEEP.encode() not in Path(f"/proc/{child.pid}/cmdline").read_bytes():
            assert time.monotonic() < deadline_s
        yield child
    finally:
        child.kill()
        child.wait()


def test_a_marked_program_of_ours_is_found_by_its_name(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path) as child:
        assert processes.of(tmp_path) == [Process(child.pid, "sim")]


def test_the_child_of_a_process_that_ends_while_processes_are_looked_for_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with a supervisord that becomes a daemon: it is gone before it is read, and its child was not listed."""
    with ExitStack() as stack, _running(["-m", "sim"], tmp_path) as parent:
        name_of = processes._name  # pyright: ignore[reportPrivateUsage] - it reads a process

        def name_after_the_fork(pid: int, state_dir: Path) -> str | None:
            if pid == parent.pid:
                children.append(stack.enter_context(_running(["-m", "sim"], tmp_path)))
                parent.kill()
                parent.wait()
            return name_of(pid, state_dir)

        children: list[subprocess.Popen[bytes]] = []
        monkeypatch.setattr(processes, "_name", name_after_the_fork)
        found = processes.of(tmp_path)
        assert found == [Process(child.pid, "sim") for child in children]


def test_processes_are_found_while_others_start_all_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = Path.iterdir
    pids = itertools.count(1 << 30)

    def with_a_new_one(path: Path) -> Iterator[Path]:
        yield from listed(path)
        yield path / str(next(pids))

    with _running(["-m", "sim"], tmp_path) as child:
        monkeypatch.setattr(Path, "iterdir", with_a_new_one)
        assert processes.of(tmp_path) == [Process(child.pid, "sim")]


def test_a_marked_process_that_is_no_program_of_ours_is_left_alone(tmp_path: Path) -> None:
    with _running([], tmp_path):
        assert processes.of(tmp_path) == []


def test_a_program_of_another_state_directory_is_left_alone(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path / "other"), _running(["-m", "sim"], None):
        assert processes.of(tmp_path) == []


def test_a_signal_goes_to_the_process_that_was_found(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path) as child:
        processes.send(Process(child.pid, "sim"), tmp_path, signal.SIGKILL)
        assert child.wait(5) == -signal.SIGKILL
        assert processes.wait_for_none(tmp_path, 5) == []


def test_a_pid_that_is_somebody_elses_by_now_gets_no_signal(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path / "other") as child:
        processes.send(Process(child.pid, "sim"), tmp_path, signal.SIGKILL)
        assert child.poll() is None


def test_a_process_that_has_ended_gets_no_signal(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path) as child:
        child.kill()
        child.wait()
        processes.send(Process(child.pid, "sim"), tmp_path, signal.SIGTERM)


def test_a_process_that_does_not_end_is_reported_after_the_limit(tmp_path: Path) -> None:
    with _running(["-m", "sim"], tmp_path) as child:
        assert processes.wait_for_none(tmp_path, 0.01) == [Process(child.pid, "sim")]
