"""The record of a measurement: its JSON form, its bounds, and how a measurement continues in its file."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.stack.errors import DeployError
from passport import record
from passport.cells import Fault, Plan
from passport.record import (
    MAX_DEVIATIONS,
    MAX_SENTENCE,
    Cell,
    Conditions,
    Instrument,
    Passport,
    Run,
    from_json,
)
from passport.results import Results
from wire.foreign import ForeignError

RUN = Run(
    t0_s=0.0,
    t1_s=0.1,
    t2_s=0.2,
    t3_s=0.5,
    v0_m_s=0.8,
    distance_m=0.21,
    odometry_m=0.2,
    deceleration_m_s2=2.0,
    slip=False,
    stopped=True,
    trace=((-0.1, 0.8, -0.08), (0.0, 0.8, 0.0)),
)
PLAN = Plan(Fault.OPERATOR_KILLED, 0.8)
CELL = Cell(
    fault=PLAN.fault.words, speed_m_s=0.8, load_percent=100, with_lifeline=True, refused=None, runs=(RUN,)
)
PASSPORT = Passport(
    robot="robot (robot.toml)",
    version="0.1.0",
    commit="abc",
    configuration_sha256="0" * 64,
    date="2026-11-28 16:30 UTC",
    conditions=Conditions(top_speed_m_s=0.8, loads=("100 %: 20 kg",), floor="concrete", machine_load="0.3"),
    instrument=Instrument(wall_fit="a line", uncertainty_m=0.004, uncertainty_s=0.02),
    cells=(CELL,),
    not_tested=("a turn",),
    deviations=("a run was repeated",),
)


def test_a_record_without_turns_has_the_text_that_it_had_before_there_were_turns() -> None:
    """Otherwise its digest would change, and its signature would no longer verify."""
    assert "uncertainty_rad" not in PASSPORT.to_json()
    keys = list(json.loads(CELL.model_dump_json()))
    assert keys == ["fault", "speed_m_s", "load_percent", "with_lifeline", "refused", "runs"]


def test_a_turn_is_written_and_needs_its_uncertainty() -> None:
    turn = CELL.model_copy(update={"turn": True})
    instrument = PASSPORT.instrument.model_copy(update={"uncertainty_rad": 0.03})
    written = PASSPORT.model_copy(update={"cells": (turn,), "instrument": instrument})
    assert from_json(written.to_json()) == written
    with pytest.raises(ForeignError, match="a turn needs uncertainty_rad"):
        from_json(PASSPORT.model_copy(update={"cells": (turn,)}).to_json())


def test_a_record_is_what_was_written() -> None:
    assert from_json(PASSPORT.to_json()) == PASSPORT
    assert PASSPORT.to_json() == from_json(PASSPORT.to_json()).to_json()


def changed(path: str, value: object) -> str:
    """Return the JSON text with one value changed."""
    document = json.loads(PASSPORT.to_json())
    *above, last = [int(part) if part.isdecimal() else part for part in path.split(".")]
    place: Any = document
    for part in above:
        place = place[part]
    place[last] = value
    return json.dumps(document)


RUN_PATH = "cells.0.runs.0"


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        ("format", 2, "format: input should be 1"),
        ("robot", 7, "robot: input should be a valid string"),
        ("more", 7, "more: extra inputs are not permitted"),
        ("configuration_sha256", "0" * 63, "configuration_sha256: string should match pattern"),
        ("conditions.top_speed_m_s", 0.0, "conditions.top_speed_m_s: input should be greater than 0"),
        (
            "conditions.top_speed_m_s",
            float("nan"),
            "conditions.top_speed_m_s: input should be a finite number",
        ),
        ("instrument.uncertainty_m", -0.1, "instrument.uncertainty_m: input should be greater"),
        ("cells.0.load_percent", 50.5, "cells.0.load_percent: input should be a valid integer"),
        ("cells.0.refused", "", "cells.0.refused: string should have at least 1 character"),
        (f"{RUN_PATH}.t0_s", 0.1, "t0_s: input should be less than or equal to 0"),
        (f"{RUN_PATH}.t3_s", 1e9, "t3_s: input should be less than or equal to 600"),
        (f"{RUN_PATH}.stopped", "yes", "stopped: input should be a valid boolean"),
        (f"{RUN_PATH}.trace", [[0.0, 0.0]], "trace.0.2: field required"),
        (f"{RUN_PATH}.trace", 401 * [[0.0, 0.0, 0.0]], "trace: tuple should have at most 400 items"),
        (f"{RUN_PATH}.trace", [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "the trace is not in order of time"),
        (f"{RUN_PATH}.distance_m", None, "a run that stopped has a distance_m"),
        (f"{RUN_PATH}.t0_s", None, "without t0_s there are no other times"),
    ],
)
def test_a_value_that_cannot_be_is_refused_in_one_sentence(path: str, value: object, sentence: str) -> None:
    with pytest.raises(ForeignError, match="not a passport of format 1: ") as refused:
        from_json(changed(path, value))
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.text())
def test_no_text_is_an_error_of_another_kind(text: str) -> None:
    with pytest.raises(ForeignError):
        from_json(text)


def test_a_text_that_is_too_long_or_too_deep_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ForeignError, match="the text: invalid json"):
        from_json(100_000 * "[")
    monkeypatch.setattr(record, "MAX_BYTES", 1 << 20)
    with pytest.raises(ForeignError, match="larger than 1 MiB"):
        from_json((1 << 20) * " " + "1")


def test_a_robot_that_did_not_stop_needs_no_distance() -> None:
    assert (
        not from_json(changed(f"{RUN_PATH}", {**RUN.model_dump(), "stopped": False, "distance_m": None}))
        .cells[0]
        .runs[0]
        .stopped
    )


# --- the file


BEGUN = PASSPORT.model_copy(update={"cells": (), "deviations": ()})


def test_each_change_is_in_the_file_at_once_and_the_measurement_continues_there(tmp_path: Path) -> None:
    path = tmp_path / "passport.json"
    results = Results(path, BEGUN)
    assert from_json(path.read_text()) == BEGUN
    results.add(PLAN, 100, RUN)
    results.add(PLAN, 0, RUN)
    results.deviate("a surprise")
    results = Results(path, BEGUN.model_copy(update={"date": "later"}))
    assert results.passport.date == BEGUN.date
    assert results.passport.deviations == ("a surprise",)
    results.add(PLAN, 100, RUN)
    assert (results.runs(PLAN, 100), results.runs(PLAN, 0), results.runs(PLAN, 50)) == (2, 1, 0)
    assert from_json(path.read_text()).cells[0] == CELL.model_copy(update={"runs": (RUN, RUN)})
    assert [one.name for one in tmp_path.iterdir()] == ["passport.json"]


def test_a_cell_that_is_refused_says_why_until_it_is_measured(tmp_path: Path) -> None:
    results = Results(tmp_path / "passport.json", BEGUN)
    results.refuse(PLAN, 100, None)
    assert results.passport.cells == ()
    results.refuse(PLAN, 100, "no room")
    assert results.passport.cells == (CELL.model_copy(update={"runs": (), "refused": "no room"}),)
    results.refuse(PLAN, 100, None)
    assert results.passport.cells[0].refused is None


def test_deviations_stay_within_the_record(tmp_path: Path) -> None:
    path = tmp_path / "passport.json"
    most = BEGUN.model_copy(update={"deviations": tuple(map(str, range(MAX_DEVIATIONS)))})
    results = Results(path, most)
    results.deviate(2 * MAX_SENTENCE * "x")
    found = from_json(path.read_text()).deviations
    assert (found[0], found[-1]) == ("1", MAX_SENTENCE * "x")


@pytest.mark.parametrize(
    ("field", "value"), [("configuration_sha256", "1" * 64), ("commit", "other"), ("robot", "other")]
)
def test_a_file_of_another_measurement_is_refused_and_stays(tmp_path: Path, field: str, value: str) -> None:
    path = tmp_path / "passport.json"
    path.write_text(PASSPORT.to_json())
    with pytest.raises(DeployError, match=f"is of another measurement: its {field} differs"):
        Results(path, BEGUN.model_copy(update={field: value}))
    assert path.read_text() == PASSPORT.to_json()


def test_a_file_of_another_top_speed_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "passport.json"
    path.write_text(PASSPORT.to_json())
    faster = BEGUN.conditions.model_copy(update={"top_speed_m_s": 0.9})
    with pytest.raises(DeployError, match="its top speed differs; choose another --out"):
        Results(path, BEGUN.model_copy(update={"conditions": faster}))


def test_a_file_that_is_no_record_or_cannot_be_written_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "passport.json"
    path.write_text("{}")
    with pytest.raises(
        DeployError, match="not a passport of format 1: robot: field required; choose another --out"
    ):
        Results(path, BEGUN)
    with pytest.raises(DeployError, match="cannot write"):
        Results(tmp_path / "nowhere" / "passport.json", BEGUN)
