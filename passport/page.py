"""The passport as one HTML page without external resources, for screen and paper, with the record inside. Pure."""

from collections.abc import Iterator, Sequence
from html import escape

from deploy.stack.page import document
from passport.drawing import speed_over_time, stops_over_speed
from passport.record import Cell, Instrument, Passport, Run, way_in_words
from passport.statement import digest
from passport.statistics import Limit, rounded_up
from passport.summary import Row, failures, not_shown, rows, sentence

BEGIN, END = '<script type="application/json" id="passport">', "</script>"
"""Around the record, or its signed envelope, in the page."""
STYLE = """<style>.first{font-size:1.5rem;line-height:1.35;max-width:44rem}.pair{display:flex;flex-wrap:wrap;gap:1rem}
th,td{padding:.2rem .4rem}.g{border-left:1px solid var(--rule)}th.g[colspan]{text-align:left}
.run{fill:var(--blue)}.without{fill:none;stroke:var(--amber)}.curve{stroke:var(--soft);fill:none;stroke-dasharray:4 3}.odom{stroke:var(--amber);fill:none;stroke-width:2}
.runs{display:grid;grid-template-columns:repeat(auto-fill,minmax(15rem,1fr));gap:.5rem}.runs figure{margin:0}
@media print{body{font-size:10pt}h1{font-size:1.5rem}.first{font-size:1.3rem}h2.new{break-before:page}h3{break-after:avoid}.pair{flex-wrap:nowrap;gap:0}.pair svg{width:50%}}</style>"""


def page(passport: Passport, inside: str, signer: str | None) -> str:
    """Return the page.

    Args:
        passport: the record.
        inside: the JSON text that the page carries: the signed envelope, or the record.
        signer: who signed; None: nobody.
    """
    found = rows(passport)
    parts = [
        STYLE,
        f'<p class="first {"bad" if failures(passport) else ""}">{escape(sentence(passport)).replace(" %", "&nbsp;%")}</p>',
        '<p class="soft">Measured, not certified. What the sentence does not cover is listed below.</p>',
        *_table(found),
        *_curves(found),
        *_conditions(passport, signer),
        *_list("Not shown by this measurement", list(not_shown(passport))),
        *_list("Deviations", passport.deviations),
        *_runs(passport.cells),
        *_how_to_read(has_turn=any(row.cell.turn for row in found)),
        BEGIN + inside.strip().replace("<", "\\u003c") + END,
    ]
    return document(f"Stop-time passport of {escape(passport.robot)}", parts)


def inside_of(text: str) -> str | None:
    """Return the JSON text that a page carries; None if it carries none."""
    before, begin, rest = text.partition(BEGIN)
    inside, end, _ = rest.partition(END)
    return inside if begin and end and before.startswith("<!doctype html>") else None


COLUMNS = '<th class="g">n</th><th>reaction<br>[s]</th><th>to stand-<br>still [s]</th><th>distance<br>[m]</th><th>least decel-<br>eration [m/s²]</th>'
WIDTH = 5
"""Number of these columns."""


def _table(found: Sequence[Row]) -> Iterator[str]:
    """Yield one row for each fault, speed and load, with Lifeline and, where it was measured, without it beside."""
    groups = [each for each in (True, False) if any(row.cell.with_lifeline == each for row in found)]
    alike: dict[tuple[str, float, int], dict[bool, Row]] = {}
    for row in found:
        cell = row.cell
        alike.setdefault((cell.fault, cell.speed_m_s, cell.load_percent), {})[cell.with_lifeline] = row
    heads = [
        f'<th class="g" colspan="{WIDTH}">{"with" if each else "without"} Lifeline</th>' for each in groups
    ]
    yield (
        f'<div class="wide"><table><thead><tr><th colspan="3"></th>{"".join(heads)}</tr>'
        f'<tr><th class="l">fault</th><th>speed<br>[m/s]</th><th>load<br>[%]</th>{COLUMNS * len(groups)}</tr></thead><tbody>'
    )
    for pair in alike.values():
        cell = next(iter(pair.values())).cell
        speed = cell.speed if cell.turn else f"{cell.speed_m_s:g}"
        yield f'<tr><td class="l">{escape(cell.fault)}</td><td>{speed}</td><td>{cell.load_percent}</td>'
        yield from (_quantities(pair.get(each)) for each in groups)
        yield "</tr>"
    yield (
        "</tbody></table></div>"
        '<p class="soft">Limits include the uncertainty of the instrument and are rounded up. A bold limit covers 95 % of all stops, with 95 % confidence for '
        "all cells of the sentence together, each quantity by itself; any other is the largest of the n runs, and says nothing about further "
        "ones. – : not every run shows it, such as after a fault that takes the recorder with it.</p>"
    )
    slips = [
        f"{row.slips} of {row.runs} runs of {row.cell.name} at {row.cell.speed}" for row in found if row.slips
    ]
    if slips:
        yield f'<p class="bad">The wheels slipped in {escape(", ".join(slips))}.</p>'


