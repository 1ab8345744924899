"""What a recording shows: the gaps of its topics, the places of stops and limits, and the nearest distance. Pure.

Times are seconds since the beginning of the recording. The memory does not grow with its length.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from supervisor.law.reckoning import STANDSTILL, Velocity

MAX_PLACES = 200
"""Places that are kept; more are counted."""
LIMITED_BELOW = 0.99
"""A larger permitted share of a command is no limit worth reporting."""
BARRIER = "BARRIER"
"""Name of the limit without a cause: the robot slows down before something that is near."""
CLAMPED = "MAX_SPEED"
"""Name of the limit by the configured maximum."""


@dataclass
class Stream:
    """The messages of one topic over time.

    Args:
        role: what it carries.
        topic: its name.
        timeout_s: a longer gap while the robot moves counts; infinite: none does.
    """

    role: str
    topic: str
    timeout_s: float
    messages: int = 0
    undecodable: int = 0
    longest_s: float = 0.0
    """The longest gap."""
    longest_at_s: float = math.nan
    """When it began."""
    stale: int = 0
    """Gaps longer than the timeout while the robot moved."""
    stale_longest_s: float = 0.0
    stale_at_s: float = math.nan
    """When the longest of these began."""
    repeats: int = 0
    """Messages equal to the previous one while the robot moved."""
    first_s: float = math.nan
    last_s: float = math.nan
    _since_s: float = math.nan
    """Begin of the present gap."""
    _has_moved: bool = False
    _digest: int | None = None

    def hear(self, time_s: float, digest: int | None = None, *, moving: bool = False) -> None:
        """Process a message; without a digest, it may repeat the previous one."""
        if self.messages:
            self._gap(time_s)
            self.repeats += moving and digest is not None and digest == self._digest
        else:
            self.first_s = time_s
        self.messages += 1
        self.last_s = self._since_s = time_s
        self._digest, self._has_moved = digest, moving

    def moved(self) -> None:
        """Note that the robot moves, since the last message."""
        self._has_moved = True

    def pause(self) -> None:
        """Begin again after a pause of all topics, which is no gap of this one."""
        self._since_s = math.nan

    def end(self, time_s: float) -> None:
        """End the recording: silence until then is a gap too."""
        self._gap(time_s)

    @property
    def period_s(self) -> float:
        """Mean time between two messages; NaN if there are fewer than two."""
        return (self.last_s - self.first_s) / (self.messages - 1) if self.messages > 1 else math.nan

    def _gap(self, time_s: float) -> None:
        gap_s = time_s - self._since_s  # NaN after a pause
        if gap_s > self.longest_s:
            self.longest_s, self.longest_at_s = gap_s, self._since_s
        if gap_s > self.timeout_s and self._has_moved:
            self.stale += 1
            if gap_s > self.stale_longest_s:
                self.stale_longest_s, self.stale_at_s = gap_s, self._since_s


class Moment(NamedTuple):
    """What the law decides at one moment about the motion that is wanted."""

    time_s: float
    wanted: Velocity
    """The velocity that is commanded; standstill: nothing is judged."""
    reasons: tuple[str, ...]
    """The stop reasons; empty if the robot may move."""
    limits: tuple[str, ...]
    """What reduces the speed, if nothing stops it."""
    scale: float
    """The permitted share of the wanted velocity."""
    nearest_m: float
    bearing_rad: float
    detail: str


@dataclass
class Place:
    """A time in which the wanted motion was stopped or limited without a pause."""

    is_stop: bool
    first: Moment
    until_s: float
    names: tuple[str, ...]
    """The reasons and limits at its beginning."""
    is_conditional: bool
    """Whether it holds only if the robot had come there although Lifeline would have acted before."""


@dataclass
class Total:
    """All places with one reason or limit."""

    name: str
    is_stop: bool
    first: Moment
    places: int = 0
    seconds: float = 0.0


@dataclass
class Places:
    """The places of stops and limits, and the nearest distance.

    Args:
        obeyed: whether the robot did what the law decided.
    """

    obeyed: bool = False
    kept: list[Place] = field(default_factory=list[Place])
    stops: int = 0
    limited: int = 0
    totals: dict[tuple[str, bool], Total] = field(default_factory=dict[tuple[str, bool], Total])
    """By reason or limit, and whether it stops."""
    nearest: Moment | None = None
    """The moment of the smallest distance of the hull from anything."""
    nearest_moving: Moment | None = None
    """The same, of the moments in which motion is wanted."""
    first_stop: Place | None = None
    judged_s: float = 0.0
    """Time in which motion was wanted."""
    _open: Place | None = None
    _now: frozenset[tuple[str, bool]] = frozenset()
    """The keys of `totals` that apply since the last moment."""
    _last_s: float = math.nan

    def see(self, moment: Moment) -> None:
        """Process a moment, in order of time."""
        since_s = 0.0 if math.isnan(self._last_s) else moment.time_s - self._last_s
        self._last_s = moment.time_s
        for key in self._now:
            self.totals[key].seconds += since_s
        self._note_nearest(moment)
        is_wanted = moment.wanted != STANDSTILL
        self.judged_s += since_s * is_wanted
        names = moment.reasons or (moment.limits if moment.scale < LIMITED_BELOW else ())
        if not is_wanted or not names:
            self._open, self._now = None, frozenset()
            return
        is_stop = bool(moment.reasons)
        self._count(moment, names, is_stop=is_stop)
        if self._open is None or (is_stop and not self._open.is_stop):
            self._begin(moment, names, is_stop=is_stop)
        if self._open is not None:
            self._open.until_s = moment.time_s

    def _note_nearest(self, moment: Moment) -> None:
        if not math.isfinite(moment.nearest_m):
            return
        if self.nearest is None or moment.nearest_m < self.nearest.nearest_m:
            self.nearest = moment
        before = self.nearest_moving
        if moment.wanted != STANDSTILL and (before is None or moment.nearest_m < before.nearest_m):
            self.nearest_moving = moment

    def _count(self, moment: Moment, names: Iterable[str], *, is_stop: bool) -> None:
        """Count each name once until it does not apply any more."""
        now = frozenset((name, is_stop) for name in names)
        for key in now:
            total = self.totals.setdefault(key, Total(*key, moment))
            total.places += key not in self._now
        self._now = now

    def _begin(self, moment: Moment, names: tuple[str, ...], *, is_stop: bool) -> None:
        self._open = Place(is_stop, moment, moment.time_s, names, bool(self.kept) and not self.obeyed)
        self.stops += is_stop
        self.limited += not is_stop
        if is_stop and self.first_stop is None:
            self.first_stop = self._open
        if len(self.kept) < MAX_PLACES:
            self.kept.append(self._open)
