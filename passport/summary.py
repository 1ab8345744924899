"""What a record says: one row for each cell, and one sentence for all faults together. Pure."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from passport.record import Cell, Passport, Run
from passport.statistics import Limit, limit, rounded_up, upper_rate


class Row(NamedTuple):
    """One cell in figures."""

    cell: Cell
    not_stopped: int
    """Number of runs in which the robot did not stop."""
    reaction_s: Limit | None
    """Until the speed falls; None where too few runs show it."""
    stopping_s: Limit | None
    """Until standstill."""
    distance_m: Limit | None
    least_m_s2: float | None
    """The smallest deceleration."""
    slips: int

    @property
    def runs(self) -> int:
        return len(self.cell.runs)


def rows(passport: Passport) -> list[Row]:
    """Return one row for each cell, in the order of the record."""
    together = max(1, len(_spoken_of(passport)))
    return [_row(passport, cell, together) for cell in passport.cells]


def _row(passport: Passport, cell: Cell, together: int) -> Row:
    instrument = passport.instrument
    uncertainty = instrument.uncertainty_rad if cell.turn else instrument.uncertainty_m

    def limit_of(value: Callable[[Run], float | None], uncertainty: float) -> Limit | None:
        # A run that does not show the quantity may be the longest of all: it counts as longer than any other.
        shown = [value(run) if run.stopped else None for run in cell.runs]
        values = [math.inf if one is None else one for one in shown]
        found = limit(values, uncertainty, together) if values else None
        return None if found is None or math.isinf(found.value) else found

    return Row(
        cell,
        sum(not run.stopped for run in cell.runs),
        limit_of(lambda run: run.t2_s, instrument.uncertainty_s),
        limit_of(lambda run: run.t3_s, instrument.uncertainty_s),
        limit_of(lambda run: run.distance_m, uncertainty or 0.0),
        min((run.deceleration_m_s2 for run in cell.runs if run.deceleration_m_s2 is not None), default=None),
        sum(run.slip for run in cell.runs),
    )


def _spoken_of(passport: Passport) -> list[Cell]:
    """Return the cells of the sentence: those at the highest measured speed; only straight ones, and only those with Lifeline, if there are any."""
    measured = [cell for cell in passport.cells if cell.runs]
    with_lifeline = any(cell.with_lifeline for cell in measured)
    alike = [cell for cell in measured if cell.with_lifeline == with_lifeline]
    alike = [cell for cell in alike if not cell.turn] or alike
    fastest_m_s = max((cell.speed_m_s for cell in alike), default=0.0)
    return [cell for cell in alike if cell.speed_m_s == fastest_m_s]


def failures(passport: Passport) -> list[Row]:
    """Return the rows with a run without a stop; those without Lifeline only if nothing was measured with it."""
    spoken = _spoken_of(passport)
    return [
        row for row in rows(passport) if row.not_stopped and row.cell.with_lifeline == spoken[0].with_lifeline
    ]


def sentence(passport: Passport) -> str:
    """Return the result of the measurement in one sentence; it names each cell with a run without a stop, slower cells and turns included."""
    spoken = _spoken_of(passport)
    found = [row for row in rows(passport) if row.cell in spoken]
    if not found:
        return "Nothing was measured."
    if failed := failures(passport):
        each = ", ".join(
            f"{row.cell.fault} at {row.cell.speed} with {row.cell.load_percent} % load ({row.not_stopped} of {row.runs} runs)"
            for row in failed
        )
        who = "This robot" if spoken[0].with_lifeline else "Without Lifeline, this robot"
        return f"{who} DID NOT STOP by itself after: {each}."
    where = _where(spoken)
    distances = [row.distance_m for row in found if row.distance_m is not None]
    times = [row.stopping_s for row in found if row.stopping_s is not None]
    unit = "rad" if spoken[0].turn else "m"
    what = f"{where}, this robot stood within {rounded_up(max(one.value for one in distances))} {unit}"
    if times:
        longest = f"within {rounded_up(max(one.value for one in times))} s"
        which = (
            ""
            if len(times) == len(distances)
            else f", after the {_number(len(times))} whose time was recorded,"
        )
        what += f" and{which} {longest}"
    return f"{what}: {_proof([*distances, *times])}."


def _where(spoken: Sequence[Cell]) -> str:
    loads = sorted({cell.load_percent for cell in spoken})
    faults = len({cell.fault for cell in spoken})
    loaded = " and ".join(f"{load} %" for load in loads)
    without = "" if spoken[0].with_lifeline else " without Lifeline"
    which = "the one fault tested" if faults == 1 else f"any of the {faults} faults tested"
    return f"After {which}{without}, at {spoken[0].speed} with {loaded} load"


def _number(cells: int) -> str:
    return "one cell" if cells == 1 else f"{cells} cells"


def _runs(number: int) -> str:
    return "1 run" if number == 1 else f"{number} runs"


def _proof(limits: Sequence[Limit]) -> str:
    if all(one.proven for one in limits):
        return "95 % of all stops, with 95 % confidence for all of these cells together, distance and time each by itself"
    counts = [one.runs for one in limits if not one.proven]
    fewest, most = min(counts), max(counts)
    if len(counts) < len(limits):
        return f"some limits are only the largest of {_runs(fewest)}"
    if most == 1:
        return "one run each"
    return f"the largest of {'at least ' if fewest < most else ''}{_runs(fewest)} each"


def not_shown(passport: Passport) -> Iterator[str]:
    """Yield what the measurement does not show, as sentences."""
    yield from passport.not_tested
    for cell in passport.cells:
        if cell.refused is not None:
            yield f"{cell.name} at {cell.speed}, load {cell.load_percent} %: {cell.refused}"
    spoken = _spoken_of(passport)
    runs = min((len(cell.runs) for cell in spoken), default=0)
    alike = (cell for cell in passport.cells if spoken and cell.with_lifeline == spoken[0].with_lifeline)
    if runs and all(run.stopped for cell in alike for run in cell.runs):
        yield (
            f"how often a fault has no stop: none in {_runs(runs)} means at most {rounded_up(100 * upper_rate(runs), 1)} % (95 %)"
        )
