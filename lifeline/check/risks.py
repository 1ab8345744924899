"""Finds the settings of a valid configuration that create a risk, and explains each risk."""

import math
from collections.abc import Iterator

from lifeline.check.proof import Risk, unproven
from ros2.config import Ros2Section
from supervisor.config import NamedLidarSection, SupervisorSection
from supervisor.measured import MeasuredSection
from wire.host.config import BaseSection, BusSection
from wire.tls import is_loopback

NO_MARGIN_SHARE = 0.9
"""A deceleration above this fraction of the base's braking leaves no margin for load, slope and floor."""


def risks(
    config: SupervisorSection,
    base: BaseSection | None,
    bus: BusSection,
    ros2: Ros2Section | None,
    measured: MeasuredSection | None = None,
) -> Iterator[Risk]:
    """Yield every risk of a valid configuration.

    Args:
        config: the section `[supervisor]`.
        base: the section `[sim]`; None for a real base, whose numbers are not in the file.
        bus: the section `[bus]`.
        ros2: the section `[ros2]`; None without it.
        measured: the section `[measured]`; None without it.
    """
    yield from _of_bus(bus)
    yield from _of_stop_distance(config)
    yield from _of_timeouts(config, base)
    for lidar in config.all_lidars():
        yield from _of_lidar(config, lidar)
    yield from _of_unseen_space(config)
    yield from _of_base(config, base)
    yield from unproven(config, measured, is_real=base is None)
    if ros2 is not None:
        yield from _of_ros2(ros2, config)


def _of_bus(bus: BusSection) -> Iterator[Risk]:
    takes_part = bus.without_certificate == "participant"
    if not is_loopback(bus.endpoint) and bus.endpoint.startswith("tcp/"):
        may = (
            "publish commands and sensor data, and read every message" if takes_part else "read every message"
        )
        yield Risk(
            f'[bus] endpoint = "{bus.endpoint}"', f"Any client that can connect to this port can {may}."
        )
    elif takes_part and bus.endpoint.startswith("tcp/"):
        yield Risk(
            '[bus] without_certificate = "participant"',
            "Every user of this machine can publish commands and sensor data.",
        )


def _of_stop_distance(config: SupervisorSection) -> Iterator[Risk]:
    if config.stop_distance_m < (default_m := SupervisorSection().stop_distance_m):
        yield Risk(
            f"stop_distance_m = {config.stop_distance_m:g}",
            f"The hull may come within {config.stop_distance_m:g} m of a person instead of {default_m:g} m; sensor and "
            "base errors reduce this distance further.",
        )


def _of_timeouts(config: SupervisorSection, base: BaseSection | None) -> Iterator[Risk]:
    default = SupervisorSection()
    for key, what in (
        ("command_timeout_s", "after the operator's program hangs"),
        ("overrun_s", "while the supervisor hangs"),
        ("odom_timeout_s", "on the last odometry"),
    ):
        value = getattr(config, key)
        if value > getattr(default, key):
            yield Risk(f"{key} = {value:g}", f"The robot may drive {_way(config, value)} m {what}.")
    if base is not None and base.command_timeout_s > BaseSection().command_timeout_s:
        yield _of_slow_base("sim", base.command_timeout_s, config)


def _of_slow_base(section: str, timeout_s: float, config: SupervisorSection) -> Risk:
    return Risk(
        f"[{section}] command_timeout_s = {timeout_s:g}",
        f"The base may drive {_way(config, timeout_s)} m after the supervisor hangs.",
    )


def _way(config: SupervisorSection, seconds: float) -> str:
    return f"{config.max_linear_m_s * seconds:.2f}"


