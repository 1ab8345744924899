"""Summarizes many runs."""

import math
from collections import Counter
from dataclasses import dataclass, field

from tests.scenes.run import Outcome

LISTED = 20
GONE_M = 0.3
"""Minimum distance for a run to count as driven."""


@dataclass
class Tally:
    """Counts of the runs with one tag."""

    runs: int = 0
    violations: int = 0
    contacts: int = 0
    least_m: float = math.inf
    """The smallest clearance minus the scene's bound."""
    least_seed: int = -1

    def add(self, outcome: Outcome) -> None:
        self.runs += 1
        self.violations += outcome.violated
        self.contacts += outcome.contact
        margin_m = outcome.closest_m - outcome.bound_m
        if margin_m < self.least_m:
            self.least_m, self.least_seed = margin_m, outcome.seed


@dataclass
class Summary:
    """All runs of a search."""

    total: Tally = field(default_factory=Tally)
    tags: dict[str, Tally] = field(default_factory=dict[str, Tally])
    stops: Counter[str] = field(default_factory=Counter[str])
    skipped: int = 0
    went: int = 0
    """Number of scenes in which the robot drove farther than `GONE_M`."""
    travelled_m: float = 0.0
    driven_s: float = 0.0
    stopped_s: float = 0.0
    worst: list[Outcome] = field(default_factory=list[Outcome])

    def add(self, outcome: Outcome) -> None:
        self.total.add(outcome)
        for tag in outcome.tags:
            self.tags.setdefault(tag, Tally()).add(outcome)
        self.stops.update(outcome.stops)
        self.went += outcome.travelled_m > GONE_M
        self.travelled_m += outcome.travelled_m
        self.driven_s += outcome.duration_s
        self.stopped_s += outcome.stopped_s
        if outcome.violated:
            self.worst.append(outcome)

    def lines(self) -> list[str]:
        """Format the summary; a margin is a clearance minus the scene's bound."""
        total = self.total
        text = [
            f"scenes      {total.runs} ({self.skipped} skipped), {self.driven_s:.0f} s of driving",
            f"violations  {total.violations}, of which {total.contacts} contacts",
            f"least margin {total.least_m * 1000:.1f} mm beyond the bound (seed {total.least_seed})",
            f"driven      {self.travelled_m:.0f} m, more than {GONE_M} m in {self.went} scenes; stopped {self.stopped_s / max(self.driven_s, 1e-9):.1%} of the time",
            "stops       " + ", ".join(f"{reason} {count}" for reason, count in self.stops.most_common()),
            f"{'':24}{'scenes':>8}{'viol.':>8}{'contact':>8}{'least margin':>15}{'seed':>9}",
        ]
        text += [
            f"{tag:24}{tally.runs:8}{tally.violations:8}{tally.contacts:8}"
            f"{tally.least_m * 1000:12.1f} mm{tally.least_seed:9}"
            for tag, tally in sorted(self.tags.items())
        ]
        if self.worst:
            text.append("worst seeds:")
            text += [
                f"  {outcome.seed:8} {outcome.closest_m * 1000:8.1f} mm at {outcome.closest_s:5.2f} s"
                f"  ({', '.join(outcome.tags)})"
                for outcome in sorted(self.worst, key=lambda o: o.closest_m - o.bound_m)[:LISTED]
            ]
        return text
