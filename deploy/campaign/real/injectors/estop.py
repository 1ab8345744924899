"""An e-stop, and the death of a process: whatever starts again, and whoever asks for motion, only a reset ends it."""

import signal
import time
from random import Random

from deploy.campaign.real.injectors.injection import Injection, Plan, lasting
from deploy.campaign.real.rig.stage import Stage, StageError
from wire import topics
from wire.messages import Bool

PRESSED_S = 1.0
"""By then zero must be out, or there was no e-stop."""
LOOK_S = 0.05
INSISTS_S = 1.5
NODES = (topics.TELEOP, topics.SUPERVISOR, topics.SIM)


class EstopAndKill(Injection):
    """Pressed; then SIGKILL; then neutral and motion from an operator who does not reset.

    Args:
        node: what dies.
        pause_s: from the press to its death.
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
        """Everything is there again; the operator is neutral, and then asks for motion."""
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
