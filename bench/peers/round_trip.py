"""Measures how long a command takes from a driver through the middle and back, at several rates, in interleaved rounds."""

import json
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.peers.kinds import Kind
from bench.rig.program import ROOT

RATES_HZ = (20.0, 100.0, 500.0)
LIMIT_S = 120.0


@dataclass(frozen=True)
class RoundTrip:
    """The times of one kind at one rate in one round."""

    kind: str
    rate_hz: float
    round: int
    sent: int
    times_ms: tuple[float, ...]
    """Of the commands that arrived."""

    @property
    def median_ms(self) -> float:
        return float(np.median(self.times_ms))


def measure(kinds: Sequence[Kind], rounds: int, count: int, tell: Callable[[str], None]) -> list[RoundTrip]:
    """Measure all kinds in each round, so that a slow moment of the machine affects all of them.

    Args:
        kinds: what is compared.
        rounds: number of rounds.
        count: number of commands for each kind, rate and round.
        tell: called with a sentence of progress.

    Raises:
        RuntimeError: a process fails.
    """
    return [
        trip
        for number in range(rounds)
        for kind in kinds
        for trip in _round(kind, number, count, lambda text, n=number: tell(f"round {n + 1}: {text}"))
    ]


def _round(kind: Kind, number: int, count: int, tell: Callable[[str], None]) -> list[RoundTrip]:
    tell(kind.name)
    pairs = [str(value) for rate_hz in RATES_HZ for value in (rate_hz, count)]
    with kind.middle() as address:
        done = subprocess.run(
            kind.command("driver", address, *pairs),
            cwd=ROOT,
            env=kind.environment,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    lines = [line for line in done.stdout.splitlines() if line.startswith("[")]
    if done.returncode != 0 or len(lines) != len(RATES_HZ):
        raise RuntimeError(f"the driver of {kind.name} failed: {done.stderr[-400:]}")
    return [
        RoundTrip(kind.name, rate_hz, number, count, tuple(json.loads(line)))
        for rate_hz, line in zip(RATES_HZ, lines, strict=True)
    ]
