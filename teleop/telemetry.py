"""Status, odometry and scans: the newest message of each stream, its age, and the rate.

Scans and odometry are decoded only when a picture is drawn; messages in between are only counted.
"""

import math
from collections import deque
from typing import Any

from teleop.guards import Supervisors
from teleop.screen.view import Rates
from wire import topics
from wire.bus import Arrival, Bus, Subscription
from wire.messages import SafetyStatus
from wire.reasons import StopReason, words_of

RATE_WINDOW_S = 2.0
RATE_MIN_S = 0.9
"""Minimum time for measuring a rate."""
AGAIN_S = 2.0
"""A cause that returns sooner is the same stop: at an obstacle, it comes and goes."""


class Meter:
    """Measures the rate of a stream from the total number of its messages."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def rate_hz(self, arrived: int, now_s: float) -> float:
        """Return the rate [Hz] over the last two seconds; NaN if not known yet."""
        seen = self._seen
        seen.append((now_s, arrived))
        while now_s - seen[0][0] > RATE_WINDOW_S and now_s - seen[1][0] >= RATE_MIN_S:
            seen.popleft()
        since_s, before = seen[0]
        return (arrived - before) / (now_s - since_s) if now_s - since_s >= RATE_MIN_S else math.nan


class Stream:
    """The newest message of a topic, and the number of messages.

    Args:
        subscription: source of the messages; None: no message arrives.
    """

    def __init__(self, subscription: Subscription[Any] | None) -> None:
        self._subscription = subscription
        self._taken = 0
        self._meter = Meter()
        self.newest: Arrival[Any] | None = None

    def look(self) -> bool:
        """Process arrived messages; return whether there was a new one."""
        arrivals = [] if self._subscription is None else self._subscription.take()
        self._taken += len(arrivals)
        newest = next((arrival for arrival in reversed(arrivals) if arrival.message is not None), None)
        self.newest = newest or self.newest
        return newest is not None

    @property
    def message(self) -> Any:  # noqa: ANN401 - the type of its topic
        """The newest message; None if there is none."""
        return None if self.newest is None else self.newest.message

    @property
    def arrival_s(self) -> float:
        """Arrival time of the newest message; `-math.inf` if there is none."""
        return -math.inf if self.newest is None else self.newest.arrival_s

    def age_s(self, now_s: float) -> float:
        return 0.0 if self.newest is None else max(0.0, now_s - self.newest.arrival_s)

    def rate_hz(self, now_s: float) -> float:
        if self._subscription is None:
            return math.nan
        return self._meter.rate_hz(self._taken + self._subscription.overflowed, now_s)


class StopNews:
    """Finds the stops in the statuses: a cause that holds, and has not held for `AGAIN_S`. That no source drives is none."""

    def __init__(self) -> None:
        self._held_s: dict[str, float] = {}
        """When each cause held last."""

    def take(self, status: SafetyStatus, now_s: float) -> list[str]:
        """Return the causes that are new in a status, the most severe first."""
        causes = status.causes_and_latched()[0] if status.mode == SafetyStatus.STOPPED else []
        known = [name for name in causes if name != StopReason.NO_COMMAND and words_of(name) is not None]
        new = [name for name in known if now_s - self._held_s.get(name, -math.inf) > AGAIN_S]
        self._held_s.update(dict.fromkeys(known, now_s))
        return new


class Telemetry:
    """The streams for the display.

    Args:
        bus: an open bus.
        pictures: False: only the status.
    """

    def __init__(self, bus: Bus, *, pictures: bool) -> None:
        self.statuses = Stream(bus.subscribe(topics.STATUS))
        self.odom = Stream(bus.subscribe(topics.ODOM) if pictures else None)
        self.scan = Stream(bus.subscribe(topics.SCAN) if pictures else None)
        self.supervisors = Supervisors()

    def look(self) -> SafetyStatus | None:
        """Return the newest status if it has not been returned before, else None."""
        if not self.statuses.look():
            return None
        newest = self.statuses.newest
        if newest is not None and newest.stamp is not None:
            self.supervisors.heard(newest.stamp.gid, newest.arrival_s)
        return self.status

    @property
    def status(self) -> SafetyStatus | None:
        return self.statuses.message

    def rates(self, now_s: float) -> Rates:
        return Rates(*(stream.rate_hz(now_s) for stream in (self.statuses, self.odom, self.scan)))
