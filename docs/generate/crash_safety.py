"""Write the measured parts of docs/crash-safety.md.

The parts between `<!-- NAME: generated -->` and `<!-- /NAME -->` are

    caption   what the picture of the stop times shows
    answer    the time in which a robot stops when its teleop is killed
    real      the table of the campaign with real processes: docs/campaign/real.jsonl
    virtual   the table of the campaign on a virtual clock: docs/campaign/virtual.jsonl.gz
    ros2      keyboard nodes of ROS 2, with and without Lifeline: docs/campaign/ros2_crash.jsonl
    soak      the resources after an hour of driving: docs/campaign/soak.jsonl.gz
"""

from collections.abc import Iterator, Sequence
from functools import cache

from bench.rig.stored import FOLDER, read_appended
from bench.soak import Sample, judge, warm_up_s
from deploy.stack.errors import DeployError
from docs.generate import sections
from docs.generate.ros2_crash import markdown, read_origins
from docs.generate.ros2_crash import read as read_ros2
from faults.classes import BY_NAME
from faults.promises import PROMISES
from faults.report.figures import Campaign, ClassFigures, Spread
from faults.report.page import percent, read_campaigns, verdict
from faults.report.statistics import upper_rate
from faults.trial import Provenance

RESULTS = {"real": FOLDER / "real.jsonl", "virtual": FOLDER / "virtual.jsonl.gz"}
ROS2, SOAK = FOLDER / "ros2_crash.jsonl", FOLDER / "soak.jsonl.gz"
PLACES = {"real": "of real processes (blue)", "virtual": "on a virtual clock (grey)"}


@cache
def result(mode: str) -> Campaign:
    """Return the committed campaign of a mode.

    Raises:
        DeployError: its file cannot be read, is damaged, or has another mode.
    """
    found, _ = read_campaigns([RESULTS[mode]])
    for one in found:
        if one.mode == mode:
            return one
    raise DeployError(f"{RESULTS[mode]} contains no {mode} trials")


# --- the answer


def answer(campaign: Campaign) -> str:
    """Return the results for a killed teleop.

    Raises:
        ValueError: the campaign has no measured trial of `teleop_sigkill`.
    """
    found = campaign.find("teleop_sigkill")
    if found is None or not (found.stop and found.wheels and found.standstill and found.distance):
        raise ValueError("docs/campaign/real.jsonl contains no measured trial of teleop_sigkill")
    reasons = ", ".join(f"`{name}` {count} times" for name, count in found.detectors)
    which = "longest" if found.stop.limit is None else "upper 95 % limit of the 95 % quantile"
    lines = [
        f"**Promised**: {PROMISES[2]}.",
        "",
        f"**Measured** with SIGKILL of a real teleop while the robot drove, median and {which} (n = {found.stop.number:,}):",
        "",
        f"* zero on `cmd_vel` after {_pair(found.stop, 1000, '.1f', 'ms')}. Detected by {reasons}.",
        f"* zero wheel command after {_pair(found.wheels, 1000, '.1f', 'ms')}.",
        f"* standstill after {_pair(found.standstill, 1, '.2f', 's')}, and after {_pair(found.distance, 100, '.0f', 'cm')}.",
        (
            f"* broken promises: {f'{found.broken} of them' if found.broken else 'none'} "
            f"(failure rate ≤ {percent(upper_rate(found.trials, found.broken))}, 95 % upper bound)."
        ),
        "",
        *_origin(campaign),
    ]
    return "\n".join(lines).rstrip()


def _pair(found: Spread, factor: float, digits: str, unit: str) -> str:
    """Return the median and the limit; without a limit, the longest."""
    upper = found.worst if found.limit is None else found.limit
    return f"{factor * found.median:{digits}} and {factor * upper:{digits}} {unit}"


# --- the tables


def table(campaign: Campaign) -> str:
    """Return the table of a campaign's classes, and its broken promises."""
    lines = [
        *_origin(campaign),
        verdict(campaign),
        "",
        "| fault | what is done | n | detected by | bound | p50 | limit | longest | late | distance | nearest | broken |",
        "|---|---|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|",
        *(_row(one) for one in campaign.classes()),
    ]
    if campaign.broken:
        lines += ["", "Broken promises:", ""]
        lines += [
            f"* promise {one.promise.promise}, {_safe(', '.join(one.classes))}: {_safe(one.promise.sentence)} (`{one.command}`)"
            for one in campaign.broken[:20]
        ]
    return "\n".join(lines)


