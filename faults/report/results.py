"""The results of a campaign as JSON values. Pure."""

from collections.abc import Sequence
from typing import Any

from faults.report.figures import ClassFigures, Spread, class_of, figures_of, replay
from faults.trial import Trial


def results(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the figures of each class, and every broken promise with the command that replays it."""
    return {
        "trials": len(trials),
        "broken_trials": sum(bool(trial.violations) for trial in trials),
        "classes": [_class(one) for one in figures_of(trials)],
        "broken": [
            {
                "class": class_of(trial),
                "seed": trial.seed,
                "promise": broken.promise,
                "time_s": broken.time_s,
                "sentence": broken.sentence,
                "replay": replay(trial),
            }
            for trial in trials
            for broken in trial.violations
        ],
    }


def _class(one: ClassFigures) -> dict[str, Any]:
    return {
        "class": one.name,
        "trials": one.trials,
        "stops": len(one.stops),
        "detectors": dict(one.detectors),
        "bound_s": one.bound_s,
        "to_zero_s": _spread(one.stop),
        "to_standstill_s": _spread(one.standstill),
        "distance_m": _spread(one.distance),
        "clearance_m": one.clearance_m,
        "broken_trials": one.broken,
    }


def _spread(spread: Spread | None) -> dict[str, float] | None:
    return None if spread is None else spread._asdict()
