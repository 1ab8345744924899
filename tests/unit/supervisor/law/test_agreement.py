"""Whether scans change as the motion of the robot makes them change; wrong mountings and signs of odometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law import sight as sights
from supervisor.law.agreement import (
    CONFIRMED_SHARE,
    DOUBTS,
    LEAST_RAD,
    MOST_M,
    MOST_RAD,
    MOST_S,
    STEP_M,
    STEP_RAD,
    STILL,
    Agreement,
    Explanation,
    Shift,
    _Fit,  # pyright: ignore[reportPrivateUsage]
    _fit,  # pyright: ignore[reportPrivateUsage]
    _is_clearly_better,  # pyright: ignore[reportPrivateUsage]
    _is_far,  # pyright: ignore[reportPrivateUsage]
    _shifts,  # pyright: ignore[reportPrivateUsage]
    agree,
    explain,
)
from supervisor.law.model import Odometry
from supervisor.law.reckoning import Pose, Velocity
from supervisor.law.scan import Geometry, Mount, View
from tests.scenes.operators import Scripted
from tests.scenes.run import Moment, Outcome, Report, Spoil, run
from tests.scenes.sensing import Ranges
from tests.scenes.simple import LIDAR, plain_scene
from tests.unit.supervisor.law.closed_loop import World, advance, random_world
from tests.unit.supervisor.law.law_harness import CONFIG, NEUTRAL, Law
from tests.unit.supervisor.law.views import GEOMETRY, view_of
from wire.reasons import StopReason

HERE = Mount()
HALF = math.pi
E = Explanation
ROOM = World(
    pillars=np.array([(2.0, 0.8), (-1.5, -2.0), (0.5, -1.5), (-2.0, 1.0)]),
    radii=np.array([0.2, 0.3, 0.1, 0.2]),
    starts=np.array([(3.5, 2.5), (-3.0, 2.5), (-3.0, -2.8), (3.5, -2.8)]),
    ends=np.array([(-3.0, 2.5), (-3.0, -2.8), (3.5, -2.8), (3.5, 2.5)]),
)
START = Pose(0.3, 0.2, 0.4)


def look(
    pose: Pose,
    mount: Mount = HERE,
    *,
    world: World = ROOM,
    noise: np.ndarray | None = None,
    is_mirrored: bool = False,
    at_s: float = 0.0,
    odometer: Pose | None = None,
) -> View:
    """What a lidar with this true mount sees; by default, the odometer shows the true pose."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    ranges = world.ranges(
        pose.x_m + cos * mount.x_m - sin * mount.y_m,
        pose.y_m + sin * mount.x_m + cos * mount.y_m,
        pose.yaw_rad + mount.yaw_rad,
    ).astype(np.float64)
    if noise is not None:
        ranges = ranges + noise
    if is_mirrored:
        ranges = np.roll(ranges[::-1], 1)
    return view_of(ranges)._replace(pose=odometer or pose, taken_s=at_s)


