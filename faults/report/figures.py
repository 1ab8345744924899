"""The figures of a campaign's trials, by class. Pure."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from faults.classes import BY_NAME, CLASSES, PAIR, Effect
from faults.demands import LEEWAY_S
from faults.measure import BASE
from faults.report.statistics import quantile, upper_rate
from faults.trial import BrokenPromise, Injected, Provenance, Trial

APART_S = 2.0
"""Faults closer together than this count as a pair, not as their own classes."""
TIMELINES_KEPT = 40
"""Number of trials with a timeline that are kept for each class, to choose a typical one."""
ROUNDING_S = 1e-9

PROMISES = {
    1: "cmd_vel is never outside the limits, never NaN, and zero while a stop reason holds",
    2: "teleop dead: zero within 10 ms",
    3: "teleop hung or cut off: zero within 0.2 s and one tick",
    4: "supervisor dead: the base brakes within 10 ms; hung: within 0.15 s and a step",
    5: "scan gone or senseless: zero within 0.25 s and one tick",
    6: "by its own motion the hull never comes nearer than 0.29 m, and never touches",
    7: "after every stop no motion without a neutral command",
    8: "whatever was killed, it becomes drivable again by the operator's neutral alone",
}


class Case(NamedTuple):
    """One fault of one trial."""

    seed: int
    detector: str | None
    stop_s: float | None
    """See `stop_s`."""
    wheels_s: float | None
    """Time until the drive's target is zero; measured in real trials."""
    standstill_s: float | None
    distance_m: float | None


class Broken(NamedTuple):
    """A broken promise, and the command that replays it."""

    classes: tuple[str, ...]
    seed: int
    promise: BrokenPromise
    command: str


class Spread(NamedTuple):
    """Quantiles of a time or distance."""

    number: int
    median: float
    p99: float
    p999: float
    worst: float


