"""`lifeline judge`: read one recording from its beginning to its end, and return what it shows."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from deploy.stack.errors import DeployError
from recordings.judge.choice import Named, choose
from recordings.judge.configuration import law_of, read_own
from recordings.judge.feed import AnyRobot, Feed, Supervised
from recordings.judge.monitors import Monitors
from recordings.judge.source import BlackBoxSource, open_source

LEEWAY_S = 0.1
"""How far messages of different topics may be recorded out of order; those of a black box are in order."""
PROGRESS_MESSAGES = 2000


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a recording shows."""

    path: Path
    is_supervised: bool
    """Whether Lifeline supervised the robot: then the places are what it did."""
    config: Path | None
    assumptions: tuple[str, ...]
    """What the law assumes of the robot; empty if its configuration is known."""
    feed: Feed
    duration_s: float
    problem: str
    """Why the recording ends early; empty if it does not."""

    @property
    def broken(self) -> list[str]:
        """The rules that were broken."""
        return [verdict.rule for verdict in self.feed.monitors.verdicts() if verdict.broken]

    @property
    def is_found(self) -> bool:
        """Whether a rule was broken, or Lifeline would have stopped the robot."""
        return bool(self.broken) or (self.feed.places.stops > 0 and not self.is_supervised)

    @property
    def is_judged(self) -> bool:
        """Whether anything could be judged: the law's stops, or a rule."""
        return not self.feed.not_judged or any(one.is_judged for one in self.feed.monitors.verdicts())


def judge(path: Path, config: Path | None, named: Named, show: Callable[[str], None]) -> Judgement:
    """Judge a recording.

    Args:
        path: an MCAP file, a .db3 file or a folder of rosbag2, or a black box.
        config: the robot's configuration; None: that of the black box, or assumptions.
        named: the topics that the operator names.
        show: is called with the progress.

    Raises:
        DeployError: it cannot be judged; the message says why.
    """
    source = open_source(path)
    own = None if config is None else read_own(config)
    show("reading the topics")
    found = source.topics()
    chosen = choose(path, found, named, [] if own is None else own.lidars)
    law, assumptions = law_of(source, chosen, own)
    leeway_s = 0.0 if isinstance(source, BlackBoxSource) else LEEWAY_S
    kind = AnyRobot if chosen.status is None else Supervised
    feed = kind(law, chosen, Monitors(law.command_timeout_s, law.braking_m_s2, leeway_s))
    expected = sum(found[name].messages for name in chosen.all() if name in found)
    first_ns: int | None = None
    time_s = 0.0
    with closing(source.in_order(chosen.all())) as messages:
        for number, message in enumerate(messages):
            first_ns = message.log_time_ns if first_ns is None else first_ns
            time_s = (message.log_time_ns - first_ns) / 1e9
            feed.hear(time_s, message)
            if number % PROGRESS_MESSAGES == 0:
                show(f"judging: {number / max(1, expected):.0%}, {time_s:,.0f} s")
    if first_ns is None:
        because = f" ({source.problem})" if source.problem else ""
        raise DeployError(f"{path} cannot be judged: none of its messages can be read{because}")
    feed.end(time_s)
    if source.set_back:
        feed.notes.append(
            f"the clock was set back {source.set_back:,} ×; what follows counts as recorded after a pause"
        )
    return Judgement(path, chosen.status is not None, config, assumptions, feed, time_s, source.problem)
