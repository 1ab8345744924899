"""An e-stop, then the death of a process: only a reset may end the stop."""

import signal
import time
from random import Random

from faults.real.injectors.injection import Injection, Plan, lasting
from faults.real.rig.stage import Stage, StageError
from wire import topics
from wire.messages import Bool

PRESSED_S = 1.0
"""Time by which zero must have been sent."""
LOOK_S = 0.05
INSISTS_S = 1.5
NODES = (topics.TELEOP, topics.SUPERVISOR, topics.SIM)


class EstopAndKill(Injection):
    """Press the e-stop, kill a process, then request neutral and motion without a reset.

    Args:
        node: the process to kill.
        pause_s: time from the press to the kill.
    """

    def __init__(self, node: str, pause_s: float) -> None:
        super().__init__(LOOK_S, pause_s=pause_s)
        self._node, self._pause_s = node, pause_s

    async def do(self, stage: Stage) -> float:
        at_s = time.monotonic()
        stage.observer.bus.publisher(topics.ESTOP).put(Bool(data=True))
        if not await stage.observer.until(
            lambda seen: any(one.is_zero and one.arrival_s > at_s for one in seen.commands[-200:]), PRESSED_S
        ):
            raise StageError("the e-stop did not reach the supervisor")
        await stage.observer.watch(self._pause_s)
        stage.observer.alive.discard(self._node)
        stage.signal(self._node, signal.SIGKILL)
        return at_s

    async def lift(self, stage: Stage) -> None:
        """Wait until all processes are alive; the operator then sends neutral, and requests motion."""
        await stage.alive(topics.TELEOP)
        until_s = time.monotonic() + INSISTS_S
        while time.monotonic() < until_s:
            stage.teleop.press("s")
            await stage.observer.watch(3 * LOOK_S)
            stage.teleop.press("wwww")
            await stage.observer.watch(6 * LOOK_S)


def _estop(node: str) -> Plan:
    def plan(chance: Random) -> Injection:
        return EstopAndKill(node, lasting(chance, 0.0, 0.3))

    return plan


PLANS: dict[str, Plan] = {f"estop_{node}_sigkill": _estop(node) for node in NODES}