def _of_lidar(config: SupervisorSection, lidar: NamedLidarSection) -> Iterator[Risk]:
    timeout_s = config.scan_timeout_of(lidar)
    if timeout_s > SupervisorSection().scan_timeout_s:
        yield Risk(
            f"timeout of {lidar.name} = {timeout_s:g}",
            f"The robot may drive {_way(config, timeout_s)} m on the last scan after the lidar fails.",
        )
    profile = lidar.readings()
    if profile.silence_limit_s < math.inf:  # a beam must have returned a distance recently
        return
    names = [
        name
        for name, is_free in (
            ("0.0", profile.zero_is_free),
            ("NaN", profile.nan_is_free),
            (f"below {profile.codes_below_m:g} m", profile.codes_below_m > 0.0),
            (", ".join(f"{code:g}" for code in profile.free_codes_m), bool(profile.free_codes_m)),
        )
        if is_free
    ]
    if names:
        yield Risk(
            f'profile of {lidar.name} = "{lidar.profile}"',
            f'Readings of {", ".join(names)} count as "nothing there" without proof: dirt on the lidar, or an object '
            "that does not reflect, looks like free space.",
        )


def _of_unseen_space(config: SupervisorSection) -> Iterator[Risk]:
    if config.works_in_the_open:
        yield Risk(
            "works_in_the_open = true",
            f"A covered lidar looks like open space, in which the robot drives at up to {config.open_m_s:g} m/s.",
        )
    if config.blind_creep_m_s > 0.0:
        yield Risk(
            f"blind_creep_m_s = {config.blind_creep_m_s:g}",
            f"The hull may touch an obstacle that no beam sees, at up to {config.blind_creep_m_s:g} m/s.",
        )
    if config.unseen_memory_s > 0.0:
        yield Risk(
            f"unseen_memory_s = {config.unseen_memory_s:g}",
            f"A person may have entered space that was last seen up to {config.unseen_memory_s:g} s ago, and the robot "
            "may drive there.",
        )
    if config.smallest_obstacle_m > (default_m := SupervisorSection().smallest_obstacle_m):
        yield Risk(
            f"smallest_obstacle_m = {config.smallest_obstacle_m:g}",
            f"The robot may hit objects between {default_m:g} and {config.smallest_obstacle_m:g} m wide, such as a "
            "table leg, that stand between two beams.",
        )


def _of_base(config: SupervisorSection, base: BaseSection | None) -> Iterator[Risk]:
    if not config.odometry:
        yield Risk(
            "odometry = false",
            "A base that moves without a command or ignores commands is not detected, and neither is a frozen scan while the base "
            "moves without a command.",
        )
    if base is not None and config.deceleration_m_s2 > NO_MARGIN_SHARE * base.braking_m_s2:
        yield Risk(
            f"deceleration_m_s2 = {config.deceleration_m_s2:g}",
            f"The base brakes with {base.braking_m_s2:g} m/s² ([sim] braking_m_s2), which leaves no margin for load, "
            "slope and floor.",
        )


def _of_ros2(ros2: Ros2Section, config: SupervisorSection) -> Iterator[Risk]:
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
    if ros2.command_timeout_s > Ros2Section().command_timeout_s:
        yield _of_slow_base("ros2", ros2.command_timeout_s, config)
    if ros2.stamp == "now":
        yield Risk(
            '[ros2] stamp = "now"',
            "If the base's clock is behind this computer's, its own timeout stops the robot later by the difference.",
        )
    for source in ros2.sources:
        if source.hold_s is not None:
            yield Risk(
                f"hold_s of {source.name} = {source.hold_s:g}",
                f"The robot drives up to {held_cm(source.hold_s, config):.0f} cm after the key is released or the program "
                "hangs, and then brakes.",
            )
        if source.clock == "own":
            yield Risk(
                f'clock of {source.name} = "own"',
                "A command that is old by a constant time moves the robot: only the progress of its stamps is judged.",
            )
        if source.arm == "on_request":
            yield Risk(
                f'arm of {source.name} = "on_request"',
                "A call of /lifeline/arm moves the robot at once if the program is requesting motion.",
            )


def held_cm(hold_s: float, config: SupervisorSection) -> float:
    """Return how far the robot drives at its maximum speed during a hold [cm]."""
    return 100.0 * hold_s * config.max_linear_m_s
