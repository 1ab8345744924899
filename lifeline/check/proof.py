"""Compares the configuration with the measurements in `[measured]` of robot.toml.

A number whose measurement is worse than its configured value is a risk. For a real base, so is a number that was not measured.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from supervisor.config import UNCONFIRMED_M_S, UNMEASURED_M_S, NamedLidarSection, SupervisorSection
from supervisor.law.base_braking import LATE_S, LEAST_SPEED_M_S
from supervisor.measured import MeasuredLidar, MeasuredSection, MeasuredValue

HOW = "`lifeline commission FILE` measures it"
# A measured number is part of the setting's text, so a risk that was accepted before the measurement is reported again.

YAW_RAD = math.radians(3.0)
"""At 1 m, a wall is then 5 cm from where it is expected."""
LATENCY_S = 0.03
"""Smaller differences are the error of a measurement."""
SCALE = 0.05
"""Each deceleration and each distance that the law measures has the same error as odometry."""
PERIOD_SHARE = 1.1


class Risk(NamedTuple):
    """A setting, and the risk that it creates."""

    setting: str
    sentence: str


def unproven(config: SupervisorSection, measured: MeasuredSection | None, *, is_real: bool) -> Iterator[Risk]:
    """Yield a risk for each number that was not measured, or whose measurement is worse than its configured value.

    Args:
        config: the section `[supervisor]`.
        measured: the section `[measured]`; None without it.
        is_real: whether the file describes a real base, of which nothing is proven without a measurement.
    """
    found = measured or MeasuredSection()
    yield from _of_deceleration(config, found.deceleration_m_s2, is_real=is_real)
    yield from _of_dead_time(config, found.dead_time_s, is_real=is_real)
    yield from _of_base_timeout(config, found.base_timeout_s, is_real=is_real)
    if config.odometry:
        yield from _of_odometry(found, is_real=is_real)
    for lidar in config.all_lidars():
        yield from _of_lidar(config, lidar, found.lidars.get(lidar.name, MeasuredLidar()), is_real=is_real)
    if is_real and found.estop_s is None:
        yield Risk("no measured estop_s", f"No e-stop was tried on this robot; {HOW}.")


def _of_deceleration(
    config: SupervisorSection, measured: MeasuredValue | None, *, is_real: bool
) -> Iterator[Risk]:
    setting = f"deceleration_m_s2 = {config.deceleration_m_s2:g}"
    if is_real and "deceleration_m_s2" not in config.model_fields_set:
        shown = "" if measured is None else f"; [measured] shows at least {measured.limit:g} m/s²"
        yield Risk(
            "no deceleration_m_s2",
            f"Until a stop from {LEAST_SPEED_M_S:g} m/s has measured the brakes of the base, it drives at most {UNMEASURED_M_S:g} "
            f"m/s: measure them fully loaded, and set the number{shown}.",
        )
    elif measured is not None and measured.limit < config.deceleration_m_s2:
        yield Risk(
            f"{setting} (measured: {measured.limit:g})",
            f"On {measured.date}, the base braked with {measured.value:g} m/s², of which {measured.limit:g} m/s² is proven: set at most "
            f"{measured.limit:g}.",
        )
    elif measured is None and is_real:
        yield Risk(
            setting,
            f"The file has no [sim], so nothing proves that the base brakes this hard: measure it, fully loaded; {HOW}.",
        )


def _of_dead_time(
    config: SupervisorSection, measured: MeasuredValue | None, *, is_real: bool
) -> Iterator[Risk]:
    setting = f"base_dead_time_s = {config.base_dead_time_s:g}"
    if measured is None and is_real:
        yield Risk(
            setting,
            f"Nothing proves how late the base reacts until it has stopped from {LEAST_SPEED_M_S:g} m/s; {HOW}.",
        )
    elif measured is not None and measured.limit > config.base_dead_time_s + LATE_S:
        yield Risk(
            f"{setting} (measured: {measured.limit:g})",
            f"On {measured.date}, the base reacted after up to {measured.limit:g} s: set this.",
        )


def _of_base_timeout(
    config: SupervisorSection, measured: MeasuredValue | None, *, is_real: bool
) -> Iterator[Risk]:
    setting = f"base_timeout_s = {config.base_timeout_s:g}"
    if measured is None and is_real:
        yield Risk(
            setting,
            "Nothing proves that the base stops by itself if the supervisor dies: `lifeline ros2 check-base` measures it; "
            "write the result into [measured] (docs/commission.md).",
        )
    elif measured is not None and measured.limit > config.base_timeout_s:
        yield Risk(
            f"{setting} (measured: {measured.limit:g})",
            f"The base continued for up to {measured.limit:g} s without a command: set this.",
        )


def _of_odometry(measured: MeasuredSection, *, is_real: bool) -> Iterator[Risk]:
    for key, what in (("odometry_scale", "distance"), ("turn_scale", "turn")):
        value: MeasuredValue | None = getattr(measured, key)
        if value is not None and abs(value.limit - 1.0) > SCALE:
            yield Risk(
                f"{key} = {value.value:g}",
                f"The true {what} is {value.value:g} times that of odometry: correct the wheels' size and distance in the base's driver.",
            )
        elif value is None and is_real:
            yield Risk(f"no measured {key}", f"Nothing proves the scale of a {what} by odometry; {HOW}.")


def _of_lidar(
    config: SupervisorSection, lidar: NamedLidarSection, measured: MeasuredLidar, *, is_real: bool
) -> Iterator[Risk]:
    yaw, period, latency = measured.yaw_rad, measured.period_s, measured.latency_s
    setting = f"yaw_rad of {lidar.name} = {lidar.yaw_rad:g}"
    if yaw is None and is_real:
        slow = (
            ""
            if config.mounts_confirmed
            else f" Until motion has confirmed it, the hull moves at most at {UNCONFIRMED_M_S:g} m/s."
        )
        yield Risk(setting, f"Nothing proves that the lidar looks this way and is not mirrored; {HOW}.{slow}")
    elif yaw is not None and abs(math.remainder(yaw.limit - lidar.yaw_rad, math.tau)) > YAW_RAD:
        yield Risk(
            f"{setting} (measured: {yaw.value:g})",
            f"The lidar looks up to {abs(math.remainder(yaw.limit - lidar.yaw_rad, math.tau)):.2g} rad elsewhere: obstacles are seen "
            "in the wrong place.",
        )
    configured_s = lidar.usual_latency_s()
    setting = f"latency_s of {lidar.name} = {configured_s:g}"
    if latency is None and is_real:
        yield Risk(setting, f"Nothing proves that the scans are not older than configured; {HOW}.")
    elif latency is not None and latency.limit > configured_s + LATENCY_S:
        yield Risk(
            f"{setting} (measured: {latency.limit:g})",
            "The scans are older than configured: set the measured limit.",
        )
    usual_s = lidar.usual_period_s()
    if period is not None and usual_s is not None and period.value > PERIOD_SHARE * usual_s:
        yield Risk(
            f"period_s of {lidar.name} = {usual_s:g} (measured: {period.value:g})",
            "Scans arrive less often than configured: set the measured period.",
        )
    timeout_s = config.scan_timeout_of(lidar)
    if period is not None and period.limit > timeout_s:
        yield Risk(
            f"timeout of {lidar.name} = {timeout_s:g} (measured: {period.limit:g})",
            "The robot was at rest and the gap between two scans was longer than the timeout: such a gap stops the robot.",
        )
