"""The part of `lifeline check` for `[ros2]`: the topics with their types, and the risks of the settings."""

from collections.abc import Iterator
from typing import NamedTuple

from rich.table import Table
from rich.text import Text

from lifeline.check.risks import Risk
from ros2.config import Ros2Section, RosSourceSection
from supervisor.config import SupervisorSection

TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


class RosTopicUse(NamedTuple):
    """One ROS 2 topic that Lifeline uses."""

    use: str
    """What it carries, such as `source joy`."""
    direction: str
    """`in`: Lifeline subscribes; `out`: Lifeline publishes."""
    topic: str
    """Its absolute name."""
    type: str
    note: str = ""


def topics_of(ros2: Ros2Section, config: SupervisorSection) -> Iterator[RosTopicUse]:
    """Yield every topic of a section that agrees with `[supervisor]`."""
    for lidar, topic in zip(config.all_lidars(), ros2.scans, strict=True):
        yield RosTopicUse(f"lidar {lidar.name}", "in", ros2.resolved(topic), "sensor_msgs/msg/LaserScan")
    yield RosTopicUse("odometry", "in", ros2.resolved(ros2.odom), "nav_msgs/msg/Odometry")
    for source in ros2.sources:
        yield RosTopicUse(
            f"source {source.name}",
            "in",
            ros2.resolved(source.topic),
            _twist(stamped=source.stamped),
            "; ".join(_notes(source, config)),
        )
    timeout = f"zero after {ros2.command_timeout_s:g} s without the supervisor"
    yield RosTopicUse("base", "out", ros2.resolved(ros2.cmd_vel), _twist(stamped=ros2.stamped), timeout)


def _twist(*, stamped: bool) -> str:
    return TWIST_STAMPED if stamped else TWIST


def _notes(source: RosSourceSection, config: SupervisorSection) -> Iterator[str]:
    if source.hold_s is not None:
        yield (
            f"held for {source.hold_s:g} s: up to {held_cm(source.hold_s, config):.0f} cm after the last key press, "
            "before it brakes"
        )
    if source.arm == "on_request":
        yield "armed by /lifeline/arm after each stop"


def held_cm(hold_s: float, config: SupervisorSection) -> float:
    """Return how far the robot drives at its maximum speed during a hold [cm]."""
    return 100.0 * hold_s * config.max_linear_m_s


def ros2_risks(ros2: Ros2Section, config: SupervisorSection) -> Iterator[Risk]:
    """Yield every risk that `[ros2]` creates."""
    if ros2.rmw == "zenoh":
        yield Risk(
            f'[ros2] rmw = "zenoh", router = "{ros2.router}"',
            "Every program that reaches the router can publish scans, odometry and commands, also to the base itself, unless the "
            "router has access control. Without the router, only the base's own timeout stops the robot.",
        )
    elif ros2.discovery_range == "subnet":
        yield Risk(
            '[ros2] discovery_range = "subnet"',
            "Any machine in this network can publish scans, odometry and commands, also to the base itself: DDS has no "
            "access control.",
        )
    default_s = Ros2Section().command_timeout_s
    if ros2.command_timeout_s > default_s:
        distance_m = config.max_linear_m_s * ros2.command_timeout_s
        yield Risk(
            f"[ros2] command_timeout_s = {ros2.command_timeout_s:g}",
            f"The base may drive {distance_m:.2f} m after the supervisor hangs.",
        )
    for source in ros2.sources:
        if source.hold_s is not None:
            yield Risk(
                f"hold_s of {source.name} = {source.hold_s:g}",
                f"The robot drives up to {held_cm(source.hold_s, config):.0f} cm after the key is released or the program "
                "hangs, and then brakes.",
            )
        if source.arm == "on_request":
            yield Risk(
                f'arm of {source.name} = "on_request"',
                "A call of /lifeline/arm moves the robot at once if the program is requesting motion.",
            )


def ros2_table(topics: tuple[RosTopicUse, ...]) -> Table:
    """Format the topics as a table for the terminal."""
    table = Table(title="ROS 2 topics", title_justify="left", box=None, padding=(0, 1, 0, 0))
    for heading in ("use", "", "topic", "type", "note"):
        table.add_column(heading, overflow="fold")
    for one in topics:
        arrow = "→" if one.direction == "out" else "←"
        table.add_row(*map(Text, (one.use, arrow, one.topic, one.type.rpartition("/")[2], one.note)))
    return table
