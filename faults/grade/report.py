"""The grade as a table for the terminal, one HTML page without external resources, JUnit XML and JSON. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from html import escape
from xml.etree import ElementTree as ET

from pydantic import TypeAdapter

from deploy.stack.page import document
from deploy.stack.table import Column, Table
from faults.grade.marks import TITLES, Grade, Mark
from faults.report.drawing import BOTTOM_PX, LEFT_PX, WIDTH_PX, Frame, axes, moment, opened, true_line

TICKS_PX = 30
"""Room for the labels of the times."""


def table(grade: Grade) -> Table:
    """Return the marks as a table for the terminal."""
    found = Table("fault", Column("points", right=True), "why", title=grade.sentence)
    for one in grade.marks:
        found.add_row(TITLES[one.fault], points(one), one.sentence)
    return found


def points(one: Mark) -> str:
    """Return the points of a mark for people; a fault that was not tested has none."""
    return "–" if one.observed is None else f"{one.points:g} of {one.of}"


def as_json(grade: Grade) -> dict[str, object]:
    """Return the grade as a JSON document, which `from_json` reads."""
    return {
        "points": grade.points,
        "of": grade.of,
        "percent": round(grade.percent, 1),
        "passed": grade.passed,
        **asdict(grade),
    }


def from_json(text: str | bytes) -> Grade:
    """Return the grade of a JSON document.

    Raises:
        ValueError: it is not one of `as_json`.
    """
    return TypeAdapter(Grade).validate_json(text)


def junit(grade: Grade) -> str:
    """Return the grade as JUnit XML: a test case for each fault, which fails unless it has full points."""
    tested = [one for one in grade.marks if one.observed is not None]
    failed = [one for one in tested if one.points < one.of]
    suite = ET.Element(
        "testsuite",
        name="lifeline grade",
        tests=str(len(grade.marks)),
        failures=str(len(failed)),
        skipped=str(len(grade.marks) - len(tested)),
    )
    properties = ET.SubElement(suite, "properties")
    for name, value in (("points", grade.points), ("of", grade.of), ("passed", grade.passed)):
        ET.SubElement(properties, "property", name=name, value=str(value))
    for one in grade.marks:
        case = ET.SubElement(suite, "testcase", classname="lifeline.grade", name=one.fault)
        if one.observed is None:
            ET.SubElement(case, "skipped", message=one.sentence)
        elif one.points < one.of:
            ET.SubElement(case, "failure", message=f"{points(one)} points: {one.sentence}")
        else:
            ET.SubElement(case, "system-out").text = one.sentence
    ET.indent(suite)
    return ET.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"


def page(grade: Grade) -> str:
    """Return the HTML page: the total, and for each fault the points, the sentence and the speed over time."""
    return document(f"{grade.points:g} of {grade.of} points", _parts(grade))


def _parts(grade: Grade) -> Iterator[str]:
    yield f"<p>{escape(grade.sentence)}.</p>"
    yield f"<p>The program <code>{escape(grade.program)}</code> drove {escape(grade.robot)}. The red line is the fault.</p>"
    for one in grade.marks:
        yield f"<h2>{escape(TITLES[one.fault])}: {points(one)}</h2><p>{escape(one.sentence)}</p>"
        if one.observed is not None:
            yield f"<figure>{drawing(one.observed.curve)}<figcaption>Forward speed in m/s</figcaption></figure>"


def drawing(curve: Sequence[tuple[float, float]]) -> str:
    """Draw the forward speed over the time from the fault as SVG."""
    begin_s, end_s = min(curve[0][0], -0.1), max(curve[-1][0], 0.1)
    speeds_m_s = [speed for _, speed in curve]
    frame = Frame(begin_s, end_s, min(0.0, *speeds_m_s), max(0.2, *speeds_m_s))
    seconds = {f"{second} s": float(second) for second in range(int(begin_s), int(end_s) + 1)}
    parts = [
        opened(LEFT_PX + WIDTH_PX + TICKS_PX, BOTTOM_PX + TICKS_PX, "Forward speed over time"),
        *axes(frame, seconds, BOTTOM_PX + TICKS_PX / 2),
        *moment(frame, 0.0, "fault"),
        true_line(frame, curve),
        "</svg>",
    ]
    return "".join(parts)
