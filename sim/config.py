"""`[sim]` of robot.toml."""

import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from sim.drive import DriveLimits
from sim.encoders import MAX_ERROR, EncoderConfig
from sim.imu import ImuConfig
from sim.lidar import MAX_BEAMS, LidarConfig
from sim.lidar_config import MAX_LIDARS, SimLidarSection, check_lidars
from sim.scene import DEFAULT, MAX_PAYLOAD_KG, MAX_SLIP, Build, Hull
from wire.config import Positive, Section

Rate = Annotated[float, Field(gt=0, le=500)]
"""Hz; there are 500 physics steps in a second."""
Share = Annotated[float, Field(ge=0, le=1)]
Error = Annotated[float, Field(ge=-MAX_ERROR, le=MAX_ERROR)]


class SimSection(Section):
    """The simulated base, its sensors with their errors, and the rates of what it publishes."""

    scene: str = DEFAULT
    hull: Literal["round", "rectangular"] = "round"
    payload_kg: Annotated[float, Field(ge=0, le=MAX_PAYLOAD_KG)] = 0.0
    wheel_slip: Annotated[float, Field(ge=0, le=MAX_SLIP)] = 0.0
    moving: bool = True
    command_timeout_s: Positive = 0.15
    max_linear_m_s: Positive = 1.0
    max_angular_rad_s: Positive = 2.0
    acceleration_m_s2: Positive = 1.0
    braking_m_s2: Positive = 2.0
    angular_acceleration_rad_s2: Positive = 4.0
    angular_braking_rad_s2: Positive = 8.0
    scan_hz: Rate = 20.0
    odom_hz: Rate = 50.0
    imu_hz: Rate = 100.0
    lidar_beams: Annotated[int, Field(ge=1, le=MAX_BEAMS)] = 360
    lidar_span_rad: Annotated[float, Field(gt=0, le=math.tau)] = math.tau
    lidar_range_min_m: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.1
    lidar_range_max_m: Positive = 12.0
    lidar_noise_m: Annotated[float, Field(ge=0, le=0.1)] = 0.002
    lidar_dropout: Share = 0.0
    lidars: (
        Annotated[tuple[SimLidarSection, ...], Field(min_length=1, max_length=MAX_LIDARS, strict=False)]
        | None
    ) = None
    """Instead of the one that the keys before describe."""
    encoder_ticks: Annotated[int, Field(ge=1, le=1_000_000)] = 16384
    odom_left_error: Error = 0.001
    odom_right_error: Error = 0.0005
    odom_track_error: Error = 0.005
    odom_noise_m: Annotated[float, Field(ge=0, le=0.1)] = 0.0005
    gyro_noise_rad_s: Annotated[float, Field(ge=0, le=1)] = 0.002
    accel_noise_m_s2: Annotated[float, Field(ge=0, le=10)] = 0.02
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("lidar_range_max_m")
    @classmethod
    def _is_beyond_the_shortest_range(cls, value: float, info: ValidationInfo) -> float:
        if not info.data.get("lidar_range_min_m", 0.0) < value:
            raise ValueError("must be more than lidar_range_min_m")
        return value

    @model_validator(mode="after")
    def _has_lidars_of_one_kind(self) -> Self:
        if self.lidars is not None:
            check_lidars(self.lidars)
            both = sorted(key for key in self.model_fields_set if key.startswith("lidar_"))
            if both:
                raise ValueError(f"give either [[sim.lidars]] or {', '.join(both)}")
        return self

    def scene_beside(self, config: Path | None) -> str:
        """The scene; a file that is not named from the root is looked for beside the configuration file."""
        if config is None or Path(self.scene).suffix == "":
            return self.scene
        return str(config.resolve().parent / self.scene)

    def build(self, *, scenery: bool = False) -> Build:
        return Build(Hull(self.hull), self.payload_kg, self.wheel_slip, moving=self.moving, scenery=scenery)

    def limits(self) -> DriveLimits:
        return DriveLimits(
            max_linear_m_s=self.max_linear_m_s,
            max_angular_rad_s=self.max_angular_rad_s,
            acceleration_m_s2=self.acceleration_m_s2,
            braking_m_s2=self.braking_m_s2,
            angular_acceleration_rad_s2=self.angular_acceleration_rad_s2,
            angular_braking_rad_s2=self.angular_braking_rad_s2,
        )

    def lidar_configs(self) -> tuple[LidarConfig, ...]:
        """Each lidar; the first one publishes on `scan`."""
        if self.lidars is not None:
            return tuple(lidar.lidar() for lidar in self.lidars)
        return (self.lidar(),)

    def lidar(self) -> LidarConfig:
        """The one lidar of a robot without `[[sim.lidars]]`."""
        return LidarConfig(
            beams=self.lidar_beams,
            span_rad=self.lidar_span_rad,
            range_min_m=self.lidar_range_min_m,
            range_max_m=self.lidar_range_max_m,
            noise_std_m=self.lidar_noise_m,
            dropout=self.lidar_dropout,
        )

    def encoders(self) -> EncoderConfig:
        return EncoderConfig(
            ticks=self.encoder_ticks,
            left_error=self.odom_left_error,
            right_error=self.odom_right_error,
            track_error=self.odom_track_error,
            noise_m=self.odom_noise_m,
        )

    def imu(self) -> ImuConfig:
        return ImuConfig(self.gyro_noise_rad_s, self.accel_noise_m_s2)
