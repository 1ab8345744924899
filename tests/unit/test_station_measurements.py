"""The measurements of a station's page: what counts as a false stop, what is stored, the tables, and the person who drives."""

import math
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from bench.rig.sheet import Times
from docs.generate import station
from docs.generate.scripted_person import BACK, FORWARD, LEFT, NOTHING, RIGHT, Keys, Look, Person
from docs.generate.station import Case, Drive, Gaps, Measured, Phase, Stops
from wire.messages import SafetyStatus, header

RUN = {
    "command": "measure",
    "date": "2026-11-29 13:00 UTC",
    "machine": "2 cores (x86_64), load average 0.5 before and 1.5 during, Linux",
    "commit": "abc",
}
CASE = Case("key-up", tuple(map(float, range(1, 60))), (1.0, 2.0), {"OVERRUN": 2}, RUN)
CLOSED = replace(CASE, name="closed", browser_ms=(5.0,) * 59)
GAPS = Gaps("gaps", 60.0, (Phase(0, 0, Times(3000, 20.0, 21.0, 22.0)),), RUN)
DRIVE = Drive("drive", 3600.0, 700.0, 400, {"OBSTACLE": 2, "OVERRUN, SCAN_STALE": 1}, {}, RUN)
ALL: dict[str, Measured] = {one.name: one for one in (CASE, CLOSED, GAPS, DRIVE)}


def status(mode: int, *reasons: str) -> SafetyStatus:
    return SafetyStatus(header(""), mode=mode, reasons=list(reasons))


def test_a_stop_counts_once_with_its_first_reasons_and_not_before_the_robot_was_ready() -> None:
    stops = Stops()
    heard = [
        stops.hear(status(mode, *reasons))
        for mode, *reasons in (
            (SafetyStatus.STOPPED, "NO_COMMAND"),
            (SafetyStatus.DRIVING,),
            (SafetyStatus.STOPPED, "OVERRUN"),
            (SafetyStatus.STOPPED, "OVERRUN", "SCAN_STALE"),
            (SafetyStatus.READY,),
            (SafetyStatus.STOPPED, "OBSTACLE"),
        )
    ]
    assert heard == [False, False, True, False, False, True]
    assert stops.counts == {"OVERRUN": 1, "OBSTACLE": 1}


@pytest.mark.parametrize(
    ("stops", "refusals", "false_stops"),
    [
        ({"OBSTACLE": 2}, {}, 0),
        ({"SCAN_BLIND, OBSTACLE": 1}, {}, 0),
        ({"OVERRUN, OBSTACLE": 1}, {}, 1),
        ({"COMMAND_TIMEOUT": 1, "SOURCE_LOST": 2}, {}, 3),
        ({"": 1}, {}, 1),
        ({}, {"The picture is N s old.": 2}, 2),
    ],
)
def test_a_stop_is_false_unless_the_world_alone_asks_for_it(
    stops: dict[str, int], refusals: dict[str, int], false_stops: int
) -> None:
    assert replace(DRIVE, stops=stops, refusals=refusals).false_stops == false_stops


def test_sentences_that_differ_only_in_their_numbers_are_counted_together() -> None:
    counts = dict[str, int]()
    for text in ("The picture is 0.4 s old.", "The picture is 12 s old.", "Let go first."):
        station.count(counts, text)
    assert counts == {"The picture is N s old.": 2, "Let go first.": 1}


@pytest.mark.parametrize(
    ("one", "wanted", "commit", "is_stored"),
    [
        (CASE, 59, "abc", True),
        (CASE, 60, "abc", False),
        (CASE, 59, "abc, with changes that are not committed", True),
        (CASE, 59, "abd", False),
        (DRIVE, 3600.0, "abc", True),
        (GAPS, math.nextafter(60.0, 61.0), "abc", False),
        (None, 1, "abc", False),
    ],
)
def test_only_what_has_enough_runs_of_this_commit_is_not_measured_again(
    one: Measured | None, wanted: float, commit: str, *, is_stored: bool
) -> None:
    assert station.is_stored(one, wanted, commit) is is_stored


def test_measurements_are_read_as_they_were_written(tmp_path: Path) -> None:
    file = tmp_path / "station.jsonl"
    assert station.read(file) == {}
    station.write(file, ALL, RUN)
    assert station.read(file) == ALL


