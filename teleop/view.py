"""What every display shows, and what a display is made of.

`View` is everything that the operator is shown at one moment; `display.py` (one line) and `dashboard.py` (the
whole terminal) both draw it. It holds no clock: the ages are those at the moment when it was made.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from teleop.pilot import NEUTRAL, Velocity
from wire.messages import LaserScan, Odometry, SafetyStatus, SourceStatus, yaw_of

# --- what a display is made of


class Tone(StrEnum):
    """What a piece of text means to the operator; the screen gives it a colour, and no meaning hangs on that alone."""

    PLAIN = "plain"
    DIM = "dim"
    """Labels, frames, and what is too old to hold."""
    STRONG = "strong"
    GOOD = "good"
    CAUTION = "caution"
    STOP = "stop"
    GOOD_BANNER = "good banner"
    CAUTION_BANNER = "caution banner"
    STOP_BANNER = "stop banner"


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of a line in one tone: characters of one column each, none of them a control character."""

    text: str
    tone: Tone = Tone.PLAIN


Line = tuple[Segment, ...]


def columns_of(line: Line) -> int:
    return sum(len(segment.text) for segment in line)


def plain(text: str) -> str:
    """`text` with everything but printable ASCII replaced: no control sequences, one column each."""
    return "".join(char if " " <= char <= "~" else "?" for char in text)


# --- what the operator is shown


class Control(StrEnum):
    """How the operator drives."""

    INCREMENTAL = "incremental"
    HOLD = "hold"
    GAMEPAD = "gamepad"
    VIEW_ONLY = "view only"


@dataclass(frozen=True, slots=True)
class Odom:
    """Where the robot says it is, in its odometry's frame, and how it moves."""

    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float

    @staticmethod
    def of(message: Odometry) -> "Odom":
        pose, twist = message.pose.pose, message.twist.twist
        yaw_rad = yaw_of(pose.orientation)
        return Odom(pose.position.x, pose.position.y, yaw_rad, twist.linear.x, twist.angular.z)


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of the lidar, in its own frame; what is not within [range_min_m, range_max_m] is no point."""

    ranges_m: npt.NDArray[np.float32]
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float

    @staticmethod
    def of(message: LaserScan) -> "Scan":
        return Scan(
            message.ranges,
            message.angle_min,
            message.angle_increment,
            message.range_min,
            message.range_max,
        )


@dataclass(frozen=True, slots=True)
class Robot:
    """What of the supervisor's configuration a picture needs: the hull, the lidar's mount, the two distances."""

    radius_m: float = 0.25
    """Of a round hull about the base frame's origin; not used where there are corners."""
    corners_m: tuple[tuple[float, float], ...] = ()
    """Of a convex hull, in the base frame."""
    lidar_x_m: float = 0.0
    lidar_y_m: float = 0.0
    lidar_yaw_rad: float = 0.0
    stop_distance_m: float = 0.30
    warning_distance_m: float = 0.50


@dataclass(frozen=True, slots=True)
class Rates:
    """How often each stream arrived of late [Hz]; NaN where that is not known yet."""

    status_hz: float = math.nan
    odom_hz: float = math.nan
    scan_hz: float = math.nan


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened, kept for a while."""

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
    """Everything that a display shows. An age means nothing where there is no message."""

    source: str
    endpoint: str
    """Of the supervisor."""
    control: Control = Control.INCREMENTAL
    control_note: str = ""
    """How the control works here: "hold: key releases reported by the terminal"."""
    neutral_hint: str = "press s"
    """How to be neutral, as the beginning of a sentence: "press s", "let go of the keys"."""
    level: int = 1
    """Of speed, 1 to 5."""
    wanted: Velocity = NEUTRAL
    """Where the ramp goes."""
    sent: Velocity = NEUTRAL
    """What is asked of the supervisor now."""
    max_linear_m_s: float = 1.0
    max_angular_rad_s: float = 2.0
    """The ends of the bars."""
    status: SafetyStatus | None = None
    status_age_s: float = 0.0
    """Since the newest arrived, as are the other ages."""
    odom: Odom | None = None
    odom_age_s: float = 0.0
    scan: Scan | None = None
    scan_age_s: float = 0.0
    rates: Rates = Rates()
    robot: Robot = Robot()
    events: tuple[Event, ...] = ()
    """The newest last."""
    keys: tuple[KeyHelp, ...] = ()

    @property
    def own(self) -> SourceStatus | None:
        """This source as the supervisor sees it."""
        sources = () if self.status is None else self.status.sources
        return next((source for source in sources if source.name == self.source), None)

    @property
    def is_neutral(self) -> bool:
        """Nothing is asked for, now and at the end of the ramp."""
        return self.wanted.is_neutral and self.sent.is_neutral
