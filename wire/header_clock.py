"""Whether the stamps of a topic's headers run like real time (pure).

A bridge, a recording or a simulation may stamp headers with a clock that stands, that has only whole seconds, or that runs
slower than real time. Ages from such stamps grow without a delay, so the messages are refused as late. This module finds
the cause, for people; it decides nothing.
"""

from typing import NamedTuple

WINDOW_S = 2.0
"""Time over which stamps are compared with arrivals."""
MIN_MESSAGES = 5
"""Fewer messages in a window show nothing."""
RATE_TOLERANCE = 0.01
"""A smaller deviation in a window may be the jitter of two arrivals. A deviation counts if two windows in sequence have it."""
SIMULATED_BEFORE_S = 1e9
"""No clock of a computer shows a time before September 2001; the clock of a simulation, or since a start, does."""


class HeaderClock(NamedTuple):
    """The stamps of one topic since the window began, and what the previous window showed."""

    first_ns: int = 0
    first_s: float = 0.0
    """Stamp and arrival of the first message of the window."""
    messages: int = 0
    """Number of messages of the window."""
    is_whole: bool = True
    """Whether all of them are whole seconds."""
    newest_ns: int = 0
    """The newest stamp; 0: the header has none."""
    rate: float = 1.0
    """Rate of the stamps in the previous window."""
    uneven: str = ""
    """What the previous windows show; empty if the stamps run like real time."""

    @property
    def is_simulated(self) -> bool:
        return self.newest_ns != 0 and is_simulated(self.newest_ns * 1e-9)

    @property
    def problem(self) -> str:
        """How the stamps differ from real time, as a predicate; empty if they do not."""
        return f"{self.uneven} (simulated time)" if self.uneven and self.is_simulated else self.uneven


def is_simulated(stamp_s: float) -> bool:
    """Return whether a stamp is of a simulation, or counts from a start."""
    return stamp_s < SIMULATED_BEFORE_S


def follow(clock: HeaderClock, stamp_ns: int, arrival_s: float) -> HeaderClock:
    """Process the stamp of a message.

    Args:
        clock: the stamps before it.
        stamp_ns: the stamp of its header; 0: it has none.
        arrival_s: its arrival time by the local monotonic clock.
    """
    if stamp_ns == 0:
        return HeaderClock()
    is_whole = stamp_ns % 1_000_000_000 == 0
    if clock.messages == 0:
        return HeaderClock(stamp_ns, arrival_s, 1, is_whole, stamp_ns)
    clock = clock._replace(
        messages=clock.messages + 1, is_whole=clock.is_whole and is_whole, newest_ns=stamp_ns
    )
    passed_s = arrival_s - clock.first_s
    if passed_s < WINDOW_S or clock.messages < MIN_MESSAGES:
        return clock
    rate = (stamp_ns - clock.first_ns) * 1e-9 / passed_s
    uneven = _uneven(clock, rate)
    return HeaderClock(stamp_ns, arrival_s, 1, is_whole, stamp_ns, rate, uneven)


def _uneven(clock: HeaderClock, rate: float) -> str:
    """Return how the stamps of a window and of the previous one differ from real time; empty if they do not."""
    if rate == 0.0:
        return "do not change"
    if clock.is_whole:
        return "are whole seconds"
    slower = max(rate, clock.rate) < 1.0 - RATE_TOLERANCE
    faster = min(rate, clock.rate) > 1.0 + RATE_TOLERANCE
    return f"run at {rate:.2f} of real time" if slower or faster else ""