def after(pose: Pose, x_m: float, y_m: float, turn_rad: float) -> Pose:
    """The pose after a motion in the frame of another."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return Pose(pose.x_m + cos * x_m - sin * y_m, pose.y_m + sin * x_m + cos * y_m, pose.yaw_rad + turn_rad)


AHEAD = after(START, 0.3, 0.0, 0.0)
ARC = after(START, 0.28, 0.05, 0.3)
SPIN = after(START, 0.0, 0.0, 0.5)
AT_A_CORNER = Mount(0.35, 0.2, -math.pi / 2)


@pytest.mark.parametrize("there", [AHEAD, ARC, after(START, -0.3, 0.0, 0.0)])
@pytest.mark.parametrize("mount", [HERE, AT_A_CORNER, Mount(-0.2, 0.1, 2.5)])
def test_the_right_configuration_is_confirmed_by_each_motion(there: Pose, mount: Mount) -> None:
    found = explain(look(START, mount), look(there, mount), mount)
    assert found is not None
    assert E.CONFIGURED in found


def test_the_configuration_explains_the_motion_across_the_robot_as_well() -> None:
    """A reference may be from before a turn."""
    there = Pose(0.1, 0.4, 0.3)
    shift = _shifts(look(Pose(0.0, 0.0, 0.0)), look(there), HERE)[E.CONFIGURED]
    assert shift.to == pytest.approx(0.1 + 0.4j)
    assert shift.turn_rad == pytest.approx(0.3)


def test_an_explanation_that_the_motion_cannot_separate_is_confirmed_as_well() -> None:
    assert explain(look(START), look(AHEAD), HERE) == {E.CONFIGURED, E.MIRRORED, E.TURNS_BACK}
    found = explain(look(START), look(SPIN), HERE)
    assert found == {E.CONFIGURED, E.TURNED, E.BACKWARDS, E.LEFT, E.RIGHT}
    assert explain(look(START), look(ARC), HERE) == {E.CONFIGURED}


@pytest.mark.parametrize(
    ("yaw_rad", "wrong"), [(HALF, {E.TURNED, E.BACKWARDS}), (HALF / 2, {E.LEFT}), (-HALF / 2, {E.RIGHT})]
)
@pytest.mark.parametrize("configured", [HERE, Mount(0.0, 0.0, 2.5)])
def test_a_lidar_turned_against_its_configuration_is_named(
    yaw_rad: float, wrong: set[E], configured: Mount
) -> None:
    true = replace(configured, yaw_rad=configured.yaw_rad + yaw_rad)
    assert explain(look(START, true), look(ARC, true), configured) == wrong


@pytest.mark.parametrize("configured", [HERE, Mount(0.0, 0.0, HALF)])
def test_a_mirrored_lidar_is_named(configured: Mount) -> None:
    before, view = (look(pose, configured, is_mirrored=True) for pose in (START, ARC))
    assert explain(before, view, configured) == {E.MIRRORED, E.TURNS_BACK}


def test_a_mirrored_lidar_turned_by_180_degrees_is_named() -> None:
    before, view = (look(pose, Mount(0.0, 0.0, HALF), is_mirrored=True) for pose in (START, ARC))
    assert explain(before, view, HERE) == {E.MIRRORED_TURNED, E.BOTH_SIGNS}


@pytest.mark.parametrize(
    ("forward", "turn", "wrong"), [(-1, 1, E.BACKWARDS), (1, -1, E.TURNS_BACK), (-1, -1, E.BOTH_SIGNS)]
)
def test_a_wrong_sign_of_odometry_is_told_from_a_wrong_mounting_by_a_lidar_at_a_corner(
    forward: int, turn: int, wrong: E
) -> None:
    """The motion of this lidar in a turn is that of its place: the motion separates the explanations."""
    far = Mount(0.6, 0.5, -math.pi / 2)
    there = after(START, 0.3, 0.05, 0.9)
    # A base that drives backwards draws the reversed arc.
    odometer = after(START, forward * 0.3, forward * turn * 0.05, turn * 0.9)
    found = explain(look(START, far), look(there, far, odometer=odometer), far)
    assert found == {wrong}


def test_wheels_that_slip_and_odometry_with_a_wrong_scale_are_no_wrong_mounting() -> None:
    assert explain(look(START), look(START, odometer=ARC), HERE) == frozenset()
    twice = after(START, 0.5, 0.1, 0.6)
    assert explain(look(START), look(ARC, odometer=twice), HERE) == frozenset()


def test_the_drift_of_the_heading_is_no_wrong_turn_sign() -> None:
    """Odometry turns 0.1 rad to one side, the robot to the other: the explanation differs by less than a step."""
    drifting = after(START, 0.3, 0.0, 0.1)
    found = explain(look(START), look(after(START, 0.3, 0.0, -0.1), odometer=drifting), HERE)
    assert found is not None
    assert found <= {E.CONFIGURED, E.TURNS_BACK, E.MIRRORED}
    assert not found or E.CONFIGURED in found


def test_a_room_that_changes_around_a_robot_at_rest_is_no_wrong_mounting() -> None:
    assert explain(look(START), look(ARC, odometer=START), HERE) == frozenset()


def test_a_motion_that_changes_nothing_is_not_judged() -> None:
    ring = view_of(np.full(360, 3.0))
    assert explain(ring, ring._replace(pose=Pose(0.0, 0.0, 0.5)), HERE) is None


def test_a_view_without_returns_is_not_judged() -> None:
    nothing = view_of(np.full(360, math.inf))
    assert explain(nothing, nothing._replace(pose=Pose(0.3, 0.0, 0.0)), HERE) is None


def test_a_scan_that_repeats_is_no_wrong_mounting() -> None:
    assert explain(look(START), look(START, odometer=AHEAD), HERE) == frozenset()


noises = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).standard_normal((2, 360)))
mounts = st.builds(Mount, st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-math.pi, math.pi))


@given(
    seed=st.integers(0, 1000),
    mount=mounts,
    way=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.1, 0.1), st.floats(-1.0, 1.0)),
    noise=noises,
    noise_m=st.floats(0.0, 0.03),
    drift=st.tuples(st.floats(0.9, 1.1), st.floats(-0.05, 0.05)),
)
def test_in_no_room_is_a_right_mounting_taken_for_a_wrong_one(
    seed: int,
    mount: Mount,
    way: tuple[float, float, float],
    noise: np.ndarray,
    noise_m: float,
    drift: tuple[float, float],
) -> None:
    """With the noise of cheap lidars, and odometry that is wrong by 10 % and 3 degrees."""
    world = random_world(np.random.default_rng(seed))
    x_m, y_m, turn_rad = way
    odometer = after(START, drift[0] * x_m, drift[0] * y_m, drift[0] * turn_rad + drift[1])
    before = look(START, mount, world=world, noise=noise_m * noise[0])
    view = look(after(START, *way), mount, world=world, noise=noise_m * noise[1], odometer=odometer)
    found = explain(before, view, mount)
    assert not found or E.CONFIGURED in found


@pytest.mark.parametrize("noise_m", [0.0, 0.03])
@pytest.mark.parametrize(("yaw_rad", "is_mirrored"), [(HALF, False), (HALF / 2, False), (0.0, True)])
def test_in_most_rooms_one_motion_shows_a_wrong_mounting(
    noise_m: float, yaw_rad: float, *, is_mirrored: bool
) -> None:
    true, found = Mount(0.1, 0.0, yaw_rad), 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        world, noise = random_world(rng), noise_m * rng.standard_normal((2, 360))
        before, view = (
            look(pose, true, world=world, noise=one, is_mirrored=is_mirrored)
            for pose, one in zip((START, ARC), noise, strict=True)
        )
        explained = explain(before, view, Mount(0.1, 0.0, 0.0))
        assert not explained or E.CONFIGURED not in explained
        found += bool(explained)
    assert found >= 36


STEP = 2.0**-6
"""Angle between two beams [rad]: 16 of them are `LEAST_RAD`, exactly."""
SPUN = 26
"""The robot turns by half a beam more than so many: a return lies between the beams 26 and 27 further on."""


Part = tuple[int, int, float]
"""First beam, number of beams, distance [m]."""


def spin_between(old: list[Part], new: list[Part]) -> frozenset[E] | None:
    """Explain two views during a turn on the spot: 2 m everywhere, except for these parts."""
    views: list[View] = []
    for number, parts in enumerate((old, new)):
        ranges = np.full(200, 2.0)
        for first, count, distance_m in parts:
            ranges[first : first + count] = distance_m
        view = view_of(ranges, Geometry(200, -1.5, STEP))
        views.append(view._replace(pose=Pose(0.0, 0.0, number * (SPUN + 0.5) * STEP)))
    return explain(views[0], views[1], HERE)


def test_a_motion_is_judged_if_it_changes_enough_beams() -> None:
    assert LEAST_RAD == 16 * STEP
    assert spin_between([], [(100, 16, 4.0)]) == frozenset()
    assert spin_between([], [(100, 15, 4.0)]) is None


@pytest.mark.parametrize(("contradict", "confirmed"), [(9, True), (10, False)])
def test_the_configuration_is_confirmed_if_it_explains_a_share_of_them(
    contradict: int, *, confirmed: bool
) -> None:
    """Seven beams show what was 26 beams further on, an eighth should, and eight no longer show it."""
    assert CONFIRMED_SHARE * 25 == 15.0
    found = spin_between([(60 + SPUN, 9, 4.0)], [(60, 7, 4.0), (140, contradict, 6.0)])
    assert found is not None
    assert (E.CONFIGURED in found) is confirmed


@pytest.mark.parametrize(("moved", "is_found"), [(8, True), (7, False)])
def test_an_explanation_must_explain_enough_beams_that_the_configuration_does_not(
    moved: int, *, is_found: bool
) -> None:
    """As many beams show what was on the other side, and as many do not show what the configuration predicts."""
    found = spin_between([(60, moved + 1, 4.0)], [(60 + SPUN + 1, moved, 4.0), (140, 2, 6.0)])
    mirrored = {E.MIRRORED, E.TURNS_BACK, E.MIRRORED_TURNED, E.BOTH_SIGNS}
    assert found == (mirrored if is_found else frozenset())


def test_an_explanation_must_place_most_returns() -> None:
    for nonsense, is_found in ((30, True), (60, False)):
        old, new = [(60, 9, 4.0)], [(60 + SPUN + 1, 8, 4.0), (100, nonsense, 6.0)]
        assert bool(spin_between(old, new)) is is_found


def test_an_explanation_must_be_better_than_a_robot_that_stood_still() -> None:
    """What would be new under the configuration is at the end of the view, where the explanation is not wrong."""
    assert spin_between([(180, 20, 4.0)], [(180, 20, 4.0)]) == frozenset()


def test_an_explanation_must_be_better_than_the_configuration() -> None:
    """Both explain 18 beams that a robot at rest does not, and the configuration 18 more; 44 beams show nonsense."""
    old = [(176, 19, 4.0), (123, 19, 4.0)]
    assert spin_between(old, [(150, 18, 4.0), (97, 18, 4.0), (0, 44, 6.0)]) == frozenset()


def test_a_return_differs_beyond_twice_its_tolerance() -> None:
    """Twice 6 cm and 2 % of 2.2 m."""
    assert spin_between([], [(100, 16, 2.21)]) == frozenset()
    assert spin_between([], [(100, 16, 2.20)]) is None


@pytest.mark.parametrize(("more_m", "confirmed"), [(0.14, True), (0.15, False)])
def test_a_return_agrees_within_its_tolerance(more_m: float, *, confirmed: bool) -> None:
    found = spin_between([(60 + SPUN, 9, 4.0)], [(60, 7, 4.0 + more_m), (140, 9, 6.0)])
    assert found is not None
    assert (E.CONFIGURED in found) is confirmed


def test_a_return_agrees_anywhere_between_the_old_ones_on_both_sides_of_it() -> None:
    zigzag = [(beam, 1, 2.0 + beam % 2) for beam in range(100, 130)]
    found = spin_between(zigzag, [(100 - SPUN, 29, 2.5)])
    assert found is not None
    assert E.CONFIGURED in found
    old, new = np.full(360, 2.0), np.full(360, 2.0)
    old[100:130] += np.arange(30) % 2
    new[100 - SPUN : 129 - SPUN] = 2.5
    spun = view_of(new)._replace(pose=Pose(0.0, 0.0, (SPUN + 0.5) * 2 * math.pi / 360))
    found = explain(view_of(old), spun, HERE)
    assert found is not None
    assert E.CONFIGURED in found


TURN_S = 0.18
"""Time of one turn of a slow lidar."""


def skewed(pose: Pose, twist: Velocity, mount: Mount = HERE) -> View:
    """What a rotating lidar sees from a moving robot: its beams are measured one after the other."""
    view = look(pose, mount)
    for part in range(36):
        beams, dt_s = slice(10 * part, 10 * part + 10), TURN_S * (part / 36 - 1.0)
        then = advance(pose, twist, dt_s)
        view.free_m[beams] = look(then, mount).free_m[beams]
    return view


@pytest.mark.parametrize("twist", [Velocity(0.0, 2.0), Velocity(1.0, 0.0), Velocity(0.8, 1.5)])
@pytest.mark.parametrize("yaw_rad", [0.0, HALF])
def test_the_skew_of_a_rotating_lidar_confirms_and_explains_nothing_wrong(
    twist: Velocity, yaw_rad: float
) -> None:
    """At a steady twist, both scans are skewed alike. While the twist changes, nothing wrong is concluded."""
    mount = Mount(0.1, 0.0, yaw_rad)
    there = advance(START, twist, 0.3)
    steady = explain(skewed(START, twist, mount), skewed(there, twist, mount), mount)
    assert steady is not None
    assert E.CONFIGURED in steady
    for before, view in (
        (look(START, mount), skewed(there, twist, mount)),
        (skewed(START, twist, mount), look(there, mount)),
    ):
        changing = explain(before, view, mount)
        assert not changing or E.CONFIGURED in changing


def turned(pose: Pose, at_s: float = 0.0) -> View:
    """What a lidar sees that is turned by 180 degrees against its configuration."""
    return look(pose, Mount(0.0, 0.0, HALF), at_s=at_s)


def doubts(*views: View, mount: Mount = HERE) -> list[int]:
    """The number of doubts after each view."""
    agreement = Agreement()
    numbers: list[int] = []
    for view in views:
        agreement = agree(agreement, view, mount)
        numbers.append(agreement.doubts)
    return numbers


def test_the_first_view_is_the_reference() -> None:
    view = look(START)
    assert agree(Agreement(), view, HERE) == Agreement(view)


ORIGIN = Pose(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("less", "enough"),
    [
        (Pose(math.nextafter(STEP_M, 0.0), 0.0, 0.0), Pose(STEP_M, 0.0, 0.0)),
        (Pose(0.0, -math.nextafter(STEP_M, 0.0), 0.0), Pose(0.0, -STEP_M, 0.0)),
        (Pose(0.0, 0.0, -math.nextafter(STEP_RAD, 0.0)), Pose(0.0, 0.0, -STEP_RAD)),
        (Pose(0.2, 0.0, 0.39), Pose(0.2, 0.0, 0.4)),
    ],
)
def test_a_scan_becomes_the_reference_once_the_robot_has_moved_by_a_step(less: Pose, enough: Pose) -> None:
    first = look(ORIGIN)
    assert agree(Agreement(first), look(less), HERE).reference is first
    assert agree(Agreement(first), look(enough), HERE).reference is not first


def test_a_reference_is_replaced_once_it_is_too_old() -> None:
    first, end_s = turned(START, 5.0), 5.0 + MOST_S
    later_s = math.nextafter(end_s, math.inf)
    assert agree(Agreement(first), turned(START, end_s), HERE).reference is first
    too_old = turned(START, later_s)
    assert agree(Agreement(first), too_old, HERE).reference is too_old
    assert agree(Agreement(first), turned(ARC, end_s), HERE).doubts == 1
    assert agree(Agreement(first), turned(ARC, later_s), HERE).doubts == 0


@pytest.mark.parametrize(
    ("far", "too_far"),
    [
        (Pose(MOST_M, 0.0, 0.0), Pose(math.nextafter(MOST_M, 2.0), 0.0, 0.0)),
        (Pose(0.3, 0.0, MOST_RAD), Pose(0.3, 0.0, math.nextafter(MOST_RAD, 2.0))),
    ],
)
def test_scans_that_are_too_far_apart_are_not_compared(far: Pose, too_far: Pose) -> None:
    assert doubts(turned(ORIGIN), turned(far)) == [0, 1]
    assert doubts(turned(ORIGIN), turned(too_far)) == [0, 0]


def test_two_judgements_in_a_row_show_a_mismatch_and_a_third_does_not_change_it() -> None:
    poses = [START, ARC, after(ARC, 0.28, 0.05, 0.3), after(ARC, 0.5, 0.2, 0.6)]
    assert DOUBTS == 2
    assert doubts(*map(turned, poses)) == [0, 1, 2, 2]
    agreement = Agreement()
    for pose, text in zip(
        poses[:3],
        ("", "", "a lidar turned by 180 degrees, or a wrong forward sign of odometry"),
        strict=True,
    ):
        agreement = agree(agreement, turned(pose), HERE)
        assert agreement.mismatch == text


def test_the_reference_moves_on_during_a_mismatch() -> None:
    views = [turned(START), turned(ARC), turned(after(ARC, 0.28, 0.05, 0.3)), turned(START)]
    agreement = Agreement()
    for view in views:
        agreement = agree(agreement, view, HERE)
        assert agreement.reference is view


def test_two_judgements_that_share_no_explanation_show_nothing() -> None:
    left = Mount(0.0, 0.0, HALF / 2)
    agreement = agree(Agreement(turned(START)), turned(ARC), HERE)
    agreement = agree(agreement._replace(reference=look(START, left)), look(ARC, left), HERE)
    assert (agreement.doubts, agreement.explanations) == (1, {E.LEFT})


def test_what_two_judgements_share_is_named() -> None:
    """A translation cannot separate a mirrored lidar from one that is not."""
    agreement = agree(Agreement(turned(START)), turned(AHEAD), HERE)
    assert agreement.explanations == {E.TURNED, E.BACKWARDS, E.MIRRORED_TURNED, E.BOTH_SIGNS}
    on = agree(agreement, turned(after(AHEAD, 0.28, 0.05, 0.3)), HERE)
    assert on.explanations == {E.TURNED, E.BACKWARDS}
    on = agree(agreement, turned(after(AHEAD, 0.3, 0.0, 0.0)), HERE)
    assert on.explanations == agreement.explanations
    assert on.mismatch == "a lidar turned by 180 degrees, or a wrong forward sign of odometry"


def test_two_mistakes_at_once_are_named_where_one_alone_explains_nothing() -> None:
    both = Agreement(None, DOUBTS, frozenset({E.MIRRORED_TURNED, E.BOTH_SIGNS}))
    assert both.mismatch == "a mirrored lidar turned by 180 degrees, or two wrong signs of odometry"


def test_a_motion_that_cannot_separate_ends_no_doubt_and_one_that_can_does() -> None:
    """A turn on the spot looks the same for a lidar that is turned by 180 degrees."""
    doubt = agree(Agreement(turned(START)), turned(ARC), HERE)
    assert doubt.doubts == 1
    spun = after(ARC, 0.0, 0.0, 0.5)
    view = turned(spun)
    ruled_out = {E.MIRRORED, E.TURNS_BACK, E.MIRRORED_TURNED, E.BOTH_SIGNS}
    assert agree(doubt, view, HERE) == doubt._replace(
        reference=view, not_ruled_out=doubt.not_ruled_out - ruled_out
    )
    ended = agree(doubt._replace(reference=look(START)), look(ARC), HERE)
    assert (ended.doubts, ended.explanations) == (0, frozenset())


def test_a_mismatch_ends_when_the_scans_agree_again() -> None:
    wrong = Agreement(look(START), DOUBTS, frozenset({E.TURNED}))
    assert agree(wrong, look(ARC), HERE).mismatch == ""


def test_a_judgement_without_an_explanation_ends_a_doubt_but_no_mismatch() -> None:
    doubt = Agreement(look(START), 1, frozenset({E.TURNED}))
    slipped = look(START, odometer=ARC)
    assert agree(doubt, slipped, HERE) == Agreement(slipped)
    wrong = doubt._replace(doubts=DOUBTS)
    assert agree(wrong, slipped, HERE) == wrong._replace(reference=slipped)


def test_a_motion_that_is_not_judged_leaves_a_doubt() -> None:
    ring = view_of(np.full(360, 3.0))
    doubt = Agreement(ring, 1, frozenset({E.TURNED}))
    on = ring._replace(pose=Pose(0.0, 0.0, 0.5))
    assert agree(doubt, on, HERE) == doubt._replace(reference=on)


def _turned(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
    return np.roll(ranges, 180)


def _to_the_left(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
    return np.roll(ranges, 90)


def _mirrored(at_s: float, lidar: int, ranges: Ranges) -> Ranges:
    return np.roll(ranges[::-1], 1)


def drive(
    wanted: Velocity, spoil: Spoil | None, noise_m: float, report: Report | None = None
) -> tuple[Outcome, Moment]:
    """Drive in a room with three pillars; return the outcome and the last moment."""
    discs = ((3.0, 0.4, 0.05), (-2.0, 1.0, 0.2), (1.0, -2.0, 0.3))
    scene = plain_scene(*discs, lidars=(replace(LIDAR, noise_m=noise_m),), duration_s=8.0)
    moments: list[Moment] = []
    outcome = run(
        scene,
        operator=Scripted(wanted),
        spoil=spoil,
        watch=moments.append,
        report=report,
        stuck_s=math.inf,
    )
    return outcome, moments[-1]


STRAIGHT, CURVE, TURN = Velocity(0.8, 0.0), Velocity(0.5, 0.8), Velocity(0.0, 1.0)


@pytest.mark.parametrize("noise_m", [0.002, 0.03])
@pytest.mark.parametrize(
    ("spoil", "wanted", "named"),
    [
        (_turned, STRAIGHT, "a lidar turned by 180 degrees, or a wrong forward sign of odometry"),
        (_turned, CURVE, "a lidar turned by 180 degrees, or a wrong forward sign of odometry"),
        (_to_the_left, STRAIGHT, "a lidar turned by 90 degrees to the right"),
        (_mirrored, CURVE, "a mirrored lidar, or a wrong turn sign of odometry"),
        (_mirrored, TURN, "a mirrored lidar, or a wrong turn sign of odometry"),
    ],
)
def test_a_wrong_mounting_stops_the_robot_within_1_m_and_is_named(
    spoil: Spoil, wanted: Velocity, named: str, noise_m: float
) -> None:
    outcome, last = drive(wanted, spoil, noise_m)
    assert outcome.travelled_m < 1.0
    assert last.decision.causes == (StopReason.SENSOR_MISMATCH,)
    assert last.decision.detail == f"motion shows {named}"
    assert last.twist == NEUTRAL


@pytest.mark.parametrize("wanted", [STRAIGHT, CURVE, TURN])
def test_a_right_mounting_stops_nothing(wanted: Velocity) -> None:
    assert "SENSOR_MISMATCH" not in drive(wanted, None, 0.03)[0].stops


def _nothing(now_s: float, twist: Velocity) -> None:
    """No odometry."""


def test_without_odometry_nothing_is_concluded_from_commands() -> None:
    outcome, _ = drive(STRAIGHT, _turned, 0.002, report=_nothing)
    assert outcome.travelled_m > 1.0
    assert "SENSOR_MISMATCH" not in outcome.stops


def test_the_detail_names_the_lidar_where_there_are_several() -> None:
    config = replace(CONFIG, lidars=(CONFIG.lidars[0], replace(CONFIG.lidars[0], name="rear")))
    wrong = sights.LidarState(agreement=Agreement(None, DOUBTS, frozenset({E.LEFT})))
    one = sights.Sight((sights.LidarState(), wrong))
    assert sights.mismatches(one, config) == "rear: a lidar turned by 90 degrees to the left"
    assert StopReason.SENSOR_MISMATCH in sights.causes(one, config, 0.0, ())


def test_after_a_suspend_no_scan_is_compared_with_one_from_before_it() -> None:
    """Meanwhile the robot may have been carried away. A mismatch remains."""
    law = Law()
    law.tick(odometry=Odometry(NEUTRAL, law.now_s))
    law.tick(odometry=Odometry(NEUTRAL, law.now_s))
    (lidar,) = law.state.sight.lidars
    assert lidar.agreement.reference is not None
    wrong = lidar.agreement._replace(doubts=DOUBTS, explanations=frozenset({E.LEFT}))
    sight = law.state.sight._replace(lidars=(lidar._replace(agreement=wrong),))
    (after_it,) = sights.suspended(sight, CONFIG).lidars
    assert after_it.agreement == wrong._replace(reference=None)


def test_a_lidar_that_turns_clockwise_or_sees_only_a_part_is_judged_alike() -> None:
    """A part of a turn has no beam beyond its ends."""
    part = slice(70, 290)
    for before, there in ((turned(START), turned(ARC)), (look(START), look(ARC))):
        whole = explain(before, there, HERE)
        clockwise: list[View] = []
        partly: list[View] = []
        for view in (before, there):
            count, angle_min, step = view.geometry
            clockwise.append(
                view._replace(
                    geometry=Geometry(count, angle_min + step * (count - 1), -step),
                    free_m=view.free_m[::-1],
                    hit=view.hit[::-1],
                )
            )
            partly.append(
                view._replace(
                    geometry=Geometry(220, angle_min + step * 70, step),
                    free_m=view.free_m[part],
                    hit=view.hit[part],
                )
            )
        assert explain(clockwise[0], clockwise[1], HERE) == whole
        assert explain(partly[0], partly[1], HERE) == whole


def test_scans_of_two_geometries_are_comparable() -> None:
    """Lidars with uneven rotation send a new geometry with every scan."""
    before = look(START)
    there = look(ARC)
    half = there._replace(
        geometry=Geometry(180, -math.pi, 2 * there.geometry.increment),
        free_m=there.free_m[::2],
        hit=there.hit[::2],
    )
    found = explain(before, half, HERE)
    assert found == {E.CONFIGURED}


@pytest.mark.parametrize(
    "geometry", [GEOMETRY, Geometry(300, -2.0, GEOMETRY.increment)], ids=["full turn", "sector"]
)
def test_a_return_agrees_with_the_two_old_beams_beside_it(geometry: Geometry) -> None:
    """Between a near and a far beam, as on a slanted wall, and also between the last beam of a full turn and the first."""
    count, angle_min, increment = geometry
    old = view_of(np.where(np.arange(count) % 2 == 0, 1.0, 2.0) + 0.25 * (np.arange(count) % 4), geometry)
    angle = angle_min + increment * (np.arange(count) + 0.5)
    following_m = np.roll(old.free_m, -1)
    points = ((old.free_m + following_m) / 2.0 * np.exp(1j * angle)).astype(np.complex128)
    fit = _fit(old, old, points, STILL)
    has_both = np.ones(count, dtype=np.bool_)
    has_both[-1] = geometry is GEOMETRY
    assert (fit.agrees == has_both).all()
    assert fit.share == 1.0


@pytest.mark.parametrize("turn_rad", np.linspace(0.41, 1.1, 12))
def test_a_full_turn_may_lack_a_part_of_a_beam(turn_rad: float) -> None:
    """Returns in the gap between the last and the first beam are beside both."""
    angle_min, beams = GEOMETRY.angle_min, GEOMETRY.beams
    uneven = Geometry(beams, angle_min, 2 * math.pi / (beams + 0.4))
    before, view = (
        look(pose)._replace(geometry=uneven) for pose in (START, after(START, 0.0, 0.0, turn_rad))
    )
    found = explain(before, view, HERE)
    assert found is not None
    assert E.CONFIGURED in found


def test_explanations_differ_by_a_step_at_least() -> None:
    assert _is_far(Shift(complex(STEP_M), 0.0), STILL)
    assert not _is_far(Shift(complex(math.nextafter(STEP_M, 0.0)), 0.0), STILL)
    assert _is_far(Shift(0j, STEP_RAD), STILL)
    assert not _is_far(Shift(0j, math.nextafter(STEP_RAD, 0.0)), STILL)


@pytest.mark.parametrize(("worse", "is_better"), [(1, True), (2, False)])
def test_a_better_explanation_may_fail_on_a_fifth_of_the_beams(worse: int, *, is_better: bool) -> None:
    beams = np.arange(20)
    fit = _Fit(agrees=beams < 5, differs=(beams >= 10) & (beams < 10 + worse), share=1.0)
    other = _Fit(agrees=beams >= 10, differs=beams < 5, share=1.0)
    assert _is_clearly_better(fit, other, 0.1) is is_better
