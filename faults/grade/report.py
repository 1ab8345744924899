"""The grade as a table for the terminal, one HTML page without external resources, JUnit XML and JSON. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from html import escape
from xml.etree import ElementTree as ET

from pydantic import TypeAdapter
from rich.table import Column, Table

from faults.grade.marks import TITLES, Grade, Mark

WIDTH_PX, HEIGHT_PX, LEFT_PX, TOP_PX, BOTTOM_PX = 560, 120, 44, 10, 24
STYLE = """
:root{color-scheme:light dark;--ink:#20262e;--paper:#fff;--soft:#66707c;--rule:#d9dee4;--line:#3a6ea5;--red:#c8443c}
@media(prefers-color-scheme:dark){:root{--ink:#e4e8ec;--paper:#15191e;--soft:#98a3af;--rule:#343c45;--line:#7eb0e3;--red:#ff7a70}}
body{background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif;max-width:50rem;margin:2rem auto;padding:0 1rem}
section{border-top:1px solid var(--rule);break-inside:avoid}h2{font-size:1.1rem;margin:.8rem 0 0}p{margin:.2rem 0}
code{overflow-wrap:anywhere}svg{max-width:100%;height:auto;font:11px system-ui,sans-serif}
text{fill:var(--soft)}.grid{stroke:var(--rule);fill:none}.fault{stroke:var(--red);stroke-width:2}
.speed{stroke:var(--line);stroke-width:2;fill:none}
"""


def table(grade: Grade) -> Table:
    """Return the marks as a table for the terminal."""
    found = Table(
        "fault", Column("points", justify="right"), "why", title=grade.sentence, title_justify="left"
    )
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
    return "".join(_page(grade))


def _page(grade: Grade) -> Iterator[str]:
    yield '<!doctype html><html lang="en"><meta charset="utf-8">'
    yield f'<meta name="viewport" content="width=device-width"><title>Grade</title><style>{STYLE}</style>'
    yield f"<h1>{grade.points:g} of {grade.of} points</h1><p>{escape(grade.sentence)}.</p>"
    yield f"<p>The program <code>{escape(grade.program)}</code> drove {escape(grade.robot)}. The red line is the fault.</p>"
    for one in grade.marks:
        yield f"<section><h2>{escape(TITLES[one.fault])}: {points(one)}</h2><p>{escape(one.sentence)}</p>"
        if one.observed is not None:
            yield drawing(one.observed.curve)
        yield "</section>"
    yield "</html>\n"


def drawing(curve: Sequence[tuple[float, float]]) -> str:
    """Draw the forward speed over the time from the fault as SVG."""
    begin_s, end_s = min(curve[0][0], -0.1), max(curve[-1][0], 0.1)
    speeds = [speed for _, speed in curve]
    low, high = min(0.0, *speeds), max(0.2, *speeds)

    def x_px(time_s: float) -> float:
        return LEFT_PX + WIDTH_PX * (time_s - begin_s) / (end_s - begin_s)

    def y_px(speed_m_s: float) -> float:
        return TOP_PX + HEIGHT_PX * (high - speed_m_s) / (high - low)

    def parts() -> Iterator[str]:
        size = f"{LEFT_PX + WIDTH_PX + 30} {TOP_PX + HEIGHT_PX + BOTTOM_PX}"
        yield f'<svg role="img" viewBox="0 0 {size}" aria-label="Forward speed over time">'
        for speed_m_s in dict.fromkeys((0.0, high)):
            yield f'<path class="grid" d="M{LEFT_PX} {y_px(speed_m_s):.1f}h{WIDTH_PX}"/>'
            yield f'<text x="0" y="{y_px(speed_m_s) + 4:.1f}">{speed_m_s:.2f}</text>'
        for second in range(int(begin_s), int(end_s) + 1):
            yield f'<text x="{x_px(second):.1f}" y="{TOP_PX + HEIGHT_PX + 16}">{second} s</text>'
        yield f'<path class="fault" d="M{x_px(0.0):.1f} {TOP_PX}v{HEIGHT_PX}"/>'
        line = "L".join(f"{x_px(time_s):.1f} {y_px(speed):.1f}" for time_s, speed in curve)
        yield f'<path class="speed" d="M{line}"/><text x="0" y="{TOP_PX + HEIGHT_PX / 2:.0f}">m/s</text></svg>'

    return "".join(parts())
