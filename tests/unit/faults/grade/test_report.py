"""The grade as table, page, JUnit XML and JSON."""

import json
import re
from html.parser import HTMLParser
from io import StringIO
from xml.etree import ElementTree as ET

import pytest
from rich.console import Console

from faults.grade.marks import Fault, Grade, Observed, mark, untested
from faults.grade.report import as_json, drawing, from_json, junit, page, table
from faults.grade.rubric import read

RUBRIC = read(None)
SEEN = Observed(
    0.5, 0.3, 0.1, 0.0, 0.5, 2.0, touched=False, swings=1, ended=False, curve=((-0.5, 0.5), (0.3, 0.0))
)
ON = Observed(
    0.5, None, 2.2, 0.0, 0.5, 2.0, touched=False, swings=0, ended=False, curve=((-0.5, 0.5), (4.5, 0.5))
)
GRADE = Grade(
    "python <teleop>.py & more",
    "the simulated robot",
    50.0,
    (
        mark(Fault.KILLED, SEEN, RUBRIC),
        mark(Fault.STOPPED, ON, RUBRIC),
        untested(Fault.UNPLUGGED, "network namespaces need root", RUBRIC),
    ),
)


def test_the_table_has_a_row_for_each_fault_and_the_total() -> None:
    file = StringIO()
    Console(file=file, width=200).print(table(GRADE))
    text = file.getvalue()
    assert "25 of 45 points" in text
    assert "25 of 25" in text
    assert "0 of 20" in text
    assert "not tested: network namespaces need root" in text


def test_json_is_read_as_it_was_written() -> None:
    text = json.dumps({"run": {"date": "today"}, **as_json(GRADE)})
    assert from_json(text) == GRADE
    assert json.loads(text)["points"] == 25.0
    with pytest.raises(ValueError, match="program"):
        from_json("{}")


def test_junit_has_a_failure_for_each_fault_without_full_points() -> None:
    suite = ET.fromstring(junit(GRADE))
    assert (suite.get("tests"), suite.get("failures"), suite.get("skipped")) == ("3", "1", "1")
    passed, failed, skipped = suite.findall("testcase")
    assert passed.find("failure") is None
    failure, skip = failed.find("failure"), skipped.find("skipped")
    assert failure is not None
    assert failure.get("message", "").startswith("0 of 20 points: the robot drove on")
    assert skip is not None


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append(tag)


def test_the_page_needs_nothing_else_and_draws_each_fault_that_was_tested() -> None:
    text = page(GRADE)
    tags = _Tags()
    tags.feed(text)
    assert tags.found.count("svg") == 2
    assert tags.found.count("h2") == 3
    assert not re.search(r"<script|src=|href=|url\(", text)
    assert "python &lt;teleop&gt;.py &amp; more" in text


@pytest.mark.parametrize("curve", [((0.0, 0.0),), ((-1.0, -0.4), (4.0, -0.4)), ((-1.0, 1.0), (9.0, 0.0))])
def test_any_curve_is_drawn_within_the_picture(curve: tuple[tuple[float, float], ...]) -> None:
    svg = ET.fromstring(drawing(curve))
    _, _, width_px, height_px = map(float, svg.get("viewBox", "").split())
    line = next(path.get("d", "") for path in svg.iter("path") if path.get("class") == "true")
    for x_px, y_px in re.findall(r"([-\d.]+) ([-\d.]+)", line):
        assert 0 <= float(x_px) <= width_px
        assert 0 <= float(y_px) <= height_px
