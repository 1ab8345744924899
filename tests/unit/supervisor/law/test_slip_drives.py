"""Closed loop: stops on a slippery floor, and people who walk while the robot stops."""

from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.base_braking import WEAK_SHARE, bound_m_s2
from supervisor.law.reckoning import Pose
from tests.scenes.operators import SETTLE_S
from tests.scenes.scene import TRUSTED_M_S2, Scene
from tests.scenes.simple import plain_scene
from tests.scenes.world import World
from tests.unit.supervisor.law.sliding import DRIVE_S, Walk, drive


@pytest.mark.parametrize("locks", [False, True])
@pytest.mark.parametrize("factor", [1.3, 1.5, 2.0])
def test_after_two_stops_with_slip_the_robot_keeps_its_distance(factor: float, *, locks: bool) -> None:
    before_m, _ = drive(stops=0, factor=factor, locks=locks)
    after_m, state = drive(stops=2, factor=factor, locks=locks)
    assert before_m < 0.285 <= after_m
    assert bound_m_s2(state.base.braking) == pytest.approx(TRUSTED_M_S2 / factor, rel=0.05)
    assert min(state.base.braking.shown_slip_m) > 0.05


@pytest.mark.parametrize("noise_m", [0.002, 0.03])
@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_a_base_that_hardly_slips_is_not_weak(noise_m: float, factor: float) -> None:
    _, state = drive(stops=3, factor=factor, noise_m=noise_m)
    assert state.base.braking.shown_slip_m == (0.0, 0.0, 0.0)
    assert bound_m_s2(state.base.braking) > WEAK_SHARE * TRUSTED_M_S2


def corridor() -> Scene:
    """A corridor along the travel whose end is 7 m away."""
    starts = np.array([[-6.0, -1.2], [-6.0, 1.2], [7.0, -1.2]])
    ends = np.array([[7.0, -1.2], [7.0, 1.2], [7.0, 1.2]])
    return replace(plain_scene(), world=World(starts, ends, np.full(3, 0.05)))


def people(number: int, speed_m_s: float, from_s: float, until_s: float, start_m: float) -> Walk:
    """People side by side who walk along x from a place during this time."""

    def walk(now_s: float, pose: Pose) -> list[tuple[float, float]]:
        x_m = start_m + speed_m_s * (min(max(now_s, from_s), until_s) - from_s)
        return [(x_m, 0.55 * (one - (number - 1) / 2)) for one in range(number)]

    return walk


STOP_S = SETTLE_S + DRIVE_S


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("scene", [plain_scene(room_m=4.0), corridor()], ids=["room", "corridor"])
@pytest.mark.parametrize(
    "walk",
    [
        (-0.8, 0.0, 9.0, 4.0),
        (-0.8, 0.0, STOP_S + 0.7, 4.0),
        (0.8, STOP_S, 9.0, 2.6),
        (-1.0, STOP_S, STOP_S + 0.8, 3.4),
    ],
    ids=["toward", "toward until the robot stands", "away when it stops", "toward when it stops"],
)
def test_people_who_walk_while_the_robot_stops_are_no_slip(
    number: int, scene: Scene, walk: tuple[float, float, float, float]
) -> None:
    _, state = drive(stops=1, scene=scene, walk=people(number, *walk))
    assert not any(state.base.braking.shown_slip_m)
    assert bound_m_s2(state.base.braking) > WEAK_SHARE * TRUSTED_M_S2
