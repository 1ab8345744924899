"""Measures how long after the SIGKILL of a process its end is known to another one, in interleaved rounds."""

import queue
import subprocess
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from bench.peers.kinds import Kind
from bench.rig.program import ROOT
from bench.rig.terminal import end
from deploy.stack.launch import free_loopback_endpoint

LIMIT_S = 20.0


@dataclass(frozen=True)
class Death:
    """The times of one kind in one round."""

    kind: str
    round: int
    times_ms: tuple[float, ...]


def measure(kinds: Sequence[Kind], rounds: int, kills: int, tell: Callable[[str], None]) -> list[Death]:
    """Kill holders of each kind in each round.

    Raises:
        RuntimeError: an end is not noticed within the limit.
    """
    deaths: list[Death] = []
    for number in range(rounds):
        for kind in kinds:
            tell(f"round {number + 1}: SIGKILL, {kind.name}")
            deaths.append(Death(kind.name, number, tuple(_kills(kind, kills))))
    return deaths


def _kills(kind: Kind, kills: int) -> Generator[float]:
    with ExitStack() as ending:
        # TCP needs no relay: the watcher itself listens.
        address = free_loopback_endpoint() if kind.link == "tcp" else ending.enter_context(kind.middle())
        losses = ending.enter_context(_lines(kind, "watcher", address))
        _next(losses, kind)
        for _ in range(kills):
            with _lines(kind, "holder", address) as (process, lines):
                _next((process, lines), kind)
                killed_ns = time.monotonic_ns()
                process.kill()
                lost_ns = 0
                while lost_ns < killed_ns:  # an earlier one is a stop that had another cause
                    lost_ns = int(_next(losses, kind))
                yield (lost_ns - killed_ns) / 1e6


Lines = tuple["subprocess.Popen[str]", "queue.Queue[str]"]


@contextmanager
def _lines(kind: Kind, program: str, address: str) -> Generator[Lines]:
    """Run a program, and collect its lines."""
    process = subprocess.Popen(
        kind.command(program, address),
        cwd=ROOT,
        env=kind.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    lines: queue.Queue[str] = queue.Queue()
    stdout = process.stdout
    assert stdout is not None

    def read() -> None:
        for line in stdout:
            lines.put(line)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        yield process, lines
    finally:
        end(process)
        reader.join()
        stdout.close()


def _next(program: Lines, kind: Kind) -> str:
    try:
        return program[1].get(timeout=LIMIT_S)
    except queue.Empty:
        raise RuntimeError(f"{kind.name}: no line within {LIMIT_S:g} s") from None
