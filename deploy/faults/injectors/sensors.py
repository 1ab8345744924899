"""Faults of the sim's sensors, which it plays on request."""

import time
from contextlib import suppress
from random import Random

from deploy.faults.injectors.injection import Injection, Plan, lasting
from deploy.faults.stage import ALIVE_LIMIT_S, Stage, StageError

NONE = "none"
ASK_AGAIN_S = 0.1


class SensorFault(Injection):
    """A text of `topics.SIM_FAULTS`, and then none."""

    def __init__(self, faults: str, lasts_s: float) -> None:
        super().__init__(lasts_s, faults=faults)
        self._faults = faults

    async def do(self, stage: Stage) -> float:
        asked_s = await stage.sensors(self._faults)
        # Until it answered the sim may have gone on as before: by so much the fault may have begun later.
        self.leeway_s = time.monotonic() - asked_s
        return asked_s

    async def lift(self, stage: Stage) -> None:
        """As soon as there is a sim to be told so: another fault may have taken it away."""
        deadline_s = time.monotonic() + ALIVE_LIMIT_S
        while time.monotonic() < deadline_s:
            with suppress(StageError):
                await stage.sensors(NONE)
                return
            await stage.observer.watch(ASK_AGAIN_S)
        raise StageError(f"no sim was told within {ALIVE_LIMIT_S:g} s that its sensors are well again")


def _always(faults: str) -> Plan:
    return lambda chance: SensorFault(faults, lasting(chance, 0.5, 1.0))


def _blocked(chance: Random) -> Injection:
    """A sector of 20° to 120°, ahead or anywhere."""
    middle_rad = chance.choice((0.0, chance.uniform(-3.1, 3.1)))
    half_rad = chance.uniform(0.17, 1.05)
    faults = f"blocked {middle_rad - half_rad:.2f} {middle_rad + half_rad:.2f}"
    return SensorFault(faults, lasting(chance, 0.5, 1.0))


def _rate(chance: Random) -> Injection:
    return SensorFault(f"rate {chance.choice((1.0, 2.0, 3.0, 4.0, 5.0, 8.0)):g}", lasting(chance, 0.8, 1.5))


PLANS: dict[str, Plan] = {
    "sim_scan_frozen": _always("freeze"),
    "sim_scan_nan": _always("all_nan"),
    "sim_scan_blocked": _blocked,
    "sim_scan_silent": _always("silent"),
    "sim_scan_rate": _rate,
    "sim_odom_gone": _always("no_odom"),
}
