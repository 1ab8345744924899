"""`lifeline check`: report a configuration's lidars, stopping distance, permitted motions, ROS 2 topics and risks."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.text import Text

from deploy.stack.console import print_json
from deploy.stack.errors import DeployError
from deploy.stack.robot_file import read_robot
from deploy.stack.table import Column, Table
from lifeline.check.motions import Permitted, View, permitted_motions
from lifeline.check.proof import Risk
from lifeline.check.risks import held_cm, risks
from ros2.config import Ros2Section, RosSourceSection
from sim.config import SimSection
from supervisor.config import FULL_TURN_SLACK_RAD, NamedLidarSection, SupervisorSection
from supervisor.law.clearance import Barrier, Floats, permitted_closing_speed
from supervisor.law.decision import Decision
from supervisor.law.seen_space import hiding_distance_m
from supervisor.measured import MeasuredSection
from wire import topics
from wire.host.config import BusSection, ConfigError, read_toml
from wire.text import printable, printable_lines

EXIT_RISKS = 1

ASSUMED_BEAMS = 360
ASSUMED_RANGE_M = 12.0
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


class Stopping(NamedTuple):
    """The parts of the distance in which the robot stops from its top speed: v·T + v²/2a + d."""

    speed_m_s: float
    reaction_s: float
    reaction_m: float
    deceleration_m_s2: float
    braking_m: float
    keep_m: float

    @property
    def total_m(self) -> float:
        return self.reaction_m + self.braking_m + self.keep_m


class Hiding(NamedTuple):
    """What the gaps between a lidar's beams hide, and the closing speed that this permits."""

    lidar: str
    from_m: float
    """Distance from the lidar at which the smallest obstacle fits between two beams."""
    permits_m_s: float
    """Highest speed toward such a place ahead, by the barrier; at most the robot's own."""


class Report(NamedTuple):
    """The result of `lifeline check`."""

    config: SupervisorSection
    lidars: tuple[View, ...]
    stopping: Stopping
    passage_m: float
    """Width of the narrowest straight passage: that of the hull, and the stop distance at both sides."""
    hiding: tuple[Hiding, ...]
    motions: tuple[Permitted, ...]
    risks: tuple[Risk, ...]
    """Those that are not accepted."""
    ros2: tuple[RosTopicUse, ...] = ()
    """The topics of `[ros2]`; empty without this section."""
    accepted: tuple[Risk, ...] = ()
    """The risks that `accepted_risks` names."""
    needless: tuple[str, ...] = ()
    """What `accepted_risks` names, and what is not a risk of this file."""


def check(file: Path, *, as_json: bool = False) -> int:
    """Print the report on a file; return 1 if a setting creates a risk that is not accepted, else 0.

    Raises:
        DeployError: the configuration is refused; the message names every error.
    """
    report = examine(file)
    if as_json:
        print_json(to_json(report))
    else:
        _print(Console(), file, report)
    return EXIT_RISKS if report.risks else 0


def examine(file: Path) -> Report:
    """Read a configuration, and run the safety law on scans that its lidars would make in open space.

    Raises:
        DeployError: the configuration is refused.
    """
    try:
        sections = read_robot(read_toml(file), simulated=False)
    except ConfigError as error:
        raise DeployError(str(error)) from error
    config, sim = sections[SupervisorSection], sections.get(SimSection)
    views = tuple(_view(lidar, sim) for lidar in config.all_lidars())
    ros2, measured = sections.get(Ros2Section), sections.get(MeasuredSection)
    way = stopping(config, views, measured or MeasuredSection())
    found = tuple(risks(config, sim, sections[BusSection], ros2, measured))
    settings = {risk.setting for risk in found}
    return Report(
        config,
        views,
        way,
        passage_m(config),
        tuple(
            hiding(config, lidar, view, way) for lidar, view in zip(config.all_lidars(), views, strict=True)
        ),
        tuple(permitted_motions(config, views)),
        tuple(risk for risk in found if risk.setting not in config.accepted_risks),
        () if ros2 is None else tuple(topics_of(ros2, config)),
        tuple(risk for risk in found if risk.setting in config.accepted_risks),
        tuple(setting for setting in config.accepted_risks if setting not in settings),
    )


