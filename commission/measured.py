"""Turns what was measured into the table `[measured]` of a robot.toml, and leaves everything else in the file alone."""

import math
import tomllib
from typing import Any, NamedTuple

import tomlkit
from tomlkit.exceptions import TOMLKitError

from commission.estimate import Estimate
from supervisor.measured import MeasuredSection
from wire.host.config import ConfigError, section

SECTION = "measured"
DIGITS = 4


class Result(NamedTuple):
    """One result for the table."""

    path: tuple[str, ...]
    """Its key below `[measured]`, such as ("lidars", "front", "yaw_rad")."""
    estimate: Estimate
    limit: float
    """The end of the interval on the unsafe side."""
    how: str

    @property
    def is_known(self) -> bool:
        return self.estimate.is_determined and math.isfinite(self.limit) and self.estimate.n > 0


class TableError(Exception):
    """The table cannot be written; the message says why."""


def with_results(text: str, results: list[Result], *, date: str, version: str) -> str:
    """Return a file with the results in `[measured]`; values that were not measured this time stay.

    Args:
        text: the file.
        results: the results; those that are not known are left out.
        date: such as 2026-11-27.
        version: the version of Lifeline.

    Raises:
        TableError: the file is not TOML, or `[measured]` in it is not a table.
    """
    try:
        document = tomlkit.parse(text)
        if SECTION not in document:
            table = tomlkit.table()
            table.comment("measured by `lifeline commission FILE`: docs/commission.md")
            document[SECTION] = table
        for result in results:
            if result.is_known:
                _put(document[SECTION], result, date, version)
        written = tomlkit.dumps(document)
    except (TOMLKitError, TypeError) as error:  # TypeError: a number where a table is expected
        raise TableError(f"it cannot be written: {error}") from error
    try:
        section(tomllib.loads(written), SECTION, MeasuredSection)
    except ConfigError as error:
        raise TableError(f"it cannot be written: {error}") from error
    if _others(written) != _others(text):
        raise TableError(
            f"it cannot be written without a change of other keys: give [{SECTION}] a place of its own"
        )
    return written


def _put(table: Any, result: Result, date: str, version: str) -> None:  # noqa: ANN401 - tomlkit's items
    for name in result.path[:-1]:
        if name not in table:
            table[name] = tomlkit.table(is_super_table=name == "lidars")
        table = table[name]
    value = tomlkit.inline_table()
    value.update(
        {
            "value": _rounded(result.estimate.value),
            "limit": _rounded(result.limit),
            "n": result.estimate.n,
            "date": date,
            "version": version,
            "how": result.how,
        }
    )
    table[result.path[-1]] = value


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _others(text: str) -> dict[str, Any]:
    """Return all other sections of a file."""
    return {key: value for key, value in tomllib.loads(text).items() if key != SECTION}
