"""The supervisor's mode in words, with its reason and the operator's next step; and the display of one plain line.

The line is used with `--plain` and on terminals without control sequences. An old status is shown with its age, not as if
it still held. Text from the network is converted to plain ASCII, so that no payload can send control sequences to the
terminal.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from teleop.screen.view import Control, Line, Segment, Tone, View, columns_of, nearest_in_words, plain
from wire.messages import SafetyStatus, Twist
from wire.reasons import LIMIT_WORDS, words_of

SILENT_AFTER_S = 0.5
"""A stream without a message for longer than this is outdated; the slowest stream has 10 Hz."""
LATE_S = 0.15
"""A source is silent if its last command is older than this; it sends 20 per second."""


class News(NamedTuple):
    """Texts for the mode."""

    mode: str
    """Name of the mode in capitals."""
    what: str
    """The reason or details, as a text after the mode and a colon."""
    next_step: str
    """The operator's next step; empty if there is none."""
    tone: Tone
    """GOOD, CAUTION or STOP."""
    reasons: tuple[str, ...] = ()
    """Names of the stop reasons that hold now, most severe first."""
    over: tuple[str, ...] = ()
    """Names of the stop reasons that are over, and that still require a neutral command."""


def is_silent(view: View) -> bool:
    """Return whether the last status is outdated."""
    return view.status is not None and not view.status_age_s <= SILENT_AFTER_S


def news(view: View) -> News:
    """Return the texts for the mode, its cause and the next step."""
    status = view.status
    if status is None:
        endpoint = plain(view.endpoint)
        step = "wait for it, or start it; Ctrl-C quits"
        return News("WAITING", f"nothing heard from the supervisor at {endpoint}", step, Tone.CAUTION)
    if is_silent(view):
        what = f"silent for {view.status_age_s:.1f} s: it or the link is lost; the base brakes by itself"
        return News("NO SUPERVISOR", what, "wait; then check the link, or restart the supervisor", Tone.STOP)
    match status.mode:
        case SafetyStatus.STOPPED:
            return _stopped(view, status)
        case _ if view.lateness:
            return News("LATE", view.lateness, "no motion is sent: wait, or use a faster link", Tone.STOP)
        case _ if view.demands_key:
            what = f"no key was pressed: zero is sent in {_seconds(view)} s"
            return News("PRESS ENTER", what, "Enter: continue; s: stop", Tone.CAUTION)
        case SafetyStatus.READY:
            return _ready(view, status)
        case SafetyStatus.DRIVING:
            return News("DRIVING", *_driving(view, status), Tone.GOOD)
        case SafetyStatus.LIMITED:
            return _limited(view, status)
        case unknown:
            what = f"the supervisor reports mode {unknown}, which this program does not know"
            return News("UNKNOWN", what, "run the same version of Lifeline on both sides", Tone.STOP)


def _seconds(view: View) -> int:
    """Return the whole seconds until zero is sent for lack of a key."""
    return max(0, math.ceil(view.vigilance_left_s))


def next_step(view: View, reason: str) -> str:
    """Return a short text on what the operator can do about a stop reason."""
    if view.control is Control.VIEW_ONLY and reason != "BASE_RUNAWAY":
        return "the operator must reset it" if reason == "ESTOP" else "the operator must re-arm"
    if reason == "ESTOP" and view.is_neutral:  # a reset is refused while a source commands motion
        return "press r to reset"
    words = words_of(reason)
    unknown = "remove the cause, NEUTRAL" if reason else "NEUTRAL to re-arm"
    step = unknown if words is None else words.step
    return step.replace("NEUTRAL", view.neutral_hint)


def step_after(view: View, *, short: bool = False) -> str:
    """Return a short text on what the operator can do if all stop reasons are over."""
    if view.control is Control.VIEW_ONLY:
        return "the operator must re-arm"
    return view.neutral_hint if short else f"{view.neutral_hint} to drive again"


def _stopped(view: View, status: SafetyStatus) -> News:
    causes, over = (tuple(map(plain, names)) for names in status.causes_and_latched())
    alarm = "ALARM: " if status.alarm else ""
    if over and not causes:
        words = words_of(over[0])
        what = f"the reason was {over[0]}" if words is None else words.over
        return News("STOPPED", f"{alarm}{what}. Over now", step_after(view), Tone.STOP, causes, over)
    first = causes[0] if causes else ""
    return News(
        "STOPPED", alarm + cause_in_words(first, status), next_step(view, first), Tone.STOP, causes, over
    )


