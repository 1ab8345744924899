"""The requested, permitted and true velocity of a trial over time, as samples for a drawing. Pure."""

from collections.abc import Iterable, Iterator

from faults.seen import Seen
from faults.trial import Sample

PERIOD_S = 0.1
FINE_S = 0.02
STEP_M_S, STEP_RAD_S = 0.03, 0.15
"""In a thinned timeline, a smaller difference from the previous sample does not count as a change."""
ROUNDING_S = 1e-6


def timeline(seen: Seen, period_s: float = PERIOD_S) -> Iterator[Sample]:
    """Yield a sample for each period in which the robot was seen."""
    commands, statuses = iter(seen.commands), iter(seen.statuses)
    command, status = next(commands, None), next(statuses, None)
    permitted, commanded, reasons = (0.0, 0.0), (0.0, 0.0), tuple[str, ...]()
    due_s = 0.0
    for motion in seen.motions:
        while command is not None and command.arrival_s <= motion.time_s:
            permitted = (round(command.linear_m_s, 3), round(command.angular_rad_s, 3))
            command = next(commands, None)
        while status is not None and status.arrival_s <= motion.time_s:
            commanded = (round(status.commanded[0], 3), round(status.commanded[1], 3))
            reasons = status.reasons
            status = next(statuses, None)
        if motion.time_s >= due_s:
            due_s = motion.time_s + period_s - ROUNDING_S
            yield Sample(
                time_s=round(motion.time_s, 3),
                commanded=commanded,
                permitted=permitted,
                true=(round(motion.linear_m_s, 3), round(motion.angular_rad_s, 3)),
                clearance_m=round(motion.clearance_m, 4),
                reasons=reasons,
            )


def thinned(samples: Iterable[Sample], from_s: float, until_s: float) -> Iterator[Sample]:
    """The first and the last sample of a window, and between them those that differ from the one kept before.

    A zero differs from what is none, however small that is.
    """
    within = [sample for sample in samples if from_s <= sample.time_s <= until_s]
    kept: Sample | None = None
    for sample in within:
        if kept is None or sample is within[-1] or _differ(kept, sample):
            kept = sample
            yield sample


def _differ(one: Sample, other: Sample) -> bool:
    if one.reasons != other.reasons or _zeros(one) != _zeros(other):
        return True
    return any(
        abs(a - b) > step
        for was, now in (
            (one.commanded, other.commanded),
            (one.permitted, other.permitted),
            (one.true, other.true),
        )
        for a, b, step in zip(was, now, (STEP_M_S, STEP_RAD_S), strict=True)
    )


def _zeros(one: Sample) -> tuple[bool, ...]:
    return tuple(value == 0.0 for value in (*one.commanded, *one.permitted))
