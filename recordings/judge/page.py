"""The page of `lifeline judge`, and its result as JSON."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, cast

from rich.text import Text

from deploy.stack.formatting import nearest, number
from deploy.stack.table import Column, Table, facts
from recordings.judge.findings import BARRIER, CLAMPED, Moment, Place
from recordings.judge.judge import Judgement
from wire.reasons import words_of
from wire.text import printable

LIMIT_WORDS = {BARRIER: "slows down before something near", CLAMPED: "faster than the configured limit"}
UNKNOWN = "–"


def page(found: Judgement) -> Iterator[Table | Text]:
    """Yield the parts of the page: the verdict, the facts, and the tables."""
    of = "supervised" if found.is_supervised else "not supervised"
    style = "bold red" if found.is_found else "bold yellow" if found.feed.not_judged else "bold green"
    title = f"{found.path}: {found.duration_s:,.1f} s, robot {of} by Lifeline"
    yield Text(printable(title), "bold").append("\n").append(printable(sentence(found)), style)
    table = facts()
    for name, value in (*_facts_of_places(found), *_facts_of_recording(found)):
        table.add_row(name, value)
    yield table
    for part in (_places(found), _rules(found), _streams(found)):
        yield Text()
        yield part


def sentence(found: Judgement) -> str:
    """Return the verdict as one sentence."""
    places, broken = found.feed.places, found.broken
    rules = f"; broken: {', '.join(broken)}" if broken else ""
    if found.feed.not_judged:
        return f"Whether Lifeline would have stopped this robot cannot be judged: {found.feed.not_judged}{rules}."
    limited = f"; it limited the speed {places.limited:,} ×" if places.limited else ""
    if found.is_supervised:
        return f"Lifeline stopped or refused a motion {places.stops:,} ×{limited}{rules}."
    if places.first_stop is not None:
        at = places.first_stop.first
        return f"Lifeline would have stopped this robot, first after {at.time_s:.2f} s: {', '.join(at.reasons)}{rules}."
    return f"Lifeline would not have stopped this robot{limited.replace('it', 'it would have')}{rules}."


def _facts_of_places(found: Judgement) -> Iterator[tuple[str, str]]:
    places = found.feed.places
    first = places.kept[0] if places.kept else None
    if first is not None:
        yield "first", _place(first)
    if places.first_stop is not None and places.first_stop is not first:
        yield "first stop", _place(places.first_stop)
    later = places.stops + places.limited - 1
    if later > 0 and not found.is_supervised:
        yield (
            "later",
            f"{later:,} more, each on the condition that the robot came there in spite of the first",
        )
    for name, at in (("nearest", places.nearest), ("moving", places.nearest_moving)):
        if at is not None:
            yield name, f"{_nearest(at)}, after {at.time_s:.2f} s"


def _facts_of_recording(found: Judgement) -> Iterator[tuple[str, Text | str]]:
    feed = found.feed
    for one in feed.streams.values():
        if one.stale:
            longest = f"at most {one.stale_longest_s:.2f} s, after {one.stale_at_s:.2f} s"
            yield (
                "silent",
                f"{one.role}: {one.stale:,} × longer than {one.timeout_s:.2g} s while the robot moved, {longest}",
            )
    if not feed.not_judged and not found.is_supervised:
        yield "judged", f"from {feed.judged_from_s:.2f} s on: {feed.places.judged_s:,.1f} s of motion"
    if found.config is not None:
        yield "with", str(found.config)
    for assumption in found.assumptions:
        yield "assumed", assumption
    for note in feed.notes:
        yield "note", Text(printable(note), "yellow")
    if found.problem:
        yield "problem", Text(printable(f"the recording ends early: {found.problem}"), "bold red")


def _nearest(moment: Moment) -> str:
    # A point inside the hull is at it; adding zero turns −0.0 into 0.0.
    return nearest(moment.nearest_m * (moment.nearest_m > 0.0) + 0.0, moment.bearing_rad)


def _place(place: Place) -> str:
    at = place.first
    what = "stop" if place.is_stop else f"limit to {at.scale:.0%}"
    detail = f" ({at.detail})" if at.detail else ""
    names = ", ".join(map(_words, place.names))
    return f"{what} after {at.time_s:.2f} s at {_speed(at)}: {names}{detail}; nearest {_nearest(at)}"


def _words(name: str) -> str:
    words = words_of(name)
    text = LIMIT_WORDS.get(name, "") if words is None else words.caption
    return f"{name}, {text}" if text else name


def _speed(moment: Moment) -> str:
    linear_m_s, angular_rad_s = moment.wanted
    is_valid = math.isfinite(linear_m_s)
    return f"{linear_m_s:.2f} m/s, {angular_rad_s:.2f} rad/s" if is_valid else "an invalid command"


def _places(found: Judgement) -> Table:
    title = (
        "what Lifeline did"
        if found.is_supervised
        else "what Lifeline would have done at the places of this recording"
    )
    figures = [Column(name, right=True) for name in ("times", "s", "first at")]
    table = Table("reason", "", *figures, "requested", "nearest", title=title)
    totals = found.feed.places.totals.values()
    for one in sorted(totals, key=lambda total: (not total.is_stop, total.first.time_s)):
        kind = Text("stop", "red") if one.is_stop else Text("limit", "yellow")
        counted = (f"{one.places:,}", f"{one.seconds:,.1f}", f"{one.first.time_s:.2f}")
        table.add_row(one.name, kind, *counted, _speed(one.first), _nearest(one.first))
    if not totals:
        table.add_row("none", "", "", "", "", "", "")
    return table


def _rules(found: Judgement) -> Table:
    table = Table("rule", "verdict", "", title="rules, judged without the law")
    for one in found.feed.monitors.verdicts():
        if not one.is_judged:
            table.add_row(one.rule, Text("not judged", "dim"), one.why_not)
        elif one.broken:
            first = one.violations[0]
            detail = f"{one.broken:,} ×, first after {first.time_s:.2f} s: {first.sentence}"
            table.add_row(one.rule, Text("broken", "bold red"), detail)
        else:
            table.add_row(one.rule, Text("kept", "green"), f"at {one.moments:,} moments")
    return table


def _streams(found: Judgement) -> Table:
    names = ("messages", "period", "longest gap", "at", "stale", "repeats")
    title = "topics (stale, repeats: while the robot moved)"
    table = Table("topic", "carries", *(Column(name, right=True) for name in names), title=title)
    for one in found.feed.streams.values():
        broken = f" ({one.undecodable:,} undecodable)" if one.undecodable else ""
        stale = f"{one.stale:,}" if math.isfinite(one.timeout_s) else UNKNOWN
        gaps = (_seconds(one.period_s), _seconds(one.longest_s), _seconds(one.longest_at_s), stale)
        table.add_row(one.topic, one.role, f"{one.messages:,}{broken}", *gaps, f"{one.repeats:,}")
    return table


def _seconds(value: float) -> str:
    return f"{value:.3f} s" if math.isfinite(value) else UNKNOWN


def to_json(found: Judgement) -> dict[str, Any]:
    """Return the result as JSON values; times count from the beginning of the recording."""
    feed = found.feed
    places = _plain(feed.places)
    return {
        "file": printable(str(found.path)),
        "config": None if found.config is None else printable(str(found.config)),
        "supervised": found.is_supervised,
        "found": found.is_found,
        "sentence": printable(sentence(found)),
        "duration_s": number(found.duration_s),
        "judged_from_s": number(feed.judged_from_s),
        "not_judged": printable(feed.not_judged) or None,
        "problem": printable(found.problem) or None,
        "assumptions": _plain(found.assumptions),
        "notes": _plain(feed.notes),
        "places": places.pop("kept"),
        **places,
        "totals": _plain(list(feed.places.totals.values())),
        "rules": _plain(feed.monitors.verdicts()),
        "topics": [_plain(one) | {"period_s": number(one.period_s)} for one in feed.streams.values()],
    }


def _plain(value: object) -> Any:  # noqa: ANN401 - any JSON
    """Return a record, or a collection of records, as JSON values without its private fields."""
    if is_dataclass(value):
        return _plain({one.name: getattr(value, one.name) for one in fields(value)})
    match value:
        case str():
            return printable(value)
        case float():
            return number(value)
        case dict():
            named = cast("Mapping[object, object]", value).items()
            return {str(key): _plain(item) for key, item in named if not str(key).startswith("_")}
        case tuple() | list():
            items = cast("Any", value)
            return _plain(items._asdict()) if hasattr(items, "_asdict") else [_plain(item) for item in items]
        case _:
            return value
