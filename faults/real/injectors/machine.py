"""Lack of CPU, memory or disk space, during which teleop is killed and must be detected as dead."""

import asyncio
import signal
import subprocess
import sys
from pathlib import Path
from random import Random

from faults.classes import KILL_BOUND_S, SILENT_BOUND_S
from faults.real.injectors.injection import Injection, Plan, lasting
from faults.real.rig.stage import Stage
from wire import topics

HOGS = 8
HOG = "ulimit -t 30; while :; do :; done"
"""It ends by itself, even if the campaign is killed."""
GREEDY_BYTES = 1 << 30
GREEDY = f"""
import time
held, end_s = bytearray({GREEDY_BYTES}), time.monotonic() + 30
while time.monotonic() < end_s:
    for at in range(0, len(held), 4096):
        held[at] = held[at] + 1 & 255
"""
BUSY_LEEWAY_S = SILENT_BOUND_S - KILL_BOUND_S
"""With so many competitors, a process may be scheduled late; the command timeout is then the bound."""
FILLER = "filler"
FILLER_BYTES = 1 << 20


class InTrouble(Injection):
    """Start the overload, and kill teleop a moment later."""

    also = ("teleop_sigkill",)

    def __init__(self, pause_s: float) -> None:
        super().__init__(then="teleop_sigkill")
        self._pause_s = pause_s

    def begin(self, stage: Stage) -> None:
        raise NotImplementedError

    async def do(self, stage: Stage) -> float:
        self.begin(stage)
        await stage.observer.watch(self._pause_s)
        return stage.signal(topics.TELEOP, signal.SIGKILL)


class Crowded(InTrouble):
    """Overload by processes that only consume."""

    leeway_s = BUSY_LEEWAY_S

    def __init__(self, pause_s: float, command: list[str], count: int) -> None:
        super().__init__(pause_s)
        self.lasts_s = 0.5
        self._command, self._count = command, count
        self._takers: list[subprocess.Popen[bytes]] = []

    def begin(self, stage: Stage) -> None:  # noqa: ARG002 - as every trouble
        self._takers = [
            subprocess.Popen(self._command, stdin=subprocess.DEVNULL, start_new_session=True)
            for _ in range(self._count)
        ]

    async def lift(self, stage: Stage) -> None:  # noqa: ARG002 - likewise
        for taker in self._takers:
            taker.kill()
        for taker in self._takers:
            await asyncio.to_thread(taker.wait)
        self._takers = []


class DiskFull(InTrouble):
    """Fill the disk with the logs and the black boxes."""

    def __init__(self, pause_s: float) -> None:
        super().__init__(pause_s)
        self.lasts_s = 0.8

    def begin(self, stage: Stage) -> None:
        fill(stage.state.path / FILLER)

    async def lift(self, stage: Stage) -> None:
        (stage.state.path / FILLER).unlink(missing_ok=True)


def fill(path: Path) -> None:
    """Fill the remaining disk space."""
    with path.open("wb", buffering=0) as file:
        size = FILLER_BYTES
        while size:
            try:
                file.write(bytes(size))
            except OSError:
                size //= 16


def _hogs(chance: Random) -> Injection:
    return Crowded(lasting(chance, 0.2, 0.5), ["/bin/sh", "-c", HOG], HOGS)


def _memory(chance: Random) -> Injection:
    return Crowded(lasting(chance, 0.4, 0.8), [sys.executable, "-c", GREEDY], 1)


PLANS: dict[str, Plan] = {
    "machine_cpu_hogs": _hogs,
    "machine_memory": _memory,
    "machine_disk": lambda chance: DiskFull(lasting(chance, 0.1, 0.4)),
}
