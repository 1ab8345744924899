"""The worst case that an optimizer finds. `python -m tests.scenes.worst` searches for longer, and describes the parameters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.permission import TOUCH_M
from supervisor.law.reckoning import STANDSTILL, Velocity
from tests.scenes.operators import Scripted
from tests.scenes.run import TICK_S, Moment, run
from tests.scenes.scene import BOUND_M, NEAR_LOSS_M, BaseNumbers, Configured
from tests.scenes.sensing import Ranges
from tests.scenes.simple import BASE, LIDAR, plain_scene
from tests.scenes.worst import (
    CONFIGURABLE,
    HARD,
    RANGES,
    Case,
    Course,
    Result,
    case_from,
    case_of,
    drive,
    genes_of,
    left_alone_m,
    scene_of,
    search,
    text_of,
)

FULL = Velocity(1.0, 0.0)
MIDDLE = case_of(np.full(len(RANGES), 0.5))
AS_CONFIGURED = replace(HARD, dead_s=0.0, braking_m_s2=1.5, latency_s=0.0, timeout_s=0.15)


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
    for configured_s in (0.0, 0.1):
        moments: list[Moment] = []
        scene = plain_scene(room_m=3.0, lidars=(replace(LIDAR, latency_s=0.1),), duration_s=1.0)
        run(
            replace(scene, configured=Configured(latency_s=configured_s)),
            operator=Scripted(FULL),
            watch=moments.append,
        )
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
    assert scene_of(case).configured == Configured(1.0, 0.1, 0.05, 0.3)
    assert scene_of(case, frozenset({"dead_s"})).configured == Configured(1.0, 0.0, 0.05, 0.3)
    assert scene_of(case, frozenset({"braking_m_s2"})).configured.braking_m_s2 == 1.5
    assert scene_of(replace(case, braking_m_s2=2.0)).configured.braking_m_s2 == 1.5


def test_a_case_is_the_same_after_it_was_printed_and_after_it_was_a_point_of_the_search() -> None:
    again = case_from(text_of(HARD))
    assert again == HARD
    assert text_of(case_of(genes_of(HARD))) == text_of(HARD)


def test_the_search_finds_the_least_value_of_a_function() -> None:
    found = search(lambda case: abs(case.dead_s - 0.1) + abs(case.speed_m_s - 0.9), 480, 0)
    assert len(found) >= 2
    best = min(found, key=lambda one: one.score)
    assert best.score < 0.05
    assert (best.case.dead_s, best.case.speed_m_s) == (
        pytest.approx(0.1, abs=0.03),
        pytest.approx(0.9, abs=0.05),
    )


def test_a_drive_is_the_same_for_the_same_case() -> None:
    assert drive(MIDDLE) == drive(MIDDLE)
    assert drive(replace(MIDDLE, object_m=0.6, object_rad=0.0)) == Result(math.inf, math.inf), "too near"


# --- the worst case


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize("number", [1, 2])
def test_while_the_law_decides_the_search_finds_no_drive_below_the_bound(number: int) -> None:
    """In 2026-11, 1,300 drives came no closer than 0.288 m."""
    worst = min(
        search(lambda case: drive(case, alone=False).driven_m, 250, number), key=lambda one: one.score
    )
    assert worst.score >= BOUND_M, text_of(worst.case)


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("noise_m", "least_m"), [(0.005, TOUCH_M - NEAR_LOSS_M), (0.03, 0.0)])
def test_if_everything_above_the_base_dies_at_the_worst_tick_the_search_finds_no_contact(
    noise_m: float, least_m: float
) -> None:
    """In 2026-11, the worst of 500 drives kept 0.037 m of the 0.05 m: noise of 2 cm hides how near a thin pillar is."""

    def score(case: Case) -> float:
        return drive(replace(case, noise_m=min(noise_m, case.noise_m))).alone_m

    worst = min(search(score, 120, 1), key=lambda one: one.score)
    assert worst.score > least_m, text_of(worst.case)


FOUND = (
    (
        "dead_s 0.12, braking_m_s2 1.326, latency_s 0.02632, timeout_s 0.3128, noise_m 0, lost_scans 0.04056,"
        "vanish_rad 1.577, vanish_at_rad -0.8679, vanish_s 2.22, rate_hz 31.18, acceleration_m_s2 1.58, axes 0.6702,"
        "odometry 0.5598, hull 2.425, object_m 0.9892, object_rad -0.07824, object_radius_m 0.0205, slant_rad -0.4724,"
        "speed_m_s 0.7359, turn_rad_s -0.0383, then_m_s -0.3036, then_rad_s -0.26, then_s 2.473"
    ),
    (
        "dead_s 0.04, braking_m_s2 1.352, latency_s 0.02347, timeout_s 0.4942, noise_m 0.01013, lost_scans 0,"
        "vanish_rad 0.5904, vanish_at_rad -0.5742, vanish_s 2.37, rate_hz 24.65, acceleration_m_s2 1.554, axes 0.5166,"
        "odometry 0.5703, hull 2.032, object_m 1.745, object_rad -0.1206, object_radius_m 0.08035, slant_rad -0.4372,"
        "speed_m_s 0.7955, turn_rad_s 0.09748, then_m_s -0.1498, then_rad_s -0.758, then_s 2.309"
    ),
    (
        "dead_s 0.2, braking_m_s2 1.544, latency_s 0.1409, timeout_s 0.48, noise_m 0.0001081, lost_scans 0.02309,"
        "vanish_rad 1.024, vanish_at_rad 0.1219, vanish_s 2.485, rate_hz 39.67, acceleration_m_s2 1.303, axes 0.6338,"
        "odometry 0, hull 1.117, object_m 1.604, object_rad 0.2474, object_radius_m 0.4873, slant_rad 0.1002,"
        "speed_m_s 0.4862, turn_rad_s 0.4308, then_m_s 0.9458, then_rad_s -0.4048, then_s 2.63"
    ),
    (
        "dead_s 0.18, braking_m_s2 1.131, latency_s 0, timeout_s 0.36, noise_m 0.01911, lost_scans 0.03873,"
        "vanish_rad 0, vanish_at_rad 0, vanish_s 2, rate_hz 11.99, acceleration_m_s2 1.969, axes 0.3942, odometry 0.888,"
        "hull 0.3902, object_m 2.57, object_rad 0.01945, object_radius_m 0.0205, slant_rad 0, speed_m_s 0.9911,"
        "turn_rad_s 0, then_m_s 0.2343, then_rad_s -2, then_s 2.965"
    ),
)
"""The worst drives of longer searches: 0.292, 0.304, 0.288 and 0.322 m while the law decides; 0.059 m (the second) and 0.037 m
(the fourth, with 2 cm of noise) after the death of everything above the base."""


@pytest.mark.parametrize("text", FOUND)
def test_the_worst_drives_of_longer_searches_keep_the_distance(text: str) -> None:
    driven_m, alone_m = drive(case_from(text))
    assert driven_m >= BOUND_M
    assert alone_m > 0.0


GAPS = (
    ({"dead_s": 0.2}, 0.13),
    ({"latency_s": 0.15}, 0.18),
    ({"latency_s": 0.15, "rate_hz": 40.0}, 0.16),
    ({"braking_m_s2": 0.75}, 0.03),
    ({"dead_s": 0.2, "latency_s": 0.15}, -0.01),
    ({"dead_s": 0.2, "latency_s": 0.15, "braking_m_s2": 0.75}, -0.27),
)
"""What differs from a configuration that does not contain it, and the least clearance of one straight drive [m]."""


@pytest.mark.parametrize(("numbers", "least_m"), GAPS)
def test_what_the_configuration_does_not_contain_costs_distance(
    numbers: dict[str, float], least_m: float
) -> None:
    """Expected gaps, until the law measures dead time and latency, and limits a base that has shown nothing.

    Each number alone ends without contact. Where the configuration contains all of them, the same drive keeps its distance.
    """
    case = replace(AS_CONFIGURED, **numbers)  # type: ignore[arg-type]
    assert drive(case, alone=False).driven_m >= BOUND_M
    assert drive(case, frozenset(CONFIGURABLE) - {"timeout_s"}, alone=False).driven_m >= least_m


def test_a_base_timeout_that_the_configuration_does_not_contain_may_end_in_contact() -> None:
    """An expected gap: -0.12 m with 0.5 s instead of 0.15 s; `lifeline ros2 check-base` measures it."""
    case = replace(AS_CONFIGURED, timeout_s=0.5)
    assert drive(case).alone_m >= TOUCH_M
    assert drive(case, frozenset({"timeout_s"})).alone_m >= -0.12
    assert drive(replace(case, timeout_s=0.3), frozenset({"timeout_s"})).alone_m >= TOUCH_M


@pytest.mark.parametrize("room_m", [5.0, 6.7, 8.0])
def test_a_sector_that_falls_silent_and_turns_with_the_robot_remains_closed(room_m: float) -> None:
    """In the largest room, returns from the corners are beyond 0.8 of `range_max`, so that their loss is not judged."""
    assert blind_drive_m(room_m) >= BOUND_M


def blind_drive_m(room_m: float) -> float:
    """Return the least clearance of a robot that turns and drives at a pillar, into a sector that fell silent before."""
    angle = LIDAR.angle_min + LIDAR.angle_increment * np.arange(LIDAR.beams)

    def spoil(taken_s: float, number: int, ranges: Ranges) -> Ranges | None:
        ranges[(np.abs(angle) <= 1.4) & (taken_s > 1.0)] = math.inf
        return ranges

    pillar = (1.3 * math.cos(1.05), -1.3 * math.sin(1.05), 0.1)
    course = Course(replace(HARD, speed_m_s=0.0, turn_rad_s=-0.51, then_m_s=0.3, then_s=2.45))
    return run(plain_scene(pillar, room_m=room_m, duration_s=8.0), operator=course, spoil=spoil).closest_m
