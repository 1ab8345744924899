"""The age of a command of a stamped source, from the stamp of its header. Pure.

A program, or a relay, may publish an old command: only the header's stamp then shows its age. On this host, stamps are
compared with the wall clock. On another host, the offset of the clocks is part of the difference: a stamp that differs by
more than a limit is refused, and the progress of the others shows delays that grow, as for all stamps on the wire
(`wire/freshness.py`). With a clock of its own, only the progress shows an age. A stamp of zero is none.
"""

import math

from ros2.samples import Sample
from wire import cdr
from wire.header_clock import HeaderClock, follow, is_simulated

AGE_UNPROVEN = "age unproven"
"""How the report begins of a source whose commands may all have a constant age."""
RECENT_S = 2.0
"""How long a problem is reported after the last message that shows it."""


class HeaderAge:
    """Finds the source time of each message of one source.

    Args:
        name: name of the source.
        timeout_s: maximum age of a command of a program on this host.
        limit_s: maximum difference between a stamp of another host and the wall clock; None: its clock is its own.
    """

    def __init__(self, name: str, timeout_s: float, limit_s: float | None) -> None:
        self._name, self._timeout_s, self._limit_s = name, timeout_s, limit_s
        self._clock = HeaderClock()
        self._ahead_s = 0.0
        """The newest stamp less the time of its arrival, both by wall clocks."""
        self._is_here = False
        self._heard_s = self._refused_s = -math.inf

    def attend(self, *, is_here: bool) -> None:
        """Begin with a program.

        Args:
            is_here: whether it is known to run on this host.
        """
        self._clock, self._is_here = HeaderClock(), is_here
        self._heard_s = self._refused_s = -math.inf

    def source_time_ns(self, sample: Sample) -> int | None:
        """Return the source time of a message by the clock of `Sample.source_time_ns`; None if it is refused."""
        stamp_ns, self._heard_s = cdr.header_ns_of(sample.payload), sample.arrival_s
        self._clock = follow(self._clock, stamp_ns, sample.arrival_s)
        if stamp_ns == 0:
            return sample.source_time_ns
        source_time_ns = stamp_ns - sample.clock_ns
        self._ahead_s = source_time_ns * 1e-9 - sample.arrival_s
        if self._limit_s is not None and not abs(self._ahead_s) <= self._most_s(self._limit_s):
            self._refused_s = sample.arrival_s
            return None
        return source_time_ns

    def _most_s(self, limit_s: float) -> float:
        return self._timeout_s if self._is_here else limit_s

    @property
    def shown(self) -> str:
        """What shows the age of a command, for the report."""
        if self._clock.newest_ns == 0:
            return "from the middleware: the headers have no stamp"
        if self._limit_s is None:
            return f"{AGE_UNPROVEN}: only the progress of the headers' stamps is judged"
        if self._is_here:
            return "from the headers' stamps, by the clock of this host"
        return f"from the headers' stamps; the clocks may differ by {self._limit_s:g} s"

    def problem(self, now_s: float) -> str | None:
        """Return a sentence if messages were refused lately, or if the stamps do not run like real time; None else."""
        if self._clock.problem and now_s - self._heard_s <= RECENT_S:
            return (
                f"the stamps of the source {self._name} {self._clock.problem}, so its commands become too old: let "
                "the program stamp with real time (use_sim_time:=false)"
            )
        if self._limit_s is None or now_s - self._refused_s > RECENT_S:
            return None
        if is_simulated(self._clock.newest_ns * 1e-9):
            return (
                f"the stamps of the source {self._name} are of simulated time, or count from a start, so its commands are "
                f'refused: use use_sim_time:=false, or set its clock = "own" in [[ros2.sources]]'
            )
        difference = (
            f"the stamps of the source {self._name} are {abs(self._ahead_s):.2f} s "
            f"{'ahead of' if self._ahead_s > 0.0 else 'behind'} this computer's clock, more than "
            f"{self._most_s(self._limit_s):g} s, so its commands are refused: "
        )
        if self._is_here:
            return (
                f"{difference}end what delays them; if a relay passes stamps of another computer on, synchronise the clocks, or "
                'set its clock = "own" in [[ros2.sources]]'
            )
        return (
            f'{difference}synchronise the clocks with NTP, or set its clock = "own" in [[ros2.sources]], which leaves a '
            "constant delay unseen"
        )
