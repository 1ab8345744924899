"""The configuration of the law for a recording: the robot's own, or assumptions that the page names."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from deploy.stack.errors import DeployError
from deploy.stack.robot_file import read_robot
from recordings.judge.choice import Chosen
from recordings.judge.source import BlackBoxSource, Source
from supervisor.config import SupervisorSection, is_base_known
from supervisor.law.lidar import PROFILES
from supervisor.law.model import LawConfig
from supervisor.law.scan import Lidar, Mount
from wire.host.config import ConfigError, read_toml

RATED_MESSAGES = 20
"""Messages of a topic that show its period."""
RATED_AT_MOST = 20_000
PERIODS_IN_TIMEOUT = 1.5
LONGEST_TIMEOUT_S = 3.0


class Own(NamedTuple):
    """The robot's own configuration."""

    law: LawConfig
    lidars: list[str]
    """The topics of the lidars, below the namespace."""


def read_own(path: Path) -> Own:
    """Read the configuration of a robot.

    Raises:
        DeployError: the file is refused.
    """
    try:
        document = read_toml(path)
        section = read_robot(document, simulated=False)[SupervisorSection]
    except ConfigError as error:
        raise DeployError(str(error)) from error
    law = section.law(is_base_known=is_base_known(document))
    return Own(law, [lidar.topic for lidar in section.all_lidars()])


def law_of(source: Source, chosen: Chosen, own: Own | None) -> tuple[LawConfig, tuple[str, ...]]:
    """Return the configuration of the law, and a text for each part of it that is assumed."""
    if own is not None:
        return replace(own.law, odometry=own.law.odometry and chosen.odom is not None), ()
    if isinstance(source, BlackBoxSource):
        return source.law, ()
    law = SupervisorSection().law()
    if chosen.status is not None:
        return law, ("the default configuration; name the robot's own with --config",)
    periods_s = _periods_s(source, chosen)
    timeout_s = law.lidars[0].timeout_s
    lidars = tuple(
        Lidar(name, Mount(), PROFILES["rep117"], _fitting_s(timeout_s, periods_s.get(name)))
        for name in chosen.scans
    )
    odom_s = _fitting_s(law.odom_timeout_s, periods_s.get(chosen.odom or ""))
    law = replace(law, lidars=lidars or law.lidars, odometry=chosen.odom is not None, odom_timeout_s=odom_s)
    assumed = [
        f"round hull of {law.hull.radius_m:g} m; stop distance {law.stop_distance_m:g} m",
        f"limits {law.max_linear_m_s:g} m/s and {law.max_angular_rad_s:g} rad/s",
        f"the base brakes with {law.deceleration_m_s2:g} m/s² without a dead time",
        f"command timeout {law.command_timeout_s:g} s",
        *(
            f"lidar {one.name}: in the centre, not turned, REP 117, timeout {one.timeout_s:.2g} s"
            for one in lidars
        ),
    ]
    if chosen.cmd_vel is None and chosen.odom is not None:
        assumed.append("no commands are recorded: the motion that odometry shows counts as commanded")
    if chosen.odom is None:
        assumed.append("no odometry is recorded: the base moves as commanded")
    return law, tuple(assumed)


def _periods_s(source: Source, chosen: Chosen) -> dict[str, float]:
    """Return the median period of the scans and of odometry, by the first messages of the recording."""
    wanted = [name for name in (*chosen.scans, chosen.odom) if name is not None]
    times_ns: dict[str, list[int]] = {name: [] for name in wanted}
    with closing(source.messages(wanted)) as messages:
        for number, message in enumerate(messages):
            times_ns[message.topic].append(message.log_time_ns)
            enough = all(len(times) >= RATED_MESSAGES for times in times_ns.values())
            if enough or number > RATED_AT_MOST:
                break
    rated = {name: np.diff(times) for name, times in times_ns.items() if len(times) > 1}
    return {name: float(np.median(between)) / 1e9 for name, between in rated.items()}


def _fitting_s(timeout_s: float, period_s: float | None) -> float:
    """Return a timeout, or a longer one if messages of this period need it."""
    return min(max(timeout_s, PERIODS_IN_TIMEOUT * (period_s or 0.0)), LONGEST_TIMEOUT_S)
