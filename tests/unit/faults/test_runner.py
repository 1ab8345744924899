"""The trials of a campaign, their order, and resuming."""

import itertools
from pathlib import Path
from typing import Any

import pytest

from deploy.stack.errors import DeployError
from faults.classes import real_classes
from faults.real.real_faults import planned, why_not
from faults.real.rig.stage import Route, routes_for
from faults.real.runner import (
    KEPT_TIMELINES,
    REVISION,
    Orders,
    chosen,
    keeps_timeline,
    run,
    schedule,
    untried,
)
from faults.trial import BrokenPromise, Injected, Sample, Trial
from wire.host.installation import EXTRAS

NAMES = tuple(one.name for one in real_classes())


def _trial(name: str, seed: int, *faults: str) -> Trial:
    injected = tuple(
        Injected(fault=fault, time_s=1.0, parameters={"pair": "both"} if name == "pair" else {})
        for fault in faults or (name,)
    )
    return Trial(
        mode="real",
        revision=REVISION,
        seed=seed,
        duration_s=3.0,
        faults=injected,
        smallest_clearance_m=1.0,
        contacts=0,
    )


def test_every_class_gets_so_many_trials_with_seeds_of_its_own() -> None:
    plan = schedule(Orders(trials=3, seed=5), NAMES, [])
    assert sorted(plan) == sorted((name, seed) for name in NAMES for seed in (5, 6, 7))


def test_what_is_there_is_not_done_again() -> None:
    there = [
        _trial("teleop_gil", 0),
        _trial("pair", 1, "net_cut", "wire_huge"),
        _trial("pair", 0, "net_cut"),
    ]
    plan = schedule(Orders(trials=2), ("teleop_gil", "pair", "net_cut"), there)
    assert sorted(plan) == [("net_cut", 0), ("net_cut", 1), ("teleop_gil", 1)]


def test_in_a_round_a_way_to_the_hub_is_changed_as_rarely_as_can_be() -> None:
    for trials in (1, 2, 3):
        plan = schedule(Orders(trials), [name for name in NAMES if name != "pair"], [])
        ways = [routes_for([name]) for name, _ in plan]
        changes = sum(a != b for a, b in itertools.pairwise(ways))
        assert changes <= trials * (len(set(ways)) - 1)


def test_two_campaigns_of_one_seed_are_the_same() -> None:
    assert schedule(Orders(2, seed=9), NAMES, []) == schedule(Orders(2, seed=9), NAMES, [])
    assert schedule(Orders(2, seed=9), NAMES, [])[:40] != schedule(Orders(2, seed=10), NAMES, [])[:40]


def test_classes_are_chosen_by_name_or_beginning() -> None:
    assert chosen(()) == NAMES
    assert chosen(("pair", "teleop_gil", "pair")) == ("pair", "teleop_gil")
    assert set(chosen(("net_*",))) == {name for name in NAMES if name.startswith("net_")}


@pytest.mark.parametrize("name", ["teleop", "net_lossy", "*_gil", "x*"])
def test_a_class_that_there_is_not_is_refused(name: str) -> None:
    with pytest.raises(DeployError, match="there is no class"):
        chosen((name,))


@pytest.mark.parametrize("name", NAMES)
def test_the_same_seed_plans_the_same_faults(name: str) -> None:
    for seed in range(5):
        first, second = planned(name, seed), planned(name, seed)
        assert [one for one, _ in first] == [one for one, _ in second]
        assert [one.parameters for _, one in first] == [one.parameters for _, one in second]
        assert [one.lasts_s for _, one in first] == [one.lasts_s for _, one in second]
        assert len(first) == (2 if name == "pair" else 1)
        teleop, sim = routes_for([one for one, _ in first])
        assert sim is not Route.CABLE
        assert teleop is not Route.CABLE or name == "net_unplugged"


def test_a_page_takes_the_place_of_teleop_in_the_classes_of_the_station_only() -> None:
    by_page = {name for name in NAMES if name != "pair" and routes_for([name])[0] is Route.STATION}
    assert by_page == {name for name in NAMES if name.startswith("station_")}
    assert len(by_page) == 7


