"""Views of a robot for the tests of the displays."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from teleop.pilots.pilot import Velocity
from teleop.screen.view import Event, KeyHelp, Line, Rates, View
from wire.messages import LaserScan, Odometry, SafetyStatus, SourceStatus, header, odometry
from wire.reasons import StopReason

REASONS = tuple(reason.value for reason in StopReason)


def source(name: str, priority: int = 100, *, armed: bool = True, age_s: float = 0.03) -> SourceStatus:
    return SourceStatus(
        name=name,
        priority=priority,
        liveliness=SourceStatus.ALIVE,
        armed=armed,
        neutral=True,
        stamped=True,
        age_s=age_s,
        reasons=[],
        accepted=1,
        refused_late=0,
        refused_sequence=0,
        refused_epoch=0,
        refused_invalid=0,
    )


def status(mode: int = SafetyStatus.READY, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - any field of the status
    fields = {"sources": [source("teleop"), source("joy", 90)], "owner": "teleop"} | fields
    return SafetyStatus(header("base_link", 0), mode=mode, **fields)


def stopped(*reasons: str, **fields: Any) -> SafetyStatus:  # noqa: ANN401 - likewise
    return status(SafetyStatus.STOPPED, reasons=list(reasons), **fields)


def over(*reasons: str, causes: tuple[str, ...] = (), **fields: Any) -> SafetyStatus:  # noqa: ANN401 - likewise
    """A stop with `causes`, which hold, and `reasons`, which have ended."""
    return stopped(*causes, *reasons, causes=list(causes), latched=list(reasons), **fields)


def scan_of(
    ranges: npt.ArrayLike, angle_min_rad: float, increment_rad: float, range_min_m: float, range_max_m: float
) -> LaserScan:
    """A scan with this geometry and these limits."""
    readings, none = np.asarray(ranges, np.float32), np.empty(0, np.float32)
    head = header("lidar", 0)
    return LaserScan(
        head, angle_min_rad, 0.0, increment_rad, 0.0, 0.05, range_min_m, range_max_m, readings, none
    )


def odom_of(x_m: float, y_m: float, yaw_rad: float, linear_m_s: float, angular_rad_s: float) -> Odometry:
    """Odometry; an infinite yaw counts as NaN, because no orientation has it."""
    yaw_rad = yaw_rad if math.isfinite(yaw_rad) else math.nan
    return odometry((x_m, y_m, yaw_rad), (linear_m_s, angular_rad_s))


def room(ahead_m: float, left_m: float, behind_m: float, right_m: float, beams: int = 360) -> LaserScan:
    """A scan from within four walls, counter-clockwise from straight behind."""
    angles = -math.pi + np.arange(beams) * math.tau / beams
    with np.errstate(divide="ignore"):
        x = np.where(np.cos(angles) > 0.0, ahead_m, behind_m) / np.abs(np.cos(angles))
        y = np.where(np.sin(angles) > 0.0, left_m, right_m) / np.abs(np.sin(angles))
    return scan_of(np.minimum(x, y), -math.pi, math.tau / beams, 0.1, 12.0)


KEYS = (KeyHelp("w / x", "forward / backward"), KeyHelp("SPACE", "emergency stop"), KeyHelp("q", "quit"))
EVENTS = (Event("12:03:41", "emergency stop"), Event("12:03:44", "reset done"))


def driving(newest: SafetyStatus | None = None, **fields: Any) -> View:  # noqa: ANN401 - any field of the view
    """A View with complete, fresh data, except for `fields`."""
    everything: dict[str, Any] = {
        "status": status(SafetyStatus.DRIVING) if newest is None else newest,
        "wanted": Velocity(0.5, -0.4),
        "sent": Velocity(0.4, -0.3),
        "odom": odom_of(1.25, -0.5, math.pi / 2, 0.29, -0.23),
        "scan": room(1.0, 1.2, 1.6, 2.0),
        "rates": Rates(10.0, 50.0, 20.0),
        "keys": KEYS,
        "events": EVENTS,
        "level": 3,
        "control_note": "each press is a step",
    }
    return View("teleop", "tcp/127.0.0.1:7447", **(everything | fields))


def text(line: Line) -> str:
    return "".join(segment.text for segment in line)
