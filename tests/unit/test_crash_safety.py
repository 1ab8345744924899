"""The measured parts of docs/crash-safety.md match the committed results."""

from pathlib import Path

from bench.rig.sheet import Times
from bench.soak import Sample, Usage
from docs.generate import crash_safety, draw_crash_safety
from docs.generate.sections import ROOT
from faults.classes import CLASSES
from faults.promises import KILL_LIMIT_S, KILL_MEDIAN_S, PROMISES
from faults.report.figures import Campaign, campaigns
from faults.trial import BrokenPromise, Injected, Provenance, Trial


def campaign() -> Campaign:
    killed = Injected(
        fault="teleop_sigkill",
        time_s=1.0,
        detector="SOURCE_LOST",
        to_zero_s=0.003,
        to_standstill_s=0.3,
        distance_m=0.12,
        parameters={"to_wheels_s": 0.004},
    )
    broken = BrokenPromise(promise=2, time_s=1.0, sentence="a | b\n<c>")
    found, _ = campaigns(
        [
            Trial(
                mode="real",
                revision="1",
                seed=4,
                duration_s=3.0,
                faults=(killed,),
                smallest_clearance_m=0.4,
                contacts=0,
                violations=(broken,),
            )
        ]
    )
    return found[0]


def test_the_answer_has_the_figures_and_hides_no_broken_promise() -> None:
    text = crash_safety.answer(campaign())
    for words in (
        "median and longest (n = 1)",
        "zero on `cmd_vel` after 3.0 and 3.0 ms",
        "zero wheel command after 4.0 and 4.0 ms",
        "12 and 12 cm",
        "`SOURCE_LOST` 1 times",
        "1 of them",
    ):
        assert words in text
    assert "does not record" in text, "there is no provenance"


def test_the_table_has_a_row_and_what_was_broken_in_one_line() -> None:
    text = crash_safety.table(campaign())
    assert "| `teleop_sigkill` | SIGKILL (teleop) | 1 | `SOURCE_LOST` 1 | 10 / 25 | 3.0 |  | 3.0 |" in text
    assert (
        "* promise 2, teleop_sigkill: a / b ‹c› (`lifeline faults --classes teleop_sigkill --trials 1 --seed 4`)"
        in text
    )


def test_the_committed_results_are_where_the_document_says() -> None:
    assert {path.parent for path in crash_safety.RESULTS.values()} == {
        Path(crash_safety.__file__).parents[1] / "campaign"
    }


def test_the_soak_is_reported_with_what_grew_and_what_stopped_without_a_cause() -> None:
    gaps = Times(500, 20.0, 21.5, 25.0)

    def sample(time_s: float, *false_stops: str) -> Sample:
        used = Usage(7, int(50e6 * (1 + time_s / 36_000)), 20, 9)
        return Sample(time_s, {"supervisor": used}, gaps, gaps, {"cmd_vel": 2}, false_stops, 3, 4, time_s / 2)

    samples = [sample(10.0 * n) for n in range(1, 361)]
    good = crash_safety.soaked(samples, [Provenance()])
    for words in (
        "60 minutes, 1800 m, 3 stops",
        "**no stop without a cause**, 720 samples lost",
        "21.5 ms (worst)",
    ):
        assert words in good
    assert "unknown command" in good
    assert "| supervisor | 52.9 MB | +7.87 % | 20 | 9 |" in good, "over 50 of the 60 minutes"
    assert "FAILED: supervisor: memory grew by" in good
    bad = crash_safety.soaked(
        [*samples[:-1], sample(3600.0, "OVERRUN")], [Provenance(command="python -m bench.soak")]
    )
    assert "**1 stop without a cause**" in bad
    assert "FAILED: false stops: OVERRUN" in bad


def test_the_picture_has_words_for_each_class_with_a_bound_and_for_what_fails_in_it() -> None:
    bounded = [one for one in CLASSES if one.bound_s is not None]
    assert draw_crash_safety.WORDS.keys() == {one.name for one in bounded}
    assert draw_crash_safety.HEADINGS.keys() == {one.group for one in bounded}


def test_each_promise_about_a_killed_process_has_one_number_with_its_statistic_in_every_place() -> None:
    promise = "10 ms (median) and 25 ms (upper 95 % limit of the 95 % quantile)"
    assert promise in PROMISES[2]
    assert promise in PROMISES[4]
    page = (ROOT / "docs/crash-safety.md").read_text()
    assert f"**Promised**: {PROMISES[2]}." in page
    assert "within milliseconds" not in page
    stored = crash_safety.result("real")
    killed = stored.find("teleop_sigkill")
    assert killed is not None
    assert killed.stop is not None
    assert killed.stop.limit is not None
    assert killed.stop.median <= KILL_MEDIAN_S
    assert killed.stop.limit <= KILL_LIMIT_S
    for document in (page, (ROOT / "README.md").read_text()):
        assert f"{1000 * killed.stop.median:.1f}" in document
        assert f"{1000 * killed.stop.limit:.1f} ms" in document
        assert f"n = {killed.stop.number}" in document