def caption(campaigns: Sequence[Campaign]) -> str:
    """Return what the picture of the stop times shows: the numbers of stops and trials, and the load."""
    shown = (
        f"{sum(len(one.timed) for one in campaign.classes() if one.bound_s is not None)} stops {PLACES[campaign.mode]} "
        f"from {campaign.trials:,} trials, {sections.load_of(one.machine for one in campaign.provenances)}"
        for campaign in campaigns
    )
    return f"*{'; '.join(shown)}. Red: the bound. A shorter time is drawn at 0.1 ms.*"


def _row(one: ClassFigures) -> str:
    known, stop, distance = BY_NAME.get(one.name), one.stop, one.distance
    target = f" ({known.target})" if known is not None and known.target else ""
    cells = (
        f"`{one.name}`",
        "" if known is None else f"{known.does}{target}",
        f"{len(one.cases):,}",
        _detectors(one),
        one.bound_ms,
        "" if stop is None else f"{1000 * stop.median:.1f}",
        "" if stop is None or stop.limit is None else f"{1000 * stop.limit:.1f}",
        "" if stop is None else f"{1000 * stop.worst:.1f}",
        "" if stop is None or one.bound_s is None else f"{one.late} of {stop.number}",
        "" if distance is None else f"{100 * distance.worst:.0f}",
        f"{100 * one.clearance_m:.1f}",
        f"**{one.broken}**" if one.broken else "0",
    )
    return f"| {' | '.join(cells)} |"


def _detectors(one: ClassFigures) -> str:
    meant = ", ".join(f"`{name}` {count:,}" for name, count in one.detectors)
    others = sum(count for _, count, _ in one.others)
    return meant + (f"{'; ' if meant else ''}other detectors {others:,}" if others else "")


def _safe(text: str) -> str:
    return " ".join(text.split()).replace("|", "/").replace("<", "‹").replace(">", "›")[:300]


def _origin(campaign: Campaign) -> Iterator[str]:
    """Yield the provenance, or a sentence that it is missing."""
    for provenance in campaign.provenances:
        yield from _signature(provenance)
    if campaign.unsigned or not campaign.provenances:
        yield "The file does not record the command, date, machine and commit of these trials."
        yield ""


def _signature(provenance: Provenance) -> Iterator[str]:
    yield f"`{provenance.command or 'unknown command'}`,"
    yield f"{provenance.date or 'unknown date'}, {provenance.machine or 'unknown machine'},"
    yield f"commit {provenance.commit or 'unknown'}."
    yield ""


# --- the soak


def soaked(samples: Sequence[Sample], origins: Sequence[Provenance]) -> str:
    """Return the resources of each process after driving, and the stops without a cause."""
    last, (found, faults) = samples[-1], judge(samples)
    growths = {(growth.process, growth.measure): growth for growth in found}
    false = sum(len(sample.false_stops) for sample in samples)
    gaps_ms = sorted(sample.ticks.p99_ms for sample in samples)
    lines = [
        *_signature(origins[-1]),
        (
            f"{last.time_s / 60:.0f} minutes, {last.driven_m:.0f} m, {last.obstacle_stops} stops at obstacles, {last.black_boxes} black boxes; "
            f"**{false or 'no'} {'stops' if false > 1 else 'stop'} without a cause**, {sum(sum(s.lost.values()) for s in samples)} samples lost. "
            f"Gaps of `cmd_vel`, p99 of ten seconds: {gaps_ms[len(gaps_ms) // 2]:.1f} ms (median), {gaps_ms[-1]:.1f} ms (worst)."
        ),
        "",
        f"| process | memory (RSS) | growth after {warm_up_s(last.time_s) / 60:.0f} min | descriptors | threads |",
        "|---|--:|--:|--:|--:|",
    ]
    for name in last.processes:
        memory = growths[name, "memory"]
        lines.append(
            f"| {name} | {memory.level / 1e6:.1f} MB | {memory.percent:+.2f} % | "
            f"{growths[name, 'descriptors'].level:g} | {growths[name, 'threads'].level:g} |"
        )
    lines += ["", *(f"* FAILED: {_safe(fault)}" for fault in faults)]
    return "\n".join(lines).rstrip()


# --- the document


def ros2_table() -> str:
    """Return the table of the keyboard nodes, with where and when it was measured."""
    origins = read_origins(ROS2)
    first, last = origins[0], origins[-1]
    return (
        f"{markdown(read_ros2(ROS2))}\n"
        f"docs/campaign/ros2_crash.jsonl, {first.date} to {last.date}, {first.machine}, "
        f"commits {first.commit} to {last.commit}, by the program that `lifeline grade --ros2` replaces."
    )


PARTS: sections.Parts = {
    "caption": lambda: caption([result(mode) for mode in RESULTS]),
    "answer": lambda: answer(result("real")),
    "real": lambda: table(result("real")),
    "virtual": lambda: table(result("virtual")),
    "ros2": ros2_table,
    "soak": lambda: soaked(*read_appended(SOAK, Sample)),
}
