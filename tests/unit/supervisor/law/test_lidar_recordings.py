"""The law over real recordings: six sensors, five codings of "no return", and all their anomalies.

`data/lidar/README.md` beside the repository says where they are from; LIFELINE_LIDAR_DATA names another place.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from supervisor.config import LidarSection, SupervisorSection
from supervisor.law.decision import Decision
from supervisor.law.lidar import PROFILES
from supervisor.law.model import Inputs, LawConfig, Odometry
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import step
from tests.unit.supervisor.law import recordings
from tests.unit.supervisor.law.law_harness import NEUTRAL, TICK_S, on_time, proven_state, with_lidar
from tests.unit.supervisor.law.recordings import ROBOTS, SLOW, START_S, Ranges, Recording, Replay
from wire.reasons import StopReason

pytestmark = pytest.mark.proof

SPIKE = Velocity(31.0, 0.0)

OPEN_M = 0.7
"""Minimum free distance ahead of the hull in open space: more than twice the stop distance."""


@cache
def _load(name: str) -> Recording:
    robot = ROBOTS[name]
    if not (recordings.DATA / f"{robot.file}.npz").exists():
        pytest.skip(f"no recording {robot.file}.npz; LIFELINE_LIDAR_DATA can say where the recordings are")
    return recordings.load(robot)


@pytest.fixture(params=list(ROBOTS))
def recording(request: pytest.FixtureRequest) -> Recording:
    return _load(request.param)


def _usual_beams(recording: Recording) -> int:
    return int(np.bincount([len(scan) for scan in recording.scans]).argmax())


def _open(recording: Recording) -> list[Ranges]:
    """Scans of the usual size with free space ahead, by plain geometry and not by the law."""
    beams = _usual_beams(recording)
    whole = [scan for scan in recording.scans if len(scan) == beams]
    return [scan for scan in whole if recording.free_ahead_m(scan) >= OPEN_M]


def _drive(recording: Recording, ranges: Ranges, motion: Velocity = SLOW) -> Decision:
    """A robot at rest receives this scan twice; the operator sends neutral, then requests a motion.

    Before that, every beam has had a return, because some profiles trust no silence otherwise.
    """
    state = proven_state(recording.config, now_s=START_S)
    now_s = START_S
    for seen in (np.full(len(ranges), 5.0, dtype=np.float32), ranges, recording.noisy(ranges, 1)):
        now_s += TICK_S
        state, _ = step(state, now_s, Inputs(scans=(recording.scan(seen, now_s),)))
    for velocity in (NEUTRAL, motion):
        now_s += TICK_S
        state, decision = step(state, now_s, Inputs(commands=(on_time("teleop", velocity, now_s),)))
    return decision


def _check(decision: Decision, config: LawConfig) -> None:
    assert all(map(math.isfinite, decision.output))
    assert abs(decision.output.linear_m_s) <= config.max_linear_m_s
    assert abs(decision.output.angular_rad_s) <= config.max_angular_rad_s
    assert not decision.reasons or decision.output == STANDSTILL


def test_nothing_raises_and_every_output_is_lawful_over_the_whole_recording(recording: Recording) -> None:
    replay = Replay(recording)
    for _, decision in replay.run():
        _check(decision, recording.config)
    assert replay.driven > 0
    assert replay.decision.scan_counts.accepted > 0


def test_a_standing_robot_in_an_open_place_may_drive(recording: Recording) -> None:
    places = _open(recording)
    assert len(places) >= 30
    for ranges in places[:: max(1, len(places) // 40)]:
        decision = _drive(recording, ranges)
        assert decision.output == SLOW, (decision.reasons, decision.scan_problem, decision.nearest_m)


@pytest.mark.parametrize(
    ("name", "permitted_m_s"),
    [
        (
            "hokuyo768-right",
            0.1,
        ),  # its corner lidar does not see ahead of the other corner: it may only creep
        ("hokuyo-urg04", 1.0),
        ("sick-intel", 1.0),
        ("neato-lds", 1.0),
    ],
)
def test_with_nothing_within_1_m_no_scan_of_a_recording_stops_or_slows_the_robot(
    name: str, permitted_m_s: float
) -> None:
    """In the other two recordings, something is within 1 m all the time."""
    recording, beams = _load(name), _usual_beams(_load(name))
    places = [r for r in recording.scans if len(r) == beams and recording.free_around_m(r) >= 1.0]
    assert places
    speeds_m_s = [_drive(recording, r, Velocity(1.0, 0.0)).output.linear_m_s for r in places]
    print(f"{name}: {sum(v == 0.0 for v in speeds_m_s)} false stops in {len(places)} scans with 1 m of room")
    assert speeds_m_s == pytest.approx([permitted_m_s] * len(places))


def test_a_recorded_drive_of_a_neato_keeps_its_speed_for_99_percent_of_its_time() -> None:
    """Commanded as odometry shows the drive, including bumper contacts."""
    replay = Replay(_load("neato-lds"), NEUTRAL)
    moving = slowed = 0
    for _, decision in replay.run():
        if decision.commanded != STANDSTILL:
            moving += 1
            slowed += bool(decision.reasons) or decision.scale < 1.0
        if replay.state.base.odometry is not None:
            replay.motion = replay.state.base.odometry.velocity
    print(f"slowed or stopped in {slowed} of {moving} steps of a moving robot")
    assert moving > 1000
    assert slowed < 0.01 * moving


@pytest.mark.parametrize("name", ["sick-intel", "neato-lds"])
def test_no_recorded_motion_contradicts_the_mounting_and_sectors_that_repeat_hardly_leave_a_hole(
    name: str,
) -> None:
    """The velocities of `sick-intel` contain spikes, so that its poses drift: nothing may be concluded from them.

    One of its scans leaves a hole: in a turn, two repeated beams at the end of the view look where no scan has looked before.
    """
    robot = replace(ROBOTS[name], longest_s=math.inf)
    _load(name)  # skips without the recordings
    replay = Replay(recordings.load(robot))
    scans = repeated = holes = 0
    for number, decision in replay.run():
        assert StopReason.SENSOR_MISMATCH not in decision.causes
        (lidar,) = replay.state.sight.lidars
        block = lidar.agreement.repeated
        if number is None or lidar.scan is None or lidar.scan.view is None:
            continue
        scans += 1
        if block is not None and len(block) == len(lidar.scan.view.free_m):
            repeated += 1
            holes += bool((lidar.scan.view.free_m[block] == 0.0).any())
    print(f"{name}: {repeated} of {scans} scans with a repeated block, {holes} with a hole")
    assert scans > 300
    assert repeated <= 0.002 * scans
    assert holes <= 0.001 * scans


def test_the_same_places_with_an_object_at_20_cm_ahead_do_not(recording: Recording) -> None:
    places = _open(recording)
    for ranges in places[:: max(1, len(places) // 40)]:
        decision = _drive(recording, recording.painted(ranges))
        assert decision.output == STANDSTILL
        assert decision.reasons == (StopReason.OBSTACLE,)


def test_with_an_object_ahead_no_oddity_of_the_whole_recording_lets_it_forward(recording: Recording) -> None:
    for _, decision in Replay(recording).run(painted=True):
        assert decision.output == STANDSTILL


def _odd(recording: Recording) -> dict[str, set[int]]:
    """The numbers of a recording's anomalous scans, by anomaly."""
    gaps = np.diff(recording.arrival_s) > 2.0 * recording.period_s
    back = np.diff(recording.header_s) < 0.0
    return {
        "too few beams": {n for n, s in enumerate(recording.scans) if len(s) != _usual_beams(recording)},
        "a stamp that goes back": set((np.flatnonzero(back) + 1).tolist()),
        "a gap": set((np.flatnonzero(gaps) + 1).tolist()),
        "-inf": {n for n, scan in enumerate(recording.scans) if np.isneginf(scan).any()},
    }


