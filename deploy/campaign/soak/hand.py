"""An operator who drives about at random by teleop's keys: goes on, turns, runs into things, and backs out."""

from random import Random
from typing import NamedTuple

from wire.messages import SafetyStatus

STEPS = 10
"""To full speed, of teleop's default steps."""
WEDGED_STOPS = 6
"""So many stops one after the other without a whole plan in between: the robot is put back to its start."""
LET_GO_S = 0.6


class _Act(NamedTuple):
    """Steps forward and to the left, for a while."""

    linear: int
    angular: int
    for_s: float


LET_GO = _Act(0, 0, LET_GO_S)


class Hand:
    """Types. Pure: the time, and what the robot tells, are arguments."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._plan: list[_Act] = []
        self._now = (0, 0)
        self._until_s = 0.0
        self._stops = 0
        self._is_out = True
        """The last stop has been answered."""

    @property
    def is_wedged(self) -> bool:
        return self._stops >= WEDGED_STOPS

    def put_back(self) -> None:
        """The robot is at its start again."""
        self._stops = 0
        self._plan = [LET_GO]

    def keys(self, now_s: float, status: SafetyStatus) -> str:
        """What is typed now; mostly nothing."""
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
        """The keys from what is asked for now to this."""
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
        """Mostly back a little, then another way round."""
        back = _Act(self._random.choice((-3, -3, -2, 0)), 0, self._random.uniform(0.6, 1.2))
        return [back, LET_GO, self._turn(), LET_GO]

    def _turn(self) -> _Act:
        """On the spot, by a quarter to a half."""
        return _Act(0, self._random.choice((-6, 6)), self._random.uniform(1.2, 2.6))
