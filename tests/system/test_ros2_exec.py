"""`lifeline ros2 exec`: the token lives exactly as long as the program, which runs as if it had been started directly."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path

import pexpect
import pytest

from tests.system.harness import PATIENCE_S, Robot, robot
from wire import topics
from wire.bus import Inbox, LivelinessChange
from wire.topics import EXEC_SUFFIX

TOKEN = f"joy{EXEC_SUFFIX}"
RUNNING = "import os, signal, sys, time; print('running', flush=True); "
SLEEPS = RUNNING + "time.sleep(60)"
# A handler writes without a buffer: the signal may come while `print` is still at work, which refuses a second call.
COUNTS = RUNNING + (
    "signal.signal(signal.SIGINT, lambda *_: os.write(1, b'interrupted\\n')); "
    "signal.signal(signal.SIGTERM, lambda *_: (os.write(1, b'terminated\\n'), sys.exit(3))); "
    "print('ready', flush=True); "
    "[time.sleep(0.05) for _ in range(1200)]"
)
GENEROUS_S = 1.0
"""Far below the supervisor's command timeouts of a slow machine, far above what is measured."""


def command(endpoint: str, *program: str, source: str = "joy") -> list[str]:
    exec_ = [
        sys.executable,
        "-m",
        "lifeline.cli.app",
        "ros2",
        "exec",
        "--source",
        source,
        "--endpoint",
        endpoint,
    ]
    return [*exec_, "--", *program]


class Tokens:
    """The changes of the token of `lifeline ros2 exec --source joy`."""

    def __init__(self, inbox: Inbox[LivelinessChange]) -> None:
        self._inbox = inbox
        self.alive = False
        self.changed_s = 0.0

    def look(self) -> bool:
        for change in self._inbox.take():
            if change.node == TOKEN:
                self.alive, self.changed_s = change.alive, change.arrival_s
        return self.alive


@asynccontextmanager
async def supervised(tmp_path: Path) -> AsyncGenerator[tuple[Robot, Tokens]]:
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False) as subject:
        assert subject.bus is not None
        yield subject, Tokens(subject.bus.watch_alive())


@asynccontextmanager
async def started(
    subject: Robot, tokens: Tokens, program: str = SLEEPS
) -> "AsyncGenerator[tuple[subprocess.Popen[str], int]]":
    """Start a Python program under `exec`; yield the wrapper, and the program's pid, once it runs."""
    words = command(subject.endpoint, sys.executable, "-c", program)
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as wrapper:
        try:
            assert wrapper.stdout is not None
            assert wrapper.stdout.readline() == "running\n"
            await subject.until(tokens.look, "the token")
            yield wrapper, child_of(wrapper.pid)
        finally:
            wrapper.kill()


def child_of(pid: int) -> int:
    (child,) = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return int(child)


def handle_of(pid: int) -> int:
    return os.pidfd_open(pid)


def ended_within(handle: int, limit_s: float) -> bool:
    return bool(select.select([handle], [], [], limit_s)[0])


@pytest.mark.timed
async def test_the_token_goes_at_once_when_the_program_is_killed(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens), started(subject, tokens) as (wrapper, program):
        killed_s = time.monotonic()
        os.kill(program, signal.SIGKILL)
        await subject.until(lambda: not tokens.look(), "the end of the token")
        took_s = tokens.changed_s - killed_s
        print(f"program killed: its token is gone after {1000 * took_s:.1f} ms")
        assert took_s < GENEROUS_S
        assert wrapper.wait(PATIENCE_S) == 128 + signal.SIGKILL


@pytest.mark.timed
async def test_the_token_and_the_program_go_at_once_when_the_wrapper_is_killed(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens), started(subject, tokens) as (wrapper, program):
        handle = handle_of(program)
        killed_s = time.monotonic()
        wrapper.kill()
        assert ended_within(handle, PATIENCE_S)
        os.close(handle)
        await subject.until(lambda: not tokens.look(), "the end of the token")
        took_s = tokens.changed_s - killed_s
        print(f"wrapper killed: its token is gone after {1000 * took_s:.1f} ms")
        assert took_s < GENEROUS_S
        assert wrapper.wait(PATIENCE_S) == -signal.SIGKILL


@pytest.mark.smoke
async def test_the_token_exists_before_the_program_starts_and_its_exit_code_is_passed_on(
    tmp_path: Path,
) -> None:
    async with supervised(tmp_path) as (subject, tokens):
        wrapper = subprocess.Popen(
            command(subject.endpoint, "sh", "-c", "read go; exit 5"), stdin=subprocess.PIPE
        )
        await subject.until(tokens.look, "the token")
        assert wrapper.stdin is not None
        wrapper.stdin.write(b"go\n")
        wrapper.stdin.close()
        assert wrapper.wait(PATIENCE_S) == 5
        await subject.until(lambda: not tokens.look(), "the end of the token")


