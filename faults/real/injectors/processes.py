"""Faults of a process: kill, stop, block or end it."""

import asyncio
import os
import signal
import time
from contextlib import suppress
from random import Random

from faults.real.injectors.injection import Injection, Plan, lasting
from faults.real.rig.stage import NODES, Stage, StageError
from wire import topics

RESTART_LIMIT_S = 15.0
POLL_S = 0.1


class Signalled(Injection):
    """Send a signal to a node, and optionally another one later."""

    def __init__(
        self, node: str, number: signal.Signals, lasts_s: float = 0.0, then: signal.Signals | None = None
    ) -> None:
        super().__init__(lasts_s)
        self._node, self._number, self._then = node, number, then

    async def do(self, stage: Stage) -> float:
        return stage.signal(self._node, self._number)

    async def lift(self, stage: Stage) -> None:
        if self._then is not None:
            stage.signal(self._node, self._then)


class Ordered(Injection):
    """Give an order to a faulty process; see faulty_process.py."""

    def __init__(self, node: str, order: str, lasts_s: float = 0.0) -> None:
        super().__init__(lasts_s, how=order.split(maxsplit=1)[0])
        self._node, self._order = node, order

    async def do(self, stage: Stage) -> float:
        return stage.order(self._node, self._order)


class HungUp(Injection):
    """Close teleop's terminal."""

    async def do(self, stage: Stage) -> float:
        return stage.teleop.hang_up()


class InputEnded(Injection):
    """End teleop's keyboard input; its screen remains."""

    async def do(self, stage: Stage) -> float:
        return stage.teleop.end_input()


class BothKilled(Injection):
    """Kill supervisor and teleop together."""

    async def do(self, stage: Stage) -> float:
        pids = (stage.pid(topics.SUPERVISOR), stage.pid(topics.TELEOP))
        now_s = time.monotonic()
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return now_s


class SupervisordKilled(Injection):
    """Kill supervisord; its child processes continue. Only a restart of the whole stack starts a new one."""

    async def do(self, stage: Stage) -> float:
        return stage.signal("supervisord", signal.SIGKILL)

    async def lift(self, stage: Stage) -> None:
        await stage.restart_supervisord()


class SupervisordRestarted(Injection):
    """Make supervisord stop and restart its child processes, which takes some seconds."""

    def __init__(self) -> None:
        super().__init__(0.5)
        self._before: dict[str, int] = {}

    async def do(self, stage: Stage) -> float:
        self._before = {node: stage.pid(node) for node in NODES}
        return stage.signal("supervisord", signal.SIGHUP)

    async def lift(self, stage: Stage) -> None:
        """Wait until new processes have replaced the old ones."""
        deadline_s = time.monotonic() + RESTART_LIMIT_S
        while self._before and time.monotonic() < deadline_s:
            await stage.observer.watch(POLL_S)
            self._before = {node: pid for node, pid in self._before.items() if _is(stage, node, pid)}


def _is(stage: Stage, node: str, pid: int) -> bool:
    """Return whether the old process is still the current one, or no new one exists yet."""
    try:
        return stage.pid(node) == pid
    except StageError:
        return True


class CrashLoop(Injection):
    """Kill a child process, and let it end at each start."""

    def __init__(self, lasts_s: float) -> None:
        super().__init__(lasts_s)

    async def do(self, stage: Stage) -> float:
        stage.crash_loop(topics.SIM, ends=True)
        return stage.signal(topics.SIM, signal.SIGKILL)

    async def lift(self, stage: Stage) -> None:
        stage.crash_loop(topics.SIM, ends=False)
        await asyncio.sleep(0)


def _killed(node: str) -> Plan:
    return lambda _: Signalled(node, signal.SIGKILL)


def _stopped(node: str) -> Plan:
    return lambda chance: Signalled(node, signal.SIGSTOP, lasting(chance, 0.3, 1.2), signal.SIGCONT)


def _blocked(node: str, *how: str) -> Plan:
    def plan(chance: Random) -> Injection:
        lasts_s = lasting(chance, 0.35, 1.2)
        return Ordered(node, f"{chance.choice(how)} {lasts_s}", lasts_s)

    return plan


def _restarted(chance: Random) -> Injection:
    """Restart the supervisor by a signal, or by an exception."""
    if chance.random() < 0.5:
        return Ordered(topics.SUPERVISOR, "raise")
    return Signalled(topics.SUPERVISOR, signal.SIGTERM)


PLANS: dict[str, Plan] = {
    "teleop_sigkill": _killed(topics.TELEOP),
    "teleop_sigterm": lambda _: Signalled(topics.TELEOP, signal.SIGTERM),
    "teleop_sigstop": _stopped(topics.TELEOP),
    "teleop_blocked": _blocked(topics.TELEOP, "block"),
    "teleop_exception": lambda _: Ordered(topics.TELEOP, "raise"),
    "teleop_hang_up": lambda _: HungUp(),
    "teleop_end_of_input": lambda _: InputEnded(),
    "teleop_gil": _blocked(topics.TELEOP, "gil"),
    "supervisor_sigkill": _killed(topics.SUPERVISOR),
    "supervisor_sigstop": _stopped(topics.SUPERVISOR),
    "supervisor_blocked": _blocked(topics.SUPERVISOR, "block", "gil", "decided"),
    "supervisor_and_teleop_sigkill": lambda _: BothKilled(),
    "supervisor_restart": _restarted,
    "sim_sigkill": _killed(topics.SIM),
    "sim_sigstop": _stopped(topics.SIM),
    "sim_blocked": _blocked(topics.SIM, "block", "gil"),
    "supervisord_sigkill": lambda _: SupervisordKilled(0.5),
    "supervisord_restart": lambda _: SupervisordRestarted(),
    "supervisord_crash_loop": lambda chance: CrashLoop(lasting(chance, 1.0, 2.0)),
}
