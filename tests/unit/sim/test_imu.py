"""The inertial unit's noise."""

import numpy as np

from sim.motion_sensors import Imu, ImuConfig

AT_REST = ((0.0, 0.0, 0.0), (0.0, 0.0, 9.81))


def test_without_noise_it_says_what_is() -> None:
    imu = Imu(ImuConfig(0.0, 0.0))
    assert imu.read((0.1, 0.2, 0.3), (1.0, 2.0, 9.81)) == ((0.1, 0.2, 0.3), (1.0, 2.0, 9.81))


def test_each_axis_has_the_noise_that_is_asked_for_around_the_true_value() -> None:
    imu = Imu(ImuConfig(gyro_noise_rad_s=0.01, accel_noise_m_s2=0.2), seed=1)
    readings = np.array([np.concatenate(imu.read(*AT_REST)) for _ in range(4000)])
    np.testing.assert_allclose(readings.mean(axis=0), [0.0, 0.0, 0.0, 0.0, 0.0, 9.81], atol=0.02)
    np.testing.assert_allclose(readings.std(axis=0), [0.01] * 3 + [0.2] * 3, rtol=0.05)


def test_the_same_seed_makes_the_same_readings_and_another_others() -> None:
    assert Imu(seed=1).read(*AT_REST) == Imu(seed=1).read(*AT_REST)
    assert Imu(seed=1).read(*AT_REST) != Imu(seed=2).read(*AT_REST)
