"""The section `[measured]` of robot.toml: the results of the first drive, written by `lifeline commission`.

The law does not read it. `lifeline check` compares it with the configuration.
"""

from typing import Annotated

from pydantic import Field

from wire.host.config import Between, Name, Section

LEAST_DECELERATION_M_S2 = 0.05
"""The least that can be configured; a measured limit may be lower, even negative."""
Text = Annotated[str, Field(max_length=200)]
MAX_LIDARS = 4


class MeasuredTrial(Section):
    """One number, without an interval."""

    value: Annotated[float, Between(-1000.0, 1000.0)]
    n: Annotated[int, Between(1, 10_000_000)]
    """Number of measurements."""
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    version: Text
    """Version of Lifeline that measured it."""
    how: Text


class MeasuredValue(MeasuredTrial):
    """One measured number with its interval."""

    limit: Annotated[float, Between(-1000.0, 1000.0)]
    """The end of the 95 % interval on the unsafe side."""


class MeasuredLidar(Section):
    """What was measured of one lidar."""

    yaw_rad: MeasuredValue | None = None
    period_s: MeasuredValue | None = None
    noise_m: MeasuredValue | None = None
    latency_s: MeasuredValue | None = None


class MeasuredSection(Section):
    """`[measured]`."""

    deceleration_m_s2: MeasuredValue | None = None
    dead_time_s: MeasuredValue | None = None
    slip: MeasuredValue | None = None
    """Share of the stopping distance that odometry does not show."""
    odometry_scale: MeasuredValue | None = None
    """True distance divided by distance of odometry."""
    turn_scale: MeasuredValue | None = None
    """True turn divided by turn of odometry."""
    base_timeout_s: MeasuredValue | None = None
    """How long the base continues without a command; written by hand, from `lifeline ros2 check-base`."""
    estop_s: MeasuredTrial | None = None
    """Time from the first zero command to the standstill, of the e-stop that was tried."""
    lidars: dict[Name, MeasuredLidar] = Field(default={}, max_length=MAX_LIDARS)
    """By the name of the lidar."""

    def worse_braking(self, deceleration_m_s2: float, dead_time_s: float) -> tuple[float, float]:
        """Return a configured deceleration [m/s²] and dead time [s], each replaced by its measured limit if that is worse."""
        if self.deceleration_m_s2 is not None:
            deceleration_m_s2 = min(deceleration_m_s2, self.deceleration_m_s2.limit)
        if self.dead_time_s is not None:
            dead_time_s = max(dead_time_s, self.dead_time_s.limit)
        return max(LEAST_DECELERATION_M_S2, deceleration_m_s2), dead_time_s

    def worse_latency_s(self, lidar: str, latency_s: float) -> float:
        """Return the configured latency of a lidar [s], replaced by its measured limit if that is longer."""
        found = self.lidars.get(lidar, MeasuredLidar()).latency_s
        return latency_s if found is None else max(latency_s, found.limit)
