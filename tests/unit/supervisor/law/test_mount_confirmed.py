"""Until motion has confirmed the mounting of every lidar, a real robot is slow."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from supervisor.config import UNCONFIRMED_M_S, SupervisorSection, is_simulated
from supervisor.law import sight as sights
from supervisor.law.agreement import DOUBTS, MISTAKES, Agreement, Explanation, agree, explain
from supervisor.law.decision import Decision, Mode
from supervisor.law.reckoning import Pose, Velocity
from supervisor.law.safety import initial_state
from supervisor.law.scan import Mount
from supervisor.law.state import State
from tests.unit.supervisor.law.closed_loop import World
from tests.unit.supervisor.law.law_harness import NEUTRAL, Law
from tests.unit.supervisor.law.recordings import DATA, ROBOTS, Replay, load
from tests.unit.supervisor.law.test_agreement import AHEAD, ARC, HERE, SPIN, START, after, look
from wire.reasons import Limit

UNCONFIRMED = SupervisorSection().law(are_mounts_known=False)
E = Explanation


def seen_at(*poses: Pose, mount: Mount = HERE, is_mirrored: bool = False) -> Agreement:
    agreement = Agreement()
    for pose in poses:
        agreement = agree(agreement, look(pose, mount, is_mirrored=is_mirrored), HERE)
    return agreement


def test_a_straight_motion_rules_out_what_it_can_tell_apart() -> None:
    assert seen_at(START).not_ruled_out == MISTAKES
    assert seen_at(START, AHEAD).not_ruled_out == {E.MIRRORED, E.TURNS_BACK}
    assert seen_at(START, SPIN).not_ruled_out == {E.TURNED, E.BACKWARDS, E.LEFT, E.RIGHT}


def test_a_straight_motion_and_a_turn_confirm_the_mounting_in_either_order() -> None:
    assert not seen_at(START, AHEAD, after(AHEAD, 0.0, 0.0, 0.5)).not_ruled_out
    assert not seen_at(START, SPIN, after(SPIN, 0.3, 0.0, 0.0)).not_ruled_out
    assert not seen_at(START, ARC).not_ruled_out


def test_what_is_ruled_out_remains_so() -> None:
    confirmed = seen_at(START, ARC)
    assert not agree(confirmed, look(after(ARC, 0.3, 0.0, 0.0)), HERE).not_ruled_out


def test_what_a_view_does_not_contradict_is_not_ruled_out() -> None:
    """Among posts 0.52 m apart, 0.26 m forward look like 0.26 m backward."""
    along = np.arange(-5.2, 5.3, 0.52)
    pillars = np.array([(x, y) for x in along for y in (-1.0, 1.0)])
    walls = np.array([[-20.0, 2.0], [20.0, -2.0]])
    posts = World(pillars, np.full(len(pillars), 0.1), walls, -walls * np.array([1.0, -1.0]))
    start = Pose(0.13, 0.0, 0.0)
    found = explain(look(start, world=posts), look(after(start, 0.26, 0.0, 0.0), world=posts), HERE)
    assert found is not None
    assert {E.CONFIGURED, E.TURNED, E.BACKWARDS} <= found


def test_a_mismatch_ends_a_confirmation() -> None:
    confirmed = seen_at(START, ARC)
    turned = Mount(0.0, 0.0, math.pi)
    wrong = confirmed._replace(reference=look(ARC, turned))
    pose = ARC
    for count in range(1, DOUBTS + 1):
        pose = after(pose, 0.28, 0.05, 0.3)
        wrong = agree(wrong, look(pose, turned), HERE)
        assert wrong.doubts == count
        assert wrong.not_ruled_out == (MISTAKES if count == DOUBTS else frozenset())


@pytest.mark.parametrize("yaw_rad", [math.pi, math.pi / 2, -math.pi / 2])
def test_no_motion_confirms_a_lidar_that_looks_elsewhere(yaw_rad: float) -> None:
    """A turn cannot show it, and each straight motion shows it."""
    wrong = Mount(0.0, 0.0, yaw_rad)
    agreement = seen_at(START, AHEAD, ARC, SPIN, after(SPIN, 0.3, 0.0, 0.0), mount=wrong)
    assert agreement.not_ruled_out


def test_no_motion_confirms_a_mirrored_lidar() -> None:
    assert seen_at(START, AHEAD, ARC, SPIN, is_mirrored=True).not_ruled_out >= {E.MIRRORED, E.TURNS_BACK}


def asked(law: Law, command: Velocity) -> Decision:
    law.tick(("teleop", NEUTRAL))
    return law.tick(("teleop", command))


@pytest.mark.parametrize(
    ("command", "output"),
    [
        (Velocity(1.0, 0.0), Velocity(0.3, 0.0)),
        (Velocity(-0.6, 0.0), Velocity(-0.3, 0.0)),
        (Velocity(0.0, 2.0), Velocity(0.0, 1.2)),
        (Velocity(0.3, 1.2), Velocity(0.15, 0.6)),
    ],
)
def test_the_hull_moves_at_most_at_30_cm_per_second_until_then(command: Velocity, output: Velocity) -> None:
    decision = asked(Law(UNCONFIRMED), command)
    assert decision.output == pytest.approx(output)
    assert (decision.mode, decision.limit, decision.causes) == (Mode.LIMITED, Limit.MOUNT_UNCONFIRMED, ())
    assert decision.detail == "to confirm it, drive straight on and turn, with walls in sight"


def test_a_slower_command_is_obeyed() -> None:
    decision = asked(Law(UNCONFIRMED), Velocity(0.3, 0.0))
    assert (decision.mode, decision.limit, decision.output) == (Mode.DRIVING, None, Velocity(0.3, 0.0))


def state_with(*agreements: Agreement) -> State:
    config = replace(UNCONFIRMED, lidars=tuple(replace(UNCONFIRMED.lidars[0], name=f"{n}") for n in range(2)))
    state = initial_state(config)
    lidars = tuple(sights.LidarState(agreement=agreement) for agreement in agreements)
    return state._replace(sight=state.sight._replace(lidars=lidars))


def test_each_lidar_must_be_confirmed() -> None:
    confirmed, unconfirmed = seen_at(START, ARC), seen_at(START, AHEAD)
    assert sights.mounts_confirmed(state_with(confirmed, confirmed).sight)
    assert not sights.mounts_confirmed(state_with(confirmed, unconfirmed).sight)


def test_the_next_drive_goes_on_from_what_an_earlier_one_has_confirmed() -> None:
    (lidar,) = initial_state(UNCONFIRMED, mounts_confirmed=True).sight.lidars
    agreement = agree(agree(lidar.agreement, look(START), HERE), look(ARC), HERE)
    assert agreement.not_ruled_out == frozenset()


def test_what_an_earlier_drive_has_confirmed_needs_no_other() -> None:
    assert sights.mounts_confirmed(initial_state(UNCONFIRMED, mounts_confirmed=True).sight)
    law = Law(UNCONFIRMED)
    law.state = initial_state(UNCONFIRMED, mounts_confirmed=True)
    law.tick(("teleop", Velocity(1.0, 0.0)))
    assert asked(law, Velocity(1.0, 0.0)).limit is not Limit.MOUNT_UNCONFIRMED


@pytest.mark.parametrize(
    ("document", "is_known"),
    [
        ({}, True),
        ({"sim": {}, "supervisor": {}}, True),
        ({"teleop": {}}, True),
        ({"supervisor": {}}, False),
        ({"ros2": {}}, False),
    ],
)
def test_only_the_simulated_robot_needs_no_confirmation(
    document: dict[str, dict[str, str]], *, is_known: bool
) -> None:
    assert is_simulated(document) is is_known
    law = SupervisorSection().law(are_mounts_known=is_known)
    assert law.unconfirmed_m_s == (math.inf if is_known else UNCONFIRMED_M_S)


def test_a_person_may_have_checked_it() -> None:
    config = SupervisorSection(mounts_confirmed=True)
    assert math.isinf(config.law(are_mounts_known=False).unconfirmed_m_s)


@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings are not here")
def test_a_recorded_drive_with_odometry_confirms_its_mounting() -> None:
    replay = Replay(load(ROBOTS["neato-lds"]))
    states = [replay.state.sight.lidars[0].agreement.not_ruled_out for _ in replay.run()]
    assert all(later <= earlier for earlier, later in pairwise(states))
    assert not states[-1]
