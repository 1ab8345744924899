"""The file of a measurement: each run is written when it is done, and an interrupted measurement continues in it."""

from collections.abc import Callable
from pathlib import Path

from commission.commission import replace_file
from deploy.stack.errors import DeployError
from passport.cells import Plan
from passport.record import MAX_BYTES, MAX_DEVIATIONS, MAX_SENTENCE, WITHOUT, Cell, Passport, Run, from_json
from wire.foreign import ForeignError, read_text

SAME = ("robot", "version", "commit", "configuration_sha256")
"""The fields in which two parts of one measurement agree."""


class Results:
    """The record in its file.

    Args:
        path: the file; one that exists is continued.
        begun: the record of a new measurement.

    Raises:
        DeployError: the file is no record, is one of another measurement, or cannot be written.
    """

    def __init__(self, path: Path, begun: Passport) -> None:
        self._path, self.passport = path, begun
        if path.exists():
            self.passport = continued(self._read(), begun, path)
        self._write()

    def runs(self, plan: Plan, load_percent: int) -> int:
        """Return how many runs a cell has."""
        return next((len(one.runs) for one in self.passport.cells if is_of(one, plan, load_percent)), 0)

    def add(self, plan: Plan, load_percent: int, run: Run) -> None:
        self._change(plan, load_percent, lambda cell: cell.model_copy(update={"runs": (*cell.runs, run)}))
        if not plan.with_lifeline:
            self.update(not_tested=tuple(one for one in self.passport.not_tested if one != WITHOUT))

    def refuse(self, plan: Plan, load_percent: int, why: str | None) -> None:
        """Note why a cell was not measured, or was ended early; None: it is measured now."""
        if why is not None or any(is_of(one, plan, load_percent) for one in self.passport.cells):
            self._change(plan, load_percent, lambda cell: cell.model_copy(update={"refused": why}))

    def deviate(self, sentence: str) -> None:
        """Note something that did not go as planned."""
        self.update(deviations=(*self.passport.deviations, sentence[:MAX_SENTENCE])[-MAX_DEVIATIONS:])

    def update(self, **fields: object) -> None:
        self.passport = self.passport.model_copy(update=fields)
        self._write()

    def _change(self, plan: Plan, load_percent: int, change: Callable[[Cell], Cell]) -> None:
        self.update(cells=with_change(self.passport.cells, plan, load_percent, change))

    def _read(self) -> Passport:
        try:
            return from_json(read_text(self._path, MAX_BYTES))
        except (OSError, ForeignError) as error:
            raise DeployError(f"{self._path}: {error}; choose another --out") from error

    def _write(self) -> None:
        try:
            replace_file(self._path, self.passport.to_json())
        except OSError as error:
            raise DeployError(f"cannot write {self._path}: {error.strerror}") from error


def is_of(cell: Cell, plan: Plan, load_percent: int) -> bool:
    """Return whether a cell is that of a plan."""
    planned = (plan.fault.words, plan.speed, load_percent, plan.with_lifeline)
    return (cell.fault, cell.speed_m_s, cell.load_percent, cell.with_lifeline) == planned


def with_change(
    cells: tuple[Cell, ...], plan: Plan, load_percent: int, change: Callable[[Cell], Cell]
) -> tuple[Cell, ...]:
    """Return the cells with that of a plan changed; it is added if there is none."""
    if not any(is_of(one, plan, load_percent) for one in cells):
        new = Cell(
            fault=plan.fault.words,
            speed_m_s=plan.speed,
            load_percent=load_percent,
            with_lifeline=plan.with_lifeline,
            turn=plan.is_turn,
        )
        cells = (*cells, new)
    return tuple(change(one) if is_of(one, plan, load_percent) else one for one in cells)


def continued(before: Passport, begun: Passport, path: Path) -> Passport:
    """Return the record that continues a former one.

    Raises:
        DeployError: the former one is of another robot, configuration, code or top speed.
    """
    for name in SAME:
        if getattr(before, name) != getattr(begun, name):
            raise DeployError(f"{path} is of another measurement: its {name} differs; choose another --out")
    if before.conditions.top_speed_m_s != begun.conditions.top_speed_m_s:
        raise DeployError(f"{path} is of another measurement: its top speed differs; choose another --out")
    return before
