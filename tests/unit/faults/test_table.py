"""The table of a campaign, its broken promises, and the events of one trial."""

import math

import pytest
from rich.console import Console

from faults.report.figures import class_of, figures_of, spread
from faults.report.statistics import quantile
from faults.report.table import print_results, story
from faults.trial import BrokenPromise, Injected, Sample, Trial


def trial(*faults: Injected, broken: bool = False, clearance_m: float = 0.5, mode: str = "virtual") -> Trial:
    violations = (BrokenPromise(promise=3, time_s=1.5, sentence="it moves"),) if broken else ()
    timeline = (
        Sample(
            time_s=0.0, commanded=(0, 0), permitted=(0, 0), true=(0, 0), clearance_m=1.0, reasons=("ESTOP",)
        ),
        Sample(time_s=1.0, commanded=(0, 0), permitted=(0, 0), true=(0, 0), clearance_m=1.0),
    )
    return Trial(
        mode="real" if mode == "real" else "virtual",
        revision="r",
        seed=5,
        duration_s=10.0,
        faults=faults,
        smallest_clearance_m=clearance_m,
        contacts=0,
        violations=violations,
        timeline=timeline,
    )


def killed(time_s: float, to_zero_s: float | None = 0.002) -> Injected:
    detector = None if to_zero_s is None else "SOURCE_LOST"
    return Injected(
        fault="teleop_sigkill",
        time_s=time_s,
        detector=detector,
        to_zero_s=to_zero_s,
        to_standstill_s=0.3,
        distance_m=0.1,
    )


def test_a_class_counts_over_all_trials() -> None:
    (one,) = figures_of(
        [
            trial(killed(1.0)),
            trial(killed(1.0, 0.004), broken=True, clearance_m=0.3),
            trial(killed(1.0, None)),
        ]
    )
    assert (one.name, one.trials, len(one.stops), one.broken) == ("teleop_sigkill", 3, 2, 1)
    assert one.detectors == [("SOURCE_LOST", 2)]
    assert one.stop is not None
    assert one.distance is not None
    assert (one.stop.median, one.stop.worst, one.distance.worst, one.clearance_m) == (0.002, 0.004, 0.1, 0.3)


def test_a_campaign_without_trials_has_no_figures_and_a_trial_without_faults_no_class() -> None:
    assert figures_of([]) == []
    assert class_of(trial()) == ""


def test_two_faults_close_together_are_a_pair_and_apart_are_not() -> None:
    assert [one.name for one in figures_of([trial(killed(1.0), killed(2.9))])] == ["pair"]
    assert [one.name for one in figures_of([trial(killed(1.0), killed(3.1))])] == ["teleop_sigkill"]


def test_classes_come_in_the_order_of_their_table_and_an_unknown_one_last() -> None:
    unknown = Injected(fault="a_new_one", time_s=1.0)
    pair = Injected(fault="net_cut", time_s=1.0, parameters={"pair": "both"})
    assert [one.name for one in figures_of([trial(unknown), trial(pair), trial(killed(1.0))])] == [
        "teleop_sigkill",
        "pair",
        "a_new_one",
    ]


def test_a_pair_is_a_pair_also_when_one_half_was_spared() -> None:
    half = Injected(fault="net_cut", time_s=1.0, parameters={"pair": "net_cut and sim_sigkill"})
    assert class_of(trial(half)) == "pair"
    assert class_of(trial(half, killed(0.004))) == "pair"
    assert class_of(trial(killed(0.004))) == "teleop_sigkill"


@pytest.mark.parametrize(("share", "value"), [(0.5, 2.0), (0.51, 3.0), (0.99, 4.0), (1.0, 4.0), (0.0, 1.0)])
def test_a_quantile_is_one_of_the_values(share: float, value: float) -> None:
    assert quantile([1.0, 2.0, 3.0, 4.0], share) == value


def test_a_quantile_of_nothing_is_no_number() -> None:
    assert math.isnan(quantile([], 0.5))


def test_median_and_limit_are_values_that_were_measured() -> None:
    found = spread([float(value) for value in range(100, -1, -1)])
    assert found is not None
    assert (found.median, found.limit, found.worst) == (50.0, 99.0, 100.0)
    assert spread([]) is None


def test_the_table_shows_the_times_and_every_broken_promise_with_its_replay(
    capsys: pytest.CaptureFixture[str],
) -> None:
    trials = [
        trial(killed(1.0, 0.004), mode="real"),
        trial(killed(1.0, 0.016), broken=True, mode="real"),
        trial(Injected(fault="net_cut", time_s=1.0), mode="real"),
    ]
    print_results(trials, Console(width=160))
    printed = capsys.readouterr().out
    row = next(line for line in printed.splitlines() if line.startswith("teleop_sigkill ")).split()
    assert row == [
        *("teleop_sigkill", "2", "2", "SOURCE_LOST", "2", "10", "/", "25", "ms", "4.0", "ms", "16.0", "ms"),
        *("300", "ms", "10.0", "cm", "50.0", "cm", "1"),
    ]
    assert "teleop_sigkill, seed 5, promise 3, 1.500 s: it moves" in printed
    assert "replay: lifeline faults --classes teleop_sigkill --trials 1 --seed 5" in printed
    assert "nan" not in printed


def test_on_a_narrow_console_the_detectors_wrap_and_every_number_is_whole(
    capsys: pytest.CaptureFixture[str],
) -> None:
    faults = [
        Injected(
            fault="pair", time_s=1.0, detector=name, to_zero_s=1.2345, to_standstill_s=1.5, distance_m=0.4
        )
        for name in ("COMMAND_TIMEOUT", "COMMAND_INVALID", "base: COMMAND_TIMEOUT")
    ]
    print_results([trial(fault, mode="real") for fault in faults], Console(width=130, force_terminal=True))
    printed = capsys.readouterr().out
    assert "1234.5 ms" in printed
    assert "COMMAND_INVALID" in printed
    assert "…" not in printed


def test_a_story_has_everything_in_order() -> None:
    lines = list(story(trial(killed(0.5), broken=True)))
    assert "seed 5" in lines[0]
    told = [word for line in lines for word in ("ESTOP", "FAULT", "no stop", "BROKEN 3") if word in line]
    assert told == ["ESTOP", "FAULT", "no stop", "BROKEN 3"]
    assert "broken promises 1" in lines[-1]