@dataclass(frozen=True)
class ClassFigures:
    """One class of faults over all trials of a campaign."""

    name: str
    bound_s: float | None
    count: int
    """Number of injections."""
    stops: tuple[Case, ...]
    """Cases that led to a stop by an expected detector, the fastest first."""
    detectors: tuple[tuple[str, int], ...]
    """The first detectors of `stops` and their counts, the most frequent first."""
    others: tuple[tuple[str, int, float], ...]
    """Stops by other detectors: the detector, the count, the longest time [s]; NaN if none was measured."""
    leeway_s: float
    """Tolerance of a single trial beyond the bound."""
    clearance_m: float
    """Smallest clearance of its trials."""
    contacts: int
    """Contacts in its trials, whichever side moved."""
    trials: int
    broken: int
    """Number of `trials` that broke a promise."""
    with_timeline: tuple[Trial, ...]
    """Some of the trials with a timeline."""

    @property
    def stop(self) -> Spread | None:
        return spread([case.stop_s for case in self.stops])

    @property
    def wheels(self) -> Spread | None:
        return spread([case.wheels_s for case in self.stops])

    @property
    def standstill(self) -> Spread | None:
        return None if self.is_stood_still else spread([case.standstill_s for case in self.stops])

    @property
    def distance(self) -> Spread | None:
        return None if self.is_stood_still else spread([case.distance_m for case in self.stops])

    @property
    def is_stood_still(self) -> bool:
        """Whether the fault stops the simulated world itself; its motion is then not the robot's."""
        return self.name in BY_NAME and Effect.STANDSTILL in BY_NAME[self.name].effect

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

    @property
    def typical(self) -> Case | None:
        """The median case."""
        timed = self.timed
        return timed[(len(timed) - 1) // 2] if timed else None

    @property
    def worst(self) -> Case | None:
        timed = self.timed
        return timed[-1] if timed else None

    def timeline_near(self, stop_s: float) -> Trial | None:
        """Return the trial with a timeline whose stop time is nearest to this one."""
        mode_times = [(one, time_in(one, self.name)) for one in self.with_timeline]
        timed = [(abs(time_s - stop_s), one.seed, one) for one, time_s in mode_times if time_s is not None]
        return min(timed, key=lambda entry: entry[:2])[2] if timed else None


@dataclass
class _Gathered:
    """Collects the trials of one class."""

    cases: list[Case] = field(default_factory=list[Case])
    leeway_s: float = 0.0
    clearance_m: float = math.inf
    contacts: int = 0
    trials: int = 0
    broken: int = 0
    with_timeline: list[Trial] = field(default_factory=list[Trial])

    def add(self, case: Case, one: Injected) -> None:
        self.cases.append(case)
        leeway_s = one.parameters.get("leeway_s", LEEWAY_S)
        self.leeway_s = max(self.leeway_s, leeway_s if isinstance(leeway_s, float) else LEEWAY_S)

    def was_in(self, trial: Trial, name: str) -> None:
        self.trials += 1
        self.clearance_m = min(self.clearance_m, trial.smallest_clearance_m)
        self.contacts += trial.contacts
        self.broken += bool(trial.violations)
        if trial.timeline:
            self.with_timeline.append(trial)
            if len(self.with_timeline) > TIMELINES_KEPT:
                # Keep the longest one; of the others, the earliest.
                keeps = max(
                    range(len(self.with_timeline)), key=lambda n: time_in(self.with_timeline[n], name) or 0.0
                )
                del self.with_timeline[-2 if keeps == TIMELINES_KEPT else -1]

    def figures(self, name: str, mode: str) -> ClassFigures:
        known = BY_NAME.get(name)
        expected = known.detectors if known is not None else ()
        stopped = [case for case in self.cases if case.detector is not None]
        if mode == "real" and known is not None and known.bound_s is not None:
            # In these trials the operator keeps requesting motion, so a zero is a stop, whatever the reason.
            stopped = [case for case in self.cases if case.detector is not None or case.stop_s is not None]
        meant = [case for case in stopped if not expected or case.detector in expected]
        others: dict[str, list[Case]] = {}
        for case in stopped:
            if expected and case.detector not in expected:
                others.setdefault(case.detector or "no reason seen", []).append(case)
        return ClassFigures(
            name,
            None if known is None else known.bound_s,
            len(self.cases),
            tuple(sorted(meant, key=lambda case: math.inf if case.stop_s is None else case.stop_s)),
            tuple(Counter(case.detector or "no reason seen" for case in meant).most_common()),
            tuple((detector, len(cases), _longest_s(cases)) for detector, cases in sorted(others.items())),
            self.leeway_s,
            self.clearance_m,
            self.contacts,
            self.trials,
            self.broken,
            tuple(self.with_timeline),
        )


@dataclass
class Campaign:
    """The trials of one mode and one revision."""

    mode: str
    revision: str
    provenances: list[Provenance] = field(default_factory=list[Provenance])
    trials: int = 0
    duration_s: float = 0.0
    contacts: int = 0
    broken_trials: int = 0
    broken: list[Broken] = field(default_factory=list[Broken])
    _gathered: dict[str, _Gathered] = field(default_factory=dict[str, _Gathered])
    unsigned: bool = False
    """Whether there are trials since the last provenance."""

    def add(self, trial: Trial) -> None:
        self.trials += 1
        self.unsigned = True
        self.duration_s += trial.duration_s
        self.contacts += trial.contacts
        self.broken_trials += bool(trial.violations)
        named = list(classes_in(trial))
        names = tuple(dict.fromkeys(name for name, _ in named))
        self.broken += [Broken(names, trial.seed, one, replay(trial)) for one in trial.violations]
        for name, one in named:
            self._gathered.setdefault(name, _Gathered()).add(_case(trial, one), one)
        for name in names:
            self._gathered[name].was_in(trial, name)

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
        names = sorted(self._gathered, key=lambda name: (order.get(name, len(order)), name))
        return [self._gathered[name].figures(name, self.mode) for name in names]

    @property
    def bounded(self) -> Spread | None:
        """The stops of all classes with a bound, without pairs."""
        bounded = (one for one in self.classes() if one.bound_s is not None)
        return spread([case.stop_s for one in bounded for case in one.stops])

    def find(self, name: str) -> ClassFigures | None:
        """Return the figures of one class; None if it has no trial."""
        return self._gathered[name].figures(name, self.mode) if name in self._gathered else None


def spread(values: Sequence[float | None]) -> Spread | None:
    """Return the quantiles of the measured values; None if there are none."""
    ordered = sorted(value for value in values if value is not None)
    if not ordered:
        return None
    return Spread(
        len(ordered),
        quantile(ordered, 0.5),
        quantile(ordered, 0.99),
        quantile(ordered, 0.999),
        ordered[-1],
    )


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
        wheels_s = one.parameters.get("to_wheels_s")
        return wheels_s if isinstance(wheels_s, float) else None
    return one.to_zero_s


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
    if trial.mode == "virtual":
        return f"lifeline faults --virtual --seed {trial.seed}"
    return f"lifeline faults --classes {class_of(trial)} --trials 1 --seed {trial.seed}"


def classes_in(trial: Trial) -> Iterator[tuple[str, Injected]]:
    """Yield each fault of a trial with the class that it counts for."""
    for one in trial.faults:
        is_alone = PAIR not in one.parameters and all(
            abs(one.time_s - other.time_s) > APART_S for other in trial.faults if other is not one
        )
        yield (one.fault if is_alone else PAIR), one


def _case(trial: Trial, one: Injected) -> Case:
    wheels_s = one.parameters.get("to_wheels_s")
    return Case(
        trial.seed,
        one.detector,
        stop_s(trial.mode, one),
        wheels_s if isinstance(wheels_s, float) else None,
        one.to_standstill_s,
        one.distance_m,
    )


def time_in(trial: Trial, name: str) -> float | None:
    """Return the longest stop time of a class in a trial; None if none was measured."""
    times_s = [stop_s(trial.mode, one) for class_, one in classes_in(trial) if class_ == name]
    return max((time_s for time_s in times_s if time_s is not None), default=None)


def fault_of(trial: Trial, name: str) -> Injected | None:
    """Return the first fault of a class in a trial."""
    return next((one for class_, one in classes_in(trial) if class_ == name), None)


def _longest_s(cases: Sequence[Case]) -> float:
    return max((case.stop_s for case in cases if case.stop_s is not None), default=math.nan)
