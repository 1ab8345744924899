"""Runs one of this package's programs, which reads commands as lines and answers with lines."""

import os
import queue
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from bench.rig.terminal import end

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Program:
    """A running program of this package."""

    name: str
    process: "subprocess.Popen[str]"
    lines: "queue.Queue[str]"
    """What it prints; an empty line at its end."""

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
            RuntimeError: it has ended, or prints nothing within the limit.
        """
        try:
            line = self.lines.get(timeout=limit_s)
        except queue.Empty:
            raise RuntimeError(f"the {self.name} printed nothing for {limit_s:g} s") from None
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
    name: str, prefix: Sequence[str] = (), arguments: Sequence[str] = (), fds: Sequence[int] = ()
) -> Generator[Program]:
    """Run `python -m bench.link.NAME` while the context is open.

    Args:
        name: of the program.
        prefix: a command that runs it, such as one that enters a namespace.
        arguments: of the program.
        fds: file descriptors that it inherits.
    """
    process: subprocess.Popen[str] = subprocess.Popen(
        [*prefix, sys.executable, "-m", f"bench.link.{name}", *arguments],
        cwd=ROOT,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=fds,
        start_new_session=True,  # Ctrl-C in the terminal must reach only the bench, which ends its programs
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
        yield Program(name, process, lines)
    finally:
        end(process)
        reader.join()
        with suppress(BrokenPipeError):  # a line was not delivered, because the program has ended
            stdin.close()
        stdout.close()
