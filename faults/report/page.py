"""The report of a campaign as one HTML page without scripts or external resources, for screen and paper."""

import math
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError
from deploy.stack.page import document
from faults.promises import PROMISES
from faults.report.drawing import strips, timeline
from faults.report.figures import Campaign, Case, ClassFigures, Spread, campaigns, command
from faults.report.statistics import upper_rate
from faults.trial_file import read_records

BROKEN_SHOWN = 200
MODES = {"real": "Real processes", "virtual": "Virtual time"}
ABOUT = {
    "real": "The real programs over real Zenoh, killed, stopped and cut off while the robot drives by keys. What is "
    "timed includes the machine's own scheduling.",
    "virtual": "The same services with MuJoCo on a virtual clock and a virtual network: what is timed is the protocol "
    "and the law, without the machine. Equal seeds make equal trials.",
}


def read_campaigns(files: Sequence[Path]) -> tuple[list[Campaign], int]:
    """Return the campaigns in the files, and the number of trials of older revisions, which are left out.

    Raises:
        DeployError: a file cannot be read or is damaged, or no file contains a trial.
    """
    found, left_out = campaigns(record for file in files for record in read_records(file))
    if not found:
        names = ", ".join(str(file) for file in files)
        raise DeployError(f"there is no trial in {names}: `lifeline faults --out FILE.jsonl` makes some")
    return found, left_out


class Written(NamedTuple):
    """The page that was written, and the trials on it."""

    page: str
    trials: int
    broken_trials: int
    trials_of_older_revisions: int

    @property
    def sentence(self) -> str:
        verdict = (
            f"{self.broken_trials:,} broke a promise" if self.broken_trials else "every promise was kept"
        )
        return f"{self.page}: {self.trials:,} trials, {verdict}"


def write_report(files: Sequence[Path], out: Path) -> Written:
    """Write the page.

    Raises:
        DeployError: a file cannot be read or is damaged, there is no trial, or the page cannot be written.
    """
    found, left_out = read_campaigns(files)
    text = _page([file.name for file in files], found, left_out)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise DeployError(f"cannot write {out}: {error.strerror}") from error
    trials, broken = sum(one.trials for one in found), sum(one.broken_trials for one in found)
    return Written(str(out), trials, broken, left_out)


def _page(sources: Sequence[str], found: Sequence[Campaign], left_out: int) -> str:
    """Return the page.

    Args:
        sources: names of the files.
        found: the campaigns in them.
        left_out: number of trials of older revisions, which are not in the figures.
    """
    parts = [
        *_head(sources, found, left_out),
        *(part for one in found for part in _campaign(one)),
        *_how_to_read(),
    ]
    return document("Lifeline: what each fault leads to", parts)


def verdict(one: Campaign) -> str:
    """Return one sentence: number of trials, broken promises, and failure rate."""
    hours = one.duration_s / 3600
    lasted = f"{hours:.1f} h" if hours >= 1 else f"{one.duration_s / 60:.1f} min"
    found = f"{one.broken_trials:,}" if one.broken_trials else "none"
    return (
        f"{one.trials:,} trials, {lasted} in total; {found} broke a promise: failure rate ≤ {percent(one.rate)} "
        "(95 % upper bound)."
    )


def percent(rate: float) -> str:
    """Format a rate in percent with two significant digits."""
    if rate <= 0.0:
        return "0 %"
    digits = max(0, 1 - math.floor(math.log10(100 * rate)))
    return f"{100 * rate:.{digits}f} %"


def _head(sources: Sequence[str], found: Sequence[Campaign], left_out: int) -> Iterator[str]:
    yield "<dl><dt>file</dt><dd>" + escape(", ".join(sources)) + "</dd></dl>"
    for one in found:
        word = "bad" if one.broken_trials else "good"
        yield f'<p><b>{MODES[one.mode]}.</b> <span class="{word}">{verdict(one)}</span></p>'
    if left_out:
        yield f"<p>{left_out:,} trials of older revisions are in the file and not included here.</p>"