def test_without_the_packages_of_the_station_its_classes_are_skipped_with_a_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage: Any = None  # it is not looked at
    assert why_not("station_sigkill", stage) is None
    monkeypatch.setitem(EXTRAS, "station", ("no_such_module",))
    assert "install lifeline[station]" in str(why_not("station_sigkill", stage))


def test_a_campaign_that_is_all_there_starts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "trials.jsonl"
    whole = _trial("teleop_gil", 0).line()
    out.write_text(f"{whole}\n{whole[:40]}")
    assert run(Orders(1, ("teleop_gil",), out=out)) == 0
    said = capsys.readouterr().out
    assert "every promise was kept" in said
    assert "starting" not in said
    assert out.read_text() == f"{whole}\n", "the line of a killed campaign is cut off"


def test_a_broken_promise_of_an_earlier_run_still_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "trials.jsonl"
    broken = {"promise": 4, "time_s": 1.0, "sentence": "the base did not brake"}
    trial = Trial.model_validate_json(_trial("net_cut", 0).model_dump_json()).model_copy(
        update={"violations": (broken,)}
    )
    out.write_text(Trial.model_validate_json(trial.model_dump_json(warnings=False)).line() + "\n")
    assert run(Orders(1, ("net_cut",), out=out)) == 1
    assert "promise 4, 1.000 s: the base did not brake" in capsys.readouterr().out


def test_a_file_that_holds_something_else_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "notes.txt"
    out.write_text("hello\n")
    with pytest.raises(DeployError, match=r"notes\.txt:1: not a trial"):
        run(Orders(1, ("net_cut",), out=out))


# --- trials that are not run for lack of time


def test_a_class_without_a_trial_is_named_and_one_with_fewer_is_counted() -> None:
    there = [_trial("teleop_gil", 5), _trial("pair", 6, "net_cut", "wire_huge"), _trial("net_cut", 99)]
    assert untried(Orders(2, seed=5), ("teleop_gil", "net_cut", "pair"), there) == (4, ["net_cut"])


def test_nothing_is_missing_of_a_campaign_that_is_all_there() -> None:
    there = [_trial(name, seed) for name in ("teleop_gil", "pair") for seed in (0, 1)]
    assert untried(Orders(2), ("teleop_gil", "pair"), there) == (0, [])


# --- timelines


def _timelines(seed: int, to_zero_s: float | None, *, broken: bool = False) -> Trial:
    """A trial with its timeline, as the stage returns it."""
    sample = Sample(time_s=1.0, commanded=(0.5, 0.0), permitted=(0.5, 0.0), true=(0.5, 0.0), clearance_m=1.0)
    promise = BrokenPromise(promise=2, time_s=1.0, sentence="it drove on")
    return _trial("teleop_gil", seed).model_copy(
        update={
            "faults": (Injected(fault="teleop_gil", time_s=1.0, to_zero_s=to_zero_s),),
            "timeline": (sample,),
            "violations": (promise,) if broken else (),
        }
    )


def test_the_first_trials_the_longest_so_far_and_the_broken_ones_keep_their_timelines() -> None:
    before: list[Trial] = []

    def keeps(trial: Trial) -> bool:
        kept = keeps_timeline(trial, before)
        before.append(trial if kept else trial.model_copy(update={"timeline": ()}))
        return kept

    times_s = [0.2, 0.1, 0.15, None, 0.2, 0.21, 0.205, None, 0.21, 0.22]
    kept = [keeps(_timelines(seed, time_s)) for seed, time_s in enumerate(times_s)]
    assert kept == [True] * KEPT_TIMELINES + [False, True, False, False, False, True]
    assert keeps(_timelines(20, 0.01, broken=True))


def test_a_campaign_that_goes_on_knows_what_the_file_reports_already() -> None:
    there = [_timelines(seed, 0.2) for seed in range(KEPT_TIMELINES)]
    assert not keeps_timeline(_timelines(10, 0.2), there)
    assert keeps_timeline(_timelines(11, 0.3), there)
    assert keeps_timeline(_timelines(10, 0.2), [])
