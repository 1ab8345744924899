"""The dashboard on the whole terminal: mode, next step, nearest obstacle, velocities and link.

    rows 0-1    the mode in words, and what to do next: all red for a stop
    left        the robot and its lidar from above (top_view.py)
    right       nearest obstacle, velocities, position, control, link, and the events if there is room
    below       otherwise the events, and the keys

While the help is open, all keys replace the picture and the keys below; the rest stays.

Values older than SILENT_AFTER_S are grey and show their age. Text from the network is shown as plain ASCII. No meaning
depends on colour alone.
"""

import itertools
import math
import textwrap
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from teleop.pilots.pilot import LEVELS, amounts
from teleop.screen.controls import help_page
from teleop.screen.display import SILENT_AFTER_S, News, is_silent, news, render, requested_text, signed
from teleop.screen.top_view import Scale, draw_top_view, scale_of
from teleop.screen.view import Control, KeyHelp, Line, Segment, Tone, View, columns_of, plain
from wire.messages import yaw_of
from wire.text import bearing_in_words

MIN_COLUMNS, MIN_ROWS = 80, 24
"""Minimum size of the terminal for the dashboard."""

PANEL_COLUMNS, WIDE_PANEL_COLUMNS = 44, 58
WIDE_COLUMNS = 120
EVENT_ROWS = 2
"""Number of rows for events below the panel, if the panel has no room for them."""
MAX_KEY_ROWS = 5
GAUGE_M = 2.0
"""Full scale of the gauge of the nearest obstacle."""
LEAST_SHOWN = 0.005
"""Minimum velocity that is shown in a bar; smaller values are displayed as 0.00."""


@dataclass(frozen=True, slots=True)
class Glyphs:
    """The characters for drawing, each one column wide."""

    unicode: bool = True
    rule: str = "─"
    track: str = "─"
    bar: str = "━"
    bar_end: str = "╾"
    """Half a cell at the end of a bar to the right."""
    bar_begin: str = "╼"
    """Half a cell at the end of a bar to the left."""
    axis: str = "┼"
    mark: str = "┃"
    on: str = "■"
    off: str = "□"
    arrows: str = "↑↖←↙↓↘→↗"
    """Arrows for eight directions, counter-clockwise from ahead."""
    degree: str = "°"


_UNICODE = Glyphs()
_ASCII = Glyphs(
    unicode=False,
    rule="-",
    track="-",
    bar="=",
    bar_end="=",
    bar_begin="=",
    axis="+",
    mark="|",
    on="#",
    off="-",
    arrows="",
    degree=" deg",
)


def render_dashboard(view: View, columns: int, rows: int, *, unicode: bool = True) -> list[Line]:
    """Return at most `rows` lines of at most `columns` characters, without control characters for any view.

    Args:
        view: the values to show.
        columns: width of the terminal; below MIN_COLUMNS x MIN_ROWS there are only a plain line and the reason.
        rows: height of the terminal.
        unicode: False: only ASCII.
    """
    if columns < 1 or rows < 1:
        return []
    glyphs = _UNICODE if unicode else _ASCII
    if columns < MIN_COLUMNS or rows < MIN_ROWS:
        return _too_small(view, columns, rows, glyphs)
    keys = [] if view.help else _keys(view.keys, columns, glyphs)
    head = [*_banner(view, columns), _rule(_title(view), columns, glyphs)]
    key_title = "? hides all keys" if view.help else "keys"
    foot_rows = 1 + len(keys)
    panel_columns = WIDE_PANEL_COLUMNS if columns >= WIDE_COLUMNS else PANEL_COLUMNS
    sections = _sections(view, panel_columns, glyphs)
    body_rows = rows - len(head) - foot_rows
    room = body_rows - sum(map(len, sections)) - len(sections)
    if room > EVENT_ROWS + 1:
        sections.append(_events(view, room, panel_columns))
        foot = [_rule(key_title, columns, glyphs), *keys]
    else:
        body_rows -= EVENT_ROWS
        events = _events(view, EVENT_ROWS + 1, columns)[1:]
        foot = [
            _rule(f"events, {key_title}", columns, glyphs),
            *_filled(events, EVENT_ROWS),
            *keys,
        ]
    panel = _spread(sections, body_rows)
    left_columns = columns - panel_columns - 1
    if view.help:
        picture = _help(view, left_columns, body_rows, glyphs)
    else:
        picture = _picture(view, left_columns, body_rows, glyphs)
    body = [(*left, Segment(" "), *right) for left, right in zip(picture, panel, strict=True)]
    return [_fitted(line, columns) for line in (*head, *body, *foot)]


