"""The displayed values, and the elements of a display.

`View` has all values that are displayed at one time; `display.py` (one line) and `dashboard.py` (the whole terminal)
render it. It has no clock: its ages are those at its creation.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from teleop.pilots.pilot import NEUTRAL, Velocity
from teleop.pilots.vigilance import DEMAND_S
from wire.messages import LaserScan, Odometry, SafetyStatus, SourceStatus
from wire.text import bearing_in_words

# --- elements of a display


class Tone(StrEnum):
    """Meaning of a piece of text; the screen shows it as a colour, but no meaning depends on colour alone."""

    PLAIN = "plain"
    DIM = "dim"
    """Labels, frames and outdated values."""
    STRONG = "strong"
    GOOD = "good"
    CAUTION = "caution"
    STOP = "stop"
    GOOD_BANNER = "good banner"
    CAUTION_BANNER = "caution banner"
    STOP_BANNER = "stop banner"


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of a line in one tone: characters one column wide, without control characters."""

    text: str
    tone: Tone = Tone.PLAIN


Line = tuple[Segment, ...]


def columns_of(line: Line) -> int:
    return sum(len(segment.text) for segment in line)


def plain(text: str) -> str:
    """Return `text` with all characters beyond printable ASCII replaced: no control sequences, one column each."""
    return "".join(char if " " <= char <= "~" else "?" for char in text)


def nearest_in_words(status: SafetyStatus, degree: str = " deg") -> str:
    """Return distance and direction of the nearest obstacle as text, such as "0.31 m ahead"; empty if unknown."""
    if not math.isfinite(status.nearest_m):
        return ""
    return f"{status.nearest_m:.2f} m {bearing_in_words(status.nearest_bearing_rad, degree)}".rstrip()


# --- displayed values


class Control(StrEnum):
    """Control mode of the operator."""

    INCREMENTAL = "incremental"
    HOLD = "hold"
    GAMEPAD = "gamepad"
    VIEW_ONLY = "view only"


NEUTRAL_HINTS = {
    Control.INCREMENTAL: "press s",
    Control.HOLD: "let go of the keys",
    Control.GAMEPAD: "let go of the gamepad",
    Control.VIEW_ONLY: "",
}


@dataclass(frozen=True, slots=True)
class Robot:
    """Values of the supervisor's configuration for the picture: hull, lidar mount, stop and warning distance."""

    radius_m: float = 0.25
    """Radius of a round hull around the base frame's origin; not used if there are corners."""
    corners_m: tuple[tuple[float, float], ...] = ()
    """Corners of a convex hull, in the base frame."""
    lidar_x_m: float = 0.0
    lidar_y_m: float = 0.0
    lidar_yaw_rad: float = 0.0
    stop_distance_m: float = 0.30
    warning_distance_m: float = 0.50
    lidar_flip: bool = False
    """Whether the lidar is mounted upside down."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Recent rate of each stream [Hz]; NaN if not known yet."""

    status_hz: float = math.nan
    odom_hz: float = math.nan
    scan_hz: float = math.nan


@dataclass(frozen=True, slots=True)
class Event:
    """A past event for the display."""

    clock: str
    """The wall clock's time, for the operator: "12:03:41"."""
    text: str
    tone: Tone = Tone.PLAIN


@dataclass(frozen=True, slots=True)
class KeyHelp:
    """One row of the legend."""

    keys: str
    does: str


@dataclass(frozen=True, slots=True)
class View:
    """All displayed values. The age of a missing message has no meaning."""

    source: str
    endpoint: str
    """Endpoint of the supervisor."""
    control: Control = Control.INCREMENTAL
    control_note: str = ""
    """How the control works on this terminal: "hold: key releases reported by the terminal"."""
    level: int | None = None
    """Speed level, 1 to 5; None if nothing can be commanded."""
    limit: Velocity | None = None
    """Maximum of each velocity at the speed level; None if nothing can be commanded."""
    wanted: Velocity = NEUTRAL
    """The requested velocity, at the end of the ramp."""
    sent: Velocity = NEUTRAL
    """The velocity that is sent to the supervisor now."""
    most: Velocity = Velocity(1.0, 2.0)
    """Full scales of the two velocity bars."""
    status: SafetyStatus | None = None
    status_age_s: float = 0.0
    """Time since the arrival of the newest status; the other ages are defined in the same way."""
    round_trip_s: float = math.nan
    """Time from a command to the status that confirms it; infinite before the first such status; NaN if unknown."""
    lateness: str = ""
    """How late the robot answers, if it obeys so late that no motion is requested; otherwise empty."""
    vigilance_left_s: float = math.inf
    """Time until zero is sent for lack of a key; infinite where none is needed."""
    odom: Odometry | None = None
    odom_age_s: float = 0.0
    scan: LaserScan | None = None
    scan_age_s: float = 0.0
    rates: Rates = Rates()
    robot: Robot = Robot()
    events: tuple[Event, ...] = ()
    """Events, newest last."""
    keys: tuple[KeyHelp, ...] = ()
    """The most important keys, always shown if there is room."""
    help: tuple[KeyHelp, ...] = ()
    """All keys, while the help is open; otherwise empty."""

    @property
    def own(self) -> SourceStatus | None:
        """This source in the supervisor's status."""
        return None if self.status is None else self.status.source(self.source)

    @property
    def neutral_hint(self) -> str:
        """How to send neutral, as the beginning of a sentence."""
        return NEUTRAL_HINTS[self.control]

    @property
    def demands_key(self) -> bool:
        """Whether the screen asks for a key: without one, zero is sent soon."""
        return self.vigilance_left_s <= DEMAND_S

    @property
    def is_neutral(self) -> bool:
        """Whether the velocity is zero, now and at the end of the ramp."""
        return self.wanted.is_neutral and self.sent.is_neutral
