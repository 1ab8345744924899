"""Checks `[ros2]` against the other sections of a robot.toml; imported only if the file has the section."""

from collections.abc import Iterator

from ros2.config import Ros2Section
from supervisor.config import TICKS_IN_BASE_TIMEOUT, SupervisorSection
from teleop.config import TeleopSection
from wire.host.config import Conflict, Sections


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
