"""Collects what the drives show, and computes the results for `[measured]` and their report."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from commission import plan, timing
from commission.estimate import UNKNOWN, Estimate, Floats, of_repeats
from commission.measured import DIGITS, Result
from commission.mounting import Motion, heading, turn_scale
from commission.stopping import Stop, brakes, by_the_law, steady_scale, steady_speeds, stop_of
from commission.trace import Driven
from supervisor.config import NamedLidarSection, SupervisorSection
from wire.standstill import STILL_M_S


@dataclass
class Findings:
    """What was measured so far."""

    period: Estimate = UNKNOWN
    longest_s: float = math.nan
    noise: Estimate = UNKNOWN
    straights: list[Motion] = field(default_factory=list[Motion])
    turns: list[Motion] = field(default_factory=list[Motion])
    driven: list[Driven] = field(default_factory=list[Driven])
    """The drives that ended with a stop from a steady speed."""
    estop_s: float = math.nan

    def latency(self) -> Estimate:
        """Return the latency of the scans by odometry, from the stops."""
        found: list[tuple[float, float]] = []
        for one in self.driven:
            odometry, walls = one.trace.toward(one.start), one.trace.walls()
            latency_s = timing.latency(walls[:, 0], walls[:, 1], odometry[:, 0], odometry[:, 1])
            if math.isfinite(latency_s):
                found.append((one.speed, latency_s))
        return timing.latency_of(*zip(*found, strict=True)) if found else UNKNOWN

    def steady_scale(self, latency_s: float, yaw_rad: float) -> Estimate:
        """Return the true speed divided by that of odometry, before the stops.

        Args:
            latency_s: of the scans.
            yaw_rad: of the lidar.
        """
        found = (
            steady_speeds(one.stopped_s, odometry, walls, latency_s)
            for one, odometry, walls in self._toward_wall(yaw_rad)
        )
        return steady_scale([speeds for speeds in found if speeds is not None])

    def stops(self, scale: float, latency_s: float, yaw_rad: float) -> list[Stop]:
        """Return the stops, measured at the wall.

        Args:
            scale: true speed divided by speed of odometry.
            latency_s: of the scans.
            yaw_rad: of the lidar.
        """
        found = (
            stop_of(one.stopped_s, one.rest_s, odometry, walls, scale=scale, latency_s=latency_s)
            for one, odometry, walls in self._toward_wall(yaw_rad)
        )
        return [stop for stop in found if stop is not None]

    def _toward_wall(self, yaw_rad: float) -> Iterator[tuple[Driven, Floats, Floats]]:
        """Yield each drive that ended in a stop, its odometry, and its distances to the wall along its heading."""
        for one in self.driven:
            walls = one.trace.walls()
            walls[:, 1] /= math.cos(one.before.bearing_rad + yaw_rad)  # the robot does not face it exactly
            yield one, one.trace.toward(one.start), walls

    def by_the_law(self) -> Estimate:
        """Return the deceleration that the safety law itself measures in the same stops, by odometry."""
        found = [
            by_the_law(one.stopped_s, one.trace.toward(one.start), one.speed, STILL_M_S)
            for one in self.driven
        ]
        return of_repeats([value for value in found if math.isfinite(value)])


def results(found: Findings, lidar: NamedLidarSection) -> list[Result]:
    """Return the results for `[measured]`, each with its limit on the unsafe side."""
    direction, turning, latency = heading(found.straights), turn_scale(found.turns), found.latency()
    own, yaw = ("lidars", lidar.name), direction.yaw_rad
    yaw_rad = yaw.value if yaw.is_determined else lidar.yaw_rad
    late = latency if latency.is_determined else Estimate(0.0, 0.0, 0)
    late_s = max(0.0, late.value)
    scale, steady = direction.scale, found.steady_scale(late_s, yaw_rad)
    if abs(steady.value - scale.value) > math.hypot(
        steady.u95, scale.u95
    ):  # the wheels slip at starts and stops, which is not part of the scale
        scale = steady
    stopping = scale if scale.is_determined else Estimate(1.0, 0.0, 0)
    stops = found.stops(stopping.value, late_s, yaw_rad)
    base = brakes(stops, stopping.u95 / abs(stopping.value), late.u95)
    if yaw.is_determined:  # written near the configured value, not a full turn away
        near_rad = lidar.yaw_rad + math.remainder(yaw.value - lidar.yaw_rad, math.tau)
        yaw = yaw._replace(value=near_rad)
    return [
        Result(
            ("deceleration_m_s2",), base.deceleration_m_s2, base.deceleration_m_s2.low, "stops before a wall"
        ),
        Result(("dead_time_s",), base.dead_time_s, base.dead_time_s.high, "stops before a wall"),
        Result(("slip",), base.slip, base.slip.high, "stops: wall and odometry"),
        Result(
            ("odometry_scale",),
            scale,
            scale.far_from(1.0),
            "straight drives before a wall",
        ),
        Result(("turn_scale",), turning, turning.far_from(1.0), "turns before a wall"),
        Result(
            ("estop_s",),
            Estimate(found.estop_s, math.inf, int(math.isfinite(found.estop_s))),
            None,
            f"e-stop at {plan.SLOW_M_S:g} m/s: zero command to standstill",
        ),
        Result((*own, "yaw_rad"), yaw, yaw.far_from(lidar.yaw_rad), "straight drives at three headings"),
        Result(
            (*own, "period_s"), found.period, found.longest_s, "scans at rest; the limit is the longest gap"
        ),
        Result((*own, "noise_m"), found.noise, found.noise.high, "scans at rest"),
        Result((*own, "latency_s"), latency, latency.high, "wall and odometry while the speed changes"),
    ]


def report(found: list[Result], findings: Findings, config: SupervisorSection) -> list[str]:
    """Return the lines of the report."""
    lines: list[str] = []
    for result in found:
        name, estimate = ".".join(result.path), result.estimate
        if not result.is_known:
            lines.append(f"{name}: not measured ({estimate.n} measurements do not determine it)")
        elif result.limit is None:
            lines.append(f"{name} = {estimate.value:.4g} (one trial): {result.how}")
        else:
            lines.append(
                f"{name} = {estimate.value:.{DIGITS}g} ± {estimate.u95:.2g} (limit {result.limit:.{DIGITS}g}, n = {estimate.n}): {result.how}"
            )
    by_law = findings.by_the_law()
    if by_law.n:
        lines.append(
            f"the safety law itself measured {by_law.value:.3g} m/s² by odometry in {by_law.n} of these stops "
            f"(configured: {config.deceleration_m_s2:g})"
        )
    lines.append(
        "not measured here: the base's own timeout, for which the supervisor must be silent (docs/commission.md)"
    )
    return lines
