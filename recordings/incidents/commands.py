"""`lifeline incidents`: list the black boxes of a robot, show the seconds around a stop, and export one for other tools."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, groupby
from math import isfinite, nan
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from deploy.stack.console import print_json
from deploy.stack.errors import DeployError
from deploy.stack.formatting import COLOURS, nearest
from deploy.stack.table import Column, Table, facts
from recordings.incidents.incident import IncidentError, black_boxes, id_of, messages
from recordings.incidents.summary import Incident, Sample, read_incident
from recordings.recording import RecordingError, RecordingWriter, exists
from supervisor.law.reckoning import Velocity
from wire.reasons import words_of
from wire.standstill import is_still
from wire.text import printable

EXIT_INCOMPLETE = 1
ROW_S = 0.25
"""Time between two rows of the table; a change of the mode or the reasons begins another row."""
TURN_RAD_S = 0.1
"""The table shows turn rates only if one is at least this fast, because odometry contains noise."""
NOISE_M = 0.02
"""Noise of the nearest distance."""
MAX_ROWS = 200
MAX_WIDTH = 160
PLOT_HEIGHT = 8
PLOT_LABEL = 8
"""Columns of the axis labels and the axis of a plot."""
PLOT_MIN_COLUMNS = 20
MAX_DRAWN = 1e6
UNKNOWN = "–"


# --- list


def show_list(directory: Path, *, as_json: bool) -> int:
    """Print one row for each black box; a file that cannot be read has its own row."""
    paths = black_boxes(directory)
    if as_json:
        print_json([_json_of(path) for path in paths])
        return 0
    if not paths:
        print(f"lifeline: no incidents in {directory}: a black box is written at each stop of a moving robot")
        return 0
    figures = [Column(name, right=True) for name in ("speed", "distance", "nearest")]
    table = Table("ID (UTC)", "reasons", "owner", *figures)
    for path, short in zip(paths, _short_ids(paths), strict=True):
        table.add_row(*_row(path, short))
    Console().print(table)
    return 0


def _json_of(path: Path) -> dict[str, Any]:
    try:
        return read_incident(path).to_json()
    except IncidentError as error:
        return {"id": id_of(path), "file": str(path), "problem": printable(str(error))}


def _short_ids(paths: Sequence[Path]) -> list[str]:
    """Return the time in each name, or the whole name if several files have this time."""
    times = [id_of(path).split("-", maxsplit=1)[0] for path in paths]
    return [
        short if times.count(short) == 1 else id_of(path) for path, short in zip(paths, times, strict=True)
    ]


def _row(path: Path, short: str) -> list[Text | str]:
    try:
        incident = read_incident(path)
    except IncidentError as error:
        return [short, Text(printable(_problem(path, str(error))), "bold red"), *[UNKNOWN] * 4]
    at, velocity, rest = incident.at_stop, incident.velocity, incident.braking
    reasons = Text(printable(", ".join(incident.reasons)))
    if incident.problem:
        reasons.append(printable(f" ({_problem(path, incident.problem)})"), "bold red")
    return [
        short,
        reasons,
        UNKNOWN if at is None or not at.owner else at.owner,
        UNKNOWN if velocity is None else _speed(velocity),
        UNKNOWN if rest is None else f"{rest.distance_m:.2f} m",
        UNKNOWN if at is None else nearest(at.nearest_m, nan),
    ]


def _problem(path: Path, sentence: str) -> str:
    """Return a problem without the path that the row names already."""
    return sentence.replace(f"{path} ", "").replace(f" {path}", "").removeprefix("is ")


def _speed(velocity: Velocity) -> str:
    """Format the speed, or the turn rate of a robot that turns on the spot."""
    if is_still(velocity.linear_m_s, 0.0) and not is_still(0.0, velocity.angular_rad_s):
        return f"{abs(velocity.angular_rad_s):.2f} rad/s"
    return f"{abs(velocity.linear_m_s):.2f} m/s"


# --- show


def show(path: Path, seconds: float, *, as_json: bool) -> int:
    """Print the seconds around a stop: summary, table and plots. Exit 1 if a part of the file cannot be read.

    Raises:
        DeployError: the file cannot be read, or has no step in this time.
    """
    incident = read_incident(path, seconds)
    if as_json:
        samples = [sample.to_json() for sample in incident.samples]
        print_json({**incident.to_json(), "samples": samples})
        return EXIT_INCOMPLETE if incident.problem else 0
    console = Console()
    console.print(_summary(incident))
    if incident.samples:
        console.print()
        console.print(table_of(rows_of(incident.samples, ROW_S)))
        for drawing in _plots(incident, min(console.width, MAX_WIDTH), turns=_is_turn(incident.samples)):
            console.print()
            console.print(drawing)
    return EXIT_INCOMPLETE if incident.problem else 0


def _summary(incident: Incident) -> Table:
    table = facts()
    first, at, velocity, rest = incident.stops[0], incident.at_stop, incident.velocity, incident.braking
    table.add_row("stop", f"{first.utc.replace('T', ' ')} UTC")
    for stop in incident.stops:
        after_s = stop.now_s - first.now_s
        for reason in stop.reasons:
            words = words_of(reason)
            caption = "" if words is None else f": {words.caption}"
            table.add_row("reason", f"{after_s:+.3f} s  {printable(reason)}{caption}")
    if at is not None:
        table.add_row("owner", printable(at.owner) or "none")
        if at.detail:
            table.add_row("detail", printable(at.detail))
        table.add_row("nearest", nearest(at.nearest_m, at.nearest_bearing_rad))
    for act in incident.acts:
        time = act.utc.replace("T", " ").partition(".")[0]
        table.add_row("people", printable(f"{time} UTC  {act.by}: {act.text}"))
    table.add_row("speed", "no odometry" if velocity is None else f"{_speed(velocity)}, by odometry")
    if rest is not None:
        table.add_row("stopping", f"{rest.distance_m:.3f} m in {rest.to_standstill_s:.2f} s, by odometry")
    if incident.left_out:
        table.add_row("left out", f"{incident.left_out:,} older steps, for lack of space")
    if incident.problem:
        table.add_row("problem", Text(printable(incident.problem), "bold red"))
    return table


def _is_turn(samples: Sequence[Sample]) -> bool:
    """Return whether the robot was requested to turn on the spot and nothing else."""
    return all(sample.commanded.linear_m_s == 0.0 for sample in samples) and any(
        sample.commanded.angular_rad_s != 0.0 for sample in samples
    )


def rows_of(samples: Sequence[Sample], period_s: float) -> list[Sample]:
    """Return the first sample of each phase, and of each period within it, unless it repeats the one before.

    The stop at time zero begins a phase.
    """
    rows: list[Sample] = []
    last: Sample | None = None
    for _, phase in groupby(samples, key=lambda sample: (sample.time_s >= 0.0, *_outline(sample))):
        for _, grid in groupby(phase, key=lambda sample: sample.time_s // period_s):
            sample = next(grid)
            if last is None or not _repeats(sample, last):
                rows.append(sample)
            last = sample
    return rows


def _outline(sample: Sample) -> tuple[str, str]:
    return sample.mode, sample.why


def _repeats(sample: Sample, last: Sample) -> bool:
    """Return whether two samples differ only by the noise of a robot at rest."""
    # Without the requested velocity: it does not show whether the robot moves.
    rates = [*sample.velocities[1:], *last.velocities[1:]]
    is_at_rest = all(velocity is None or is_still(*velocity) for velocity in rates)
    return (
        is_at_rest and _outline(sample) == _outline(last) and abs(sample.nearest_m - last.nearest_m) < NOISE_M
    )


def table_of(rows: Sequence[Sample]) -> Table:
    """Return the table of the samples, of at most the first `MAX_ROWS`."""
    velocities = (one for sample in rows for one in sample.velocities if one is not None)
    turns = any(abs(one.angular_rad_s) >= TURN_RAD_S for one in velocities)
    figures = [Column(name, right=True) for name in ("requested", "permitted", "measured", "nearest")]
    table = Table(Column("s", right=True), "mode", *figures, "reasons")
    table.add_row("", "", *["m/s, rad/s" if turns else "m/s"] * 3, "m", "", style="dim")
    for sample in rows[:MAX_ROWS]:
        table.add_row(
            f"{sample.time_s + 0.0:+.3f}",
            Text(printable(sample.mode), COLOURS[sample.mode]),
            *(_twist(velocity, turns=turns) for velocity in sample.velocities),
            _value(sample.nearest_m),
            printable(sample.why),
        )
    if len(rows) > MAX_ROWS:
        table.add_row("…", "", "", "", "", "", f"{len(rows) - MAX_ROWS:,} more rows: see --json")
    return table


def _twist(velocity: Velocity | None, *, turns: bool) -> str:
    if velocity is None:
        return UNKNOWN
    return ", ".join(map(_value, velocity if turns else velocity[:1]))


def _value(value: float) -> str:
    # Adding zero turns −0.0 into 0.0.
    return f"{round(value, 2) + 0.0:.2f}" if isfinite(value) else UNKNOWN


def _plots(incident: Incident, width: int, *, turns: bool) -> Iterator[Text]:
    samples = incident.samples
    times_s = [sample.time_s for sample in samples]

    looks = (("requested", "·", "cyan"), ("permitted", "─", "yellow"), ("measured", "●", "bold green"))
    velocities = zip(*(sample.velocities for sample in samples), strict=True)
    speeds = [
        Series(*look, [nan if one is None else one[turns] for one in values])
        for look, values in zip(looks, velocities, strict=True)
    ]
    title = "turn rate, rad/s" if turns else "speed, m/s"
    yield plot(title, times_s, speeds, width=width, height=PLOT_HEIGHT)
    distances = (
        Series(
            f"stop distance {incident.stop_distance_m:.2f}",
            "─",
            "red",
            [incident.stop_distance_m] * len(samples),
        ),
        Series("nearest", "●", "bold magenta", [sample.nearest_m for sample in samples]),
    )
    yield plot("distance, m", times_s, distances, width=width, height=PLOT_HEIGHT)


@dataclass(frozen=True, slots=True)
class Series:
    """One value for each time of a plot; a value that is not finite or beyond `MAX_DRAWN` is not drawn."""

    name: str
    glyph: str
    style: str
    values: Sequence[float]


def plot(title: str, times_s: Sequence[float], series: Sequence[Series], *, width: int, height: int) -> Text:
    """Return a plot as text; the glyphs differ also without colour. Of several series at one place, the last is visible.

    Args:
        title: the plotted quantity, with its unit.
        times_s: (n,), increasing; the vertical line is at zero.
        series: of n values each.
        width: columns of the whole plot.
        height: lines of the plot without title and time axis.
    """
    columns = max(PLOT_MIN_COLUMNS, width - PLOT_LABEL)
    drawn = [value for one in series for value in one.values if abs(value) <= MAX_DRAWN]
    low, high = min([0.0, *drawn]), max([0.0, *drawn])
    if high == low:
        high = low + 1.0
    cells = [[(" ", "")] * columns for _ in range(height)]
    first_s, span_s = times_s[0], max(1e-9, times_s[-1] - times_s[0])
    stop = round(-first_s / span_s * (columns - 1))
    zero = round(high / (high - low) * (height - 1))
    cells[zero] = [("┈", "dim")] * columns
    if 0 <= stop < columns:
        for row in cells:
            row[stop] = ("│", "dim")
    for one in series:
        for column in range(columns):
            value = one.values[_at(times_s, first_s + column * span_s / (columns - 1))]
            if abs(value) <= MAX_DRAWN:  # false for NaN
                cells[round((high - value) / (high - low) * (height - 1))][column] = (one.glyph, one.style)
    text = Text(printable(f"{title}: "), no_wrap=True, overflow="crop")
    for one in series:
        text.append(f"{one.glyph} {one.name}  ", one.style)
    for number, row in enumerate(cells):
        value = high - number * (high - low) / (height - 1)
        text.append(f"\n{value + 0.0:6.2f} ┤")
        for glyph, style in row:
            text.append(glyph, style)
    return text.append(f"\n{' ' * PLOT_LABEL}{_time_axis(first_s, times_s[-1], stop, columns)}")


def _at(times_s: Sequence[float], time_s: float) -> int:
    """Return the index of the last time that is not after `time_s`, else the first."""
    return max(0, bisect_right(times_s, time_s + 1e-9) - 1)


def _time_axis(first_s: float, last_s: float, stop: int, columns: int) -> str:
    """Return the labels of the time axis: the first time, zero at the vertical line, and the last time. A label without room is left out."""
    axis = [" "] * columns
    labels = [(0, f"{first_s:+.1f} s"), (columns, f"{last_s:+.1f} s"), (stop, "0")]
    for place, label in labels:
        begin = min(max(0, place), columns - len(label))
        if all(char == " " for char in axis[max(0, begin - 1) : begin + len(label) + 1]):
            axis[begin : begin + len(label)] = label
    return "".join(axis).rstrip()


# --- export


def export(path: Path, file: Path, namespace: str, *, as_json: bool) -> int:
    """Write a black box as a recording. Exit 1 if a part of the black box cannot be read.

    Raises:
        DeployError: the file exists or cannot be written, or nothing of the black box can be read.
    """
    if file.exists():
        raise exists(file)
    stream = messages(path, namespace)
    first = next(stream, None)
    if first is None:
        raise DeployError(f"{path} contains no messages: choose another incident")
    writer = RecordingWriter(file)
    counts: Counter[str] = Counter()
    problem = ""
    try:
        try:
            for message in chain((first,), stream):
                writer.write(message)
                counts[message.topic] += 1
        except IncidentError as error:
            problem = str(error)
        writer.close()
    except BaseException as error:
        with suppress(OSError):
            writer.close()
        file.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise RecordingError(
                f"cannot write {file} ({error.strerror}): free disk space or choose another directory"
            ) from error
        raise
    if as_json:
        size = file.stat().st_size
        print_json({"file": str(file), "messages": counts, "bytes": size, "problem": problem or None})
    else:
        width = max(map(len, counts))
        for topic in sorted(counts):
            print(f"  {topic:<{width}}  {counts[topic]:>9,}")
        print(f"lifeline: {file}: {sum(counts.values()):,} messages, {file.stat().st_size / 1e6:.2f} MB")
        if problem:
            print(f"lifeline: the recording ends early, because {printable(problem)}")
    return EXIT_INCOMPLETE if problem else 0
