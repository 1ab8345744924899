"""The stored measurements of a station's page, and their tables for docs/station.md (pure, except for reading the file).

`measure_station` measures them. Each measurement has the run in which it was made, because they are made one by one.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from bench.link.stops import upper_rate
from bench.rig.sheet import Column, Sheet, Times, Verdict, percentile, sentences
from bench.rig.stored import FOLDER, loads, origin, read_rows, rows_of, write_rows
from docs.generate import sections
from passport.statistics import limit, rounded_up
from wire.messages import SafetyStatus
from wire.reasons import StopReason

STORED = FOLDER / "bench_station.jsonl"
DIGITS = 2
"""Decimal places of stored figures: milliseconds and seconds."""
HOUR_S = 3600.0
WORLD = frozenset({StopReason.OBSTACLE, StopReason.SCAN_BLIND})
"""The reasons of stops that the surroundings require; every other stop of the scripted drive is false."""


class Event(NamedTuple):
    """What is done to the page or its browser."""

    words: str
    targets_ms: Mapping[int, float]
    """The longest permitted time, by its percentile."""


EVENTS: Mapping[str, Event] = {
    "key-down": Event("a key is pressed, to motion", {50: 8.0, 99: 20.0}),
    "key-up": Event("the key is released", {99: 20.0}),
    "blur": Event("the page loses the focus", {99: 20.0}),
    "closed": Event("the page is closed", {99: 20.0}),
    "killed": Event("SIGKILL of the browser", {99: 20.0}),
    "frozen": Event("the page hangs: `while (true) {}`", {99: 250.0}),
    "touch": Event("the page is touched: the e-stop", {}),
}
"""All end with the first zero on cmd_vel, except for the first one."""


@dataclass(frozen=True)
class Case:
    """The runs of one event."""

    name: str
    """Of `EVENTS`."""
    times_ms: tuple[float, ...]
    """From the event to the first fitting message on cmd_vel."""
    reference_ms: tuple[float, ...]
    """From the put of the same change by a source without a page, once for each run."""
    repeated: dict[str, int]
    """Number of runs that were repeated, by reason."""
    run: dict[str, str]
    browser_ms: tuple[float, ...] = ()
    """From the event to its first sign at a plain websocket of the page, once for each run of an event that ends the connection."""


@dataclass(frozen=True)
class Phase:
    """The gaps of cmd_vel without stations, or beside some."""

    stations: int
    pictures: int
    """Number of pictures that their pages have drawn."""
    gaps: Times


@dataclass(frozen=True)
class Gaps:
    """Phases without stations and beside them, in turn."""

    name: str
    seconds: float
    """Of each phase."""
    phases: tuple[Phase, ...]
    run: dict[str, str]


@dataclass(frozen=True)
class Drive:
    """A scripted drive by the keys of the page."""

    name: str
    seconds: float
    driven_m: float
    presses: int
    stops: dict[str, int]
    """Number of stops, by the reasons in the status when the robot stopped."""
    refusals: dict[str, int]
    """Number of sentences in which the page said that it drives no longer, or that a command was refused."""
    run: dict[str, str]

    @property
    def false_stops(self) -> int:
        """Number of stops that the surroundings did not require; a refusal counts too, even beside a stop by the supervisor."""
        return sum(self.refusals.values()) + sum(
            number for why, number in self.stops.items() if not is_asked(why)
        )


Measured = Case | Gaps | Drive
KINDS: Mapping[str, type[Measured]] = {"case": Case, "gaps": Gaps, "drive": Drive}


def is_stored(one: Measured | None, wanted: float, commit: str) -> bool:
    """Return whether a measurement has at least this number of runs or seconds, and is from this commit."""
    if one is None or _commit_of(one.run["commit"]) != _commit_of(commit):
        return False
    return (len(one.times_ms) if isinstance(one, Case) else one.seconds) >= wanted


def _commit_of(text: str) -> str:
    """Return a commit, whether or not files differed from it: a measurement that is stored changes one."""
    return text.partition(",")[0]


def is_asked(why: str) -> bool:
    """Return whether the surroundings require a stop with these reasons, which are separated by commas."""
    return bool(why) and set(why.split(", ")) <= WORLD


def read(path: Path = STORED) -> dict[str, Measured]:
    """Return the stored measurements by their names; none if there is no file.

    Raises:
        RuntimeError: the file is damaged.
    """
    if not path.exists():
        return {}
    stored = read_rows(path)
    return {one.name: one for kind, made in KINDS.items() for one in stored.of(kind, made)}


def write(path: Path, measured: Mapping[str, Measured], run: dict[str, str]) -> None:
    rows = [
        row
        for kind, made in KINDS.items()
        for row in rows_of(kind, (one for one in measured.values() if isinstance(one, made)), DIGITS)
    ]
    write_rows(path, run, rows)


class Stops:
    """Counts the stops of the supervisor: each change to the mode STOPPED, with its reasons."""

    def __init__(self) -> None:
        self.counts = dict[str, int]()
        self._mode = SafetyStatus.STOPPED

    def hear(self, status: SafetyStatus) -> bool:
        """Take a status; return whether the robot has stopped with it."""
        stopped = status.mode == SafetyStatus.STOPPED != self._mode
        self._mode = status.mode
        if stopped:
            count(self.counts, ", ".join(status.reasons))
        return stopped


def count(counts: dict[str, int], text: str) -> None:
    """Count a text; its numbers are replaced by N, so that "0.4 s old" and "0.5 s old" are one."""
    text = re.sub(r"\d+(\.\d+)?", "N", text)
    counts[text] = counts.get(text, 0) + 1


def times(cases: Iterable[Case]) -> Sheet:
    """Return a row for each event."""
    columns: list[Column[Case]] = [
        ("event", lambda one: EVENTS[one.name].words),
        ("n", lambda one: f"{len(one.times_ms)}"),
        ("p50", lambda one: _ms(one.times_ms, 50)),
        ("p99", lambda one: _ms(one.times_ms, 99)),
        ("largest", lambda one: _ms(one.times_ms, 100)),
        ("95/95", lambda one: _limit(one.times_ms)),
        ("reference p50", lambda one: _ms(one.reference_ms, 50)),
        ("reference p99", lambda one: _ms(one.reference_ms, 99)),
        ("plain websocket p50", lambda one: _ms(one.browser_ms, 50) if one.browser_ms else "–"),
        ("plain websocket p99", lambda one: _ms(one.browser_ms, 99) if one.browser_ms else "–"),
        ("repeated", lambda one: _counts(one.repeated)),
    ]
    return Sheet.of(
        "From the page to cmd_vel [ms]",
        columns,
        cases,
        "From the event to the first zero on cmd_vel; for a key that is pressed, to the first motion. The time begins before the event is sent "
        "to the browser, or before the signal.",
        "Before every other event, a held key moves the robot. The zero has the cause that takes effect first: the end of the page's commands, the loss of "
        "the station, or its press.",
        "95/95: upper 95 % confidence limit of the 95 % quantile; – with fewer than 59 runs.",
        "reference: from the put of the same change, motion or zero, by a source without a page, before each run.",
        "plain websocket: from the event to its first sign at another websocket of the same page, which has no other use. The sign is "
        "a message on `pagehide`, or the end of this websocket. The browser and the operating system take about this time, whatever the page does.",
        "repeated: runs that did not count and were repeated, and why; N replaces each number. OVERRUN is a delay of the supervisor by the machine.",
        "Debian's Chromium without a window, on the robot's computer; the robot is simulated. The page loses the focus by a `blur` event that is dispatched "
        "in it.",
    )


def _ms(values: Sequence[float], percent: float) -> str:
    return f"{percentile(values, percent):.1f}"


def _limit(values: Sequence[float]) -> str:
    found = limit(values, 0.0, 1)
    return rounded_up(found.value, 1) if found.proven else "–"


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{number} × {why}" for why, number in counts.items()) or "0"


def verdicts(case: Case) -> list[Verdict]:
    """Return a verdict on each target of an event."""
    words, targets_ms = EVENTS[case.name]
    return [
        Verdict(f"{words}, p{percent}", percentile(case.times_ms, percent), target_ms, "ms")
        for percent, target_ms in targets_ms.items()
    ]


def gaps(found: Gaps) -> Sheet:
    """Return a row for each phase."""
    columns: list[Column[Phase]] = [
        ("stations", lambda one: f"{one.stations}"),
        ("pictures a second", lambda one: f"{one.pictures / found.seconds:.0f}"),
        ("gaps", lambda one: f"{one.gaps.samples}"),
        ("p50", lambda one: f"{one.gaps.p50_ms:.1f}"),
        ("p99", lambda one: f"{one.gaps.p99_ms:.1f}"),
        ("largest", lambda one: f"{one.gaps.max_ms:.1f}"),
    ]
    return Sheet.of(
        "Gaps of cmd_vel beside stations [ms]",
        columns,
        found.phases,
        f"{found.seconds:g} s each, in this order, while the robot stands. Each station is a separate `lifeline station` with one client in place of a "
        "browser, which answers the challenges, and reports each picture as drawn after 1/60 s. Robot, stations and clients share the machine.",
    )


def drive(found: Drive) -> Sheet:
    """Return one row."""
    columns: list[Column[Drive]] = [
        ("hours", lambda one: f"{one.seconds / HOUR_S:.2f}"),
        ("distance [m]", lambda one: f"{one.driven_m:.0f}"),
        ("keys pressed", lambda one: f"{one.presses}"),
        ("stops", lambda one: _counts(one.stops)),
        ("refusals of the page", lambda one: _counts(one.refusals)),
        ("false stops", lambda one: f"{one.false_stops}"),
        (
            "false stops an hour, at most",
            lambda one: f"{upper_rate(one.false_stops, one.seconds / HOUR_S):.1f}",
        ),
    ]
    return Sheet.of(
        "Driving by keys in the page",
        columns,
        [found],
        "A script holds the keys: it turns, drives along the main aisle of the warehouse, reverses and pauses.",
        "stops: by the supervisor. The surroundings require OBSTACLE and SCAN_BLIND; every other stop is false. Each refusal counts as a false stop, "
        "too: a refused command, or the end of driving.",
        "at most: 95 % upper bound of the rate.",
    )


def together(runs: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return the runs, with those of one command and commit as one, from the first date to the last and with all loads."""
    groups: dict[tuple[str, str], list[Mapping[str, str]]] = {}
    for run in runs:
        groups.setdefault((run["command"], run["commit"]), []).append(run)
    return [_one(group) for group in groups.values()]