def cause_in_words(reason: str, status: SafetyStatus) -> str:
    """Return the sentence for a stop reason of a status; the status has details of its first cause."""
    words = words_of(reason)
    if words is None:
        unknown = f"unknown stop reason {reason}"
        return _detail(status) or (unknown if reason else "the supervisor gives no reason")
    who = plain(status.owner) or "a source"
    now = words.now.replace("WHO", who)
    detail = _detail(status) if reason in status.causes_and_latched()[0][:1] else ""
    match reason:
        case "ESTOP":
            of_disk = plain(status.estop_record_problem)
            return "; ".join(filter(None, (f"{now}: {detail}" if detail else now, of_disk)))
        case "SCAN_INVALID":
            problem = detail or plain(status.scan_problem) or "no usable beams"
            return f"{now}: {problem}"
        case _ if detail:
            return detail
        case "ESTOP_UNRECORDED" if status.estop_record_problem:
            return plain(status.estop_record_problem)
        case "SCAN_STALE" if math.isfinite(status.scan_age_s):
            return f"the newest scan is {status.scan_age_s:.1f} s old"
        case "COMMAND_TIMEOUT" if (silent_s := _silent_s(status)) > LATE_S:
            return f"{who} silent for {silent_s:.1f} s"
        case "OBSTACLE":
            return f"{now}{_where(status)}"
        case _:
            return now


def _detail(status: SafetyStatus) -> str:
    """Return the law's details of the first cause, in ASCII."""
    return plain(status.detail.replace("°", " deg").replace("…", ".."))


def _silent_s(status: SafetyStatus) -> float:
    """Return the age [s] of the owner's last command; NaN if unknown."""
    owner = status.source(status.owner)
    return math.nan if owner is None else owner.age_s


def _where(status: SafetyStatus) -> str:
    nearest = nearest_in_words(status)
    return f": {nearest}" if nearest else ""


def _ready(view: View, status: SafetyStatus) -> News:
    if view.control is Control.VIEW_ONLY:
        return News("READY", "at rest, armed", "", Tone.GOOD)
    name, own = plain(view.source), view.own
    if own is not None and not own.armed:
        who = plain(status.owner) or "another source"
        return News("READY", f"for {who}, but not for {name}", f"{view.neutral_hint} to arm", Tone.CAUTION)
    if own is None and status.sources:
        what = f"but the supervisor ignores {name}"
        return News("READY", what, "add it to the sources in robot.toml", Tone.CAUTION)
    return News("READY", "at rest, armed", "the next command moves the robot", Tone.GOOD)


def _driving(view: View, status: SafetyStatus) -> tuple[str, str]:
    """Return who drives, and the operator's next step."""
    owner = plain(status.owner) or "a source"
    if view.control is Control.VIEW_ONLY:
        return f"{owner} drives", ""
    if status.owner in ("", view.source):
        return "as requested", "SPACE is the emergency stop"
    own, other = view.own, status.source(status.owner)
    if own is not None and other is not None and own.priority > other.priority:
        return f"{owner} drives, not you", "command motion to take over; SPACE is the emergency stop"
    return f"{owner} drives, not you", "it must stop first; SPACE is the emergency stop"


def _limited(view: View, status: SafetyStatus) -> News:
    who, step = _driving(view, status)
    limit = next((words for name, words in LIMIT_WORDS.items() if name in status.causes), None)
    if limit is not None:
        why = f": {limit.now.replace('WHO', plain(status.owner) or 'a source')}"
    else:
        why = f": {_detail(status)}" if status.causes and status.detail else _where(status)
    what = f"slowed to {status.scale:.0%}{why}" if status.scale > 0.0 else f"held at zero{why}"
    if who != "as requested":
        return News("LIMITED", f"{who}; {what}", step, Tone.CAUTION)
    step = "steer away from it, or slow down" if limit is None else limit.step
    return News("LIMITED", what, step, Tone.CAUTION)


# --- the display of one line


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
            return Segment(_stopped_line(status, view, short=short), Tone.STOP)
        case _ if view.lateness:
            return Segment(f"LATE: {view.lateness}", Tone.STOP)
        case _ if view.demands_key:
            return Segment(f"PRESS ENTER: zero in {_seconds(view)} s", Tone.CAUTION)
        case SafetyStatus.READY:
            return Segment(f"READY{who}", Tone.GOOD)
        case SafetyStatus.DRIVING:
            return Segment(f"DRIVING {_permitted(status.permitted, omega)}{who}", Tone.GOOD)
        case SafetyStatus.LIMITED:
            return Segment(f"LIMITED to {_permitted(status.permitted, omega)}{who}", Tone.CAUTION)
        case unknown:
            return Segment(f"unknown mode {unknown}", Tone.STOP)


def _stopped_line(status: SafetyStatus, view: View, *, short: bool) -> str:
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
    where = nearest_in_words(status, "°" if unicode else " deg")
    return Segment(" | "), Segment(f"{mark}{where}", tone)


def _permitted(twist: Twist, omega: str) -> str:
    return f"v {signed(twist.linear.x)} {omega} {signed(twist.angular.z)}"


def _cut(segment: Segment, width: int, end: str) -> Segment:
    return Segment(segment.text[: max(0, width - 1)] + end * (width > 0), segment.tone)
