"""The rows of `lifeline watch`: the state of each robot at a moment, as a table and as JSON lines."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from deploy.stack.formatting import (
    COLOURS,
    HEARD_LIMIT_S,
    mode_name,
    nearest,
    number,
    speed,
    status_json,
)
from wire.messages import Odometry, SafetyStatus, Twist
from wire.text import printable

LINE_PERIOD_S = 0.85
"""Maximum time between two JSON lines of a robot; with the update period (0.1 s) added, it is still below 1 s."""

COLUMNS = ("robot", "mode", "reasons", "owner", "speed", "nearest", "link")
FLEET_WIDTHS = {"nearest": len("12.31 m, 103°"), "link": len("no supervisor")}
"""They leave the longest stop reason its width in 80 columns."""
NOTHING = "–"
NO_SUPERVISOR = "no supervisor"


@dataclass(slots=True)
class Watched:
    """The last messages of one robot; times are arrival times by the monotonic clock [s]."""

    namespace: str
    endpoint: str
    since_s: float
    """When the watch began."""
    status: SafetyStatus | None = None
    status_s: float = 0.0
    odometry: Odometry | None = None
    odometry_s: float = 0.0
    problem: str = ""
    """Why no connection is possible; empty if it is."""


class Row(NamedTuple):
    """One robot at one moment; `status` and `twist` are None if they are missing or outdated."""

    namespace: str
    endpoint: str
    status: SafetyStatus | None
    twist: Twist | None
    status_age_s: float | None
    """None: no status was heard yet."""
    link: str

    @property
    def mode(self) -> str | None:
        return None if self.status is None else mode_name(self.status)


def row_at(robot: Watched, now_s: float) -> Row:
    """Return the row of a robot at `now_s`; values older than `HEARD_LIMIT_S` count as unknown."""
    age_s = None if robot.status is None else max(0.0, now_s - robot.status_s)
    heard = age_s is not None and age_s <= HEARD_LIMIT_S
    recent = robot.odometry is not None and now_s - robot.odometry_s <= HEARD_LIMIT_S
    return Row(
        namespace=robot.namespace,
        endpoint=robot.endpoint,
        status=robot.status if heard else None,
        twist=robot.odometry.twist.twist if robot.odometry is not None and recent else None,
        status_age_s=age_s,
        link=_link(robot, age_s, now_s),
    )


def _link(robot: Watched, age_s: float | None, now_s: float) -> str:
    """Describe the connection: the age of the last status, or that no supervisor answers."""
    if age_s is not None:
        return f"{age_s:.1f} s" if age_s <= HEARD_LIMIT_S else f"{NO_SUPERVISOR} for {age_s:.0f} s"
    if robot.problem:
        return printable(robot.problem)
    return NO_SUPERVISOR if now_s - robot.since_s > HEARD_LIMIT_S else "connecting"


def to_json(row: Row, unix_time_s: float) -> str:
    """Format a row as one line of JSON; unknown values are null."""
    document: dict[str, Any] = {
        "unix_time_s": round(unix_time_s, 3),
        "robot": f"{row.namespace}@{row.endpoint}",
        "namespace": row.namespace,
        "endpoint": row.endpoint,
        "up": row.status is not None,
        **status_json(row.status, row.twist),
        "status_age_s": number(row.status_age_s),
        "link": row.link,
    }
    return json.dumps(document)


def cells(row: Row) -> tuple[str, ...]:
    """Return the text of each of `COLUMNS`, without control characters."""
    robot = f"{row.namespace}@{row.endpoint}"
    velocity = speed(row.twist) if row.twist else NOTHING
    if row.status is None:
        return robot, NOTHING, NOTHING, NOTHING, velocity, NOTHING, row.link
    return (
        robot,
        row.mode or NOTHING,
        printable(row.status.why()) or NOTHING,
        printable(row.status.owner) or NOTHING,
        velocity,
        nearest(row.status.nearest_m, row.status.nearest_bearing_rad),
        row.link,
    )


def table(rows: Iterable[Row], shared_endpoint: str | None = None) -> Table:
    """Format the rows as a table for the terminal.

    Args:
        rows: one of each robot.
        shared_endpoint: of a fleet, of which no odometry is received: the title names it, and no speed is shown.
    """
    page, columns = Table(), COLUMNS
    if shared_endpoint is not None:
        title = Text(f"robots at {shared_endpoint}")
        page = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
        columns = tuple(name for name in COLUMNS if name != "speed")
    for name in columns:
        page.add_column(
            name, overflow="fold", max_width=None if shared_endpoint is None else FLEET_WIDTHS.get(name)
        )
    for row in rows:
        texts = {name: Text(text) for name, text in zip(COLUMNS, cells(row), strict=True)}
        if shared_endpoint is not None:
            texts["robot"] = Text(row.namespace)
        if row.status is None:
            texts["link"].stylize("bold red")
        elif row.mode is not None:
            texts["mode"].stylize(COLOURS[row.mode])
        page.add_row(*(texts[name] for name in columns))
    return page


class Lines:
    """Decides when a robot's row is printed as a line: on a change of its status, and once per period.

    Args:
        began_s: when the watch began; without a status, the first line is due one period later.
    """

    def __init__(self, began_s: float) -> None:
        self._printed_s = began_s
        self._state: object = _state(None)

    def due(self, row: Row, now_s: float) -> bool:
        """Return whether the row must be printed now; the caller then prints it."""
        state = _state(row.status)
        if state == self._state and now_s - self._printed_s < LINE_PERIOD_S:
            return False
        self._printed_s, self._state = now_s, state
        return True


def _state(status: SafetyStatus | None) -> object:
    """Return the part of a status that changes only with a decision, unlike distances and velocities."""
    if status is None:
        return None
    return status.mode, *status.causes_and_latched(), status.owner, status.warning, status.alarm