def test_the_row_of_an_event_has_its_percentiles_its_limit_and_its_reference() -> None:
    [row] = station.times([CASE]).rows
    assert row == (
        "the key is released", "59", "30.0", "58.4", "59.0", "59.0", "1.5", "2.0", "–", "–", "2 × OVERRUN",
    )  # fmt: skip
    [row] = station.times([CLOSED]).rows
    assert row[6:10] == ("1.5", "2.0", "5.0", "5.0")
    [row] = station.times([replace(CASE, times_ms=CASE.times_ms[:58])]).rows
    assert row[5] == "–", "58 runs prove no limit"


def test_each_target_of_an_event_is_judged_by_its_percentile() -> None:
    fast = replace(CASE, name="key-down", times_ms=(8.0,) * 98 + (20.0,) * 2)
    assert [one.state for one in station.verdicts(fast)] == ["on target", "on target"]
    slow = replace(fast, times_ms=(math.nextafter(8.0, 9.0),) * 98 + (20.1,) * 2)
    assert [one.state.partition(" by ")[0] for one in station.verdicts(slow)] == ["OVER TARGET"] * 2


def test_runs_of_one_command_and_commit_are_described_by_one_sentence_with_all_loads() -> None:
    machine = RUN["machine"].replace("0.5", "2.5")
    later = RUN | {"date": "2026-11-29 14:00 UTC", "machine": machine}
    other = RUN | {"commit": "abd"}
    assert station.together([RUN, later, other]) == [
        RUN
        | {
            "date": "2026-11-29 13:00 UTC to 2026-11-29 14:00 UTC",
            "machine": "2 cores (x86_64), load average 0.5 before and 2.5 during, Linux",
        },
        other,
    ]


def test_the_document_shows_what_is_measured_and_nothing_else() -> None:
    text = station.part(ALL)
    assert "| 0 | 0 | 3000 | 20.0 | 21.0 | 22.0 |" in text
    assert "| 1.00 | 700 | 400 | 2 × OBSTACLE, 1 × OVERRUN, SCAN_STALE | 0 | 1 | 4.7 |" in text
    assert "OVER TARGET by 1.9e+02 %: the key is released, p99 58.4 ms, at most 20 ms" in text
    assert "SIGKILL of the browser" not in text
    assert station.part({}) == ""


def test_the_scripted_person_stays_in_the_main_aisle_for_an_hour_and_uses_every_key_and_pauses() -> None:
    """A robot without inertia, at the speeds of the page, whose driver looks at it 20 times a second."""
    period_s, speed_m_s, turn_rad_s = 0.05, 0.4, 0.8
    person, look, begun = Person(Random(0)), Look(0.0, -4.5, 0.0, 0.0), set[Keys]()
    least_m, most_m = math.inf, -math.inf
    for number in range(1, round(3600.0 / period_s)):
        held = person.keys(look)
        begun.add(held)
        travel_m = speed_m_s * period_s * ((FORWARD in held) - (BACK in held))
        look = Look(
            number * period_s,
            look.x_m + travel_m * math.cos(look.yaw_rad),
            look.y_m + travel_m * math.sin(look.yaw_rad),
            look.yaw_rad + turn_rad_s * period_s * ((LEFT in held) - (RIGHT in held)),
        )
        assert abs(look.y_m) < 0.5
        least_m, most_m = min(least_m, look.x_m), max(most_m, look.x_m)
    assert begun >= {NOTHING, frozenset({FORWARD}), frozenset({BACK})}
    assert frozenset({LEFT}) in begun or frozenset({RIGHT}) in begun
    assert -5.0 < least_m < -3.9
    assert 2.7 < most_m < 3.3


def test_after_a_stop_the_scripted_person_pauses_and_aims_again() -> None:
    person = Person(Random(0))
    ahead = Look(0.0, 0.0, 0.0, 0.0)
    while FORWARD not in person.keys(ahead):
        ahead = ahead._replace(now_s=ahead.now_s + 0.1)
    person.begin_anew(ahead.now_s)
    assert person.keys(ahead) == NOTHING
    assert person.keys(Look(ahead.now_s + 10.0, 0.0, 0.0, 1.0)) == {RIGHT}
