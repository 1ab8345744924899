"""`[sim]` of robot.toml."""

from typing import Annotated

from pydantic import Field

from sim.drive import DriveLimits
from sim.lidar import LidarConfig
from wire.config import Positive, Section


class SimSection(Section):
    """The simulated base, its lidar, and the rates of what it publishes."""

    command_timeout_s: Positive = 0.15
    max_linear_m_s: Positive = 1.0
    max_angular_rad_s: Positive = 2.0
    acceleration_m_s2: Positive = 1.0
    braking_m_s2: Positive = 2.0
    angular_acceleration_rad_s2: Positive = 4.0
    angular_braking_rad_s2: Positive = 8.0
    scan_hz: Positive = 20.0
    odom_hz: Positive = 50.0
    lidar_noise_m: Annotated[float, Field(ge=0, le=0.1)] = 0.002
    seed: Annotated[int, Field(ge=0)] = 0

    def limits(self) -> DriveLimits:
        return DriveLimits(
            max_linear_m_s=self.max_linear_m_s,
            max_angular_rad_s=self.max_angular_rad_s,
            acceleration_m_s2=self.acceleration_m_s2,
            braking_m_s2=self.braking_m_s2,
            angular_acceleration_rad_s2=self.angular_acceleration_rad_s2,
            angular_braking_rad_s2=self.angular_braking_rad_s2,
        )

    def lidar(self) -> LidarConfig:
        return LidarConfig(noise_std_m=self.lidar_noise_m)
