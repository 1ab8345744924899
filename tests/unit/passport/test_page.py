"""The page of a passport, and what it carries."""

import json
import re

import pytest

from passport.drawing import round_numbers
from passport.page import inside_of, page
from passport.record import Passport, from_json
from passport.statement import digest, record_in, statement_of
from tests.unit.passport.records import cell, record, run
from wire.foreign import ForeignError

HOSTILE = "</script><script>alert(1)</script>\x1b[31m"
FULL = record(
    cell("plain zero", run(0.1, v0_m_s=0.3, stop_s=0.3), speed_m_s=0.3),
    cell("plain zero", *[run()] * 59),
    cell("supervisor killed", run(stop_s=None)),
    cell("operator's program killed", run(), run(stopped=False)),
    cell("e-stop", refused="the wall is too near"),
)


def shown(passport: Passport, signer: str | None = None) -> str:
    return page(passport, passport.to_json(), signer)


def test_a_page_carries_its_record() -> None:
    inside = inside_of(shown(FULL))
    assert inside is not None
    assert from_json(inside) == FULL


def test_a_text_that_is_no_page_carries_nothing() -> None:
    assert inside_of("") is None
    assert inside_of(FULL.to_json()) is None
    assert inside_of("<!doctype html>" + shown(FULL)[40:].partition("</script>")[0]) is None
    assert inside_of(shown(FULL).replace("<!doctype html>", "")) is None


def test_foreign_text_cannot_end_the_record_or_run_a_script() -> None:
    hostile = record(cell("zero " + HOSTILE, run()), robot=HOSTILE[:300])
    text = shown(hostile, HOSTILE)
    assert text.count("<script") == text.count("</script>") == 1
    inside = inside_of(text)
    assert inside is not None
    assert from_json(inside) == hostile


def test_a_limit_of_the_table_is_not_rounded_down() -> None:
    text = shown(record(cell("e-stop", run(0.3301, stop_s=0.4904))))
    assert "<td>0.52</td><td>0.35</td>" in text


def test_each_cell_is_a_row_and_each_run_has_a_picture() -> None:
    text = shown(FULL)
    rows = re.findall(r'<tr><td class="l">([^<]*)</td>', text)
    assert rows == [
        "plain zero",
        "plain zero",
        "supervisor killed",
        "operator&#x27;s program killed",
        "e-stop",
    ]
    assert text.count("<figure>") == 63
    assert "did not stop in 1 of 2 runs" in text
    assert "not measured" in text
    assert "time unknown" in text


def test_a_cell_without_lifeline_stands_beside_that_with_lifeline() -> None:
    alone = cell("e-stop", run(0.4, stop_s=0.9), with_lifeline=False)
    text = shown(record(cell("plain zero", run()), cell("e-stop", run(0.2)), alone))
    rows = re.findall(r'<tr><td class="l">([^<]*)</td>', text)
    assert rows == ["plain zero", "e-stop"]
    assert "with Lifeline</th>" in text
    e_stop = text.partition('<td class="l">e-stop')[2].partition("</tr>")[0]
    assert re.findall(r"<td>(0\.[24]\d)</td>", e_stop) == ["0.21", "0.41"]
    assert text.count('<circle class="run"') == text.count('<circle class="without"') * 2
    assert "each ring one without it" in text
    only = shown(record(alone))
    assert '<th class="g" colspan="5">with Lifeline</th>' not in only
    assert "without Lifeline</th>" in only


def test_only_a_limit_that_is_proven_is_bold() -> None:
    proven = shown(record(cell("plain zero", *[run()] * 59)))
    assert "<td><b>0.31</b></td>" in proven
    assert "<td>0.31</td>" in shown(record(cell("plain zero", run())))


def test_a_turn_is_shown_in_rad_and_not_in_the_curves() -> None:
    turn = cell("plain zero in a turn", run(0.4, v0_m_s=2.0), speed_m_s=2.0, turn=True)
    text = shown(record(turn, cell("e-stop", run())))
    assert '<td class="l">plain zero in a turn</td><td>2 rad/s</td>' in text
    assert "<td>0.43 rad</td><td>1.80 rad/s²</td>" in text
    assert "<h3>plain zero in a turn, 2 rad/s, load 0 %</h3>" in text
    assert "1: 0.400 rad from 2.00 rad/s, 0.50 s" in text
    assert "<dt>turns by</dt><dd>the direction of this line; ± 30 mrad (95 %)</dd>" in text
    assert "<b>a turn</b>" in text
    assert text.count('<circle class="run"') == 2
    assert "a turn" not in shown(FULL).partition('type="application/json"')[0]


def test_the_proven_limit_of_a_turn_has_its_unit_too() -> None:
    text = shown(record(cell("turn", *[run(0.4)] * 59, turn=True)))
    assert "<td><b>0.43</b> rad</td>" in text


def test_a_page_shows_the_digest_and_who_signed() -> None:
    assert digest(FULL) in shown(FULL)
    assert "<dd>nobody</dd>" in shown(FULL)
    assert "<dd>robot7 (supervisor@robot7)</dd>" in shown(FULL, "robot7 (supervisor@robot7)")


def test_a_slip_and_a_missing_condition_are_named() -> None:
    slipping = run().model_copy(update={"slip": True})
    bare = record(cell("plain zero", slipping)).model_copy(
        update={"commit": "", "deviations": ("A key was pressed",)}
    )
    bare = bare.model_copy(
        update={"conditions": bare.conditions.model_copy(update={"floor": "", "loads": ()})}
    )
    text = shown(bare)
    assert ", slip</figcaption>" in text
    assert "The wheels slipped in 1 of 1 runs of plain zero at" in text
    assert "not stated" in text
    assert "commit unknown" in text
    assert "<li>A key was pressed</li>" in text


def test_a_page_without_runs_has_no_curves() -> None:
    text = shown(record(cell("e-stop", refused="the wall is too near")))
    assert "<svg" not in text
    assert "Nothing was measured." in text


@pytest.mark.parametrize(
    ("most", "numbers"),
    [
        (0.65, [0.0, 0.2, 0.4, 0.6]),
        (1.0, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (9.9, [0.0, 2.0, 4.0, 6.0, 8.0]),
        (0.0011, [0.0, 0.0002, 0.0004, 0.0006, 0.0008, 0.001]),
    ],
)
def test_an_axis_has_round_numbers(most: float, numbers: list[float]) -> None:
    assert round_numbers(most) == numbers


def test_curves_without_a_time_are_empty() -> None:
    text = shown(record(cell("supervisor killed", run(stop_s=None))))
    assert text.count('<circle class="run"') == 1


def test_a_page_is_the_same_each_time() -> None:
    assert shown(FULL) == shown(FULL)


def test_a_statement_contains_the_record_with_its_digest() -> None:
    assert record_in(statement_of(FULL)) == FULL
    found = json.loads(statement_of(FULL))
    assert found["subject"] == [{"name": "robot", "digest": {"sha256": digest(FULL)}}]


@pytest.mark.parametrize(
    "changed",
    [
        {"_type": "other"},
        {"predicateType": "other"},
        {"subject": []},
        {"predicate": None},
    ],
)
def test_another_statement_is_refused(changed: dict[str, object]) -> None:
    found = json.loads(statement_of(FULL)) | changed
    with pytest.raises(ForeignError):
        record_in(json.dumps(found).encode())


@pytest.mark.parametrize("text", [b"", b"[]", b"\xff", b"1" * 9000])
def test_what_is_no_statement_is_refused(text: bytes) -> None:
    with pytest.raises(ForeignError):
        record_in(text)