def _campaign(one: Campaign) -> Iterator[str]:
    classes = one.classes()
    yield f"<h2>{MODES[one.mode]}</h2><p>{ABOUT[one.mode]}</p>"
    yield from _origin(one)
    yield from _table(classes, one.mode)
    if picture := strips(classes):
        yield (
            "<h3>How long a stop took</h3><figure>"
            f'<div class="wide">{picture}</div><figcaption>Time from the fault to zero, on a logarithmic axis. Each histogram is '
            "scaled to its highest bin. The red line is the bound of the class.</figcaption></figure>"
        )
    yield from _broken(one)
    yield from _single(classes, one.mode)


def _origin(one: Campaign) -> Iterator[str]:
    yield "<dl>"
    for provenance in one.provenances:
        for name, value in provenance.model_dump(exclude={"origin"}).items():
            yield f"<dt>{name}</dt><dd>{escape(value) or 'unknown'}</dd>"
    if one.unsigned or not one.provenances:
        which = "some" if one.provenances else "these"
        yield f"<dt>missing</dt><dd>the file does not record the command, date, machine and commit of {which} trials</dd>"
    yield f"<dt>revision</dt><dd>{escape(one.revision) or 'unknown'}</dd></dl>"


def _table(classes: Sequence[ClassFigures], mode: str) -> Iterator[str]:
    wheels = '<th colspan="2">at the wheels<br>p50, max [ms]</th>' if mode == "real" else ""
    yield (
        '<div class="wide"><table><thead><tr><th class="l">fault</th><th>n</th><th class="l">detected by</th>'
        '<th>bound<br>[ms]</th><th colspan="3">to zero<br>p50, limit, max [ms]</th><th>beyond<br>bound</th>'
        f'{wheels}<th colspan="2">to standstill<br>p50, max [ms]</th><th colspan="2">distance<br>p50, max [cm]</th>'
        "<th>smallest<br>clearance [cm]</th><th>contacts</th><th>trials that<br>broke a promise</th><th>at most,<br>95 %</th>"
        "</tr></thead><tbody>"
    )
    for one in classes:
        yield from _row(one, mode)
    yield "</tbody></table></div>"


def _row(one: ClassFigures, mode: str) -> Iterator[str]:
    stop = one.stop
    broken = f'<span class="bad">{one.broken}</span>' if one.broken else "0"
    does = "" if one.known is None else f' title="{escape(f"{one.known.group}: {one.known.does}")}"'
    yield f'<tr><td class="l"{does}>{escape(one.name)}</td><td>{len(one.cases):,}</td>'
    yield f'<td class="l w">{_detectors(one)}</td>'
    yield _cell(one.bound_ms)
    yield _cell(number(stop, "median", 1000))
    yield _cell(number(stop, "limit", 1000))
    yield _cell(number(stop, "worst", 1000))
    yield _cell("" if one.bound_s is None or stop is None else f"{one.late:,} of {stop.number:,}")
    if mode == "real":
        yield _pair(one.wheels, 1000)
    yield _pair(one.standstill, 1000) + _pair(one.distance, 100)
    yield _cell(f"{100 * one.clearance_m:.1f}") + _cell(str(one.contacts)) + _cell(broken)
    yield _cell(percent(upper_rate(one.trials, one.broken))) + "</tr>"


def _detectors(one: ClassFigures) -> str:
    meant = ", ".join(f"{escape(name)} {count:,}" for name, count in one.detectors)
    others = ", ".join(
        f"{escape(name)} {count:,}" + ("" if longest_s is None else f" (max {1000 * longest_s:.0f} ms)")
        for name, count, longest_s in one.others
    )
    return meant + (f'{" " if meant else ""}<span class="soft">or first by {others}</span>' if others else "")


def _pair(found: Spread | None, factor: float) -> str:
    return _cell(number(found, "median", factor)) + _cell(number(found, "worst", factor))


def _cell(text: str) -> str:
    return f"<td>{text}</td>"


def number(found: Spread | None, which: str, factor: float) -> str:
    """Format `median`, `limit` or `worst`, multiplied by a factor; empty if nothing was measured."""
    value = getattr(found, which, None)
    return "" if value is None else f"{factor * float(value):,.1f}"


