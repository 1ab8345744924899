"""Check that `[supervisor]` trusts the base only with what `[sim]` of the same file says that it can do."""

from collections.abc import Iterator

from supervisor.config import PERIODS_IN_TIMEOUT, SupervisorSection
from wire.host.config import BaseSection, Conflict, Sections

TICKS_IN_BASE_TIMEOUT = 2.0


def fit_to_base(sections: Sections) -> Iterator[Conflict]:
    """Yield a conflict for each value of `[supervisor]` that is unsafe or useless with the values of `[sim]`."""
    config, base = sections.get(SupervisorSection), sections.get(BaseSection)
    if config is None or base is None:
        return
    yield from _motion(config, base)
    yield from _timing(config, base)
    for index, lidar in enumerate(config.all_lidars()):
        path = ("supervisor", *(("lidars", index) if config.lidars is not None else ("lidar",)))
        for key, value, message in config.conflicts_of_period(path[1:], lidar, 1.0 / base.scan_hz):
            yield Conflict(("supervisor", *key), value, f"[sim] scan_hz = {base.scan_hz:g}: {message}")


def _motion(config: SupervisorSection, base: BaseSection) -> Iterator[Conflict]:
    trusted = config.deceleration_m_s2
    if trusted > base.braking_m_s2:
        yield _more_than(config, "deceleration_m_s2", "braking_m_s2", base.braking_m_s2)
    # On an arc, the rim of the hull must stop as fast as its centre.
    rim = base.angular_braking_rad_s2 * (radius_m := config.footprint.hull().radius_m)
    if trusted > rim:
        message = (
            f"is more than the {rim:.3g} m/s² that result from [sim] angular_braking_rad_s2 = {base.angular_braking_rad_s2:g} "
            f"at the hull's radius of {radius_m:.3g} m: set at most {rim:.3g}"
        )
        yield Conflict(("supervisor", "deceleration_m_s2"), trusted, message)
    for key, of_base in (
        ("base_acceleration_m_s2", "acceleration_m_s2"),
        ("base_angular_acceleration_rad_s2", "angular_acceleration_rad_s2"),
    ):
        if getattr(config, key) > getattr(base, of_base):
            yield _more_than(config, key, of_base, getattr(base, of_base))


def _more_than(config: SupervisorSection, key: str, of_base: str, limit: float) -> Conflict:
    message = f"is more than the base does, [sim] {of_base} = {limit:g}: set at most {limit:g}"
    return Conflict(("supervisor", key), getattr(config, key), message)


def _timing(config: SupervisorSection, base: BaseSection) -> Iterator[Conflict]:
    least_s = TICKS_IN_BASE_TIMEOUT / config.tick_hz
    if base.command_timeout_s < least_s:
        message = (
            f"must be at least {TICKS_IN_BASE_TIMEOUT:g} ticks of [supervisor] tick_hz = {config.tick_hz:g}, or the "
            f"base brakes between two commands: set {least_s:.4g}"
        )
        yield Conflict(("sim", "command_timeout_s"), base.command_timeout_s, message)
    least_s = PERIODS_IN_TIMEOUT / base.odom_hz
    if config.odometry and config.odom_timeout_s < least_s:
        message = f"must be at least {PERIODS_IN_TIMEOUT:g} periods of [sim] odom_hz = {base.odom_hz:g}: set {least_s:.4g}"
        yield Conflict(("supervisor", "odom_timeout_s"), config.odom_timeout_s, message)
