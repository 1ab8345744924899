"""The one line: what is asked for, what the supervisor makes of it and why, what to do next.

It says what is known and how old that is: a status that has not been renewed is not shown as if it held.
What comes from the network is shown as plain ASCII, so that no payload can speak to the terminal.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from teleop.setpoint import Setpoint
from wire.messages import SafetyStatus, Twist

SILENT_AFTER_S = 0.5
"""A status older than this says nothing about now; the supervisor sends ten a second."""

ELLIPSIS = "…"


class Tone(StrEnum):
    """What a part of the line means to the operator; the terminal gives it a colour."""

    PLAIN = "plain"
    GOOD = "good"
    CAUTION = "caution"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of the line in one tone."""

    text: str
    tone: Tone = Tone.PLAIN


Line = tuple[Segment, ...]


@dataclass(frozen=True, slots=True)
class View:
    """Everything that the line shows."""

    setpoint: Setpoint
    source: str
    endpoint: str
    status: SafetyStatus | None
    status_age_s: float
    """Since the newest status arrived; meaningless without one."""


REARM = "press s to re-arm"
_HINTS = {
    "NO_COMMAND": "press s to arm",
    "COMMAND_TIMEOUT": REARM,
    "COMMAND_STALE": REARM,
    "SOURCE_LOST": REARM,
    "COMMAND_INVALID": REARM,
    "OBSTACLE": "press s, or drive away from it",
    "SCAN_STALE": "wait for the lidar, press s",
    "SCAN_INVALID": "check the lidar, press s",
    "SCAN_BLIND": "no beam looks there: press s",
    "OVERRUN": REARM,
    "BASE_RUNAWAY": "cut the robot's power",
}
_UNKNOWN_HINT = "remove the cause, press s"


def hint(reason: str, setpoint: Setpoint) -> str:
    """What the operator can do about a stop reason, in a few words."""
    if reason == "ESTOP":  # its reset is refused while a source asks for motion
        return "press r to reset" if setpoint.is_neutral else "press s, then r to reset"
    return _HINTS.get(reason, _UNKNOWN_HINT)


def plain(text: str) -> str:
    """`text` with everything but printable ASCII replaced: no control sequences, one column each."""
    return "".join(char if " " <= char <= "~" else "?" for char in text)


def render(view: View, width: int) -> Line:
    """The line in at most `width` columns: what matters least goes first."""
    asked = Segment(
        f"v {_signed(view.setpoint.linear_m_s)} m/s ω {_signed(view.setpoint.angular_rad_s)} rad/s | "
    )
    news, short_news, nearest = _news(view), _news(view, short=True), _nearest(view)
    candidates: list[Line] = [(asked, news, *nearest), (asked, news), (asked, short_news), (short_news,)]
    fitting = next((line for line in candidates if _columns(line) <= width), None)
    return (_cut(short_news, width),) if fitting is None else fitting


def _news(view: View, *, short: bool = False) -> Segment:
    status = view.status
    if status is None:
        return Segment(f"waiting for the supervisor at {plain(view.endpoint)}", Tone.CAUTION)
    if view.status_age_s > SILENT_AFTER_S:
        return Segment(f"supervisor: silent for {view.status_age_s:.1f} s", Tone.STOP)
    who = f" ({plain(status.owner)} drives)" if status.owner not in ("", view.source) else ""
    match status.mode:
        case SafetyStatus.READY:
            return Segment(f"READY{who}", Tone.GOOD)
        case SafetyStatus.DRIVING:
            return Segment(f"DRIVING {_permitted(status.permitted)}{who}", Tone.GOOD)
        case SafetyStatus.LIMITED:
            return Segment(f"LIMITED to {_permitted(status.permitted)}{who}", Tone.CAUTION)
        case SafetyStatus.STOPPED:
            return Segment(_stopped(status, view.setpoint, short=short), Tone.STOP)
        case unknown:
            return Segment(f"unknown mode {unknown}", Tone.STOP)


def _stopped(status: SafetyStatus, setpoint: Setpoint, *, short: bool) -> str:
    alarm = "ALARM, " if status.alarm else ""
    if not status.reasons:
        return f"{alarm}STOPPED - {REARM}"
    first, *others = status.reasons
    names = f"{first} +{len(others)}" if short and others else ", ".join(status.reasons)
    return plain(f"{alarm}STOPPED: {names} - {hint(first, setpoint)}")


def _nearest(view: View) -> Line:
    status = view.status
    if status is None or view.status_age_s > SILENT_AFTER_S or not math.isfinite(status.nearest_m):
        return ()
    mark, tone = ("! ", Tone.CAUTION) if status.warning else ("", Tone.PLAIN)
    where = _direction(status.nearest_bearing_rad)
    return Segment(" | "), Segment(f"{mark}{status.nearest_m:.2f} m{where}", tone)


def _direction(bearing_rad: float) -> str:
    if not math.isfinite(bearing_rad):
        return ""
    quarter = round(bearing_rad / (math.pi / 2)) % 4
    return (" ahead", " left", " behind", " right")[quarter]


def _permitted(twist: Twist) -> str:
    return f"v {_signed(twist.linear.x)} ω {_signed(twist.angular.z)}"


def _signed(value: float) -> str:
    """Two decimals with a sign; zero has none, on either side of it."""
    return f"{round(value, 2) + 0.0:+.2f}" if round(value, 2) else " 0.00"


def _columns(line: Line) -> int:
    return sum(len(segment.text) for segment in line)


def _cut(segment: Segment, width: int) -> Segment:
    if len(segment.text) <= width:
        return segment
    return Segment(segment.text[: max(0, width - 1)] + ELLIPSIS * (width > 0), segment.tone)
