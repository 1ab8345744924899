"""`lifeline replay-decision`: run the law again over a black box recording, and compare the decisions."""

import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from rich.console import Console
from rich.text import Text

from deploy.stack.console import print_json
from deploy.stack.formatting import COLOURS, number
from deploy.stack.table import Column, Table
from recordings.incidents.incident import damage_of
from supervisor.blackbox.file import DECISION, INPUTS, STATE, dumps
from supervisor.blackbox.reader import BlackBoxError, Document, left_out_of, read, stops_of, time_of
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import step
from supervisor.law.state import State
from wire.standstill import is_still
from wire.text import printable, printable_lines

EXIT_DIFFERENT = 1
MIN_WIDTH = 130
"""Width of the table in columns if the output is not a terminal."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first value in which the replay differs from the recording."""

    now_s: float
    where: str
    """Path of the value, such as `decision.scale` or `state.interlock.sources[0].neutral_s`."""
    recorded: str
    replayed: str


@dataclass(slots=True)
class Phase:
    """Consecutive steps with the same outline: one line of the timeline."""

    first_s: float
    last_s: float
    first: Decision
    last: Decision


@dataclass(slots=True)
class Replay:
    """The result of a replay."""

    stop_s: float
    """Time of the first stop."""
    steps: int = 0
    difference: Difference | None = None
    phases: list[Phase] = field(default_factory=list[Phase])
    """The phases of the replay, up to the difference."""
    rest_s: float | None = None
    """Time from the first stop to the first odometry after it in which the base is at rest."""
    took_s: float = 0.0


def replay_decision(path: Path, *, as_json: bool = False) -> int:
    """Replay a black box, print its timeline and the verdict, and return the exit code.

    Raises:
        DeployError: the black box cannot be replayed.
    """
    with damage_of(path):
        document = read(path)
        found = replay(document)
    if as_json:
        print_json(to_json(document, found))
    else:
        _print(document, found)
    return 0 if found.difference is None else EXIT_DIFFERENT


@np.errstate(all="ignore")  # hostile numbers would print warnings
def replay(document: Document) -> Replay:
    """Run the law over the recorded inputs, from the first recorded state to the end or the first difference.

    Raises:
        BlackBoxError: a line does not match the types of this law.
    """
    stop = stops_of(document.header)[0]
    stop_s = stop.now_s
    found = Replay(stop_s)
    state: State | None = None
    started_s = time.perf_counter()
    for line_number, line in enumerate(document.lines, start=2):
        try:
            if "state" in line:
                if state is None:
                    state = STATE.read(line["state"])
                replayed = STATE.spell(STATE.pack(state))
                where, now_s = "state", found.phases[-1].last_s if found.phases else stop_s
                recorded = line["state"]
            else:
                now_s, inputs = time_of(line, stop), INPUTS.read(line["inputs"])
                if state is None:
                    raise ValueError("no state precedes it")  # noqa: TRY301 - reported below with its line number
                state, decision = step(state, now_s, inputs)
                replayed = DECISION.spell(DECISION.pack(decision))
                where, recorded = "decision", line["decision"]
                found.steps += 1
                _tell(found, now_s, decision)
                if found.rest_s is None and now_s >= stop_s and _is_at_rest(inputs):
                    found.rest_s = now_s - stop_s
        except (KeyError, TypeError, ValueError) as error:
            raise BlackBoxError(
                f"line {line_number} of the black box does not match the types of this law: {error}"
            ) from error
        different = _different(where, recorded, replayed)
        if different is not None:
            found.difference = Difference(now_s, *different)
            break
    found.took_s = time.perf_counter() - started_s
    return found


def _is_at_rest(inputs: Inputs) -> bool:
    return inputs.odometry is not None and is_still(*inputs.odometry.velocity)


def _tell(found: Replay, now_s: float, decision: Decision) -> None:
    last = found.phases[-1] if found.phases else None
    if last is None or _outline(last.last) != _outline(decision):
        found.phases.append(Phase(now_s, now_s, decision, decision))
    else:
        last.last_s, last.last = now_s, decision


def _outline(decision: Decision) -> tuple[object, ...]:
    """Return the values whose change begins a new line of the timeline."""
    return (
        decision.mode,
        decision.reasons,
        decision.owner,
        decision.commanded == STANDSTILL,
        decision.alarm,
        None if decision.reset_reply is None else decision.reset_reply.message,
    )


def _different(where: str, recorded: object, replayed: object) -> tuple[str, str, str] | None:
    """Find the first difference of two JSON values: its path and both values; −0.0 differs from 0.0.

    A field that only one of the two laws has is not a difference.
    """
    ours, theirs = _items(replayed), _items(recorded)
    if ours is None or theirs is None or (isinstance(replayed, list) and len(ours) != len(theirs)):
        texts = dumps(cast("Any", recorded)), dumps(cast("Any", replayed))
        return None if texts[0] == texts[1] else (where, *texts)
    pairs = ((f"{where}{key}", theirs[key], ours[key]) for key in ours if key in theirs)
    return next((found for pair in pairs if (found := _different(*pair)) is not None), None)


