"""The figures of a campaign's trials, by class. Pure."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from faults.classes import BY_NAME, CLASSES, PAIR, Effect, FaultClass
from faults.measure import BASE
from faults.promises import KILL_LIMIT_S, KILL_MEDIAN_S
from faults.report.statistics import quantile, upper_quantile, upper_rate
from faults.trial import BrokenPromise, Injected, Provenance, Trial

APART_S = 2.0
"""Faults closer together than this count as a pair, not as their own classes."""
UNSEEN = "no reason seen"
ROUNDING_S = 1e-9


class Case(NamedTuple):
    """One fault of one trial."""

    seed: int
    stop_s: float | None
    """See `stop_s`."""
    fault: Injected
    recorded: Trial | None
    """The trial, if it has a timeline."""


class Broken(NamedTuple):
    """A broken promise, and the command that replays it."""

    classes: tuple[str, ...]
    promise: BrokenPromise
    command: str


class Spread(NamedTuple):
    """The distribution of a time or distance."""

    number: int
    median: float
    limit: float | None
    """Upper 95 % limit of the 95 % quantile; None with fewer than 59 values."""
    worst: float


@dataclass
class ClassFigures:
    """One class of faults over all trials of a campaign."""

    name: str
    mode: str
    cases: list[Case] = field(default_factory=list[Case])
    """All injections."""
    clearance_m: float = math.inf
    """Smallest clearance of its trials."""
    contacts: int = 0
    """Contacts in its trials, whichever side moved."""
    trials: int = 0
    broken: int = 0
    """Number of `trials` that broke a promise."""

    def was_in(self, trial: Trial) -> None:
        """Count a trial; its cases are added separately."""
        self.trials += 1
        self.clearance_m = min(self.clearance_m, trial.smallest_clearance_m)
        self.contacts += trial.contacts
        self.broken += bool(trial.violations)

    @property
    def known(self) -> FaultClass | None:
        """Its row of the table of classes; None if this version has no such class."""
        return BY_NAME.get(self.name)

    @property
    def bound_s(self) -> float | None:
        return None if self.known is None else self.known.bound_s

    @property
    def bound_ms(self) -> str:
        """The bound in ms, after the end of a process that of the median and of the limit; empty without one."""
        median = f"{1000 * KILL_MEDIAN_S:.0f} / " if self.bound_s == KILL_LIMIT_S else ""
        return "" if self.bound_s is None else f"{median}{1000 * self.bound_s:.0f}"

    @property
    def stops(self) -> list[Case]:
        """Cases that led to a stop by an expected detector, the fastest first."""
        return sorted(self._meant, key=lambda case: math.inf if case.stop_s is None else case.stop_s)

    @property
    def detectors(self) -> list[tuple[str, int]]:
        """The first detectors of `stops` and their counts, the most frequent first."""
        return Counter(case.fault.detector or UNSEEN for case in self._meant).most_common()

    @property
    def others(self) -> list[tuple[str, int, float | None]]:
        """Stops by other detectors: the detector, the count, the longest time [s]; None if none was measured."""
        times_s: dict[str, list[float | None]] = {}
        for case in self._stopped:
            if not self._is_expected(case):
                times_s.setdefault(case.fault.detector or UNSEEN, []).append(case.stop_s)
        return [(name, len(found), _longest_s(found)) for name, found in sorted(times_s.items())]

    @property
    def _stopped(self) -> list[Case]:
        # In real trials, the operator keeps requesting motion, so a zero is a stop for any reason.
        zero_is_stop = self.mode == "real" and self.bound_s is not None
        return [
            case
            for case in self.cases
            if case.fault.detector is not None or (zero_is_stop and case.stop_s is not None)
        ]

    @property
    def _meant(self) -> list[Case]:
        return [case for case in self._stopped if self._is_expected(case)]

    def _is_expected(self, case: Case) -> bool:
        known = self.known
        return known is None or not known.detectors or case.fault.detector in known.detectors

    @property
    def stop(self) -> Spread | None:
        return spread([case.stop_s for case in self.stops])

    @property
    def wheels(self) -> Spread | None:
        return spread([_wheels_s(case.fault) for case in self.stops])

    @property
    def standstill(self) -> Spread | None:
        return None if self.is_stood_still else spread([case.fault.to_standstill_s for case in self.stops])

    @property
    def distance(self) -> Spread | None:
        return None if self.is_stood_still else spread([case.fault.distance_m for case in self.stops])

    @property
    def is_stood_still(self) -> bool:
        """Whether the fault stops the simulated world itself; its motion is then not the robot's."""
        return self.known is not None and Effect.STANDSTILL in self.known.effect

    @property
    def timed(self) -> list[Case]:
        """The cases with a measured time, the fastest first."""
        return [case for case in self.stops if case.stop_s is not None]

    @property
    def late(self) -> int:
        """Number of cases beyond the bound, without tolerance."""
        if self.bound_s is None:
            return 0
        return sum(case.stop_s > self.bound_s + ROUNDING_S for case in self.timed if case.stop_s is not None)

    def timeline_near(self, stop_s: float) -> Case | None:
        """Return the case with a timeline whose stop time is nearest to this one."""
        timed = [
            (abs(case.stop_s - stop_s), number, case)
            for number, case in enumerate(self.cases)
            if case.recorded is not None and case.stop_s is not None
        ]
        return min(timed)[2] if timed else None


