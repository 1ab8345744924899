"""Reads the reports of the ROS 2 process from `robot/diagnostics`. Pure.

Any client may write this topic, so the texts are made printable and bounded, and other statuses are ignored.
"""

from enum import StrEnum
from itertools import islice
from typing import NamedTuple

from wire.messages import DiagnosticArray, DiagnosticStatus
from wire.text import printable

PREFIX = "lifeline: "
MAX_REPORTS = 32
MAX_VALUES = 16
MAX_TEXT = 400
SUPERVISOR = "supervisor"
"""The name of the report that repeats the supervisor's status."""


class Level(StrEnum):
    """How serious a report is."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"


_LEVELS = {DiagnosticStatus.OK: Level.OK, DiagnosticStatus.WARN: Level.WARN}
COLOURS = {Level.OK: "green", Level.WARN: "yellow", Level.ERROR: "bold red"}


class Report(NamedTuple):
    """The report of one topic."""

    name: str
    """Such as `source joy`, `scan scan` or `cmd_vel`."""
    level: Level
    message: str
    values: dict[str, str]
    """Such as `guards` and `hold_s` of a source."""


def reports_of(array: DiagnosticArray) -> tuple[Report, ...]:
    """Return the reports in a message; none if it is of another process."""
    ours = (status for status in array.status if status.name.startswith(PREFIX))
    return tuple(_report(status) for status in islice(ours, MAX_REPORTS))


def _report(status: DiagnosticStatus) -> Report:
    values = {_bounded(one.key): _bounded(one.value) for one in status.values[:MAX_VALUES]}
    name = _bounded(status.name.removeprefix(PREFIX))
    return Report(name, _LEVELS.get(status.level, Level.ERROR), _bounded(status.message), values)


def _bounded(text: str) -> str:
    shown = printable(text[: MAX_TEXT + 1])
    return shown if len(shown) <= MAX_TEXT else f"{shown[: MAX_TEXT - 1]}…"
