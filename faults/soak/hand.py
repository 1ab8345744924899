"""A simulated operator who drives at random by teleop's keys: forward, turns, up to obstacles, and back."""

from random import Random
from typing import NamedTuple

from wire.messages import SafetyStatus

STEPS = 10
"""Number of teleop's default steps to full speed."""
WEDGED_STOPS = 6
"""After this many consecutive stops without a completed plan, the robot is reset to its start."""
LET_GO_S = 0.6


class _Act(NamedTuple):
    """A setpoint in steps forward and to the left, for a duration."""

    linear: int
    angular: int
    for_s: float


LET_GO = _Act(0, 0, LET_GO_S)


class Hand:
    """The operator. Pure: the time and the robot's reports are arguments."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._plan: list[_Act] = []
        self._now = (0, 0)
        self._until_s = 0.0
        self._stops = 0
        self._is_out = True
        """The operator has reacted to the last stop."""

    @property
    def is_wedged(self) -> bool:
        return self._stops >= WEDGED_STOPS

    def put_back(self) -> None:
        """Begin anew after a reset of the robot."""
        self._stops = 0
        self._plan = [LET_GO]

    def keys(self, now_s: float, status: SafetyStatus) -> str:
        """Return the keys to press now; mostly none."""
        if status.mode == SafetyStatus.STOPPED:
            if now_s < self._until_s and not self._is_out:
                return ""
            if self._is_out:
                self._stops += 1
            self._is_out = False
            self._plan = self._way_out()
            self._now = (0, 0)
            self._until_s = now_s + LET_GO_S
            return "s"
        self._is_out = True
        if now_s < self._until_s:
            return ""
        if not self._plan:
            self._stops = 0
            self._plan = self._somewhere()
        act = self._plan.pop(0)
        self._until_s = now_s + act.for_s
        return self._to(act.linear, act.angular)

    def _to(self, linear: int, angular: int) -> str:
        """Return the keys from the present setpoint to this one."""
        forward, left = linear - self._now[0], angular - self._now[1]
        self._now = (linear, angular)
        if self._now == (0, 0):
            return "s"
        return ("w" if forward > 0 else "x") * abs(forward) + ("a" if left > 0 else "d") * abs(left)

    def _somewhere(self) -> list[_Act]:
        random = self._random
        if random.random() < 0.25:
            return [LET_GO, self._turn(), LET_GO]
        turn = random.choice((0, 0, 0, 0, -1, 1, -3, 3))
        return [_Act(random.randint(3, STEPS), turn, random.uniform(0.8, 3.0))]

    def _way_out(self) -> list[_Act]:
        """Usually back a little, then turn and continue."""
        back = _Act(self._random.choice((-3, -3, -2, 0)), 0, self._random.uniform(0.6, 1.2))
        return [back, LET_GO, self._turn(), LET_GO]

    def _turn(self) -> _Act:
        """Turn on the spot, by a quarter to half a turn."""
        return _Act(0, self._random.choice((-6, 6)), self._random.uniform(1.2, 2.6))
