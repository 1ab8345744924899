"""`[sim]` of robot.toml, and the options of robot and scene that it makes of it. It imports no MuJoCo."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from sim.drive import DriveLimits
from sim.lidar_config import MAX_LIDARS, LidarConfig, NoiseM, SimLidarSection, Span, conflicts_of_lidars
from sim.motion_sensors import MAX_ERROR, EncoderConfig, ImuConfig
from wire.host.config import BaseSection, Beams, Between, Conflict, Range, Seed, Speed, TurnRate

DEFAULT = "warehouse"


class SceneError(ValueError):
    """The scene is refused; the message says why, and what to do."""


class Hull(StrEnum):
    """Shape of the robot from above."""

    ROUND = "round"
    RECTANGULAR = "rectangular"


@dataclass(frozen=True, slots=True)
class Build:
    """Options of the robot and the scene.

    Attributes:
        hull: round, 0.5 m in diameter, or rectangular, 0.6 m × 0.4 m. A scene with its own robot keeps that hull.
        payload_kg: Payload in the hull, 0 to 100 kg.
        wheel_slip: Lost share of the wheels' grip, 0 to 0.95; with too little grip, the wheels spin and slide.
        moving: Whether the people and forklifts of the layout are present.
        scenery: Whether to add purely visual elements; they take time and have no other effect.
    """

    hull: Hull = Hull.ROUND
    payload_kg: float = 0.0
    wheel_slip: float = 0.0
    moving: bool = False
    scenery: bool = False


Error = Annotated[float, Between(-MAX_ERROR, MAX_ERROR)]


class SimSection(BaseSection):
    """The simulated base, its sensors with their errors, and the rates of its topics.

    The keys that the supervisor's numbers must fit are in `BaseSection`.
    """

    model_config = ConfigDict(extra="forbid")

    scene: str = DEFAULT
    hull: Literal["round", "rectangular"] = "round"
    payload_kg: Annotated[float, Between(0.0, 100.0)] = 0.0
    wheel_slip: Annotated[float, Between(0.0, 0.95)] = 0.0
    moving: bool = True
    max_linear_m_s: Speed = 1.0
    max_angular_rad_s: TurnRate = 2.0
    imu_hz: Annotated[float, Between(0.1, 500.0, "in Hz")] = 100.0
    lidar_beams: Beams = 360
    lidar_span_rad: Span = math.tau
    lidar_range_min_m: Annotated[float, Between(0.0, 10.0, "in m")] = 0.1
    lidar_range_max_m: Range = 12.0
    lidar_noise_m: NoiseM = 0.002
    lidar_dropout: Annotated[float, Between(0.0, 1.0)] = 0.0
    lidars: (
        Annotated[tuple[SimLidarSection, ...], Field(min_length=1, max_length=MAX_LIDARS, strict=False)]
        | None
    ) = None
    """Replaces the single lidar of the keys above."""
    encoder_ticks: Annotated[int, Between(1, 1_000_000)] = 16384
    odom_left_error: Error = 0.001
    odom_right_error: Error = 0.0005
    odom_track_error: Error = 0.005
    odom_noise_m: NoiseM = 0.0005
    gyro_noise_rad_s: Annotated[float, Between(0.0, 1.0)] = 0.002
    accel_noise_m_s2: Annotated[float, Between(0.0, 10.0)] = 0.02
    seed: Seed = 0

    def conflicts(self) -> Iterator[Conflict]:
        if not self.lidar_range_min_m < self.lidar_range_max_m:
            message = f"must be more than lidar_range_min_m = {self.lidar_range_min_m:g}"
            yield Conflict(("lidar_range_max_m",), self.lidar_range_max_m, message)
        if self.lidars is not None:
            for key in sorted(key for key in self.model_fields_set if key.startswith("lidar_")):
                yield Conflict((key,), getattr(self, key), "give either [[sim.lidars]] or this: leave it out")
            yield from conflicts_of_lidars(self.lidars)

    def scene_beside(self, config: Path | None) -> str:
        """Return the scene; a relative file name is relative to the directory of the configuration file."""
        if config is None or Path(self.scene).suffix == "":
            return self.scene
        return str(config.resolve().parent / self.scene)

    def build(self, *, scenery: bool = False) -> Build:
        return Build(Hull(self.hull), self.payload_kg, self.wheel_slip, moving=self.moving, scenery=scenery)

    def limits(self) -> DriveLimits:
        return DriveLimits(**{field.name: getattr(self, field.name) for field in fields(DriveLimits)})

    def lidar_configs(self) -> tuple[LidarConfig, ...]:
        """Return the configuration of each lidar; the first one publishes on `scan`."""
        return self.lidars or (self.lidar(),)

    def lidar(self) -> LidarConfig:
        """Return the single lidar of a robot without `[[sim.lidars]]`."""
        keys = ("beams", "span_rad", "range_min_m", "range_max_m", "noise_m", "dropout")
        return LidarConfig(**{key: getattr(self, f"lidar_{key}") for key in keys})

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