# --- the head


def _banner(view: View, columns: int) -> list[Line]:
    """Return the two lines of the mode; for a stop, they fill the width, so that it is visible without colour."""
    what = news(view)
    warning = " COLLISION WARNING " if _warns(view) else ""
    if what.tone is Tone.STOP:
        sentence = f" {what.mode}: {what.what}"
        first = _ends(sentence, warning if len(sentence) + len(warning) <= columns else "", columns)
        second = _ends(f" > {what.next_step}", f" {_names(what)} ", columns)
        return [(Segment(first, Tone.STOP_BANNER),), (Segment(second, Tone.STOP_BANNER),)]
    chip = Tone.GOOD_BANNER if what.tone is Tone.GOOD else Tone.CAUTION_BANNER
    step = f" > {what.next_step}" if what.next_step else ""
    return [
        (Segment(f" {what.mode} ", chip), Segment(f" {what.what}", what.tone)),
        (
            Segment(step[: columns - len(warning)].ljust(columns - len(warning))),
            Segment(warning, Tone.CAUTION_BANNER),
        ),
    ]


def _names(what: News) -> str:
    """Return the names of the stop reasons: those that hold, then those that are over."""
    over = (f"(over: {' '.join(what.over)})",) if what.over else ()
    return " ".join((*what.reasons, *over))


def _warns(view: View) -> bool:
    return view.status is not None and view.status.warning and not is_silent(view)


def _ends(left: str, right: str, columns: int) -> str:
    """Return a line of exactly `columns` characters: `left` at the start, and as much of `right` as fits at the end."""
    room = max(0, columns - len(left))
    if len(right) > room:
        right = f"{right[: room - 3]}.. " if room > 12 else ""
    return left[:columns].ljust(columns - len(right)) + right


def _title(view: View) -> str:
    strangers = () if view.status is None or is_silent(view) else view.status.unknown_sources
    title = f"{plain(view.source)} at {plain(view.endpoint)}"
    if math.isfinite(view.round_trip_s) and not is_silent(view):
        title = f"{title}, answers in {view.round_trip_s:.2f} s"
    return f"{title} - refused, unknown: {plain(' '.join(strangers))}" if strangers else title


def _rule(title: str, columns: int, glyphs: Glyphs) -> Line:
    title = title[: columns - 6]
    return (Segment(f"{glyphs.rule} {title} {glyphs.rule * columns}"[:columns], Tone.DIM),)


# --- the panel


def _sections(view: View, columns: int, glyphs: Glyphs) -> list[list[Line]]:
    return [
        _nearest(view, columns, glyphs),
        _velocities(view, columns, glyphs),
        _position(view, glyphs),
        _control(view, columns, glyphs),
        _link(view),
    ]


def _label(text: str) -> Segment:
    return Segment(f"{text:<10}", Tone.DIM)


