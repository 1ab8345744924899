"""What many trials come to."""

import pytest
from rich.console import Console

from deploy.campaign.report.figures import spread
from deploy.campaign.report.summary import by_class, class_of, print_summary
from deploy.campaign.trial import BrokenPromise, Injected, Trial


def _trial(*faults: Injected, violations: tuple[BrokenPromise, ...] = ()) -> Trial:
    return Trial(
        mode="real",
        revision="1",
        seed=1,
        duration_s=3.0,
        faults=faults,
        smallest_clearance_m=1.0,
        contacts=0,
        violations=violations,
    )


def _killed(to_zero_s: float) -> Injected:
    return Injected(
        fault="teleop_sigkill",
        time_s=1.0,
        to_zero_s=to_zero_s,
        to_standstill_s=0.3,
        distance_m=0.1,
        parameters={"to_wheels_s": to_zero_s + 0.001},
    )


def test_percentiles_are_values_that_were_measured() -> None:
    found = spread([float(value) for value in range(100, -1, -1)])
    assert found is not None
    assert (found.median, found.p99, found.worst) == (50.0, 99.0, 100.0)
    assert spread([]) is None


def test_a_pair_is_a_pair_also_when_one_half_was_spared() -> None:
    half = Injected(fault="net_cut", time_s=1.0, parameters={"pair": "net_cut and sim_sigkill"})
    assert class_of(_trial(half)) == "pair"
    assert class_of(_trial(half, _killed(0.004))) == "pair"
    assert class_of(_trial(_killed(0.004))) == "teleop_sigkill"


def test_classes_come_in_the_order_of_their_table() -> None:
    pair = Injected(fault="net_cut", time_s=1.0, parameters={"pair": "both"})
    assert list(by_class([_trial(pair), _trial(_killed(0.004))])) == ["teleop_sigkill", "pair"]


def test_the_table_tells_the_times_and_every_broken_promise(capsys: pytest.CaptureFixture[str]) -> None:
    broken = BrokenPromise(promise=2, time_s=1.25, sentence="cmd_vel is still 0.500 m/s")
    trials = [_trial(_killed(0.004)), _trial(_killed(0.016), violations=(broken,))]
    print_summary(Console(width=140), trials)
    said = capsys.readouterr().out
    row = next(line for line in said.splitlines() if line.startswith("teleop_sigkill ")).split()
    assert row[1:4] == ["2", "10", "ms"]
    assert "16.0 ms" in said
    assert "teleop_sigkill, seed 1, promise 2, 1.250 s: cmd_vel is still 0.500 m/s" in said
