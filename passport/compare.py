"""Compares the limits of two records. Pure."""

from typing import Any, NamedTuple

from passport.record import Cell, Passport
from passport.statistics import Limit
from passport.summary import Row, rows

SAME = 0.0005
"""A limit [m or s] that differs by less is the same."""


class Change(NamedTuple):
    """One limit of one cell in both records."""

    cell: Cell
    quantity: str
    unit: str
    old: float | None
    """None: not measured."""
    new: float | None

    @property
    def is_worse(self) -> bool:
        """Whether the limit grew, or is no longer known."""
        return self.old is not None and (self.new is None or self.new > self.old + SAME)

    @property
    def result(self) -> dict[str, Any]:
        """The change as JSON values."""
        cell = self.cell.model_dump(include={"fault", "speed_m_s", "load_percent", "with_lifeline"})
        found = {"quantity": self.quantity, "unit": self.unit, "old": self.old, "new": self.new}
        return cell | found | {"worse": self.is_worse}


def changes(old: Passport, new: Passport) -> list[Change]:
    """Return each limit that either record has; a cell in which the robot did not stop has no limits."""
    before, after = _by_cell(old), _by_cell(new)
    found: list[Change] = []
    for key in dict.fromkeys((*before, *after)):
        first, second = before.get(key), after.get(key)
        cell = (first or second or after[key]).cell
        for quantity, unit in (("distance", "m"), ("stopping time", "s"), ("reaction", "s")):
            one, other = _limit(first, quantity), _limit(second, quantity)
            if one is not None or other is not None:
                found.append(Change(cell, quantity, unit, one, other))
    return found


def _by_cell(passport: Passport) -> dict[tuple[str, float, int, bool], Row]:
    return {
        (row.cell.fault, row.cell.speed_m_s, row.cell.load_percent, row.cell.with_lifeline): row
        for row in rows(passport)
        if row.runs
    }


def _limit(row: Row | None, quantity: str) -> float | None:
    if row is None or row.not_stopped:
        return None
    limits: dict[str, Limit | None] = {
        "distance": row.distance_m,
        "stopping time": row.stopping_s,
        "reaction": row.reaction_s,
    }
    found = limits[quantity]
    return None if found is None else found.value