def _view(lidar: NamedLidarSection, sim: SimSection | None) -> View:
    """Take values from the lidar's keys, else `[sim]` (without it, the period from the profile), else assume."""
    carried = None if sim is None else next(c for c in sim.lidar_configs() if c.topic == lidar.topic)
    assumed: list[str] = []

    def first(name: str, own: float | None, of_sim: float | None, assumption: float) -> float:
        if own is None and of_sim is None:
            assumed.append(name)
        return next((value for value in (own, of_sim) if value is not None), assumption)

    scan_hz = topics.SCAN.rate_hz
    assert scan_hz is not None  # a stream has a rate
    known_s = lidar.usual_period_s() if sim is None else 1.0 / sim.scan_hz
    period_s = first("period_s", lidar.period_s, known_s, 1.0 / scan_hz)
    beams = int(first("beams", lidar.beams, None if carried is None else carried.beams, ASSUMED_BEAMS))
    known_m = None if carried is None else carried.range_max_m
    range_m = first("range_max_m", lidar.range_max_m, known_m, ASSUMED_RANGE_M)
    if lidar.view_rad is not None:
        start, end = lidar.view_rad
    else:
        span_rad = first("view_rad", None, None if carried is None else carried.span_rad, math.tau)
        start, end = -span_rad / 2, span_rad / 2
    gaps = beams if end - start > math.tau - FULL_TURN_SLACK_RAD else beams - 1
    return View(start, (end - start) / max(1, gaps), beams, range_m, period_s, tuple(assumed))


def stopping(config: SupervisorSection, views: tuple[View, ...], measured: MeasuredSection) -> Stopping:
    """Compute the stopping distance from top speed, with the oldest scan in normal operation (slowest lidar).

    Where a measured limit is worse than the configured number, it replaces it.
    """
    speed_m_s = config.max_linear_m_s
    scans_s = 2.0 * max(view.period_s for view in views) + max(
        measured.worse_latency_s(one.name, one.usual_latency_s()) for one in config.all_lidars()
    )
    deceleration_m_s2, dead_s = measured.worse_braking(config.deceleration_m_s2, config.base_dead_time_s)
    reaction_s = scans_s + config.law().late_s + dead_s - config.base_dead_time_s
    return Stopping(
        speed_m_s,
        reaction_s,
        speed_m_s * reaction_s,
        deceleration_m_s2,
        speed_m_s**2 / (2.0 * deceleration_m_s2),
        config.stop_distance_m,
    )


def passage_m(config: SupervisorSection) -> float:
    """Return the width [m] of the narrowest straight passage: the barrier keeps the stop distance at both sides."""
    corners_m, keep_m = config.footprint.corners_m, config.stop_distance_m
    if corners_m is None:
        return 2.0 * (config.footprint.hull().radius_m + keep_m)
    sides_m = [y_m for _, y_m in corners_m]
    return max(sides_m) - min(sides_m) + 2.0 * keep_m


def hiding(config: SupervisorSection, lidar: NamedLidarSection, view: View, way: Stopping) -> Hiding:
    """Return where the smallest obstacle may hide between two beams of a lidar, and the speed toward it."""
    gap_rad = np.array([view.angle_increment])
    (from_m,) = hiding_distance_m(gap_rad, config.smallest_obstacle_m).tolist()
    ahead: Floats = np.array(((1.0,), (0.0,)))
    leaves_m = config.footprint.hull().crossing(lidar.x_m, lidar.y_m, ahead).leaves_m.item()
    barrier = Barrier(config.stop_distance_m, config.deceleration_m_s2, way.reaction_s, 0.0)
    permitted_m_s = permitted_closing_speed(np.array([from_m - leaves_m]), barrier).item()
    return Hiding(lidar.name, from_m, min(config.max_linear_m_s, permitted_m_s))


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
            TWIST_STAMPED if source.stamped else TWIST,
            "; ".join(_notes(source, config)),
        )
    timeout = f"zero after {ros2.command_timeout_s:g} s without the supervisor"
    yield RosTopicUse(
        "base", "out", ros2.resolved(ros2.cmd_vel), TWIST_STAMPED if ros2.stamped else TWIST, timeout
    )


