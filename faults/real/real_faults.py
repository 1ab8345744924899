"""The faults that only real processes can have, and which faults the real campaign injects."""

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from functools import partial
from pathlib import Path
from random import Random

from faults.classes import BY_NAME, PAIR, SILENT_BOUND_S, Group, real_classes
from faults.injection import DRAWS, HEALED_AFTER_S, lasting
from faults.port import Fault
from faults.promises import KILL_MEDIAN_S
from faults.real.rig import cable
from faults.real.rig.stage import NODES, UNPLUGGED, Stage, StageError
from wire import topics
from wire.host.installation import how_to_install, require

NOT_IN_PAIRS = frozenset({Group.SUPERVISORD, Group.MACHINE, Group.PAIR})
"""Each of these affects the whole stage."""
ONE_OF = ("wire_", "sim_scan_", "net_")
"""Only one fault of each of these kinds can be in force at a time."""

RESTART_LIMIT_S = 15.0
POLL_S = 0.1
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
BUSY_LEEWAY_S = SILENT_BOUND_S - KILL_MEDIAN_S
"""With so many competitors, a process may be scheduled late; the command timeout is then the bound."""
FILLER = "filler"
FILLER_BYTES = 1 << 20

RealDraw = Callable[[Random], Fault[Stage]]


# --- supervisord


async def _supervisord_killed(stage: Stage) -> AsyncGenerator[float]:
    """Its child processes continue; only a restart of the whole stack starts a new one."""
    yield stage.signal("supervisord", signal.SIGKILL)
    await stage.restart_supervisord()


async def _supervisord_restarted(stage: Stage) -> AsyncGenerator[float]:
    """Make supervisord stop and restart its child processes, and wait until new ones have replaced the old ones."""
    before = {node: stage.pid(node) for node in NODES}
    yield stage.signal("supervisord", signal.SIGHUP)
    deadline_s = time.monotonic() + RESTART_LIMIT_S
    while before and time.monotonic() < deadline_s:
        await stage.pause(POLL_S)
        before = {node: pid for node, pid in before.items() if _is(stage, node, pid)}


def _is(stage: Stage, node: str, pid: int) -> bool:
    """Return whether the old process is still the current one, or no new one exists yet."""
    try:
        return stage.pid(node) == pid
    except StageError:
        return True


async def _crash_loop(stage: Stage) -> AsyncGenerator[float]:
    """Kill a child process, and let it end at each start."""
    crash = stage.crash_file(topics.SIM)
    crash.touch()
    try:
        yield stage.kill(topics.SIM)
    finally:
        crash.unlink()


# --- the cable


async def _unplugged(stage: Stage) -> AsyncGenerator[float]:
    """Unplug teleop's cable, with the kernel's own TCP on both sides."""
    now_s = time.monotonic()
    stage.cable.unplug()
    yield now_s
    stage.cable.plug()


# --- the machine: an overload begins, and teleop is killed a moment later


def _crowd(low_s: float, high_s: float, command: Sequence[str], count: int) -> RealDraw:
    """Overload by processes that only consume."""

    def draw(chance: Random) -> Fault[Stage]:
        pause_s = lasting(chance, low_s, high_s)

        async def steps(stage: Stage) -> AsyncGenerator[float]:
            takers = [_started(command) for _ in range(count)]
            try:
                await stage.pause(pause_s)
                yield stage.kill(topics.TELEOP)
            finally:
                for taker in takers:
                    taker.kill()
                for taker in takers:
                    await asyncio.to_thread(taker.wait)

        return Fault(steps, lasts_s=0.5, also=("teleop_sigkill",), leeway_s=BUSY_LEEWAY_S)

    return draw


def _started(command: Sequence[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)


async def _disk_full(stage: Stage, pause_s: float) -> AsyncGenerator[float]:
    """Fill the disk with the logs and the black boxes."""
    filler = stage.state.path / FILLER
    try:
        fill(filler)
        await stage.pause(pause_s)
        yield stage.kill(topics.TELEOP)
    finally:
        filler.unlink(missing_ok=True)


def fill(path: Path) -> None:
    """Fill the remaining disk space."""
    with path.open("wb", buffering=0) as file:
        size = FILLER_BYTES
        while size:
            try:
                file.write(bytes(size))
            except OSError:
                size //= 16


REAL_DRAWS: dict[str, RealDraw] = {
    UNPLUGGED: lambda chance: Fault(_unplugged, lasts_s=chance.choice(HEALED_AFTER_S)),
    "supervisord_sigkill": lambda _: Fault(_supervisord_killed, lasts_s=0.5),
    "supervisord_restart": lambda _: Fault(_supervisord_restarted, lasts_s=0.5),
    "supervisord_crash_loop": lambda chance: Fault(_crash_loop, lasts_s=lasting(chance, 1.0, 2.0)),
    "machine_cpu_hogs": _crowd(0.2, 0.5, ["/bin/sh", "-c", HOG], HOGS),
    "machine_memory": _crowd(0.4, 0.8, [sys.executable, "-c", GREEDY], 1),
    "machine_disk": lambda chance: Fault(
        partial(_disk_full, pause_s=lasting(chance, 0.1, 0.4)), lasts_s=0.8, also=("teleop_sigkill",)
    ),
}


def draw_pair(chance: Random) -> tuple[str, str]:
    """Draw two classes that can be in force at the same time."""
    names = [
        one.name
        for one in real_classes()
        if one.group not in NOT_IN_PAIRS and not one.by_itself and one.name != UNPLUGGED
    ]
    while True:
        first, second = chance.sample(names, 2)
        if not any(first.startswith(kind) and second.startswith(kind) for kind in ONE_OF):
            return first, second


def planned(name: str, seed: int) -> list[tuple[str, Fault[Stage]]]:
    """Return the faults of a trial; the same seed gives the same faults."""
    chance = Random(f"{name} {seed}")  # noqa: S311 - to be repeated is what it is for
    names = draw_pair(chance) if name == PAIR else (name,)
    draws: dict[str, RealDraw] = {**DRAWS, **REAL_DRAWS}
    faults = [(one, draws[one](chance)) for one in names]
    if name == PAIR:
        for _, fault in faults:
            fault.parameters[PAIR] = " and ".join(names)
    return faults


def why_not(name: str, stage: Stage) -> str | None:
    """Return why this fault cannot be injected on this machine, in one sentence; None if it can."""
    if name == UNPLUGGED:
        return cable.why_not()
    if BY_NAME[name].group is Group.STATION:
        try:
            require("station")
        except ModuleNotFoundError:
            return how_to_install("station")
    if name == "machine_disk" and not stage.has_disk:
        return "filling the state directory needs the right to mount a small disk there (root)"
    return None
