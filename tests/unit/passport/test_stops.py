"""The times and distances of one run, from a robot whose true motion is known."""

import itertools
from typing import Any

import numpy as np
import pytest

from commission.estimate import Floats
from commission.stopping import STEADY_S
from commission.trace import Command
from passport.record import MAX_SAMPLES, Run
from passport.stops import SLIP_M, no_stop, run_of
from tests.unit.passport.truth import FAULT_S, WALL_M, Stopped

TRUTH = Stopped()
COMMANDS = [Command(at_s, is_zero=at_s > FAULT_S) for at_s in (9.0, 9.9, 10.1, 10.2)]
REST_S = 12.0


def run(
    truth: Stopped = TRUTH,
    commands: list[Command] = COMMANDS,
    *,
    odometry: Floats | None = None,
    walls: Floats | None = None,
    is_seen: bool = True,
    uncertainty_m: float = 0.0,
    rest_s: float = REST_S,
) -> Run | None:
    return run_of(
        FAULT_S,
        rest_s,
        commands,
        truth.odometry() if odometry is None else odometry,
        truth.walls() if walls is None else walls,
        is_seen=is_seen,
        uncertainty_m=uncertainty_m,
    )


def done(*arguments: Any, **more: Any) -> Run:  # noqa: ANN401 - as `run`
    found = run(*arguments, **more)
    assert found is not None
    return found


@pytest.mark.parametrize("truth", [Stopped(), Stopped(speed_m_s=1.0, late_s=0.3, braking_m_s2=1.0)])
def test_a_run_has_the_times_and_distances_of_the_true_motion(truth: Stopped) -> None:
    found = done(truth)
    assert found.v0_m_s == pytest.approx(truth.speed_m_s, rel=0.01)
    assert found.distance_m == pytest.approx(truth.distance_m, abs=0.002)
    assert found.odometry_m == pytest.approx(truth.distance_m, abs=0.002)
    assert found.t0_s == 0.0
    assert found.t1_s == pytest.approx(0.1)
    late_s = truth.late_s + 0.05 * truth.speed_m_s / truth.braking_m_s2
    assert found.t2_s == pytest.approx(late_s, abs=0.021)
    assert found.t3_s == pytest.approx(truth.stops_s, abs=0.021)
    assert found.deceleration_m_s2 == pytest.approx(truth.braking_m_s2, rel=0.1)
    assert found.stopped
    assert not found.slip


def test_a_trace_begins_before_the_fault_and_ends_after_the_standstill() -> None:
    found = done()
    times = [at_s for at_s, _, _ in found.trace]
    assert times[0] == pytest.approx(-0.5, abs=0.021)
    assert times[-1] == pytest.approx((found.t3_s or 0.0) + 0.3, abs=0.021)
    assert min(abs(way_m) for at_s, _, way_m in found.trace if abs(at_s) < 0.011) < 0.01


def test_a_long_trace_is_thinned() -> None:
    # A robot that creeps until the end never stands.
    truth = Stopped()
    odometry = truth.odometry(until_s=30.0)
    odometry[:, 2] = np.maximum(odometry[:, 2], 0.02)
    found = done(truth, odometry=odometry, walls=truth.walls(until_s=30.0), rest_s=30.0)
    assert found.t3_s is None
    assert found.deceleration_m_s2 is None
    assert MAX_SAMPLES // 2 < len(found.trace) <= MAX_SAMPLES


def test_a_fault_that_takes_the_recorder_leaves_only_the_distance() -> None:
    found = done(is_seen=False)
    assert (found.t0_s, found.t1_s, found.t2_s, found.t3_s, found.deceleration_m_s2) == (None,) * 5
    assert found.trace == ()
    assert found.distance_m == pytest.approx(Stopped().distance_m, abs=0.002)


def test_a_recorder_that_hears_the_robot_again_soon_after_the_fault_has_the_distance_too() -> None:
    odometry, back_s = TRUTH.odometry(), FAULT_S + 0.8 * STEADY_S
    heard = odometry[(odometry[:, 0] <= FAULT_S) | (odometry[:, 0] > back_s)]
    found = done(odometry=heard, is_seen=False)
    assert found.distance_m == pytest.approx(TRUTH.distance_m, abs=0.002)
    assert run(odometry=heard) is None, "the recorder was to hear the robot, so the samples are late"


def test_where_odometry_is_silent_the_wall_shows_the_times() -> None:
    truth = Stopped(late_s=0.3)
    odometry = truth.odometry()
    heard = odometry[(odometry[:, 0] <= FAULT_S) | (odometry[:, 0] > REST_S - 0.5)]
    found = done(truth, odometry=heard)
    assert found.t2_s == pytest.approx(truth.late_s, abs=0.06)
    assert found.t3_s == pytest.approx(truth.stops_s, abs=0.06)
    assert found.distance_m == pytest.approx(truth.distance_m, abs=0.002)


