"""Child processes of a benchmark: commands that run beside it, and programs that read and answer lines. All are reaped."""

import ctypes
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from wire.host.connections import LISTENING, tcp_sockets

ROOT = Path(__file__).resolve().parents[2]
LISTEN_LIMIT_S, END_LIMIT_S = 30.0, 5.0
_PR_SET_PDEATHSIG = 1


class SilentError(RuntimeError):
    """A program has printed nothing within its limit."""


@dataclass(frozen=True)
class Program:
    """A running program."""

    name: str
    process: "subprocess.Popen[str]"
    lines: "queue.Queue[str]"
    """What it prints; an empty line at its end."""

    @property
    def pid(self) -> int:
        return self.process.pid

    def tell(self, line: str) -> None:
        """Send it a line.

        Raises:
            RuntimeError: it has ended.
        """
        stdin = self.process.stdin
        assert stdin is not None
        try:
            stdin.write(line + "\n")
            stdin.flush()
        except BrokenPipeError:
            raise RuntimeError(f"the {self.name} has failed") from None

    def line(self, limit_s: float) -> str:
        """Return its next line.

        Raises:
            SilentError: it prints nothing within the limit.
            RuntimeError: it has ended.
        """
        try:
            line = self.lines.get(timeout=limit_s)
        except queue.Empty:
            raise SilentError(f"the {self.name} printed nothing for {limit_s:g} s") from None
        if not line:
            raise RuntimeError(f"the {self.name} has failed")
        return line

    def expect(self, word: str, limit_s: float) -> None:
        """Wait for a line.

        Raises:
            RuntimeError: it has ended, or prints something else or nothing within the limit.
        """
        line = self.line(limit_s).strip()
        if line != word:
            raise RuntimeError(f"the {self.name} printed {line!r} instead of {word!r}")


@contextmanager
def running(
    command: Sequence[str],
    environment: Mapping[str, str] | None = None,
    *,
    stdin: int | None = None,
    stdout: int | IO[bytes] = subprocess.DEVNULL,
    stderr: int | IO[bytes] | None = None,
    fds: Sequence[int] = (),
) -> Generator["subprocess.Popen[str]"]:
    """Run a command in the checkout while the context is open; its output is discarded, and its errors are shown.

    Args:
        command: the words.
        environment: None: that of this process.
        stdin: this and the other two files as for `Popen`.
        stdout: None is not possible, because the tables of the bench are there.
        stderr: None: that of this process.
        fds: file descriptors that it inherits.
    """
    # It inherits the mask, and ignores Ctrl-C: the bench ends it, and it prints no traceback.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process: subprocess.Popen[str] = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment,
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            text=True,
            pass_fds=fds,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield process
    finally:
        end(process)


def program(
    module: str,
    prefix: Sequence[str] = (),
    arguments: Sequence[str] = (),
    fds: Sequence[int] = (),
    name: str | None = None,
) -> AbstractContextManager[Program]:
    """Run `python -m MODULE` while the context is open.

    Args:
        module: of the program.
        prefix: a command that runs it, such as one that enters a namespace.
        arguments: of the program.
        fds: file descriptors that it inherits.
        name: for errors; None: the module's.
    """
    # A thread of the numeric library would make a fork unsafe.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    command = [*prefix, sys.executable, "-m", module, *arguments]
    return talking(name or module.rpartition(".")[2], command, environment, fds)


@contextmanager
def talking(
    name: str, command: Sequence[str], environment: Mapping[str, str] | None = None, fds: Sequence[int] = ()
) -> Generator[Program]:
    """Run a program that reads and prints lines while the context is open; the arguments are those of `running`."""
    lines: queue.Queue[str] = queue.Queue()
    pipe = subprocess.PIPE
    with (
        ExitStack() as closing,
        running(command, environment, stdin=pipe, stdout=pipe, fds=fds) as process,
    ):
        stdin, stdout = process.stdin, process.stdout
        assert stdin is not None
        assert stdout is not None

        def read() -> None:
            for line in stdout:
                lines.put(line)
            lines.put("")

        reader = threading.Thread(target=read, daemon=True)
        reader.start()

        def close() -> None:
            reader.join()
            with suppress(BrokenPipeError):  # a line was not delivered, because the program has ended
                stdin.close()
            stdout.close()

        closing.callback(close)  # when the program has ended
        yield Program(name, process, lines)


def end(process: "subprocess.Popen[Any]") -> None:
    """Terminate a process, and kill it if it does not end in time."""
    process.terminate()
    try:
        process.wait(END_LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(END_LIMIT_S)


def die_with_parent() -> None:
    """Let the kernel kill this process, a fork, when the process that forked it ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def wait_until_listening(address: str) -> None:
    """Wait until a TCP port is open, by the kernel's table: a connection would be a client.

    Raises:
        RuntimeError: nothing listens in time.
    """
    port = f"{int(address.rpartition(':')[2]):04X}"
    deadline_s = time.monotonic() + LISTEN_LIMIT_S
    while time.monotonic() < deadline_s:
        if any(row.state == LISTENING for row in tcp_sockets((port, "0000"))):
            return
        time.sleep(0.01)
    raise RuntimeError(f"nothing listens on {address}")