def _quantities(row: Row | None) -> str:
    """Return the columns of one row."""
    if row is None or not row.runs:
        return f'<td class="l g soft" colspan="{WIDTH}">{"" if row is None else "not measured"}</td>'
    if row.not_stopped:
        return (
            f'<td class="l g bad" colspan="{WIDTH}">did not stop in {row.not_stopped} of {row.runs} runs</td>'
        )
    unit, unit_of_least = (" rad", " rad/s²") if row.cell.turn else ("", "")
    least = "–" if row.least_m_s2 is None else f"{row.least_m_s2:.2f}{unit_of_least}"
    return (
        f'<td class="g">{row.runs}</td>{_limit(row.reaction_s)}{_limit(row.stopping_s)}{_limit(row.distance_m, unit)}'
        f"<td>{least}</td>"
    )


def _limit(found: Limit | None, unit: str = "") -> str:
    if found is None:
        return "<td>–</td>"
    text = rounded_up(found.value)
    return f"<td><b>{text}</b>{unit}</td>" if found.proven else f"<td>{text}{unit}</td>"


def _curves(found: Sequence[Row]) -> Iterator[str]:
    measured = [row for row in found if row.runs and not row.cell.turn]
    if measured:
        yield '<div class="pair">'
        yield stops_over_speed(measured, "distance [m]", lambda run: run.distance_m)
        yield stops_over_speed(measured, "time to standstill [s]", lambda run: run.t3_s)
        rings = (
            ""
            if all(row.cell.with_lifeline for row in measured)
            else " with Lifeline, each ring one without it"
        )
        yield f'</div><p class="soft">Each point is one run{rings}; runs of plain zeros are joined by the worst of each speed.</p>'


def _conditions(passport: Passport, signer: str | None) -> Iterator[str]:
    conditions, instrument = passport.conditions, passport.instrument
    pairs = {
        "robot": passport.robot,
        "first run": passport.date,
        "top speed": f"{conditions.top_speed_m_s:g} m/s",
        "loads": "; ".join(conditions.loads) or "none",
        "floor": conditions.floor or "not stated",
        "computer": conditions.machine_load,
        "distance by": f"{instrument.wall_fit}; ± {1000 * instrument.uncertainty_m:.0f} mm (95 %)",
        **_turns_by(instrument),
        "times by": f"arrival at the recorder; ± {1000 * instrument.uncertainty_s:.0f} ms",
        "Lifeline": f"{passport.version}, commit {passport.commit or 'unknown'}",
        "configuration": f"SHA-256 {passport.configuration_sha256}",
        "this record": f"SHA-256 {digest(passport)}",
        "signed by": signer or "nobody",
    }
    yield '<h2 class="new">Conditions and instrument</h2><dl>'
    for name, value in pairs.items():
        yield f"<dt>{name}</dt><dd>{escape(value)}</dd>"
    yield "</dl>"


def _turns_by(instrument: Instrument) -> dict[str, str]:
    if instrument.uncertainty_rad is None:
        return {}
    return {"turns by": f"the direction of this line; ± {1000 * instrument.uncertainty_rad:.0f} mrad (95 %)"}


def _list(title: str, sentences: Sequence[str]) -> Iterator[str]:
    if sentences:
        yield f"<h2>{title}</h2><ul>"
        yield from (f"<li>{escape(one)}</li>" for one in sentences)
        yield "</ul>"


def _runs(cells: Sequence[Cell]) -> Iterator[str]:
    yield '<h2 class="new">Each run</h2>'
    yield '<p class="soft">Speed by odometry over the time from the fault, in m/s and s.</p>'
    for cell in cells:
        if not cell.runs:
            continue
        yield f'<h3>{escape(cell.name)}, {cell.speed}, load {cell.load_percent} %</h3><div class="runs">'
        for number, run in enumerate(cell.runs, 1):
            picture = speed_over_time(run, f"Run {number} of {cell.name}")
            yield f"<figure>{picture}<figcaption>{number}: {escape(_run(cell, run))}</figcaption></figure>"
        yield "</div>"


def _run(cell: Cell, run: Run) -> str:
    if not run.stopped:
        return "did not stop"
    distance = way_in_words(run, turn=cell.turn)
    time = "time unknown" if run.t3_s is None else f"{run.t3_s:.2f} s"
    return f"{distance}, {time}" + (", slip" if run.slip else "")


def _how_to_read(*, has_turn: bool) -> Iterator[str]:
    turn = (
        "<li><b>a turn</b>: the robot turns on the spot; its distance is an angle. The curves do not show it.</li>"
        if has_turn
        else ""
    )
    yield (
        "<h2>How to read this</h2><ul>"
        "<li><b>reaction</b>: from the fault until the speed is below 95 % of that before. <b>to standstill</b>: until it remains "
        "below 0.01 m/s for 0.2 s. <b>distance</b>: by the lidar at a flat wall, odometry as the second witness.</li>"
        f"{turn}"
        "<li><b>limits</b>: the r-th largest of n runs, without an assumption about their distribution; the confidence is "
        "P(Bin(n, 0.05) ≥ r), and the doubt is divided by the number of cells in the sentence (Bonferroni).</li>"
        "<li>The layout follows ISO 18646-1, clause 6 (stopping characteristics). ISO 3691-4:2023 excludes remotely controlled trucks, "
        "and this is no assessment by it.</li>"
        "<li>Check a file with <code>lifeline passport verify FILE --keys BUNDLE</code>. It prints the SHA-256 of the record, "
        "which stands above, to compare it with a page on paper.</li></ul>"
    )
