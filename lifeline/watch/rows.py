"""The rows of `lifeline watch`: the state of each robot at a moment, as a table and as JSON lines."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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
from deploy.stack.table import Column, Table
from wire import topics
from wire.messages import Odometry, SafetyStatus, Twist
from wire.reasons import StopReason
from wire.text import printable

LINE_PERIOD_S = 0.85
"""Maximum time between two JSON lines of a robot; with the update period (0.1 s) added, it is still below 1 s."""

NOTHING = "–"
NO_SUPERVISOR = "no supervisor"
LONGEST_REASON = max(map(len, StopReason)) + len(",")
COLUMNS = (
    Column("robot"),
    Column("mode", len("STOPPED"), len("STOPPED")),
    Column("owner"),
    Column("speed", len("-0.52 rad/s"), len("-0.31 m/s, -0.52 rad/s")),
    Column("nearest", len("12.31 m, at"), len("12.31 m, at 103° right")),
    Column("link", len(NO_SUPERVISOR), len(NO_SUPERVISOR)),
    Column("reasons", LONGEST_REASON, LONGEST_REASON),
)
"""Their widths do not depend on the values, so that a live table does not jump; that of `owner` is set by `table`."""


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
    robot = printable(f"{row.namespace}@{row.endpoint}")
    velocity = speed(row.twist) if row.twist else NOTHING
    if row.status is None:
        return robot, NOTHING, NOTHING, velocity, NOTHING, row.link, NOTHING
    return (
        robot,
        row.mode or NOTHING,
        printable(row.status.owner) or NOTHING,
        velocity,
        nearest(row.status.nearest_m, row.status.nearest_bearing_rad),
        row.link,
        printable(row.status.why()) or NOTHING,
    )


def table(rows: Sequence[Row], shared_endpoint: str | None = None) -> Table:
    """Format the rows as a table for the terminal.

    Args:
        rows: one of each robot.
        shared_endpoint: of a fleet, of which no odometry is received: the title names it, and no speed is shown.
    """
    sources = [source.name for row in rows if row.status is not None for source in row.status.sources]
    owner = max(map(len, [topics.TELEOP, *sources]))
    columns = {column.name: column for column in COLUMNS} | {"owner": Column("owner", owner, owner)}
    if shared_endpoint is not None:
        del columns["speed"]
    page = Table(*columns.values(), title="" if shared_endpoint is None else f"robots at {shared_endpoint}")
    for row in rows:
        texts = {column.name: Text(printable(text)) for column, text in zip(COLUMNS, cells(row), strict=True)}
        if shared_endpoint is not None:
            texts["robot"] = Text(printable(row.namespace))
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
