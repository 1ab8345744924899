"""A simulated operator: drives, releases the controls, sometimes insists, and sometimes presses the e-stop."""

import asyncio
from contextlib import suppress
from random import Random

from faults.simulated.scenario import Drivers
from faults.simulated.world import World
from teleop.pilots.keys import PRESENCE_KEY
from wire import topics
from wire.bus import NoReplyError
from wire.messages import SafetyStatus

LINEAR_STEP_M_S, ANGULAR_STEP_RAD_S = 0.1, 0.2
"""Changes of the speeds by one key press."""
LOOKS_S = (0.1, 0.7)
ESTOP_SHARE = 0.01


class Operator:
    """Simulates the operator of a world; the seed determines the actions."""

    def __init__(self, world: World) -> None:
        self._world, self._stubbornness = world, world.scenario.stubbornness
        self._random: Random = world.scenario.stream("operator")
        self.is_patient = False
        """Whether the operator has released the controls and no longer drives."""

    async def run(self) -> None:
        while True:
            act = self._insist if self._world.scenario.straight and not self.is_patient else self._act
            act()
            self._show_presence()
            await asyncio.sleep(self._random.uniform(*LOOKS_S))

    def _act(self) -> None:
        random, status = self._random, self._world.status
        if self.is_patient:
            self._recover()
            return
        if random.random() < ESTOP_SHARE:
            self._press(" ")
            return
        if status is None or not status.reasons:
            if random.random() < 0.5 or self._is_neutral:
                self._drive_somewhere()
            return
        if random.random() < self._stubbornness:
            if random.random() < 0.3:
                self._drive_somewhere()
            return
        if "OBSTACLE" in status.reasons and random.random() < 0.6:
            self._ask(random.choice((-0.3, -0.2, 0.0)), random.choice((-1.0, -0.6, 0.6, 1.0)))
            return
        self._ask(0.0, 0.0)
        if "ESTOP" in status.reasons and random.random() < 0.5:
            self._reset()

    def _insist(self) -> None:
        """Drive straight on; after each stop, send neutral and drive on."""
        random, status = self._random, self._world.status
        is_stopped = status is not None and bool(status.reasons)
        if is_stopped and random.random() >= self._stubbornness:
            self._recover()
        elif is_stopped or status is None or status.commanded.linear.x == 0.0:
            self._ask(0.0, 0.0)  # keys that were pressed while it was stopped have come to nothing
            self._ask(random.choice((1.0, 0.8, 0.6)), 0.0)

    def _recover(self) -> None:
        """Send neutral, and reset an e-stop."""
        self._ask(0.0, 0.0)
        if (status := self._world.status) is not None and "ESTOP" in status.reasons:
            self._reset()

    @property
    def _is_neutral(self) -> bool:
        keyboard = self._world.keyboard
        if self._world.scenario.drivers is Drivers.STUBBORN:
            return self._world.velocity == (0.0, 0.0)
        return keyboard is None or keyboard.steps == (0, 0)

    def _drive_somewhere(self) -> None:
        random = self._random
        linear_m_s = random.choice((1.0, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0, -0.3, -0.6))
        angular_rad_s = random.choice((0.0, 0.0, 0.0, 0.4, -0.4, 1.0, -1.0, 2.0, -2.0))
        self._ask(linear_m_s, angular_rad_s)

    def _ask(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Command a velocity: by keys for teleop, directly for the other sources."""
        if self._world.scenario.drivers is not Drivers.TELEOP:
            self._world.velocity = (linear_m_s, angular_rad_s)
        keyboard = self._world.keyboard
        if keyboard is None:
            return
        if linear_m_s == angular_rad_s == 0.0:
            keyboard.steps = (0, 0)
            keyboard.press("s")
            return
        forward, left = round(linear_m_s / LINEAR_STEP_M_S), round(angular_rad_s / ANGULAR_STEP_RAD_S)
        more, turn = forward - keyboard.steps[0], left - keyboard.steps[1]
        keyboard.steps = (forward, left)
        keyboard.press(("w" if more > 0 else "x") * abs(more) + ("a" if turn > 0 else "d") * abs(turn))

    def _show_presence(self) -> None:
        """Renew vigilance while motion is requested."""
        keyboard = self._world.keyboard
        if keyboard is not None and keyboard.steps != (0, 0):
            keyboard.press((PRESENCE_KEY,))

    def _press(self, key: str) -> None:
        if self._world.keyboard is not None:
            self._world.keyboard.steps = (0, 0)
            self._world.keyboard.press(key)

    def _reset(self) -> None:
        if self._world.may_reset and self._world.scenario.drivers is not Drivers.STUBBORN:
            self._press("r")


async def reset_from_outside(world: World) -> None:
    """Request a reset from another program until the e-stop is released."""
    bus = world.network.open_client("outsider")
    await bus.connect()
    while True:
        status: SafetyStatus | None = world.status
        if world.may_reset and status is not None and "ESTOP" in status.reasons:
            with suppress(NoReplyError):
                await bus.call(topics.SUPERVISOR_RESET, timeout_s=0.5)
        await asyncio.sleep(0.4)
