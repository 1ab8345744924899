"""`[sim]`: what it makes of the configuration, and what it refuses."""

import math

import pytest

from sim.config import SimSection
from sim.lidar_config import LidarConfig
from sim.motion_sensors import EncoderConfig, ImuConfig
from wire.host.config import ConfigError, section


def test_what_is_left_out_is_what_the_models_default_to() -> None:
    config = SimSection()
    assert config.lidar() == LidarConfig(noise_m=0.002)
    assert config.encoders() == EncoderConfig()
    assert config.imu() == ImuConfig()


def test_every_key_of_the_sensors_reaches_its_model() -> None:
    config = SimSection(
        lidar_beams=500,
        lidar_span_rad=4.0,
        lidar_range_min_m=0.2,
        lidar_range_max_m=8.0,
        lidar_noise_m=0.01,
        lidar_dropout=0.25,
        encoder_ticks=1000,
        odom_left_error=0.01,
        odom_right_error=-0.02,
        odom_track_error=0.03,
        odom_noise_m=0.04,
        gyro_noise_rad_s=0.05,
        accel_noise_m_s2=0.06,
    )
    lidar = config.lidar()
    assert (lidar.beams, lidar.span_rad, lidar.range_min_m, lidar.range_max_m) == (500, 4.0, 0.2, 8.0)
    assert (lidar.noise_m, lidar.dropout) == (0.01, 0.25)
    assert config.encoders() == EncoderConfig(1000, 0.01, -0.02, 0.03, 0.04)
    assert config.imu() == ImuConfig(0.05, 0.06)


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("lidar_span_rad", 0.0, r"must be from 0\.01 to 6\.28319; in rad"),
        ("lidar_span_rad", math.nan, r"must be from 0\.01 to 6\.28319"),
        ("lidar_span_rad", 6.3, r"must be from 0\.01 to 6\.28319"),
        ("lidar_beams", 0, "must be from 1 to 65536"),
        ("lidar_beams", 65_537, "must be from 1 to 65536"),
        ("lidar_dropout", -0.1, "must be from 0 to 1"),
        ("lidar_dropout", 1.1, "must be from 0 to 1"),
        ("lidar_range_max_m", 0.1, r"must be more than lidar_range_min_m = 0\.1"),
        ("lidar_range_min_m", math.nan, "must be from 0 to 10"),
        ("lidar_range_min_m", -0.1, "must be from 0 to 10"),
        ("scan_hz", 501.0, r"must be from 0\.1 to 500"),
        ("imu_hz", 0.0, r"must be from 0\.1 to 500"),
        ("odom_hz", math.nan, r"must be from 0\.1 to 500"),
        ("payload_kg", -0.1, "must be from 0 to 100"),
        ("payload_kg", 100.1, "must be from 0 to 100"),
        ("payload_kg", math.nan, "must be from 0 to 100"),
        ("wheel_slip", -0.1, r"must be from 0 to 0\.95"),
        ("wheel_slip", 1.0, r"must be from 0 to 0\.95"),
        ("odom_left_error", 0.21, r"must be from -0\.2 to 0\.2"),
        ("odom_right_error", -0.21, r"must be from -0\.2 to 0\.2"),
        ("odom_track_error", math.nan, r"must be from -0\.2 to 0\.2"),
        ("odom_noise_m", -0.1, r"must be from 0 to 0\.1"),
        ("odom_noise_m", math.inf, r"must be from 0 to 0\.1"),
        ("encoder_ticks", 0, "must be from 1 to 1000000"),
        ("gyro_noise_rad_s", -1.0, "must be from 0 to 1"),
        ("gyro_noise_rad_s", math.nan, "must be from 0 to 1"),
        ("gyro_noise_rad_s", math.inf, "must be from 0 to 1"),
        ("accel_noise_m_s2", -1.0, "must be from 0 to 10"),
        ("accel_noise_m_s2", math.nan, "must be from 0 to 10"),
        ("accel_noise_m_s2", math.inf, "must be from 0 to 10"),
    ],
)
def test_a_value_out_of_its_bounds_is_refused_by_name_with_what_is_allowed(
    key: str, value: float, why: str
) -> None:
    with pytest.raises(ConfigError, match=rf"sim\.{key} = .*: .*{why}"):
        section({"sim": {key: value}}, "sim", SimSection)