def _nearest(view: View, columns: int, glyphs: Glyphs) -> list[Line]:
    status = view.status
    if status is None or not math.isfinite(status.nearest_m):
        what = "nothing in sight" if status is not None and status.nearest_m == math.inf else "not known"
        gauge = _gauge(view, math.nan, Tone.DIM, columns - 10, glyphs)
        return [(_label("nearest"), Segment(what, Tone.DIM)), (_label(""), *gauge)]
    nearest_m, bearing_rad, robot = status.nearest_m, status.nearest_bearing_rad, view.robot
    chip, tone = Segment(" " * 9), Tone.GOOD
    if is_silent(view):
        tone = Tone.DIM
    elif nearest_m <= robot.stop_distance_m:
        chip, tone = Segment(" TOO NEAR", Tone.STOP_BANNER), Tone.STOP
    elif status.warning:
        chip, tone = Segment(" WARNING ", Tone.CAUTION_BANNER), Tone.CAUTION
    where = bearing_in_words(bearing_rad, glyphs.degree)
    if where and glyphs.arrows:
        octant = round(math.remainder(bearing_rad, math.tau) / (math.pi / 4)) % 8
        where = f"{glyphs.arrows[octant]} {where}"
    ago = f"  {_age(view.status_age_s)} ago" if is_silent(view) else ""
    distance = f"{nearest_m:.2f} m" if nearest_m < 1000.0 else "far"
    return [
        (
            _label("nearest"),
            Segment(distance, Tone.STRONG if tone is Tone.GOOD else tone),
            Segment(f"  {where}", Tone.DIM if is_silent(view) else Tone.PLAIN),
            Segment(ago, Tone.DIM),
        ),
        (chip, Segment(" "), *_gauge(view, nearest_m, tone, columns - 10, glyphs)),
    ]


def _gauge(view: View, nearest_m: float, tone: Tone, columns: int, glyphs: Glyphs) -> Line:
    """Return a gauge of the distance, with marks at the warning distance and the stop distance."""
    end = f" {GAUGE_M:g} m"
    cells = columns - len(end)
    filled = _cell(nearest_m / GAUGE_M, cells)
    distances_m = (view.robot.stop_distance_m, view.robot.warning_distance_m)
    marks = {_cell(distance_m / GAUGE_M, cells - 1) for distance_m in distances_m}
    cuts = sorted({0, filled, cells} | marks | {mark + 1 for mark in marks})
    segments: list[Segment] = []
    for begin, stop in itertools.pairwise(cuts):
        if begin in marks:
            segments.append(Segment(glyphs.mark, tone if begin < filled or tone is Tone.DIM else Tone.PLAIN))
        elif begin < filled:
            segments.append(Segment(glyphs.bar * (stop - begin), tone))
        else:
            segments.append(Segment(glyphs.track * (stop - begin), Tone.DIM))
    return (*segments, Segment(end, Tone.DIM))


def _cell(share: float, cells: int) -> int:
    return round(min(1.0, max(0.0, share)) * cells)  # in this order, NaN gives 0


def _velocities(view: View, columns: int, glyphs: Glyphs) -> list[Line]:
    half = (columns - 10) // 2
    head = (_label("velocity"), Segment(f"{'forward m/s':<{half}}{'turn rad/s':<{half}}", Tone.DIM))
    status, odom = view.status, view.odom
    if view.control is Control.VIEW_ONLY:
        requested = None if status is None else (status.commanded.linear.x, status.commanded.angular.z)
        rows = [_velocity_row("requested", view, requested, requested, half, glyphs, is_old=is_silent(view))]
    else:
        rows = [_velocity_row("requested", view, view.wanted, view.sent, half, glyphs)]
    permitted = None if status is None else (status.permitted.linear.x, status.permitted.angular.z)
    measured = None if odom is None else (odom.twist.twist.linear.x, odom.twist.twist.angular.z)
    rows += [
        _velocity_row("permitted", view, permitted, permitted, half, glyphs, is_old=is_silent(view)),
        _velocity_row("measured", view, measured, measured, half, glyphs, is_old=_is_old(view.odom_age_s)),
    ]
    return [head, *rows]


