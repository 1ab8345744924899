"""Faults of the simulated sensors, which the sim applies on request."""

import math
import time
from contextlib import suppress
from random import Random

from faults.real.injectors.injection import Injection, Pillar, Plan, lasting
from faults.real.rig.stage import ALIVE_LIMIT_S, Stage, StageError

NONE = "none"
ASK_AGAIN_S = 0.1


class SensorFault(Injection):
    """Apply a text of `topics.SIM_FAULTS`, then none."""

    def __init__(self, faults: str, lasts_s: float) -> None:
        super().__init__(lasts_s, faults=faults)
        self._faults = faults

    async def do(self, stage: Stage) -> float:
        asked_s = await stage.sensors(self._faults)
        # The fault may have begun as late as the sim's answer.
        self.leeway_s = time.monotonic() - asked_s
        return asked_s

    async def lift(self, stage: Stage) -> None:
        """End the fault as soon as a sim runs; another fault may have ended the sim."""
        deadline_s = time.monotonic() + ALIVE_LIMIT_S
        while time.monotonic() < deadline_s:
            with suppress(StageError):
                await stage.sensors(NONE)
                return
            await stage.observer.watch(ASK_AGAIN_S)
        raise StageError(f"no sim accepted the end of its sensor faults within {ALIVE_LIMIT_S:g} s")


class InTheWay(SensorFault):
    """A lidar fault, with a pillar straight ahead; the operator re-arms and drives at it again."""

    pillar = Pillar.AHEAD
    keys = ("w", "w", "ww", "ww", "www", "wwww", "s")


class Unhindered(SensorFault):
    """A lidar fault that must not stop the robot for long if nothing is ahead of it."""

    pillar = Pillar.NONE
    keys = "w"


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


def _dirt(chance: Random) -> Injection:
    """1° to 20° straight ahead."""
    half_rad = math.radians(chance.uniform(0.5, 10.0))
    return InTheWay(f"blocked {-half_rad:.3f} {half_rad:.3f}", lasting(chance, 3.0, 4.0))


def _dropout(chance: Random) -> Injection:
    """At the rate of a fast lidar or of a slow one."""
    faults = f"dropout {chance.uniform(0.02, 0.3):.3f}; rate {chance.choice((20.0, 5.5)):g}"
    return InTheWay(faults, lasting(chance, 5.0, 6.0))


def _short(chance: Random) -> Injection:
    """Reduce the range while the robot drives; with a lidar without any return since the start, it need not start.

    A few beams are missing as well, because scans without any return would all be equal.
    """
    return InTheWay(f"reach {chance.uniform(0.5, 1.0):.2f}; beams 0.02", lasting(chance, 3.0, 4.0))


def _in_the_way(faults: str) -> Plan:
    return lambda chance: InTheWay(faults, lasting(chance, 3.0, 4.0))


PLANS: dict[str, Plan] = {
    "sim_scan_frozen": _always("freeze"),
    "sim_scan_nan": _always("all_nan"),
    "sim_scan_blocked": _blocked,
    "sim_scan_silent": _always("silent"),
    "sim_scan_rate": _rate,
    "sim_odom_gone": _always("no_odom"),
    "sim_scan_dirt": _dirt,
    "sim_scan_dropout": _dropout,
    "sim_scan_short": _short,
    # Rare enough that two consecutive scans hardly ever have one.
    "sim_scan_stray": lambda chance: Unhindered("stray 0.04", lasting(chance, 1.5, 2.0)),
    "sim_scan_frozen_no_odom": _in_the_way("freeze; no_odom"),
    "sim_scan_frozen_odom_zero": _in_the_way("freeze; odom_zero"),
}
