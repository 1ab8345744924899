"""Reads a complete robot.toml, and checks each section by itself and against the others."""

from collections.abc import Iterator
from typing import Any

from ros2.config import Ros2Section, apart_from_hub
from sim.config import SimSection
from supervisor.config import TICKS_IN_BASE_TIMEOUT, SupervisorSection, fit_to_base
from supervisor.law.interlock import IMPLAUSIBLE_FACTOR
from supervisor.measured import MeasuredSection
from teleop.pilots.config import TeleopSection
from wire.host.config import BusSection, Conflict, Fit, Section, Sections, read_sections

MOUNT_TOLERANCE = 0.01
"""Rounding tolerance of a mount [m or rad]."""

COMMANDS_IN_TIMEOUT = 1.5
"""With fewer command periods in the command timeout, each slightly late command stops the robot."""


def read_robot(document: dict[str, Any], *, simulated: bool) -> Sections:
    """Read and check every section of the document.

    Args:
        document: the result of `wire.host.config.read_toml`.
        simulated: whether the robot is simulated; `[sim]` then takes its defaults if the section is missing.

    Raises:
        ConfigError: a key is invalid; the message names every invalid key of all sections.
    """
    models: dict[str, type[Section]] = {
        "bus": BusSection,
        "supervisor": SupervisorSection,
        "teleop": TeleopSection,
    }
    if simulated or "sim" in document:
        models["sim"] = SimSection
    fits: list[Fit] = [fit_to_base, fit_to_supervisor, fit_to_simulation]
    if "measured" in document:
        models["measured"] = MeasuredSection
        fits.append(fit_to_measured)
    if "ros2" in document:
        models["ros2"] = Ros2Section
        fits += [fit_to_ros2, apart_from_hub]
    return read_sections(document, models, *fits)


def fit_to_measured(sections: Sections) -> Iterator[Conflict]:
    """Yield every lidar of `[measured]` that `[supervisor]` does not have."""
    config, measured = sections.get(SupervisorSection), sections.get(MeasuredSection)
    if config is None or measured is None:
        return
    names = [lidar.name for lidar in config.all_lidars()]
    for name in measured.lidars:
        if name not in names:
            message = f"there is no such lidar in [supervisor], only {', '.join(names)}: remove the table, or rename it"
            yield Conflict(("measured", "lidars", name), None, message)


def fit_to_simulation(sections: Sections) -> Iterator[Conflict]:
    """Yield every lidar of `[supervisor]` whose mount in `[sim]` differs or that `[sim]` does not have."""
    config, sim = sections.get(SupervisorSection), sections.get(SimSection)
    if config is None or sim is None:
        return
    simulated = {lidar.topic: lidar for lidar in sim.lidar_configs()}
    for path, lidar in config.lidars_with_paths():
        carried = simulated.get(lidar.topic)
        if carried is None:
            message = (
                f"no lidar of [sim] publishes there, only on {', '.join(simulated)}: add it to [[sim.lidars]]"
            )
            yield Conflict(("supervisor", *path, "topic"), lidar.topic, message)
            continue
        for key in ("x_m", "y_m", "yaw_rad"):
            value, of_sim = getattr(lidar, key), getattr(carried, key)
            if abs(value - of_sim) > MOUNT_TOLERANCE:
                message = (
                    f"but the lidar of [sim] on {lidar.topic} is at {of_sim:g}, so obstacles would be seen in "
                    "the wrong place: give [sim] the same mount, or start a real robot with `lifeline up --no-sim --config FILE`"
                )
                yield Conflict(("supervisor", *path, key), value, message)
        if carried.beams < lidar.min_beams:
            message = f"is more than the {carried.beams} beams of this lidar in [sim], so every scan would be refused"
            yield Conflict(("supervisor", *path, "min_beams"), lidar.min_beams, message)


def fit_to_supervisor(sections: Sections) -> Iterator[Conflict]:
    """Yield every conflict of `[teleop]` with `[supervisor]` that would stop the robot."""
    config, teleop = sections.get(SupervisorSection), sections.get(TeleopSection)
    if config is None or teleop is None:
        return
    for key in ("max_linear_m_s", "max_angular_rad_s"):
        limit, most = getattr(config, key), getattr(teleop, key)
        if most > IMPLAUSIBLE_FACTOR * limit:
            message = (
                f"is more than {IMPLAUSIBLE_FACTOR:g} times [supervisor] {key} = {limit:g}, which stops the robot as "
                f"COMMAND_INVALID: set at most {limit:g}"
            )
            yield Conflict(("teleop", key), most, message)
    least_s = COMMANDS_IN_TIMEOUT / teleop.rate_hz
    if config.command_timeout_s < least_s:
        message = (
            f"must be at least {COMMANDS_IN_TIMEOUT:g} periods of [teleop] rate_hz = {teleop.rate_hz:g}, or the robot "
            f"stops whenever a command is slightly late: set {least_s:.4g}, or a higher rate_hz"
        )
        yield Conflict(("supervisor", "command_timeout_s"), config.command_timeout_s, message)


def fit_to_ros2(sections: Sections) -> Iterator[Conflict]:
    """Yield every value of `[ros2]` that contradicts `[supervisor]` or `[teleop]`."""
    ros2, config, teleop = (
        sections.get(Ros2Section),
        sections.get(SupervisorSection),
        sections.get(TeleopSection),
    )
    if ros2 is None or config is None:
        return
    yield from _sources(ros2, config, teleop)
    lidars = [lidar.name for lidar in config.all_lidars()]
    if len(ros2.scans) != len(lidars):
        message = (
            f"must name one topic for each lidar of [supervisor], in the same order: there "
            f"{'is' if len(lidars) == 1 else 'are'} {len(lidars)} ({', '.join(lidars)})"
        )
        value = ros2.scan if isinstance(ros2.scan, str) else list(ros2.scan)
        yield Conflict(("ros2", "scan"), value, message)
    least_s = TICKS_IN_BASE_TIMEOUT / config.tick_hz
    if ros2.command_timeout_s < least_s:
        message = (
            f"must be at least {TICKS_IN_BASE_TIMEOUT:g} ticks of [supervisor] tick_hz = {config.tick_hz:g}, or the "
            f"base stops between two commands: set {least_s:.4g}"
        )
        yield Conflict(("ros2", "command_timeout_s"), ros2.command_timeout_s, message)


def _sources(
    ros2: Ros2Section, config: SupervisorSection, teleop: TeleopSection | None
) -> Iterator[Conflict]:
    known = [source.name for source in config.sources]
    for index, source in enumerate(ros2.sources):
        path = ("ros2", "sources", index, "name")
        if source.name not in known:
            message = (
                f"is none of [supervisor] sources, which are {', '.join(known)}: use one of them, or add it there "
                "with a priority"
            )
            yield Conflict(path, source.name, message)
        elif teleop is not None and source.name == teleop.source:
            message = (
                "is the source of the keyboard, [teleop] source: choose another one, such as joy, or add one to "
                "[supervisor] sources"
            )
            yield Conflict(path, source.name, message)