async def test_a_signal_to_the_wrapper_is_passed_on_and_the_token_lives_until_the_program_ends(
    tmp_path: Path,
) -> None:
    async with (
        supervised(tmp_path) as (subject, tokens),
        started(subject, tokens, COUNTS) as (wrapper, _),
    ):
        assert wrapper.stdout is not None
        assert wrapper.stdout.readline() == "ready\n"
        wrapper.send_signal(signal.SIGINT)
        assert wrapper.stdout.readline() == "interrupted\n"
        await subject.until(tokens.look, "the token")  # a busy machine may have ended it for a moment
        wrapper.send_signal(signal.SIGTERM)
        assert wrapper.stdout.read() == "terminated\n"
        assert wrapper.wait(PATIENCE_S) == 3


async def test_the_program_uses_the_terminal_and_gets_ctrl_c_once(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens):
        words = command(subject.endpoint, sys.executable, "-c", COUNTS)
        terminal: pexpect.spawn[str] = pexpect.spawn(
            words[0], words[1:], encoding="utf-8", timeout=PATIENCE_S
        )
        try:
            terminal.expect("ready")
            await subject.until(tokens.look, "the token")
            assert terminal.pid is not None
            program = child_of(terminal.pid)
            terminal.sendintr()
            terminal.expect("interrupted")
            os.kill(program, signal.SIGTERM)
            terminal.expect("terminated")
            assert terminal.before is not None
            assert "interrupted" not in terminal.before
            terminal.expect(pexpect.EOF)
            assert terminal.wait() == 3
        finally:
            terminal.close(force=True)


async def test_the_token_returns_after_a_restart_of_the_supervisor(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens), started(subject, tokens) as (wrapper, program):
        subject.kill(topics.SUPERVISOR)
        await subject.until(lambda: not tokens.look(), "the end of the token")
        subject.start(topics.SUPERVISOR)
        await subject.until(tokens.look, "the token again")
        os.kill(program, signal.SIGTERM)
        assert wrapper.wait(PATIENCE_S) == 128 + signal.SIGTERM


async def test_a_second_holder_of_the_same_source_is_refused(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens), started(subject, tokens) as (wrapper, program):
        second = run(command(subject.endpoint, "echo", "started"))
        assert (second.returncode, second.stdout) == (2, "")
        assert (
            f"another `lifeline ros2 exec --source joy` runs already, as process {wrapper.pid}: end it first"
            in second.stderr
        )
        await subject.until(tokens.look, "the token")
        os.kill(program, signal.SIGKILL)
        wrapper.wait(PATIENCE_S)


async def test_what_cannot_run_is_one_sentence_with_the_code_of_a_shell(tmp_path: Path) -> None:
    async with supervised(tmp_path) as (subject, tokens):
        plain = tmp_path / "plain"
        plain.touch()
        for program, code, words in (
            ("/nowhere/teleop", 127, "cannot run /nowhere/teleop: No such file"),
            (str(plain), 126, "Permission denied"),
        ):
            done = run(command(subject.endpoint, program))
            assert (done.returncode, words in done.stderr, "Traceback" in done.stderr) == (code, True, False)
        await subject.until(lambda: not tokens.look(), "the end of the token")


def run(words: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=PATIENCE_S)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_while_it_waits_for_the_supervisor_a_signal_ends_it_and_nothing_has_started(
    number: signal.Signals,
) -> None:
    words = command("tcp/127.0.0.1:9", "echo", "started")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as wrapper:
        assert wrapper.stderr is not None
        assert wrapper.stderr.readline() == "lifeline: waiting for the supervisor at tcp/127.0.0.1:9\n"
        handle = handle_of(child_of(wrapper.pid))
        wrapper.send_signal(number)
        assert wrapper.communicate(timeout=PATIENCE_S) == ("", "")
        assert wrapper.returncode == 128 + number
        assert ended_within(handle, PATIENCE_S)
        os.close(handle)


async def test_the_token_goes_while_both_are_stopped_as_by_ctrl_z_and_returns_with_them(
    tmp_path: Path,
) -> None:
    async with supervised(tmp_path) as (subject, tokens), started(subject, tokens) as (wrapper, program):
        for pid in (wrapper.pid, program):
            os.kill(pid, signal.SIGSTOP)
        await subject.until(lambda: not tokens.look(), "the end of the token")
        for pid in (wrapper.pid, program):
            os.kill(pid, signal.SIGCONT)
        await subject.until(tokens.look, "the token again")
        os.kill(program, signal.SIGTERM)
        assert wrapper.wait(PATIENCE_S) == 128 + signal.SIGTERM