def test_the_recordings_have_the_oddities_that_these_tests_are_about() -> None:
    found = {name: {kind: len(scans) for kind, scans in _odd(_load(name)).items()} for name in ROBOTS}
    assert found["neato-lds"]["too few beams"] == 1
    assert found["sick-intel"]["a stamp that goes back"] > 10
    assert found["sick-intel"]["a gap"] > 10
    assert found["hokuyo768-right"]["-inf"] > 100
    assert max(abs(o.velocity.linear_m_s) for o in _load("sick-intel").odometry) > 31.0


def test_after_each_oddity_it_drives_again_within_a_bounded_time(recording: Recording) -> None:
    """Two scan timeouts prove a new clock, and a gap of three scans is one more; then neutral, then the motion."""
    good = _open(recording)[0]
    limit_s = 2 * recording.config.lidars[0].timeout_s + 3 * recording.period_s + 0.2
    wanted: set[int] = set()
    for numbers in _odd(recording).values():
        some = sorted(numbers)
        wanted.update(some[:: max(1, len(some) // 8)])
    replay = Replay(recording)
    for number, _ in replay.run():
        if number in wanted:
            assert _branch(replay).recovery_s(good, limit_s) <= limit_s, number
    assert _branch(replay).recovery_s(good, limit_s) <= limit_s, "at the end"


def _branch(replay: Replay) -> Replay:
    branch = Replay(replay.recording, replay.motion)
    branch.state, branch.decision = replay.state, replay.decision
    return branch


@pytest.mark.parametrize("driving", [True, False])
def test_an_odometry_spike_neither_stops_it_permanently_nor_hides_what_is_ahead(
    recording: Recording, *, driving: bool
) -> None:
    good = _open(recording)[0]
    replay = Replay(recording, SLOW if driving else NEUTRAL)
    assert replay.recovery_s(good, 2.0) < 2.0 or not driving
    assert replay.state.clock.now_s is not None
    now_s = replay.state.clock.now_s + TICK_S
    _check(replay.step(now_s, odometry=Odometry(SPIKE, now_s)), recording.config)
    painted = recording.painted(good)
    header_s = now_s + TICK_S - recording.header_lag_s
    hidden = _branch(replay)
    hidden.motion = SLOW
    for n in range(1, 25):
        later_s = now_s + n * TICK_S
        hidden.step(later_s, recording.scan(recording.noisy(painted, n), later_s, header_s + n * TICK_S))
        assert hidden.decision.output == STANDSTILL
    replay.motion = SLOW
    assert replay.recovery_s(good, 3.0) < 2 * recording.config.lidars[0].timeout_s + 1.0


def _while_moving(recording: Recording, scans: Callable[[int], Ranges]) -> list[Decision]:
    """Scans by arrival alone while odometry says that the robot moves at 0.3 m/s."""
    state = proven_state(recording.config, now_s=START_S)
    decisions: list[Decision] = []
    for n in range(40 + round(recording.config.lidars[0].timeout_s / TICK_S)):
        now_s = START_S + n * TICK_S
        odometry = Odometry(Velocity(0.3, 0.0), now_s)
        velocity = NEUTRAL if n < 5 else SLOW
        inputs = Inputs(
            commands=(on_time("teleop", velocity, now_s),),
            scans=(recording.scan(scans(n), now_s),),
            odometry=odometry,
        )
        state, decision = step(state, now_s, inputs)
        decisions.append(decision)
    return decisions


def test_a_recorded_scan_that_freezes_while_the_robot_moves_is_invalid(recording: Recording) -> None:
    good = _open(recording)[0]
    moving = _while_moving(recording, lambda n: recording.noisy(good, n))
    assert StopReason.SCAN_INVALID not in {reason for d in moving for reason in d.reasons}
    frozen = _while_moving(recording, lambda n: good if n > 10 else recording.noisy(good, n))
    assert StopReason.SCAN_INVALID in frozen[-1].reasons
    assert frozen[-1].output == STANDSTILL
    assert "while the robot moves" in frozen[-1].scan_problem


def test_a_recorded_scan_that_goes_blank_at_once_is_invalid(recording: Recording) -> None:
    good = _open(recording)[0]
    codes = (*recording.robot.no_return, math.inf)
    for code in codes:
        blank = np.full(len(good), code, dtype=np.float32)
        decisions = _while_moving(
            recording, lambda n, blank=blank: blank if n > 10 else recording.noisy(good, n)
        )
        assert StopReason.SCAN_INVALID not in decisions[10].reasons
        assert StopReason.SCAN_INVALID in decisions[-1].reasons
        assert decisions[-1].output == STANDSTILL


def test_a_profile_that_does_not_fit_its_sensor_does_not_drive() -> None:
    """The zeros of a Neato are, by REP 117, something too close in every direction."""
    recording = _load("neato-lds")
    wrong = replace(recording, config=with_lidar(recording.config, profile=PROFILES["rep117"]))
    ranges = _open(recording)[0]
    assert _drive(recording, ranges).output == SLOW
    assert _drive(wrong, ranges).reasons == (StopReason.OBSTACLE,)


def test_a_neato_is_stale_under_a_timeout_for_20_hz_but_not_under_that_of_its_profile() -> None:
    recording = _load("neato-lds")
    profiles = SupervisorSection(lidar=LidarSection(profile="neato_xv")).law().lidars[0].timeout_s

    def stale_share(timeout_s: float) -> float:
        late_s = np.maximum(np.diff(recording.arrival_s) - timeout_s, 0.0)
        return float(late_s.sum() / np.ptp(recording.arrival_s))

    assert stale_share(SupervisorSection().scan_timeout_s) > 0.02
    assert stale_share(profiles) < 1e-4
