"""Snapshots restore the future bit for bit."""

import pytest

from sim.config import Build, Hull
from sim.lidar_config import LidarConfig
from sim.plant import Plant

NOISY = LidarConfig(noise_m=0.01)
HARD = Build(hull=Hull.RECTANGULAR, payload_kg=30.0, wheel_slip=0.85, moving=True)


def _plant(options: Build = HARD, seed: int = 3) -> Plant:
    return Plant("empty", lidars=(NOISY,), seed=seed, options=options)


def _driven() -> Plant:
    """In the middle of a ramp, of a mover's period and of a collision with the pillar."""
    plant = _plant()
    plant.place_pillar(-3.6, 0.05)
    plant.step((1.0, 0.1), 703)
    plant.scan()
    plant.step((0.2, 0.7), 13)
    assert plant.collisions > 0
    return plant


def _future(plant: Plant) -> list[object]:
    seen: list[object] = []
    for target in ((1.0, 0.2), (-0.6, -2.0), (0.0, 0.0), (1.0, 0.0)):
        for _ in range(40):
            plant.step(target, 7)
            seen += [
                plant.data.qpos.tobytes(),
                plant.data.qvel.tobytes(),
                plant.data.sensordata.tobytes(),
                plant.scan().tobytes(),
                plant.wheel_twist,
                plant.clearance_m(),
                plant.collisions,
                plant.last_contact,
                plant.movers,
            ]
    plant.remove_pillar()
    plant.reset()
    plant.step((0.3, 0.0), 50)
    return [*seen, plant.scan().tobytes(), plant.time_s]


@pytest.mark.parametrize("into", ["itself", "another"])
def test_after_a_restore_the_simulation_continues_bit_for_bit(into: str) -> None:
    plant = _driven()
    snapshot = plant.save()
    future = _future(plant)
    other = plant if into == "itself" else _plant(seed=99)
    other.restore(snapshot)
    assert other.save() == snapshot
    assert _future(other) == future


def test_a_restored_plant_says_what_the_saved_one_said_before_any_step() -> None:
    plant, other = _driven(), _plant()
    other.restore(plant.save())

    def said(plant: Plant) -> list[object]:
        return [
            plant.true_pose,
            plant.true_velocity,
            plant.time_s,
            plant.imu(),
            plant.wheel_twist,
            plant.drive.twist,
            plant.pillar,
            plant.clearance_m(),
            plant.hull_contacts,
            plant.collisions,
            plant.last_contact,
            plant.movers,
            plant.scan().tobytes(),
        ]

    assert said(other) == said(plant)
