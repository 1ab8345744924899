"""The age of a command of a stamped source, from the stamp of its header. Pure.

A program, or a relay, may publish an old command: only the header's stamp then shows its age. On this host, stamps are
compared with the wall clock. On another host, the offset of the clocks is part of the difference: a stamp that differs by
more than a limit is refused, and the progress of the others shows delays that grow, as for all stamps on the wire
(`wire/freshness.py`). With a clock of its own, only the progress shows an age. A stamp of zero means no stamp.
"""

from ros2.samples import Sample
from wire import cdr
from wire.header_clock import HeaderClock, in_words


class HeaderAge:
    """Finds the source time of each message of one source.

    Args:
        name: name of the source.
        timeout_s: maximum age of a command of a program on this host.
        limit_s: maximum difference between a stamp of another host and the wall clock; None: its clock is its own.
    """

    def __init__(self, name: str, timeout_s: float, limit_s: float | None) -> None:
        self._name, self._timeout_s, self._limit_s = name, timeout_s, limit_s
        self.attend(is_here=False)

    def attend(self, *, is_here: bool) -> None:
        """Follow a new program.

        Args:
            is_here: whether it is known to run on this host.
        """
        self._clock, self._is_here = HeaderClock(), is_here
        self._most_s = self._timeout_s if is_here and self._limit_s is not None else self._limit_s
        """The largest difference to the wall clock that is accepted; None: any."""
        self._ahead_s = 0.0
        """The newest stamp less the time of its arrival, both by wall clocks."""

    def source_time_ns(self, sample: Sample) -> int | None:
        """Return the source time of a message by the clock of `Sample.source_time_ns`; None if it is refused."""
        stamp_ns = cdr.header_ns_of(sample.payload)
        self._clock.hear(stamp_ns, sample.arrival_s)
        source_time_ns = stamp_ns - sample.clock_ns if stamp_ns else sample.source_time_ns
        self._ahead_s = source_time_ns * 1e-9 - sample.arrival_s if stamp_ns else 0.0
        return None if self._is_refused else source_time_ns

    @property
    def _is_refused(self) -> bool:
        return self._most_s is not None and abs(self._ahead_s) > self._most_s

    @property
    def shown(self) -> str:
        """What shows the age of a command, for the report."""
        if self._clock.stamp_ns == 0:
            return "from the middleware: the headers have no stamp"
        if self._most_s is None:
            return "age unproven: only the progress of the headers' stamps is judged"
        return f"from the headers' stamps, which may differ by {self._most_s:g} s from this computer's clock"

    @property
    def problem(self) -> str | None:
        """A sentence if the newest message was refused, or if the stamps do not run like real time; None else."""
        stamps = f"the stamps of the source {self._name}"
        if self._clock.problem:
            return (
                f"{stamps} {self._clock.problem}, so its commands become too old: end what delays them, or let the program "
                "stamp with real time (use_sim_time:=false)"
            )
        if not self._is_refused:
            return None
        if self._clock.is_simulated:
            what, remedy = "are of simulated time, or count from a start", "use use_sim_time:=false"
        else:
            what = f"are {in_words(self._ahead_s)}, more than {self._most_s:g} s"
            remedy = "end what delays them" if self._is_here else "synchronise the clocks with NTP"
        return (
            f'{stamps} {what}, so its commands are refused: {remedy}, or set its clock = "own" in [[ros2.sources]], which '
            "leaves a constant delay unseen"
        )