def _notes(source: RosSourceSection, config: SupervisorSection) -> Iterator[str]:
    if source.hold_s is not None:
        yield (
            f"held for {source.hold_s:g} s: up to {held_cm(source.hold_s, config):.0f} cm after the last key press, "
            "before it brakes"
        )
    if source.arm == "on_request":
        yield "armed by /lifeline/arm after each stop"


def to_json(report: Report) -> dict[str, Any]:
    """Return the report as JSON values."""
    return {
        "lidars": [
            {
                "name": lidar.name,
                "topic": lidar.topic,
                "profile": lidar.profile,
                "x_m": lidar.x_m,
                "y_m": lidar.y_m,
                "yaw_rad": lidar.yaw_rad,
                "flip": lidar.flip,
                **view._asdict(),
                "timeout_s": report.config.scan_timeout_of(lidar),
            }
            for lidar, view in zip(report.config.all_lidars(), report.lidars, strict=True)
        ],
        "stopping": report.stopping._asdict() | {"total_m": report.stopping.total_m},
        "passage_m": report.passage_m,
        "hiding": [hides._asdict() for hides in report.hiding],
        "motions": [
            {
                "motion": permitted.motion.name,
                "at_rest": _decision_json(permitted.at_rest),
                "after_driving": _decision_json(permitted.after_driving),
            }
            for permitted in report.motions
        ],
        "ros2": [topic._asdict() for topic in report.ros2],
        "risks": [risk._asdict() for risk in report.risks],
        "accepted": [risk._asdict() for risk in report.accepted],
        "needless": list(report.needless),
    }


def _decision_json(decision: Decision) -> dict[str, Any]:
    linear_m_s, angular_rad_s = decision.output
    return {
        "reasons": sorted(decision.reasons),
        "linear_m_s": linear_m_s,
        "angular_rad_s": angular_rad_s,
        "scale": decision.scale,
    }


def _print(console: Console, file: Path, report: Report) -> None:
    console.print(Text(printable(f"{file}: the configuration is valid"), style="bold green"), soft_wrap=True)
    console.print(_lidar_table(report))
    for lidar, view in zip(report.config.all_lidars(), report.lidars, strict=True):
        if view.assumed:
            keys = ", ".join(view.assumed)
            text = f"{lidar.name}: assumed {keys}; set these keys in its table, or the motions below may be wrong"
            console.print(Text(printable_lines(text), style="yellow"), soft_wrap=True)
    if report.ros2:
        console.print()
        console.print(_topic_table(report.ros2))
    way = report.stopping
    console.print(
        Text(
            f"\nFrom {way.speed_m_s:g} m/s the stopping distance is {way.total_m:.2f} m: {way.reaction_m:.2f} m of "
            f"reaction ({way.reaction_s:.2f} s: two scan periods, latency, transport and dead time), {way.braking_m:.2f} m of braking "
            f"(v²/2a, a = {way.deceleration_m_s2:g} m/s²) and {way.keep_m:.2f} m stop distance.\n"
        ),
        soft_wrap=True,
    )
    console.print(Text(printable_lines("\n".join(_limits(report)) + "\n")), soft_wrap=True)
    console.print(_motion_table(report.motions))
    required = [station.name for station in report.config.estop_stations or () if station.required]
    if required:
        text = f"Required e-stop stations: {', '.join(required)}. No motion is permitted while one of them is not heard."
        console.print(Text(printable_lines(text)), soft_wrap=True)
    for setting in report.needless:
        text = f"accepted_risks names {printable(setting)}, which is not a risk of this file: remove it"
        console.print(Text(printable_lines(text), style="yellow"), soft_wrap=True)
    if report.accepted:
        console.print(_risk_table(report.accepted, "accepted risks"))
    if report.risks:
        console.print(_risk_table(report.risks, "settings that create a risk"))
        console.print(
            "The configuration is valid. The exit code is 1 because of these risks. Correct or measure a setting, or accept its "
            "risk: list the text of its first column in \\[supervisor] accepted_risks.",
            soft_wrap=True,
        )
    elif report.accepted:
        console.print(Text("All risks are accepted.", style="green"))
    else:
        console.print(Text("No setting creates a risk that the defaults do not have.", style="green"))


