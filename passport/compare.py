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
    old_failed: bool
    """Whether the robot did not stop in a run of the cell."""
    new_failed: bool

    @property
    def is_in_both(self) -> bool:
        """Whether there is something to compare."""
        return (self.old is not None or self.old_failed) and (self.new is not None or self.new_failed)

    @property
    def is_different(self) -> bool:
        """Whether the limit changed at all."""
        return self.old != self.new or self.old_failed != self.new_failed

    @property
    def is_worse(self) -> bool:
        """Whether the limit grew, or is no longer known, or the robot did not stop, also in a cell that is new."""
        if self.new_failed:
            return not self.old_failed
        return self.old is not None and (self.new is None or self.new > self.old + SAME)

    @property
    def result(self) -> dict[str, Any]:
        """The change as JSON values."""
        cell = self.cell.model_dump(include={"fault", "speed_m_s", "load_percent", "with_lifeline"})
        found = {"quantity": self.quantity, "unit": self.unit, "old": self.old, "new": self.new}
        failed = {"old_did_not_stop": self.old_failed, "new_did_not_stop": self.new_failed}
        return cell | found | failed | {"worse": self.is_worse}


def changes(old: Passport, new: Passport) -> list[Change]:
    """Return each limit that either record has; a cell in which the robot did not stop has no limits.

    A cell in which it stopped in neither record is left out.
    """
    before, after = _by_cell(old), _by_cell(new)
    found: list[Change] = []
    for key in dict.fromkeys((*before, *after)):
        first, second = before.get(key), after.get(key)
        cell = (first or second or after[key]).cell
        way = ("angle", "rad") if cell.turn else ("distance", "m")
        for quantity, unit in (way, ("stopping time", "s"), ("reaction", "s")):
            one, other = _limit(first, quantity), _limit(second, quantity)
            if one is not None or other is not None or _failed(first) != _failed(second):
                found.append(Change(cell, quantity, unit, one, other, _failed(first), _failed(second)))
    return found


def _by_cell(passport: Passport) -> dict[tuple[str, float, int, bool, bool], Row]:
    return {
        (cell.fault, cell.speed_m_s, cell.load_percent, cell.with_lifeline, cell.turn): row
        for row in rows(passport)
        if (cell := row.cell).runs
    }


def _failed(row: Row | None) -> bool:
    return row is not None and row.not_stopped > 0


def _limit(row: Row | None, quantity: str) -> float | None:
    if row is None or _failed(row):
        return None
    limits: dict[str, Limit | None] = {
        "distance": row.distance_m,
        "angle": row.distance_m,
        "stopping time": row.stopping_s,
        "reaction": row.reaction_s,
    }
    found = limits[quantity]
    return None if found is None else found.value
