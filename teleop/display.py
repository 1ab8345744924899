"""The display of one plain line: requested velocity, supervisor's mode with its reason, next step.

It is used with `--plain` and on terminals without control sequences. An old status is shown with its age, not as if it
still held.
"""

import math
from collections.abc import Sequence

from teleop.view import Line, Segment, Tone, View, columns_of, plain
from teleop.words import is_silent, lateness, next_step, step_after
from wire.bearing import bearing_in_words
from wire.messages import SafetyStatus, Twist

ELLIPSIS = "…"


def render(view: View, width: int, *, unicode: bool = True) -> Line:
    """Return the line in at most `width` columns; the least important parts are omitted first.

    Args:
        view: the values to show.
        width: the maximum number of columns.
        unicode: False: only ASCII.
    """
    omega = "ω" if unicode else "w"
    requested = Segment(f"{requested_text(view, unicode=unicode)} | ")
    news, short_news, nearest = (
        _news(view, omega),
        _news(view, omega, short=True),
        _nearest(view, unicode=unicode),
    )
    candidates: list[Line] = [
        (requested, news, *nearest),
        (requested, news),
        (requested, short_news),
        (short_news,),
    ]
    fitting = next((line for line in candidates if columns_of(line) <= width), None)
    return (_cut(short_news, width, ELLIPSIS if unicode else "."),) if fitting is None else fitting


def requested_text(view: View, *, unicode: bool = True) -> str:
    """Return the requested velocity with its units."""
    omega = "ω" if unicode else "w"
    return f"v {signed(view.wanted.linear_m_s)} m/s {omega} {signed(view.wanted.angular_rad_s)} rad/s"


def signed(value: float) -> str:
    """Return a number with a sign and two decimals; values that round to zero have no sign."""
    return f"{round(value, 2) + 0.0:+.2f}" if round(value, 2) else " 0.00"


def _news(view: View, omega: str, *, short: bool = False) -> Segment:
    status = view.status
    if status is None:
        return Segment(f"waiting for the supervisor at {plain(view.endpoint)}", Tone.CAUTION)
    if is_silent(view):
        return Segment(f"supervisor: silent for {view.status_age_s:.1f} s", Tone.STOP)
    who = f" ({plain(status.owner)} drives)" if status.owner not in ("", view.source) else ""
    match status.mode:
        case SafetyStatus.STOPPED:
            return Segment(_stopped(status, view, short=short), Tone.STOP)
        case _ if view.is_late:
            return Segment(f"LATE: {lateness(view.round_trip_s, view.round_trip_limit_s)}", Tone.STOP)
        case SafetyStatus.READY:
            return Segment(f"READY{who}", Tone.GOOD)
        case SafetyStatus.DRIVING:
            return Segment(f"DRIVING {_permitted(status.permitted, omega)}{who}", Tone.GOOD)
        case SafetyStatus.LIMITED:
            return Segment(f"LIMITED to {_permitted(status.permitted, omega)}{who}", Tone.CAUTION)
        case unknown:
            return Segment(f"unknown mode {unknown}", Tone.STOP)


def _stopped(status: SafetyStatus, view: View, *, short: bool) -> str:
    alarm = "ALARM, " if status.alarm else ""
    causes, over = status.causes_and_latched()
    if over and not causes:
        if short:
            return plain(f"{alarm}STOPPED: was {_counted(over)} - {step_after(view, short=True)}")
        return plain(f"{alarm}STOPPED: was {', '.join(over)}; over now - {step_after(view)}")
    if not causes:
        return f"{alarm}STOPPED - {next_step(view, '')}"
    names = _counted([*causes, *over]) if short else status.why()
    return plain(f"{alarm}STOPPED: {names} - {next_step(view, causes[0])}")


def _counted(names: Sequence[str]) -> str:
    """Return the first name and the number of the others."""
    return f"{names[0]} +{len(names) - 1}" if len(names) > 1 else names[0]


def _nearest(view: View, *, unicode: bool) -> Line:
    status = view.status
    if status is None or is_silent(view) or not math.isfinite(status.nearest_m):
        return ()
    mark, tone = ("! ", Tone.CAUTION) if status.warning else ("", Tone.PLAIN)
    where = bearing_in_words(status.nearest_bearing_rad, degree="°" if unicode else " deg")
    return Segment(" | "), Segment(f"{mark}{status.nearest_m:.2f} m {where}".rstrip(), tone)


def _permitted(twist: Twist, omega: str) -> str:
    return f"v {signed(twist.linear.x)} {omega} {signed(twist.angular.z)}"


def _cut(segment: Segment, width: int, end: str) -> Segment:
    return Segment(segment.text[: max(0, width - 1)] + end * (width > 0), segment.tone)