@pytest.mark.parametrize(
    ("slips_m", "uncertainty_m", "slip"),
    [
        (0.0, 0.0, False),
        (0.004, 0.0, False),
        (0.008, 0.0, True),
        (0.008, 0.01, False),
        (1.1 * SLIP_M, 0.1, True),
    ],
)
def test_slip_is_a_difference_of_2_cm_or_of_5_percent_that_the_instrument_can_see(
    slips_m: float, uncertainty_m: float, *, slip: bool
) -> None:
    truth = Stopped()
    walls = truth.walls()
    walls[walls[:, 0] > FAULT_S, 1] -= slips_m
    assert done(truth, walls=walls, uncertainty_m=uncertainty_m).slip is slip


def test_a_turn_stands_below_its_own_speed_and_slips_by_its_own_share() -> None:
    truth = Stopped(speed_m_s=2.0, braking_m_s2=8.0)
    walls, odometry = truth.walls(), truth.odometry()
    walls[walls[:, 0] > FAULT_S, 1] -= 0.04
    odometry[odometry[:, 0] > FAULT_S, 2] += 0.015
    for is_turn in (False, True):
        found = run_of(FAULT_S, REST_S, COMMANDS, odometry, walls, uncertainty_m=0.06, is_turn=is_turn)
        assert found is not None
        assert (found.t3_s is not None) is is_turn
        assert found.slip is not is_turn
        assert found.distance_m == pytest.approx(truth.distance_m + 0.04, abs=0.01)


@pytest.mark.parametrize(
    ("zeros", "t1_s"),
    [
        ("", None),
        ("10.1", 0.1),
        ("10.1 10.2 10.3", 0.1),
        ("9.9 10.1", 0.1),
        ("10.1 !10.2 10.3", 0.3),
        ("10.1 !10.2", None),
        ("10.1 !12.5", 0.1),
    ],
)
def test_the_zero_that_counts_is_the_first_after_which_no_other_command_comes(
    zeros: str, t1_s: float | None
) -> None:
    commands = [Command(float(one.strip("!")), not one.startswith("!")) for one in zeros.split()]
    assert done(Stopped(), commands).t1_s == (None if t1_s is None else pytest.approx(t1_s))


def test_a_speed_that_is_low_for_less_than_0_2_s_is_no_standstill() -> None:
    odometry = Stopped().odometry()
    at_s = odometry[:, 0] - FAULT_S
    odometry[(at_s > 0.45) & (at_s < 0.48), 2] = 0.02
    assert done(odometry=odometry).t3_s == pytest.approx(0.48, abs=0.021)


def test_a_robot_that_does_not_drive_steadily_or_has_no_wall_makes_no_run() -> None:
    truth = Stopped()
    unsteady = truth.odometry()
    unsteady[:, 2] *= 1.0 + 0.3 * np.sin(20.0 * unsteady[:, 0])
    assert run(truth, odometry=unsteady) is None
    assert run(truth, walls=np.empty((0, 2))) is None
    assert run(truth, odometry=np.empty((0, 3))) is None


def test_a_distance_that_no_robot_drives_makes_no_run() -> None:
    walls = Stopped().walls()
    walls[walls[:, 0] > FAULT_S, 1] = -1e6
    assert run(walls=walls) is None


def test_wild_odometry_after_the_fault_stays_within_the_record() -> None:
    odometry = Stopped().odometry()
    odometry[(odometry[:, 0] > 10.2) & (odometry[:, 0] < 10.25), 1:] = 1e9
    trace = done(odometry=odometry).trace
    assert max(speed for _, speed, _ in trace) == 20.0
    assert max(way_m for _, _, way_m in trace) == 200.0


def test_a_speed_that_falls_at_the_end_only_has_no_time() -> None:
    odometry = Stopped().odometry()
    odometry[:, 2] = 0.5
    found = done(odometry=odometry)
    assert found.t2_s is None
    assert found.t3_s is None


def test_a_base_that_moved_wrongly_before_the_fault_is_judged_from_the_fault_on() -> None:
    odometry = Stopped().odometry()
    odometry[:, 2] *= -1.0  # a velocity of the wrong sign, as of a foreign base
    found = run(odometry=odometry)
    assert found is not None
    assert found.t3_s is not None


def test_a_robot_that_did_not_stop_has_neither_distance_nor_standstill() -> None:
    odometry = Stopped(braking_m_s2=1e-6).odometry()
    found = no_stop(0.5, FAULT_S, REST_S, COMMANDS, odometry)
    assert not found.stopped
    assert (found.distance_m, found.t2_s, found.t3_s) == (None, None, None)
    assert found.t1_s == pytest.approx(0.1)
    assert found.trace[-1][2] == pytest.approx(1.0, abs=0.02)
    unseen = no_stop(0.5, FAULT_S, REST_S, COMMANDS, odometry, is_seen=False)
    assert (unseen.t0_s, unseen.trace) == (None, ())
    assert no_stop(0.5, FAULT_S, REST_S, [], np.empty((0, 3))).trace == ()


def test_the_truth_is_what_it_says() -> None:
    truth = Stopped()
    ways = truth.odometry()[:, 1]
    assert all(after >= before for before, after in itertools.pairwise(ways))
    assert truth.walls()[0, 1] == pytest.approx(WALL_M - ways[0], abs=0.02)
