"""The witness of the virtual campaign: the clearance of the hull, and the robot's own share of its change."""

import math

import pytest

from faults.seen import Motion
from faults.simulated.world import FAR_M, Witness
from sim.config import Build
from sim.plant import Plant
from sim.scene import build

SAMPLE_STEPS = 10
SPEED_M_S = 0.8


class Drive:
    """A robot in an empty hall, and all samples of its witness."""

    def __init__(self, *, moving: bool = False) -> None:
        options = Build(moving=moving)
        self.plant = Plant("empty", options=options)
        self.witness = Witness(self.plant, build("empty", options))
        self.motions: list[Motion] = []
        self.own_m = 0.0

    def go(self, seconds: float, speed_m_s: float = SPEED_M_S) -> None:
        for _ in range(round(seconds / (SAMPLE_STEPS * self.plant.timestep_s))):
            self.plant.step((speed_m_s, 0.0), SAMPLE_STEPS)
            motion = self.witness.look(self.plant.time_s)
            self.motions.append(motion)
            self.own_m += motion.own_approach_m

    def put_ahead(self, clearance_m: float) -> None:
        pose, plant = self.plant.true_pose, self.plant
        ahead_m = plant.hull_radius_m + plant.pillar_radius_m + clearance_m
        plant.place_pillar(
            pose.x_m + ahead_m * math.cos(pose.yaw_rad), pose.y_m + ahead_m * math.sin(pose.yaw_rad)
        )


def test_a_pillar_that_is_put_near_came_by_itself_and_what_follows_is_the_robots_own() -> None:
    drive = Drive()
    drive.go(1.5)
    assert {motion.clearance_m for motion in drive.motions} == {FAR_M}
    drive.put_ahead(0.4)
    drive.go(0.02)
    assert drive.own_m < 0.02
    drive.go(0.3)
    assert drive.own_m == pytest.approx(0.4 - drive.plant.clearance_m(), abs=0.03)
    assert drive.motions[-1].clearance_m == pytest.approx(drive.plant.clearance_m(), abs=0.02)


def test_every_clearance_within_reach_is_the_plants() -> None:
    drive = Drive()
    drive.go(0.5)
    drive.put_ahead(0.45)
    for _ in range(10):
        drive.go(0.04, 0.3)
        assert drive.motions[-1].clearance_m == pytest.approx(drive.plant.clearance_m(), abs=0.013)


def test_going_away_is_a_negative_approach() -> None:
    drive = Drive()
    drive.put_ahead(0.1)
    drive.go(0.5, -0.3)
    assert drive.own_m == pytest.approx(0.1 - drive.plant.clearance_m(), abs=0.02)
    assert drive.own_m < -0.05


def test_whoever_walks_up_to_a_robot_that_stands_did_so_by_himself() -> None:
    drive = Drive(moving=True)
    drive.go(5.0)  # beside the walker's path
    drive.go(1.0, 0.0)
    drive.own_m = 0.0
    drive.go(12.0, 0.0)
    assert min(motion.clearance_m for motion in drive.motions) < FAR_M
    assert abs(drive.own_m) < 0.01
