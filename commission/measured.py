"""Turns what was measured into the table `[measured]` of a robot.toml, and leaves everything else in the file alone."""

import math
from typing import Any, NamedTuple

import tomlkit
from tomlkit.exceptions import TOMLKitError

from commission.estimate import Estimate
from supervisor.measured import MeasuredSection
from wire.foreign import from_toml
from wire.host.config import ConfigError, section

SECTION = "measured"
DIGITS = 5
"""Significant digits of a result. With fewer, the rounding error would exceed the uncertainty of a scale."""


class Result(NamedTuple):
    """One result for the table."""

    path: tuple[str, ...]
    """Its key below `[measured]`, such as ("lidars", "front", "yaw_rad")."""
    estimate: Estimate
    limit: float | None
    """The end of the interval on the unsafe side; None for a single trial, which has no interval."""
    how: str

    @property
    def is_known(self) -> bool:
        if self.limit is None:
            return math.isfinite(self.estimate.value)
        return self.estimate.is_determined and math.isfinite(self.limit)


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
        TableError: the file is not TOML, or has no place for the results.
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
        section(from_toml(written), SECTION, MeasuredSection)
        others_differ = _others(written) != _others(text)
    # tomlkit raises TypeError or ValueError where the place of a table has another kind of value.
    except (TOMLKitError, TypeError, ValueError, ConfigError) as error:
        raise TableError(f"[{SECTION}] cannot be written: {error}") from error
    if others_differ:
        raise TableError(
            f"[{SECTION}] cannot be written without a change of other keys: give it its own place"
        )
    return written


def check_place(text: str, results: list[Result]) -> None:
    """Check that all results, also those that are not known yet, have a place in a file.

    Raises:
        TableError: they do not.
    """
    one = Estimate(1.0, 0.0, 1)
    some = [result._replace(estimate=one, limit=None if result.limit is None else 1.0) for result in results]
    with_results(text, some, date="2026-01-01", version="")


def _put(table: Any, result: Result, date: str, version: str) -> None:  # noqa: ANN401 - tomlkit's items
    for name in result.path[:-1]:
        if name not in table:
            table[name] = tomlkit.table(is_super_table=name == "lidars")
        table = table[name]
    value = tomlkit.inline_table()
    value["value"] = _rounded(result.estimate.value)
    if result.limit is not None:
        value["limit"] = _rounded(result.limit)
    value.update({"n": result.estimate.n, "date": date, "version": version, "how": result.how})
    table[result.path[-1]] = value


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _others(text: str) -> dict[str, Any]:
    """Return all other sections of a file."""
    return {key: value for key, value in from_toml(text).items() if key != SECTION}
