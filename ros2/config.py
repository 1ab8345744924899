"""The section `[ros2]` of robot.toml: the topics of a ROS 2 robot, and its command sources.

It imports nothing of ROS: the commands of `lifeline` check it too.
"""

import re
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field

from wire import tls, topics
from wire.bus_config import BusConfig
from wire.host.config import Between, BusSection, Conflict, Endpoint, Name, Section, Sections, same_endpoint

MAX_TOPIC = 128
OWN_TOPICS = {
    "/diagnostics": "Lifeline's reports",
    "/lifeline/status": "Lifeline's status",
    "/lifeline/reset": "Lifeline's reset",
    "/lifeline/arm": "Lifeline's arming",
}


def _is_topic(value: str) -> str:
    if (
        re.fullmatch(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", value) is None
        or len(value) > MAX_TOPIC
    ):
        raise ValueError(
            f"must be a ROS 2 topic such as scan or /robot/scan, with at most {MAX_TOPIC} characters"
        )
    return value


def _is_namespace(value: str) -> str:
    return value and _is_topic(value)


RosTopic = Annotated[str, AfterValidator(_is_topic)]
# A held key repeats every 30 to 50 ms, after a delay of 0.25 to 0.66 s, so no keyboard needs a hold above 1 s.
Hold = Annotated[float, Between(0.05, 1.0, "the robot drives on for this long after the key is released")]
StampChoice = Literal["base", "zero", "now"]


class RosSourceSection(Section):
    """A ROS 2 topic that commands the robot, as one of the sources of `[supervisor]`."""

    name: Name
    """One of `[supervisor] sources`."""
    topic: RosTopic
    stamped: bool = False
    """Whether its type is TwistStamped."""
    hold_s: Hold | None = None
    """How long a command is repeated for a program that publishes only on key events; then neutral."""
    clock: Literal["synchronised", "own"] = "synchronised"
    """`own`: with `stamped`, the clock of its stamps differs from this computer's; only their progress shows an age."""
    clock_limit_s: Annotated[float, Between(0.05, 10.0)] = 1.0
    """With `stamped`: a program on another host is refused if its stamps differ by more from this computer's clock."""
    arm: Literal["on_neutral", "on_request"] = "on_neutral"
    """`on_request`: for a program that never sends zero; a person calls /lifeline/arm after each stop."""

    def conflicts(self) -> Iterator[Conflict]:
        for key in ("clock", "clock_limit_s"):
            if not self.stamped and getattr(self, key) != type(self).model_fields[key].default:
                yield Conflict((key,), getattr(self, key), "needs stamped = true: a Twist has no stamp")


class Ros2Section(Section):
    """The ROS 2 side of the robot; without this section, Lifeline needs no ROS."""

    namespace: Annotated[str, AfterValidator(_is_namespace)] = ""
    domain_id: Annotated[int, Between(0, 232)] = 0
    rmw: Literal["dds", "zenoh"] = "dds"
    """`zenoh`: the nodes of the robot use rmw_zenoh_cpp."""
    router: Endpoint = "tcp/127.0.0.1:7448"
    """With `rmw = "zenoh"`: where the robot's rmw_zenohd listens."""
    discovery_range: Literal["localhost", "subnet"] = "localhost"
    scan: RosTopic | Annotated[tuple[RosTopic, ...], Field(min_length=1, max_length=4, strict=False)] = "scan"
    """One topic for each lidar of `[supervisor]`, in the same order."""
    odom: RosTopic = "odom"
    cmd_vel: RosTopic = "cmd_vel"
    stamped: bool = False
    """Whether the base listens to TwistStamped."""
    stamp: StampChoice | None = None
    """Which time is written into a TwistStamped (`ros2/base_clock.py`); None: `base` once stamped odometry is heard, before `now`."""
    frame_id: Annotated[str, Field(min_length=1, max_length=64)] = "base_link"
    """The frame of a TwistStamped."""
    command_timeout_s: Annotated[float, Between(0.02, 1.0)] = 0.15
    """Timeout of the watchdog in this process: without a fresh command of the supervisor for this long, it commands zero."""
    python: Annotated[str, Field(min_length=1)] | None = None
    """The interpreter of the environment with rclpy; default: `.ros2/bin/python` of the checkout."""
    sources: Annotated[tuple[RosSourceSection, ...], Field(max_length=8, strict=False)] = ()

    @property
    def scans(self) -> tuple[str, ...]:
        return (self.scan,) if isinstance(self.scan, str) else self.scan

    def to_router_config(self, bus: BusSection) -> BusConfig:
        """Return how the session of the robot's domain connects to its router."""
        return BusConfig(self.router, str(self.domain_id), bus.lease_s or tls.lease_s((self.router,)))

    def resolved(self, topic: str) -> str:
        """Return the absolute name of a topic."""
        if topic.startswith("/"):
            return topic
        return "/".join(["", *filter(None, [self.namespace.strip("/"), topic])])

    def conflicts(self) -> Iterator[Conflict]:
        if self.stamp is not None and not self.stamped:
            yield Conflict(("stamp",), self.stamp, "needs stamped = true: a Twist has no stamp")
        taken = {**OWN_TOPICS, self.resolved(topics.ESTOP.key): "the e-stop"}
        for path, topic in self._robots_topics():
            name = self.resolved(topic)
            if path[0] == "scan" and taken.get(name) == "scan":
                yield Conflict(path, topic, "each lidar needs a topic of its own")
            elif name in taken:
                yield Conflict(
                    path, topic, f"is already the topic of {taken[name]}, whose messages are others"
                )
            taken.setdefault(name, str(path[0]))
        for index, source in enumerate(self.sources):
            if source.name in [other.name for other in self.sources[:index]]:
                yield Conflict(("sources", index, "name"), source.name, "each source needs a name of its own")
            topic = self.resolved(source.topic)
            if topic in taken:
                message = (
                    f"is already the topic of {taken[topic]}: remap the program to a topic of its own, "
                    f"such as /{source.name}/cmd_vel"
                )
                yield Conflict(("sources", index, "topic"), source.topic, message)
            taken[topic] = f"the source {source.name}"

    def _robots_topics(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Yield the path of each key that names a topic of the robot, and the topic."""
        yield ("cmd_vel",), self.cmd_vel
        yield ("odom",), self.odom
        for index, topic in enumerate(self.scans):
            yield ("scan",) if isinstance(self.scan, str) else ("scan", index), topic


class LidarTopic(Section):
    """The wire topic of one of the supervisor's lidars; the other keys are ignored."""

    model_config = ConfigDict(extra="ignore")

    topic: str


class SupervisorValues(Section):
    """The values of `[supervisor]` that the ROS 2 process needs; the supervisor checks the section itself."""

    model_config = ConfigDict(extra="ignore")

    command_timeout_s: Annotated[float, Between(0.03, 2.0)] = 0.2
    lidars: Annotated[tuple[LidarTopic, ...], Field(strict=False)] | None = None

    @property
    def lidar_topics(self) -> tuple[str, ...]:
        return (topics.SCAN.key,) if self.lidars is None else tuple(lidar.topic for lidar in self.lidars)


def fit_to_lidars(sections: Sections) -> Iterator[Conflict]:
    """Yield a conflict if `[ros2] scan` does not name one topic for each lidar."""
    config, supervisor = sections.get(Ros2Section), sections.get(SupervisorValues)
    if config is None or supervisor is None:
        return
    lidars = len(supervisor.lidar_topics)
    if len(config.scans) != lidars:
        message = f"must name one topic for each of the {lidars} lidars of [supervisor], in the same order"
        yield Conflict(("ros2", "scan"), config.scan, message)


def apart_from_hub(sections: Sections) -> Iterator[Conflict]:
    """Yield a conflict if the robot's router and Lifeline's hub would listen on the same port."""
    config, bus = sections.get(Ros2Section), sections.get(BusSection)
    if (
        config is None
        or bus is None
        or config.rmw != "zenoh"
        or not same_endpoint(config.router, bus.endpoint)
    ):
        return
    message = (
        f"is also [bus] endpoint = {bus.endpoint!r}, where Lifeline itself listens: if rmw_zenohd listens there, give "
        "[bus] endpoint another port"
    )
    yield Conflict(("ros2", "router"), config.router, message)