def _broken(one: Campaign) -> Iterator[str]:
    yield f"<h3>Broken promises: {len(one.broken):,}</h3>"
    if not one.broken:
        return
    yield (
        '<div class="wide"><table><thead><tr><th class="l">fault</th><th class="l">promise</th><th>at [s]</th>'
        '<th class="l">what happened</th><th class="l">see it again</th></tr></thead><tbody>'
    )
    for found in one.broken[:BROKEN_SHOWN]:
        promise = found.promise.promise
        yield (
            f'<tr><td class="l">{escape(", ".join(found.classes))}</td><td class="l w">{promise}: {PROMISES[promise]}</td>'
            f'<td>{found.promise.time_s:.3f}</td><td class="l w">{escape(found.promise.sentence[:400])}</td>'
            f'<td class="l"><code>{escape(found.command)}</code></td></tr>'
        )
    yield "</tbody></table></div>"
    if len(one.broken) > BROKEN_SHOWN:
        yield f"<p>{len(one.broken) - BROKEN_SHOWN:,} more are in the file.</p>"


def _single(classes: Sequence[ClassFigures], mode: str) -> Iterator[str]:
    yield "<h3>Single trials</h3><p>The typical one is the median by time to zero."
    yield (
        ' <span class="key" style="color:var(--soft)"></span>requested<span class="key" style="color:var(--blue)"></span>'
        'permitted<span class="key" style="color:var(--amber)"></span>true speed [m/s]; below, the stop reasons.</p>'
    )
    for one in classes:
        if not (timed := one.timed):
            continue
        cases = {"typical": timed[(len(timed) - 1) // 2], "worst": timed[-1]}
        pictures = dict(picture for case in reversed(cases.values()) for picture in _picture(one, case))
        lines = [
            f"{word}: zero after {1000 * (case.stop_s or 0.0):.1f} ms, "
            f"<code>{escape(command(mode, one.name, case.seed))}</code>"
            for word, case in cases.items()
        ]
        yield f"<h4>{escape(one.name)}</h4><p>{'<br>'.join(lines)}</p>{''.join(pictures.values())}"
        if not pictures:
            yield '<p class="soft">No trial of this class has a recorded timeline.</p>'


def _picture(one: ClassFigures, case: Case) -> Iterator[tuple[int, str]]:
    """Draw this case's trial, or the one with a timeline whose stop time is nearest."""
    near = one.timeline_near(case.stop_s or 0.0)
    if near is None or near.recorded is None or not (picture := timeline(near.recorded, near.fault)):
        return
    which = "" if near.seed == case.seed else ": the recorded timeline with the nearest stop time"
    yield near.seed, f"<figure>{picture}<figcaption>seed {near.seed}{which}</figcaption></figure>"


def _how_to_read() -> Iterator[str]:
    yield (
        "<h2>How to read this</h2><ul>"
        "<li><b>n</b>: number of injections. A short fault needs no stop, and a robot at rest has none. "
        "Two faults within 2 s of each other count as a pair.</li>"
        "<li><b>to zero</b>: time from the fault to the first zero on cmd_vel of a lasting stop; for faults of the "
        "supervisor, until the base brakes by itself. Only stops by the expected detectors of the class count; the others "
        "are listed as <i>or first by</i>.</li>"
        "<li><b>beyond bound</b>: number of stops that took longer than the bound, without tolerance. A promise counts as "
        "broken only beyond a tolerance: 5 ms on the virtual clock; on a real machine, whose scheduler gives no timing "
        "guarantee, at least 50 ms. Each record contains its tolerance.</li>"
        "<li><b>limit</b>: upper 95 % limit of the 95 % quantile, from 59 stops on; below that, use the maximum. "
        "A bound such as 10 / 25 applies to the median and to the limit.</li>"
        "<li><b>distance</b>: distance driven from the fault to standstill; the speeds differ between trials.</li>"
        "<li><b>smallest clearance, contacts</b>: over all trials with this fault, whether the robot or the object moved. "
        "People and forklifts may run into a robot at rest; only contact by the robot's own motion breaks a promise.</li>"
        "<li><b>at most</b>: upper bound of the failure rate (Clopper-Pearson, one-sided, 95 %); without a broken promise "
        "1 − 0.05<sup>1/n</sup>, about 3/n. It applies to trials of the same distribution, not to every situation.</li></ul>"
    )