def _limits(report: Report) -> Iterator[str]:
    """Yield sentences about the narrowest passage, and about each lidar whose beams are too coarse for the top speed."""
    yield (
        f"The narrowest straight passage is {report.passage_m:.2f} m wide: the hull, and {report.stopping.keep_m:g} m at both sides."
    )
    for lidar, view, hides in zip(report.config.all_lidars(), report.lidars, report.hiding, strict=True):
        if hides.permits_m_s < report.stopping.speed_m_s:
            gap = f"{view.beams} beams with {math.degrees(view.angle_increment):.2g}° between them"
            yield (
                f"{lidar.name}: between {gap}, an obstacle of {report.config.smallest_obstacle_m:g} m may hide from {hides.from_m:.2f} m "
                f"on. Toward such a place ahead, at most {hides.permits_m_s:.2f} m/s are permitted."
            )


def _lidar_table(report: Report) -> Table:
    headings = ("name", "topic", "profile", "mount x, y, yaw", "view", "beams", "range", "period", "timeout")
    table = Table(*headings, title="lidars")
    for lidar, view in zip(report.config.all_lidars(), report.lidars, strict=True):
        gaps = view.beams - 1
        table.add_row(
            lidar.name,
            lidar.topic,
            lidar.profile,
            f"{lidar.x_m:g} m, {lidar.y_m:g} m, {math.degrees(lidar.yaw_rad):.0f}°{', upside down' if lidar.flip else ''}",
            f"{math.degrees(view.angle_min):.0f}° to {math.degrees(view.angle_min + gaps * view.angle_increment):.0f}°",
            str(view.beams),
            f"{view.range_max_m:g} m",
            f"{view.period_s:.3g} s",
            f"{report.config.scan_timeout_of(lidar):g} s",
        )
    return table


def _motion_table(motions: tuple[Permitted, ...]) -> Table:
    title = "motions that the sensors permit in open space"
    table = Table("motion", "at rest", "after driving ahead", title=title)
    for permitted in motions:
        table.add_row(permitted.motion.name, _speed(permitted.at_rest), _speed(permitted.after_driving))
    return table


def _speed(decision: Decision) -> Text:
    if decision.reasons:
        return Text(printable(f"no: {', '.join(decision.reasons)}"), style="red")
    linear_m_s, angular_rad_s = decision.output
    parts = [
        f"{abs(value):.2f} {unit}" for value, unit in ((linear_m_s, "m/s"), (angular_rad_s, "rad/s")) if value
    ]
    style = "green" if decision.scale == 1.0 else "yellow"
    return Text(
        printable(f"{', '.join(parts)}{'' if decision.scale == 1.0 else f' ({decision.scale:.0%})'}"),
        style=style,
    )


def _risk_table(found: tuple[Risk, ...], title: str) -> Table:
    table = Table(Column("setting", style="yellow"), "risk", title=title)
    for risk in found:
        table.add_row(risk.setting, risk.sentence)
    return table


def _topic_table(uses: tuple[RosTopicUse, ...]) -> Table:
    table = Table("use", "", "topic", "type", "note", title="ROS 2 topics")
    for one in uses:
        arrow = "→" if one.direction == "out" else "←"
        table.add_row(one.use, arrow, one.topic, one.type.rpartition("/")[2], one.note)
    return table
