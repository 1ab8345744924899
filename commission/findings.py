"""Collects what the drives show, and computes the results for `[measured]` and their report."""

import math
from dataclasses import dataclass, field

from commission import plan, timing
from commission.estimate import UNKNOWN, Estimate, of_repeats
from commission.measured import Result
from commission.mounting import Motion, heading, turn_scale
from commission.stopping import Stop, brakes, by_the_law, stop_of
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
        found: list[float] = []
        for one in self.driven:
            odometry, walls = one.trace.toward(one.start), one.trace.walls()
            found.append(timing.latency(walls[:, 0], walls[:, 1], odometry[:, 0], odometry[:, 1]))
        return of_repeats([latency_s for latency_s in found if math.isfinite(latency_s)])

    def stops(self, scale: float, latency_s: float, yaw_rad: float) -> list[Stop]:
        """Return the stops, measured at the wall.

        Args:
            scale: true distance divided by distance of odometry.
            latency_s: of the scans.
            yaw_rad: of the lidar.
        """
        found: list[Stop] = []
        for one in self.driven:
            walls = one.trace.walls()
            walls[:, 1] /= math.cos(one.before.bearing_rad + yaw_rad)  # the robot does not face it exactly
            odometry = one.trace.toward(one.start)
            stop = stop_of(one.stopped_s, one.rest_s, odometry, walls, scale=scale, latency_s=latency_s)
            if stop is not None:
                found.append(stop)
        return found

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
    stops = found.stops(
        direction.scale.value if direction.scale.is_determined else 1.0,
        max(0.0, latency.value) if latency.is_determined else 0.0,
        yaw.value if yaw.is_determined else lidar.yaw_rad,
    )
    base = brakes(stops)
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
            direction.scale,
            direction.scale.far_from(1.0),
            "straight drives before a wall",
        ),
        Result(("turn_scale",), turning, turning.far_from(1.0), "turns before a wall"),
        Result(
            ("estop_s",),
            Estimate(found.estop_s, math.inf, 1),
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
                f"{name} = {estimate.value:.4g} ± {estimate.u95:.2g} (limit {result.limit:.4g}, n = {estimate.n}): {result.how}"
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
