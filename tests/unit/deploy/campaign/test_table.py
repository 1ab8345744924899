"""The summary of trials."""

import math

import pytest

from deploy.campaign.report.statistics import quantile
from deploy.campaign.report.table import print_table, rows, story
from deploy.campaign.trial import BrokenPromise, Injected, Sample, Trial


def trial(*faults: Injected, broken: bool = False, clearance_m: float = 0.5) -> Trial:
    violations = (BrokenPromise(promise=3, time_s=1.5, sentence="it moves"),) if broken else ()
    timeline = (
        Sample(
            time_s=0.0, commanded=(0, 0), permitted=(0, 0), true=(0, 0), clearance_m=1.0, reasons=("ESTOP",)
        ),
        Sample(time_s=1.0, commanded=(0, 0), permitted=(0, 0), true=(0, 0), clearance_m=1.0),
    )
    return Trial(
        mode="virtual",
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
        fault="teleop_sigkill", time_s=time_s, detector=detector, to_zero_s=to_zero_s, distance_m=0.1
    )


def test_a_row_counts_its_class_over_all_trials() -> None:
    (row,) = rows(
        [
            trial(killed(1.0)),
            trial(killed(1.0, 0.004), broken=True, clearance_m=0.3),
            trial(killed(1.0, None)),
        ]
    )
    assert (row.fault, row.count, row.stops, row.broken) == ("teleop_sigkill", 3, 2, 1)
    assert row.detectors == (("SOURCE_LOST", 2),)
    assert (row.p50_s, row.max_s, row.distance_m, row.clearance_m) == (0.002, 0.004, 0.1, 0.3)


def test_two_faults_close_together_are_a_pair_and_apart_are_not() -> None:
    assert [row.fault for row in rows([trial(killed(1.0), killed(2.9))])] == ["pair"]
    assert [row.fault for row in rows([trial(killed(1.0), killed(3.1))])] == ["teleop_sigkill"]


def test_a_class_that_the_table_does_not_know_comes_last() -> None:
    unknown = Injected(fault="a_new_one", time_s=1.0)
    assert [row.fault for row in rows([trial(unknown), trial(killed(1.0))])] == [
        "teleop_sigkill",
        "a_new_one",
    ]


@pytest.mark.parametrize(("share", "value"), [(0.5, 2.0), (0.51, 3.0), (0.99, 4.0), (1.0, 4.0), (0.0, 1.0)])
def test_a_quantile_is_one_of_the_values(share: float, value: float) -> None:
    assert quantile([1.0, 2.0, 3.0, 4.0], share) == value


def test_a_quantile_of_nothing_is_no_number() -> None:
    assert math.isnan(quantile([], 0.5))


def test_the_table_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([trial(killed(1.0), broken=True), trial(Injected(fault="net_lossy", time_s=1.0))])
    printed = capsys.readouterr().out
    assert "teleop_sigkill" in printed
    assert "SOURCE_LOST 1" in printed
    assert "nan" not in printed


def test_a_story_tells_everything_in_order() -> None:
    lines = list(story(trial(killed(0.5), broken=True)))
    assert "seed 5" in lines[0]
    told = [
        word for line in lines for word in ("ESTOP", "FAULT", "free to drive", "BROKEN 3") if word in line
    ]
    assert told == ["ESTOP", "FAULT", "free to drive", "BROKEN 3"]
    assert "promises broken 1" in lines[-1]