def _one(runs: Sequence[Mapping[str, str]]) -> dict[str, str]:
    dates = sorted({run["date"] for run in runs})
    found = [load for run in runs for load in loads(run["machine"])]
    text = f"load average {min(found):.1f} before and {max(found):.1f} during"
    machine = re.sub(r"load average [\d.]+ before and [\d.]+ during", text, runs[-1]["machine"])
    return {**runs[-1], "date": " to ".join(dict.fromkeys((dates[0], dates[-1]))), "machine": machine}


def part(measured: Mapping[str, Measured]) -> str:
    """Return the targets and the tables of what is measured, each with the run that it is from."""
    cases = [one for name in EVENTS if isinstance(one := measured.get(name), Case)]
    parts = ["\n".join(f"* {text}" for one in cases for text in sentences(verdicts(one), one.run))]
    sheets: list[tuple[Sheet, Sequence[Measured]]] = [(times(cases), cases)] if cases else []
    found_gaps, found_drive = measured.get("gaps"), measured.get("drive")
    if isinstance(found_gaps, Gaps):
        sheets.append((gaps(found_gaps), [found_gaps]))
    if isinstance(found_drive, Drive):
        sheets.append((drive(found_drive), [found_drive]))
    for sheet, rows in sheets:
        origins = map(origin, together([one.run for one in rows]))
        parts.append(replace(sheet, notes=(*sheet.notes, *origins)).markdown)
    return "\n\n".join(filter(None, parts))


PARTS: sections.Parts = {"measured": lambda: part(read())}