def _items(value: object) -> dict[str, object] | None:
    """Return the items of a JSON object or list by path suffix (`.key`, `[0]`); None for other values."""
    if isinstance(value, dict):
        return {f".{key}": item for key, item in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return {f"[{i}]": item for i, item in enumerate(cast("list[object]", value))}
    return None


# --- output


def to_json(document: Document, found: Replay) -> dict[str, Any]:
    """Return the result as JSON values; the times of the timeline count from the stop."""
    stop_s, difference = found.stop_s, found.difference
    return {
        "same": difference is None,
        "steps": found.steps,
        "stops": document.header["stops"],
        "rest_s": found.rest_s,
        "difference": None if difference is None else asdict(difference),
        "timeline": [
            {
                "from_s": phase.first_s - stop_s,
                "to_s": phase.last_s - stop_s,
                "mode": phase.first.mode.name,
                "reasons": sorted(phase.first.reasons),
                "owner": phase.first.owner,
                "alarm": phase.first.alarm,
                "commanded": [number(value) for value in phase.first.commanded],
                "permitted": [number(value) for value in phase.first.output],
                "nearest_m": number(phase.first.nearest_m),
            }
            for phase in found.phases
        ],
    }


def _print(document: Document, found: Replay) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=MIN_WIDTH)
    for stop in stops_of(document.header):
        console.print(Text(printable(f"{stop.utc}+00:00  {', '.join(stop.reasons)}"), style="bold"))
    left_out = left_out_of(document.header)
    if left_out:
        console.print(
            f"{left_out:,} older steps of the window were left out for lack of space", highlight=False
        )
    console.print(_timeline(found.phases, found.stop_s))
    if found.rest_s is not None:
        console.print(
            f"the base was at rest {found.rest_s:.2f} s after the stop, by its odometry",
            highlight=False,
        )
    console.print(_verdict(document, found))


def _timeline(phases: Sequence[Phase], stop_s: float) -> Table:
    times = [Column(name, right=True) for name in ("s from\nthe stop", "for s")]
    velocities = [Column(f"{name}\nm/s, rad/s", right=True) for name in ("requested", "permitted")]
    table = Table(*times, "mode", "owner", *velocities, Column("nearest\nm", right=True), "reasons")
    for i, phase in enumerate(phases):
        end_s = phases[i + 1].first_s if i + 1 < len(phases) else phase.last_s
        first, last = phase.first, phase.last
        reasons = ", ".join(first.reasons) + (" ALARM" if first.alarm else "")
        reset = "" if first.reset_reply is None else f" (reset: {first.reset_reply.message})"
        table.add_row(
            f"{phase.first_s - stop_s + 0.0:+.3f}",
            f"{end_s - phase.first_s:.3f}",
            Text(printable(first.mode.name), style=COLOURS[first.mode.name]),
            Text(printable(first.owner)),
            _span(_twist(first.commanded), _twist(last.commanded)),
            _span(_twist(first.output), _twist(last.output)),
            _span(f"{first.nearest_m:.2f}", f"{last.nearest_m:.2f}"),
            Text(printable(f"{reasons}{reset}".strip())),
        )
    return table


def _twist(velocity: Velocity) -> str:
    # Adding zero turns −0.0 into 0.0.
    return ", ".join(f"{round(value, 2) + 0.0:.2f}" for value in velocity)


def _span(first: str, last: str) -> str:
    return first if first == last else f"{first}\n→ {last}"


def _verdict(document: Document, found: Replay) -> Text:
    took = f"in {found.took_s:.2f} s"
    difference = found.difference
    if difference is None:
        return Text(
            printable(f"{found.steps:,} steps replayed {took}; all decisions are the same"),
            style="bold green",
        )
    lines = [
        f"{found.steps:,} steps replayed {took}; the first difference is in {difference.where}",
        f"  {difference.now_s - found.stop_s:+.3f} s from the stop, at step time {difference.now_s!r} s:",
        f"  recorded {_short(difference.recorded)}",
        f"  replayed {_short(difference.replayed)}",
    ]
    here = {"python": platform.python_version(), "numpy": np.__version__, "machine": platform.machine()}
    other = [
        f"{key} {_short(str(document.header.get(key)))}, here {here[key]}"
        for key in here
        if document.header.get(key) != here[key]
    ]
    if other:
        lines.append(
            f"  the environment of the recording differs, which may be the cause: {'; '.join(other)}"
        )
    return Text(printable_lines("\n".join(lines)), style="bold red")


def _short(value: str, limit: int = 200) -> str:
    return value if len(value) <= limit else f"{value[:limit]}…"