@dataclass
class Campaign:
    """The trials of one mode and one revision."""

    mode: str
    revision: str
    provenances: list[Provenance] = field(default_factory=list[Provenance])
    trials: int = 0
    duration_s: float = 0.0
    broken_trials: int = 0
    broken: list[Broken] = field(default_factory=list[Broken])
    _classes: dict[str, ClassFigures] = field(default_factory=dict[str, ClassFigures])
    unsigned: bool = False
    """Whether there are trials since the last provenance."""

    def add(self, trial: Trial) -> None:
        self.trials += 1
        self.unsigned = True
        self.duration_s += trial.duration_s
        self.broken_trials += bool(trial.violations)
        named = list(classes_in(trial))
        names = tuple(dict.fromkeys(name for name, _ in named))
        self.broken += [Broken(names, one, replay(trial)) for one in trial.violations]
        for name, one in named:
            figures = self._classes.setdefault(name, ClassFigures(name, self.mode))
            recorded = trial if trial.timeline else None
            figures.cases.append(Case(trial.seed, stop_s(trial.mode, one), one, recorded))
        for name in names:
            self._classes[name].was_in(trial)

    def sign(self, provenance: Provenance) -> None:
        """Assign the trials since the last provenance to this one."""
        if self.unsigned and provenance not in self.provenances:
            self.provenances.append(provenance)
        self.unsigned = False

    @property
    def rate(self) -> float:
        """95 % upper bound of the rate of trials that break a promise."""
        return upper_rate(self.trials, self.broken_trials)

    def classes(self) -> list[ClassFigures]:
        """Return the figures in the order of the table of classes."""
        order = {one.name: number for number, one in enumerate(CLASSES)}
        return sorted(self._classes.values(), key=lambda one: (order.get(one.name, len(order)), one.name))

    def find(self, name: str) -> ClassFigures | None:
        """Return the figures of one class; None if it has no trial."""
        return self._classes.get(name)


def spread(values: Sequence[float | None]) -> Spread | None:
    """Return the distribution of the measured values; None if there are none."""
    ordered = sorted(value for value in values if value is not None)
    if not ordered:
        return None
    limit = upper_quantile(ordered, 0.95)
    return Spread(len(ordered), quantile(ordered, 0.5), None if math.isinf(limit) else limit, ordered[-1])


def campaigns(records: Iterable[Trial | Provenance]) -> tuple[list[Campaign], int]:
    """Return the campaign of the newest revision of each mode, and the number of trials of older revisions.

    Trials may be appended to a file by different revisions; their figures must not be mixed.
    """
    found: dict[tuple[str, str], Campaign] = {}
    newest: dict[str, str] = {}
    for record in records:
        if isinstance(record, Provenance):
            for one in found.values():
                one.sign(record)
            continue
        key = (record.mode, record.revision)
        newest[record.mode] = record.revision
        found.setdefault(key, Campaign(*key)).add(record)
    kept = [found[mode, newest[mode]] for mode in sorted(newest)]
    return kept, sum(one.trials for one in found.values()) - sum(one.trials for one in kept)


def stop_s(mode: str, one: Injected) -> float | None:
    """Return the time from the fault to zero on cmd_vel; for faults that only the base can detect, to its own braking.

    A dead supervisor sends no zero, and a hung one sends it late. In real trials, the time is measured at the wheels; in
    virtual trials, the record contains the base's time.
    """
    known = BY_NAME.get(one.fault)
    if mode == "real" and known is not None and any(name.startswith(BASE) for name in known.detectors):
        return _wheels_s(one)
    return one.to_zero_s


def _wheels_s(one: Injected) -> float | None:
    """Return the time until the drive's target is zero; measured in real trials."""
    wheels_s = one.parameters.get("to_wheels_s")
    return wheels_s if isinstance(wheels_s, float) else None


def figures_of(trials: Sequence[Trial]) -> list[ClassFigures]:
    """Return the figures of trials of one mode, in the order of the table of classes."""
    if not trials:
        return []
    campaign = Campaign(trials[0].mode, trials[0].revision)
    for trial in trials:
        campaign.add(trial)
    return campaign.classes()


def class_of(trial: Trial) -> str:
    """Return the class that a real trial belongs to."""
    if not trial.faults:
        return ""
    first, *others = trial.faults
    return PAIR if others or PAIR in first.parameters else first.fault


def replay(trial: Trial) -> str:
    """Return the command that replays this trial."""
    return command(trial.mode, class_of(trial), trial.seed)


def command(mode: str, name: str, seed: int) -> str:
    """Return the command that runs the trial of this seed; on real processes, of this class."""
    which = "--virtual" if mode == "virtual" else f"--classes {name} --trials 1"
    return f"lifeline faults {which} --seed {seed}"


def classes_in(trial: Trial) -> Iterator[tuple[str, Injected]]:
    """Yield each fault of a trial with the class that it counts for."""
    for one in trial.faults:
        is_alone = PAIR not in one.parameters and all(
            abs(one.time_s - other.time_s) > APART_S for other in trial.faults if other is not one
        )
        yield (one.fault if is_alone else PAIR), one


def time_in(trial: Trial, name: str) -> float | None:
    """Return the longest stop time of a class in a trial; None if none was measured."""
    return _longest_s([stop_s(trial.mode, one) for class_, one in classes_in(trial) if class_ == name])


def _longest_s(times_s: Sequence[float | None]) -> float | None:
    return max((time_s for time_s in times_s if time_s is not None), default=None)
