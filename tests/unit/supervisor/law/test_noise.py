"""Range noise in closed loop: it neither stops a robot beside a wall, nor brings one nearer to what is ahead."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.clearance import Block, Kind, survey
from supervisor.law.reckoning import STANDSTILL, Odometer, Pose, Velocity
from supervisor.law.sight import LidarState, Sight, is_confirmed
from tests.scenes.run import Outcome, run
from tests.scenes.sensing import Ranges
from tests.scenes.simple import LIDAR, plain_scene
from tests.scenes.world import World
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, Law, ring
from wire.reasons import StopReason

HULL_M = 0.25
KEPT_M = 0.29

SETTLED_S = 0.3


class Rearming:
    """Commands one twist, and after each stop neutral for a single tick."""

    def __init__(self, wanted: Velocity) -> None:
        self._wanted = wanted

    def asks(self, now_s: float, pose: Pose, twist: Velocity, *, stopped: bool) -> Velocity:
        return STANDSTILL if stopped or now_s < SETTLED_S else self._wanted


def along_an_aisle(aside_m: float, noise_m: float, seed: int, beams: int = 360) -> Outcome:
    """12 s along an aisle 1.2 m wide and 12 m long."""
    lidar = replace(LIDAR, noise_m=noise_m, beams=beams, angle_increment=2 * math.pi / beams)
    left_m, right_m = 0.6 - aside_m, -0.6 - aside_m
    corners = np.array(((-1.0, left_m), (11.0, left_m), (11.0, right_m), (-1.0, right_m)))
    thin_m = 1e-3
    outward = thin_m * np.array(((-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)))
    walls = World(corners + outward, np.roll(corners + outward, -1, axis=0), np.full(4, thin_m))
    scene = replace(plain_scene(lidars=(lidar,), duration_s=12.0, seed=seed), world=walls)
    return run(scene, operator=Rearming(Velocity(1.0, 0.0)), stuck_s=math.inf)


def toward_a_post(
    radius_m: float,
    noise_m: float,
    seed: int,
    duration_s: float,
    speed_m_s: float = 1.0,
    wall_m: float = math.inf,
    beams: int = 360,
) -> Outcome:
    """Drive straight at a post 1 m ahead of the hull; with `wall_m`, a wall is so far behind its front."""
    return toward(
        ((HULL_M + 1.0 + radius_m, 0.0, radius_m),), noise_m, seed, duration_s, speed_m_s, wall_m, beams
    )


def toward(
    posts: tuple[tuple[float, float, float], ...],
    noise_m: float,
    seed: int,
    duration_s: float,
    speed_m_s: float = 1.0,
    wall_m: float = math.inf,
    beams: int = 360,
) -> Outcome:
    """Drive straight on at posts; with `wall_m`, a wall is so far behind the front of the last one."""
    lidar = replace(LIDAR, noise_m=noise_m, beams=beams, angle_increment=2 * math.pi / beams)
    scene = plain_scene(*posts, lidars=(lidar,), duration_s=duration_s, seed=seed)
    if wall_m < math.inf:
        (x_m, _, radius_m), world = posts[-1], scene.world
        x_m += wall_m
        world = World(
            np.vstack((world.starts, (x_m, -2.0))),
            np.vstack((world.ends, (x_m, 2.0))),
            np.append(world.radii, radius_m),
        )
        scene = replace(scene, world=world)
    return run(scene, operator=Rearming(Velocity(speed_m_s, 0.0)), stuck_s=math.inf)


def aisle_is_passed(outcomes: list[Outcome]) -> None:
    stops = sum((Counter(outcome.stops) for outcome in outcomes), Counter[str]())
    minutes = sum(outcome.duration_s for outcome in outcomes) / 60.0
    assert sum(stops.values()) <= minutes
    assert sum(outcome.travelled_m for outcome in outcomes) >= 0.5 * 60.0 * minutes


def test_noise_of_1_cm_does_not_stop_a_robot_in_an_aisle() -> None:
    """With single readings, it stopped 212 times a minute, and drove at 0.33 m/s."""
    aisle_is_passed([along_an_aisle(0.03, 0.01, seed) for seed in range(5)])


@pytest.mark.proof
@pytest.mark.parametrize("aside_m", [0.0, 0.01, 0.02, 0.03, -0.03])
def test_noise_of_1_cm_stops_a_robot_in_an_aisle_at_most_once_a_minute(aside_m: float) -> None:
    aisle_is_passed([along_an_aisle(aside_m, 0.01, 100 + seed) for seed in range(20)])


@pytest.mark.parametrize("radius_m", [0.02, 0.1])
def test_noise_of_3_cm_brings_a_robot_no_nearer_to_a_post(radius_m: float) -> None:
    outcomes = [toward_a_post(radius_m, 0.03, seed, 3.0) for seed in range(8)]
    assert min(outcome.closest_m for outcome in outcomes) >= KEPT_M


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize("radius_m", [0.02, 0.03, 0.1])
def test_noise_of_3_cm_brings_a_robot_no_nearer_to_any_post(radius_m: float) -> None:
    """A post of 4 cm has four beams. With single readings, the robot came as near as 0.287 m."""
    outcomes = [toward_a_post(radius_m, 0.03, 100 + seed, 4.0) for seed in range(60)]
    assert min(outcome.closest_m for outcome in outcomes) >= KEPT_M


@pytest.mark.proof
@pytest.mark.timeout(600)
@pytest.mark.parametrize("radius_m", [0.02, 0.1])
@pytest.mark.parametrize("noise_m", [0.01, 0.03])
def test_ten_minutes_of_rearming_at_every_tick_bring_a_robot_no_nearer(
    noise_m: float, radius_m: float
) -> None:
    """With single readings and noise of 3 cm, it crept to 0.272 m from a post of 4 cm."""
    outcome = toward_a_post(radius_m, noise_m, 0, 600.0, 0.5)
    assert outcome.stops["OBSTACLE"] > 10_000
    assert outcome.closest_m >= KEPT_M


@pytest.mark.parametrize("share", [3.0, 4.0, 6.0])
@pytest.mark.parametrize("noise_m", [0.01, 0.03])
def test_a_post_in_front_of_a_wall_that_noise_could_explain_is_kept(noise_m: float, share: float) -> None:
    """Four beams, at a depth of a few σ: a mean of seven beams would move it by half of that."""
    outcomes = [toward_a_post(0.02, noise_m, seed, 3.0, wall_m=noise_m * share) for seed in range(4)]
    assert min(outcome.closest_m for outcome in outcomes) >= KEPT_M


@pytest.mark.parametrize("beams", [120, 180])
@pytest.mark.parametrize("noise_m", [0.01, 0.03])
def test_a_post_of_one_beam_in_front_of_a_wall_is_kept(noise_m: float, beams: int) -> None:
    """Neighbours that see the wall once made it a part of the wall: 0.25 m."""
    outcomes = [
        toward_a_post(0.02, noise_m, seed, 4.0, wall_m=4.0 * noise_m, beams=beams) for seed in range(4)
    ]
    assert min(outcome.closest_m for outcome in outcomes) >= KEPT_M


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
@pytest.mark.parametrize(("slat_m", "gap_m", "depth_m"), [(0.04, 0.05, 0.05), (0.05, 0.06, 0.1)])
def test_a_fence_of_slats_before_a_wall_is_no_noise(
    slat_m: float, gap_m: float, depth_m: float, noise_m: float
) -> None:
    """When neighbours in one scan showed the noise, the fence was noise of 3 cm, and the hull came to 0.265 m."""
    radius_m = slat_m / 2
    across = np.arange(-1.0, 1.0, slat_m + gap_m)
    posts = tuple((HULL_M + 1.0 + radius_m, float(y_m), radius_m) for y_m in across)
    outcomes = [toward(posts, noise_m, seed, 4.0, wall_m=slat_m + depth_m) for seed in range(2)]
    assert min(outcome.closest_m for outcome in outcomes) >= KEPT_M


@pytest.mark.parametrize("share", [0.001, 0.01])
def test_noise_that_grows_with_the_square_of_the_distance_brings_a_robot_no_nearer(share: float) -> None:
    def far_noise(at_s: float, _lidar: int, ranges: Ranges) -> Ranges:
        rng = np.random.default_rng(round(1000.0 * at_s))
        return (ranges + share * ranges**2 * rng.standard_normal(len(ranges))).astype(np.float32)

    scene = plain_scene((HULL_M + 1.02, 0.0, 0.02), duration_s=4.0)
    outcome = run(scene, operator=Rearming(Velocity(1.0, 0.0)), spoil=far_noise, stuck_s=math.inf)
    assert outcome.closest_m >= KEPT_M


# --- what latches


def hold(law: Law, change: Callable[[int], np.ndarray], ticks: int) -> None:
    for number in range(ticks):
        law.ranges = change(number)
        law.tick(("teleop", FORWARD))


def before_a_wall(law: Law, stray_m: float | None = None) -> np.ndarray:
    """A wall 15 cm behind the stop distance straight ahead, with one reading in front of it."""
    angle = 2 * math.pi / 360 * (np.arange(360) - 180)
    ranges = np.where(np.abs(angle) < 0.8, 0.70 / np.cos(angle), ring()).astype(np.float32)
    if stray_m is not None:
        ranges[180] = stray_m
    return ranges


def test_a_stray_reading_in_front_of_a_wall_latches_nothing_but_the_second_one_does() -> None:
    law = Law()
    law.ranges = before_a_wall(law)
    law.drive(Velocity(0.1, 0.0))
    stray = before_a_wall(law, 0.54)
    for ranges, latches in ((stray, False), (before_a_wall(law), False), (stray, False), (stray, True)):
        law.ranges = ranges
        decision = law.tick(("teleop", Velocity(0.1, 0.0)))
        assert (decision.output == STANDSTILL) is (ranges is stray)
        assert (decision.reasons == (StopReason.OBSTACLE,)) is latches


@pytest.mark.parametrize(
    ("earlier_m", "now_m", "latches"),
    [(0.5522, 0.54, True), (0.5542, 0.54, False), (0.5534, 0.5508, True), (0.5545, 0.5508, False)],
)
def test_what_an_earlier_scan_shows_confirms_if_it_is_as_near(
    earlier_m: float, now_m: float, *, latches: bool
) -> None:
    """Within 3 mm of the block or of the stop distance, which is 0.55 m from the lidar."""
    law = Law()
    law.ranges = before_a_wall(law, earlier_m)
    law.tick(("teleop", NEUTRAL))
    law.ranges = before_a_wall(law, now_m)
    decision = law.tick(("teleop", Velocity(0.1, 0.0)))
    assert decision.output == STANDSTILL
    assert (decision.reasons == (StopReason.OBSTACLE,)) is latches


def shown(points: list[tuple[float, float]]) -> LidarState:
    """A lidar whose newest scan shows these points, and whose earlier one showed a point 0.37 m before the hull."""
    law = Law()
    law.tick(("teleop", NEUTRAL))
    (lidar,) = law.state.sight.lidars
    assert lidar.scan is not None
    around = survey(CONFIG.hull, np.array(points).reshape(-1, 2))
    return lidar._replace(scan=lidar.scan._replace(around=around), earlier=np.array([(0.62, 0.0)]))


def test_a_block_in_the_present_frame_is_found_again_after_a_motion() -> None:
    """0.42 m later, the far point is where the near one was."""
    sight = Sight((shown([(1.0, 0.0), (0.6, 0.0)]),))
    odometer = Odometer(pose=Pose(0.42, 0.0, 0.0), at_s=1000.0)
    assert is_confirmed(sight, CONFIG, Block(1.0, 0.0, Kind.SEEN, 0.58, 0.0), odometer, 1000.0)
    assert not is_confirmed(
        sight, CONFIG, Block(1.0, 0.0, Kind.SEEN, 0.6, 0.0), Odometer(at_s=1000.0), 1000.0
    )


def test_a_block_beside_the_robot_is_found_again_on_its_own_side() -> None:
    """An earlier scan shows it 1 cm nearer; on the other side, something is nearer still."""
    lidar = shown([(1.0, 0.4), (0.6, -0.4)])._replace(earlier=np.array([(0.99, 0.4)]))
    block = Block(1.0, 0.0, Kind.SEEN, 1.0, 0.4)
    assert is_confirmed(Sight((lidar,)), CONFIG, block, Odometer(at_s=1000.0), 1000.0)


def test_a_lidar_that_shows_nothing_near_confirms_nothing_and_hinders_nothing() -> None:
    sight = Sight((shown([]), shown([(0.62, 0.0)])))
    assert is_confirmed(sight, CONFIG, Block(1.0, 0.0, Kind.SEEN, 0.62, 0.0), Odometer(at_s=1000.0), 1000.0)


def test_a_remembered_noisy_reading_does_not_bring_the_stop_back() -> None:
    """The memory keeps the distances that count, and the next scan replaces them."""
    law, rng = Law(), np.random.default_rng(3)

    def noisy(_number: int) -> np.ndarray:
        return (before_a_wall(law) + 0.01 * rng.standard_normal(360)).astype(np.float32)

    law.ranges = noisy(0)
    law.drive(Velocity(0.1, 0.0))
    hold(law, noisy, 5)
    low = noisy(0)
    low[181] = 0.70 - 0.028
    hold(law, lambda _: low, 1)
    for _ in range(20):
        hold(law, noisy, 1)
        remembered = law.state.sight.memory.points
        assert not (np.hypot(remembered[:, 0], remembered[:, 1]) < 0.69).any()
