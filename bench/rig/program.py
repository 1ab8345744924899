"""Runs a program of a benchmark, which reads commands as lines and answers with lines."""

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from bench.rig.terminal import end, sparing_from_ctrl_c

ROOT = Path(__file__).resolve().parents[2]
LISTEN_LIMIT_S = 30.0


class SilentError(RuntimeError):
    """A program has printed nothing within its limit."""


@dataclass(frozen=True)
class Program:
    """A running program."""

    name: str
    process: "subprocess.Popen[str]"
    lines: "queue.Queue[str]"
    """What it prints; an empty line at its end."""
    told: threading.Lock = field(default_factory=threading.Lock)

    @property
    def pid(self) -> int:
        return self.process.pid

    def tell(self, line: str) -> None:
        """Send it a line; safe on any thread.

        Raises:
            RuntimeError: it has ended.
        """
        stdin = self.process.stdin
        assert stdin is not None
        try:
            with self.told:
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
def program(
    module: str, prefix: Sequence[str] = (), arguments: Sequence[str] = (), fds: Sequence[int] = ()
) -> Generator[Program]:
    """Run `python -m MODULE` while the context is open.

    Args:
        module: of the program.
        prefix: a command that runs it, such as one that enters a namespace.
        arguments: of the program.
        fds: file descriptors that it inherits.
    """
    with sparing_from_ctrl_c():
        process: subprocess.Popen[str] = subprocess.Popen(
            [*prefix, sys.executable, "-m", module, *arguments],
            cwd=ROOT,
            # A thread of the numeric library would make a fork unsafe.
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=fds,
        )
    lines: queue.Queue[str] = queue.Queue()
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None
    assert stdout is not None

    def read() -> None:
        for line in stdout:
            lines.put(line)
        lines.put("")

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        yield Program(module.rpartition(".")[2], process, lines)
    finally:
        end(process)
        reader.join()
        with suppress(BrokenPipeError):  # a line was not delivered, because the program has ended
            stdin.close()
        stdout.close()


def wait_until_listening(address: str) -> None:
    """Wait until a TCP port is open, by the kernel's table: a connection would be a client.

    Raises:
        RuntimeError: nothing listens in time.
    """
    port = f":{int(address.rpartition(':')[2]):04X}"
    deadline_s = time.monotonic() + LISTEN_LIMIT_S
    while time.monotonic() < deadline_s:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        if any(row[1].endswith(port) and row[3] == "0A" for row in rows):
            return
        time.sleep(0.01)
    raise RuntimeError(f"nothing listens on {address}")
