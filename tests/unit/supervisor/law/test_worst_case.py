"""The worst case that an optimizer finds; `python -m tests.scenes.worst` searches longer, and explains the parameters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.scenes.operators import Scripted
from tests.scenes.run import TICK_S, Moment, run
from tests.scenes.scene import BaseNumbers, Told
from tests.scenes.simple import BASE, LIDAR, plain_scene
from tests.scenes.worst import RANGES, Result, case_of, drive, left_alone_m, scene_of, search

FULL = Velocity(1.0, 0.0)
MIDDLE = case_of(np.full(len(RANGES), 0.5))


# --- the search itself


def driven(**changes: float) -> list[Moment]:
    moments: list[Moment] = []
    numbers = replace(BASE, **changes)  # type: ignore[arg-type]
    run(plain_scene(room_m=3.0, base=numbers), operator=Scripted(FULL), watch=moments.append)
    return moments


def test_a_base_with_a_dead_time_obeys_that_much_later() -> None:
    began_s = [
        next(moment.now_s for moment in driven(dead_s=dead_s) if moment.twist != STANDSTILL)
        for dead_s in (0.0, 0.1)
    ]
    assert began_s[1] - began_s[0] == pytest.approx(0.1)


def test_a_scan_arrives_after_the_latency_of_its_lidar_and_the_configuration_says_so() -> None:
    ages_s: list[float] = []
    for told_s in (0.0, 0.1):
        moments: list[Moment] = []
        scene = plain_scene(room_m=3.0, lidars=(replace(LIDAR, latency_s=0.1),), duration_s=1.0)
        run(replace(scene, told=Told(latency_s=told_s)), operator=Scripted(FULL), watch=moments.append)
        arrived = [moment for moment in moments if moment.scans][-1]
        assert arrived.now_s - arrived.scans[0][1] >= 0.1
        ages_s.append(arrived.decision.scan_age_s)
    assert ages_s[1] - ages_s[0] == pytest.approx(0.1)


@pytest.mark.parametrize(("timeout_s", "dead_s"), [(0.2, 0.0), (0.5, 0.0), (0.2, 0.1)])
def test_a_base_that_is_left_alone_drives_on_for_dead_time_and_timeout_and_then_brakes(
    timeout_s: float, dead_s: float
) -> None:
    scene = plain_scene((3.0, 0.0, 0.1), base=BaseNumbers("mixture", 1.0, 1.5, dead_s), room_m=8.0)
    moments = driven()
    moment = next(moment for moment in moments if moment.twist == moment.decision.output == FULL)
    here = moment._replace(pose=moment.pose._replace(x_m=0.0, y_m=0.0))
    steady = [here._replace(now_s=number * TICK_S) for number in range(1 + round(dead_s / TICK_S))]
    driven_m = 1.0 * (TICK_S + dead_s + timeout_s) + 0.5 / 1.5
    ends_m = 3.0 - 0.1 - 0.25 - driven_m
    assert left_alone_m(scene, timeout_s, [here, *steady]) == pytest.approx(ends_m, abs=0.005)


def test_the_configuration_contains_what_is_not_left_out() -> None:
    case = replace(MIDDLE, dead_s=0.1, latency_s=0.05, timeout_s=0.3, braking_m_s2=1.0)
    assert scene_of(case).told == Told(1.0, 0.1, 0.05, 0.3)
    assert scene_of(case, frozenset({"dead_s"})).told == Told(1.0, 0.0, 0.05, 0.3)
    assert scene_of(case, frozenset({"braking_m_s2"})).told.braking_m_s2 == 1.5
    assert scene_of(replace(case, braking_m_s2=2.0)).told.braking_m_s2 == 1.5


def test_the_search_finds_the_least_value_of_a_function() -> None:
    found = search(lambda case: abs(case.dead_s - 0.1) + abs(case.speed_m_s - 0.9), 480, 0)
    assert len(found) == 2
    best = min(found, key=lambda one: one.score)
    assert best.score < 0.05
    assert (best.case.dead_s, best.case.speed_m_s) == (
        pytest.approx(0.1, abs=0.03),
        pytest.approx(0.9, abs=0.05),
    )


def test_a_drive_is_the_same_for_the_same_case() -> None:
    assert drive(MIDDLE) == drive(MIDDLE)
    assert drive(replace(MIDDLE, object_m=0.6, object_rad=0.0)) == Result(math.inf, math.inf), "too near"
