"""What the robot and its supervisor tell: the newest of each stream, how old it is, and how often it comes.

Scans and odometry are decoded only where a picture is drawn of them: what arrives in between is counted, no more.
"""

import math
from collections import deque
from typing import Any

from teleop.view import Odom, Rates, Scan
from wire import topics
from wire.bus import Arrival, Bus, Subscription
from wire.messages import LaserScan, Odometry, SafetyStatus

RATE_WINDOW_S = 2.0
RATE_MIN_S = 0.9
"""Over a shorter time a rate says little."""


class Meter:
    """How often a stream arrives, from how many have arrived in all."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def rate_hz(self, arrived: int, now_s: float) -> float:
        """Over the last two seconds; NaN: not known yet."""
        seen = self._seen
        seen.append((now_s, arrived))
        while now_s - seen[0][0] > RATE_WINDOW_S and now_s - seen[1][0] >= RATE_MIN_S:
            seen.popleft()
        since_s, before = seen[0]
        return (arrived - before) / (now_s - since_s) if now_s - since_s >= RATE_MIN_S else math.nan


class Stream:
    """The newest message of a topic, and how many came."""

    def __init__(self, subscription: Subscription[Any]) -> None:
        self._subscription = subscription
        self._taken = 0
        self._meter = Meter()
        self.newest: Arrival[Any] | None = None

    def look(self) -> bool:
        """Take in what came; whether that is a new message."""
        arrivals = self._subscription.take()
        self._taken += len(arrivals)
        newest = next((arrival for arrival in reversed(arrivals) if arrival.message is not None), None)
        self.newest = newest or self.newest
        return newest is not None

    def age_s(self, now_s: float) -> float:
        return 0.0 if self.newest is None else max(0.0, now_s - self.newest.arrival_s)

    def rate_hz(self, now_s: float) -> float:
        return self._meter.rate_hz(self._taken + self._subscription.overflowed, now_s)


class Telemetry:
    """The streams that the operator is shown.

    Args:
        bus: open.
        pictures: False: the status alone.
    """

    def __init__(self, bus: Bus, *, pictures: bool) -> None:
        self._status = Stream(bus.subscribe(topics.STATUS))
        self._odom = Stream(bus.subscribe(topics.ODOM)) if pictures else None
        self._scan = Stream(bus.subscribe(topics.SCAN)) if pictures else None

    def look(self) -> SafetyStatus | None:
        """The newest status, if there is one that was not looked at before."""
        return self.status if self._status.look() else None

    @property
    def status(self) -> SafetyStatus | None:
        newest = self._status.newest
        return None if newest is None else newest.message

    @property
    def status_arrival_s(self) -> float:
        """When the newest status came; `-math.inf`: none has."""
        newest = self._status.newest
        return -math.inf if newest is None else newest.arrival_s

    def status_age_s(self, now_s: float) -> float:
        return self._status.age_s(now_s)

    def odom(self, now_s: float) -> tuple[Odom | None, float]:
        """The newest odometry and its age."""
        message, age_s = _newest(self._odom, now_s)
        return (Odom.of(message) if isinstance(message, Odometry) else None), age_s

    def scan(self, now_s: float) -> tuple[Scan | None, float]:
        """The newest scan and its age."""
        message, age_s = _newest(self._scan, now_s)
        return (Scan.of(message) if isinstance(message, LaserScan) else None), age_s

    def rates(self, now_s: float) -> Rates:
        return Rates(
            *(
                math.nan if stream is None else stream.rate_hz(now_s)
                for stream in (self._status, self._odom, self._scan)
            )
        )


def _newest(stream: Stream | None, now_s: float) -> tuple[object, float]:
    if stream is None:
        return None, 0.0
    stream.look()
    return (None if stream.newest is None else stream.newest.message), stream.age_s(now_s)
