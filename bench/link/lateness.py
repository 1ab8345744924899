"""Records how late a part of the bench acts (pure)."""

from array import array

from bench.link.stops import LATE_S


class Lateness:
    """The lateness of all acts, and the moments of the late ones."""

    def __init__(self) -> None:
        self._late_s = array("d")
        self.moments: list[tuple[float, float]] = []
        """For each act that was later than `LATE_S`: when it was due, and how late it was [s]."""

    def add(self, due_s: float, at_s: float) -> None:
        late_s = at_s - due_s
        self._late_s.append(late_s)
        if late_s > LATE_S:
            self.moments.append((due_s, late_s))

    def percentile(self, percent: float) -> float:
        """Return a percentile [s]; 0 without acts."""
        ordered = sorted(self._late_s)
        return ordered[min(len(ordered) - 1, int(percent / 100 * len(ordered)))] if ordered else 0.0

    def report(self) -> dict[str, object]:
        """Return p99, maximum and the late moments, for JSON."""
        return {
            "p99_s": self.percentile(99),
            "max_s": max(self._late_s, default=0.0),
            "acts": len(self._late_s),
            "moments": self.moments,
        }
