"""A simulated robot before a wall, with known numbers: what its lidar and its odometry show."""

import math
from typing import NamedTuple

import numpy as np

from commission.estimate import Floats
from supervisor.law.reckoning import Pose

WALL_M = 4.0
"""The wall is the line x = `WALL_M` in the world, wide enough for every beam that reaches it within the range."""
RANGE_M = 10.0


class Lidar(NamedTuple):
    """The true mount of a lidar, and its errors."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    is_mirrored: bool = False
    beams: int = 360
    noise_m: float = 0.005

    @property
    def angles_rad(self) -> Floats:
        """(beams,) over a full turn."""
        return np.linspace(-math.pi, math.pi, self.beams, endpoint=False)

    def scan(self, pose: Pose, random: np.random.Generator) -> Floats:
        """Return the ranges (beams,) from a pose; infinite without a return."""
        turn = -1.0 if self.is_mirrored else 1.0
        directions = pose.yaw_rad + self.yaw_rad + turn * self.angles_rad
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        ahead_m = WALL_M - (pose.x_m + cos * self.x_m - sin * self.y_m)
        with np.errstate(divide="ignore"):
            ranges = ahead_m / np.cos(directions)
        ranges = np.where((np.cos(directions) > 0.0) & (ranges < RANGE_M), ranges, math.inf)
        return ranges + self.noise_m * random.standard_normal(self.beams)


class Run(NamedTuple):
    """A drive toward the wall at one speed, and the stop."""

    stopped_s: float
    rest_s: float
    odometry: Floats
    """(n, 3): arrival [s], way [m], speed [m/s]."""
    walls: Floats
    """(m, 2): arrival [s], distance [m]."""


def run(
    speed_m_s: float,
    random: np.random.Generator,
    *,
    dead_s: float = 0.08,
    braking_m_s2: float = 1.2,
    latency_s: float = 0.0,
    scale: float = 1.0,
    wall_sd_m: float = 0.001,
    speed_sd_m_s: float = 0.002,
    scan_hz: float = 20.0,
) -> Run:
    """Simulate a start with 1 m/s², steady motion and a stop; odometry shows the way divided by `scale`."""
    reached_s = speed_m_s / 1.0
    stopped_s = reached_s + 1.0 + random.uniform(0.0, 0.05)
    braking_s = stopped_s + dead_s
    rest_s = braking_s + speed_m_s / braking_m_s2 + 0.8
    times = np.arange(0.0, rest_s, 0.001)
    speeds = np.minimum(times / reached_s, 1.0) * speed_m_s
    speeds = np.clip(
        np.where(times < braking_s, speeds, speed_m_s - braking_m_s2 * (times - braking_s)), 0.0, None
    )
    ways = np.concatenate(([0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * 0.001)))
    at = np.arange(0.0, rest_s, 0.02)
    seen = np.arange(random.uniform(0.0, 0.05), rest_s - latency_s, 1.0 / scan_hz)
    odometry = np.column_stack(
        (
            at,
            np.interp(at, times, ways) / scale,
            np.interp(at, times, speeds) / scale + speed_sd_m_s * random.standard_normal(len(at)),
        )
    )
    distances = 3.0 - np.interp(seen, times, ways) + wall_sd_m * random.standard_normal(len(seen))
    return Run(stopped_s, rest_s, odometry, np.column_stack((seen + latency_s, distances)))