def _velocity_row(
    name: str,
    view: View,
    numbers: tuple[float, float] | None,
    bars: tuple[float, float] | None,
    columns: int,
    glyphs: Glyphs,
    *,
    is_old: bool = False,
) -> Line:
    if numbers is None or bars is None:
        return (_label(name), Segment("not known", Tone.DIM))
    segments = [_label(name)]
    # A turn to the left is positive, and its bar extends to the left.
    for number, bar, limit, sign in zip(numbers, bars, view.most, (1, -1), strict=True):
        cells = (columns - 9) // 2
        share = sign * bar / limit if limit > 0.0 and abs(bar) >= LEAST_SHOWN else 0.0
        segments.append(Segment(f"{_number(number)} ", Tone.DIM if is_old else Tone.STRONG))
        segments += _bar(share, cells, Tone.DIM if is_old else Tone.GOOD, glyphs)
        segments.append(Segment(" " * (columns - 7 - 2 * cells - 1)))
    return tuple(segments)


def _bar(share: float, cells: int, tone: Tone, glyphs: Glyphs) -> tuple[Segment, ...]:
    """Return a bar from the axis in the middle to one side; share 1 fills the side."""
    halves = 0
    if share and not math.isnan(share):
        halves = max(1, round(2 * cells * min(1.0, abs(share))))
    bar = glyphs.bar * (halves // 2)
    track = glyphs.track * (cells - (halves + 1) // 2)
    axis, other = Segment(glyphs.axis, Tone.DIM), Segment(glyphs.track * cells, Tone.DIM)
    if share < 0:
        return Segment(track, Tone.DIM), Segment(glyphs.bar_begin * (halves % 2) + bar, tone), axis, other
    return other, axis, Segment(bar + glyphs.bar_end * (halves % 2), tone), Segment(track, Tone.DIM)


def _position(view: View, glyphs: Glyphs) -> list[Line]:
    odom, label = view.odom, _label("position")
    if odom is None:
        return [(label, Segment("no odometry yet", Tone.DIM))]
    pose = odom.pose.pose
    place = f"{_number(pose.position.x)}, {_number(pose.position.y)} m"
    if _is_old(view.odom_age_s):
        return [(label, Segment(f"{place}  {_age(view.odom_age_s)} ago", Tone.DIM))]
    return [(label, Segment(f"{place}  heading {_degrees(yaw_of(pose.orientation))}{glyphs.degree}"))]


def _control(view: View, columns: int, glyphs: Glyphs) -> list[Line]:
    name = Segment(view.control.value, Tone.STRONG)
    note = _ours(view.control_note, glyphs)[: columns - 1]
    second = (Segment(f" {note}", Tone.DIM),)
    if view.control is Control.VIEW_ONLY or view.level is None:
        return [(_label("control"), name), second]
    level = max(0, min(LEVELS, view.level))
    steps = glyphs.on * level + glyphs.off * (LEVELS - level)
    lines: list[Line] = [(_label("control"), name, Segment(f"   speed {steps} {level} of {LEVELS}"))]
    if view.limit is not None:
        lines.append((_label("  up to"), Segment(amounts(view.limit)[: columns - 10])))
    return [*lines, second]


def _link(view: View) -> list[Line]:
    status = view.status
    own = view.own
    streams = (
        (view.rates.status_hz, None if status is None else view.status_age_s),
        (view.rates.odom_hz, None if view.odom is None else view.odom_age_s),
        (view.rates.scan_hz, None if view.scan is None else view.scan_age_s),
    )
    rates = [_rate(rate_hz, age_s) for rate_hz, age_s in streams]
    ages = [_age_segment(age_s) for _, age_s in streams]
    if view.control is Control.VIEW_ONLY:
        head = f"{'status':<8}{'odom':<8}{'scan':<8}"
    else:
        head = f"{'status':<8}{'odom':<8}{'scan':<8}commands"
        own_s = None if own is None or is_silent(view) or not math.isfinite(own.age_s) else own.age_s
        ages.append(_age_segment(own_s))
    return [
        (_label("link"), Segment(head, Tone.DIM)),
        (_label("  rate"), *rates),
        (_label("  age"), *ages),
    ]


def _rate(rate_hz: float, age_s: float | None) -> Segment:
    if age_s is None or not math.isfinite(rate_hz):
        return Segment(f"{'-':<8}", Tone.DIM)
    text = f"{min(rate_hz, 9999.0):.0f} Hz"
    return Segment(f"{text:<8}", Tone.DIM if _is_old(age_s) else Tone.PLAIN)


def _age_segment(age_s: float | None) -> Segment:
    if age_s is None:
        return Segment(f"{'none':<8}", Tone.CAUTION)
    return Segment(f"{_age(age_s):<8}", Tone.STOP if _is_old(age_s) else Tone.GOOD)


def _events(view: View, rows: int, columns: int) -> list[Line]:
    """Return a heading and the newest events, newest first; long events are wrapped."""
    lines: list[Line] = [(_label("events"),)]
    for event in reversed(view.events):
        if len(lines) >= rows:
            break
        first, *others = _wrapped(plain(event.text), columns - 11)
        clock = f" {plain(event.clock)[:8]:<8} "
        lines.append((Segment(clock, Tone.DIM), Segment(first, event.tone)))
        lines += [(Segment(" " * 10), Segment(other, event.tone)) for other in others]
    return lines[:rows]


@lru_cache(maxsize=128)
def _wrapped(text: str, columns: int) -> list[str]:
    return textwrap.wrap(text, columns) or [""]


# --- the picture


def _picture(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Line]:
    """Return the top view and a line below it with the scale, or with the age of an old scan."""
    is_old = view.scan is None or _is_old(view.scan_age_s)
    lines = draw_top_view(view.scan, view.robot, columns, rows - 1, is_stale=is_old, unicode=glyphs.unicode)
    scale = scale_of(view.robot, columns, rows - 1)
    return [*lines, _fitted(_caption(view, scale, glyphs), columns)]


def _caption(view: View, scale: Scale, glyphs: Glyphs) -> Line:
    if view.scan is None:
        return (Segment(" no scan yet", Tone.CAUTION),)
    if _is_old(view.scan_age_s):
        return (Segment(f" the scan is {_age(view.scan_age_s)} old", Tone.CAUTION),)
    cells = max(1, round(0.5 / (2 * scale.dot_m)))
    robot = view.robot
    rings = f"rings {robot.stop_distance_m:.2f}, {robot.warning_distance_m:.2f} m"
    return (Segment(f" {glyphs.mark}{glyphs.rule * cells}{glyphs.mark} 0.5 m  {rings}", Tone.DIM),)


# --- the keys


@lru_cache(maxsize=4)
def _keys(keys: tuple[KeyHelp, ...], columns: int, glyphs: Glyphs) -> list[Line]:
    """Return the keys in columns with as few lines as possible; if they do not fit, the widest column is cut off."""
    rows = _our_rows(keys, glyphs)
    stacks: list[list[KeyHelp]] = []
    widths: list[int] = []
    for height in range(1, MAX_KEY_ROWS + 1):
        stacks = [rows[first : first + height] for first in range(0, len(rows), height)]
        widths = [_keys_wide(stack) + max(len(row.does) for row in stack) + 2 for stack in stacks]
        if sum(widths) < columns:
            break
    while sum(widths) >= columns:
        widths[widths.index(max(widths))] -= 1
    lines: list[Line] = [(Segment(" "),) for _ in range(max(map(len, stacks), default=0))]
    for stack, width in zip(stacks, widths, strict=True):
        left = min(width, _keys_wide(stack))
        right = width - left
        for at, line in enumerate(lines):
            row = stack[at] if at < len(stack) else KeyHelp("", "")
            lines[at] = (
                *line,
                Segment(f"{row.keys[: max(0, left - 1)]:<{left}}", Tone.STRONG),
                Segment(f"{row.does[: max(0, right - 1)]:<{right}}", Tone.DIM),
            )
    return lines


def _keys_wide(stack: list[KeyHelp]) -> int:
    """Return the width of the keys in one column, with an empty character."""
    return max(len(row.keys) for row in stack) + 1


def _help(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Line]:
    """Return all keys in exactly `rows` lines of `columns` characters."""
    page = help_page(_our_rows(view.help, glyphs), columns - 1, rows)
    return [_fitted((Segment(" "), *line), columns) for line in _filled(page, rows)]


def _our_rows(keys: Iterable[KeyHelp], glyphs: Glyphs) -> list[KeyHelp]:
    return [KeyHelp(_ours(row.keys, glyphs), _ours(row.does, glyphs)) for row in keys]


# --- a terminal that is too small


def _too_small(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Line]:
    line = render(view, columns, unicode=glyphs.unicode)
    why = f"terminal {columns}x{rows}: the dashboard needs {MIN_COLUMNS}x{MIN_ROWS}"
    if len(why) > columns:
        why = f"{columns}x{rows}, needs {MIN_COLUMNS}x{MIN_ROWS}"
    reason = (Segment(why[:columns], Tone.DIM),)
    if not view.help:
        return [line, reason][:rows]
    requested = requested_text(view, unicode=glyphs.unicode)
    state = [line]
    if view.control is not Control.VIEW_ONLY and not line[0].text.startswith(requested):
        state.append((Segment(requested[:columns]),))
    page = help_page(_our_rows(view.help, glyphs), columns, rows - len(state))
    return [*state, *page, reason][:rows]


# --- helpers


def _is_old(age_s: float) -> bool:
    return not age_s <= SILENT_AFTER_S


def _age(age_s: float) -> str:
    """Return an age as text of at most seven characters; small ages give a constant text."""
    if age_s < 0.1:
        return "<0.1 s"
    if age_s < 100.0:
        return f"{age_s:.1f} s"
    return f"{age_s:.0f} s" if age_s < 10_000.0 else "long"


def _number(value: float) -> str:
    """Return a number in six characters, with a sign and two decimals if they fit."""
    if not math.isfinite(value):
        return f"{'-':>6}"
    text = signed(value) if abs(value) < 99.99 else f"{value:+.0f}"
    return f"{text:>6}" if len(text) <= 6 else f"{'+' if value > 0 else '-'}large"


def _degrees(angle_rad: float) -> str:
    """Return an angle in degrees, -180 to 180, counter-clockwise positive."""
    if not math.isfinite(angle_rad):
        return "-"
    degrees = round(math.degrees(math.remainder(angle_rad, math.tau)))
    return f"{degrees:+d}" if degrees else "0"


def _ours(text: str, glyphs: Glyphs) -> str:
    """Return a text of this program, with characters beyond ASCII only if the terminal supports them."""
    return "".join(map(_one_column, text)) if glyphs.unicode else plain(text)


@lru_cache(maxsize=1024)
def _one_column(char: str) -> str:
    is_narrow = unicodedata.east_asian_width(char) not in "WF" and not unicodedata.combining(char)
    return char if char.isprintable() and is_narrow else "?"


def _spread(sections: Sequence[list[Line]], rows: int) -> list[Line]:
    """Return the sections below each other, with empty lines between them as far as there is room."""
    empty = rows - sum(map(len, sections))
    lines: list[Line] = []
    for section in sections:
        if lines and empty > 0:
            lines.append(())
            empty -= 1
        lines += section
    return _filled(lines, rows)


def _filled(lines: Iterable[Line], rows: int) -> list[Line]:
    """Return exactly `rows` lines."""
    some = list(lines)[:rows]
    return some + [()] * (rows - len(some))


def _fitted(line: Line, columns: int) -> Line:
    """Return a line of exactly `columns` characters."""
    spare = columns - columns_of(line)
    if spare >= 0:
        return (*line, Segment(" " * spare)) if spare else line
    fitting: list[Segment] = []
    for segment in line:
        fitting.append(Segment(segment.text[:columns], segment.tone))
        columns -= len(fitting[-1].text)
    return tuple(fitting)
