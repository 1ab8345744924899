"""A person who drives the simulated robot up and down the main aisle of the warehouse by keys. Pure: the time is an argument."""

import math
from random import Random
from typing import NamedTuple

ENDS_M = (2.8, -4.0)
"""x of the places between which the person drives, on the middle line y = 0: more than a metre from the rack and the wall behind them."""
AHEAD_M = 1.0
"""The person steers for a point of the middle line this far ahead."""
AIMED_RAD, OFF_RAD = 0.1, 0.2
"""The person turns on the spot until the direction differs by less than the first angle; while driving, corrections begin at the second."""
BACK_S = (0.5, 1.2)
PAUSE_S = (0.3, 4.0)
"""Before and after each manoeuvre."""

Keys = frozenset[str]
NOTHING: Keys = frozenset()
FORWARD, BACK, LEFT, RIGHT = "KeyW", "KeyS", "KeyA", "KeyD"


class Look(NamedTuple):
    """What the person sees at one moment."""

    now_s: float
    x_m: float
    y_m: float
    yaw_rad: float


class Person:
    """Turns, drives to one end, backs, and turns for the other end, with pauses."""

    def __init__(self, random: Random) -> None:
        self._random, self._end, self._aimed = random, 0, False
        self._steps: list[tuple[float, Keys]] = []
        """Keys that do not depend on the robot's place, with the times at which they end."""

    def begin_anew(self, now_s: float) -> None:
        """Pause, and turn for the end: the robot has stopped."""
        self._aimed = False
        self._plan(now_s, (PAUSE_S, NOTHING))

    def keys(self, look: Look) -> Keys:
        """Return the keys to hold now."""
        self._steps = [step for step in self._steps if step[0] > look.now_s]
        if self._steps:
            return self._steps[0][1]
        direction = 1.0 if ENDS_M[self._end] > 0.0 else -1.0
        off_rad = math.remainder(math.atan2(-look.y_m, direction * AHEAD_M) - look.yaw_rad, math.tau)
        side = LEFT if off_rad > 0.0 else RIGHT
        if not self._aimed:
            if abs(off_rad) > AIMED_RAD:
                return frozenset({side})
            self._aimed = True
            return self._plan(look.now_s, (PAUSE_S, NOTHING))
        if direction * (ENDS_M[self._end] - look.x_m) > 0.0:
            return frozenset({FORWARD, side}) if abs(off_rad) > OFF_RAD else frozenset({FORWARD})
        self._end, self._aimed = 1 - self._end, False
        return self._plan(look.now_s, (PAUSE_S, NOTHING), (BACK_S, frozenset({BACK})), (PAUSE_S, NOTHING))

    def _plan(self, now_s: float, *steps: tuple[tuple[float, float], Keys]) -> Keys:
        """Hold keys for random times one after the other; return the first ones."""
        for between_s, keys in steps:
            now_s += self._random.uniform(*between_s)
            self._steps.append((now_s, keys))
        return self._steps[0][1]
