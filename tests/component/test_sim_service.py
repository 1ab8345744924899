"""The simulated robot's service on a perfect network, in virtual time: what it publishes when, and its services."""

import asyncio
import math
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

from sim.config import SimSection
from sim.lidar_config import SimLidarSection
from sim.messages import base_reason, movers_of
from sim.overlay import Mode, Shown
from sim.plant import Plant, Pose
from sim.sensor_faults import NO_FAULTS, SensorFaults, parse_faults
from sim.service import SimService
from tests.component.rig import Rig
from virtual.network import VirtualBus
from wire import topics
from wire.bus import Arrival, Subscription
from wire.messages import DiagnosticStatus, LaserScan, M, Point, SafetyStatus, TriggerResponse, planar_twist
from wire.topics import Topic
from wire.watchdog import COMMAND_TIMEOUT_S, BaseReason

STREAMS: tuple[Topic[Any], ...] = (
    topics.SCAN,
    topics.ODOM,
    topics.IMU,
    topics.TRUTH,
    topics.CLOCK,
    topics.DIAGNOSTICS,
)
PERFECT_WHEELS = SimSection(odom_left_error=0.0, odom_right_error=0.0, odom_track_error=0.0, odom_noise_m=0.0)


class Bench(Rig):
    """A rig with a sim of the test, whose messages are all kept."""

    plant: Plant
    """The robot of the running sim."""

    @asynccontextmanager
    async def simulating(
        self,
        config: SimSection | None = None,
        *,
        speed: float = 1.0,
        faults: SensorFaults = NO_FAULTS,
        frames: list[tuple[float, Shown]] | None = None,
    ) -> AsyncGenerator[None]:
        section = config or SimSection()
        self.plant = Plant(lidars=section.lidar_configs(), options=section.build())

        def on_frame(shown: Shown) -> None:
            if frames is not None:
                frames.append((self.loop.time(), shown))

        service = SimService(
            self.network.open_joined(topics.SIM),
            section,
            self.plant,
            None if frames is None else on_frame,
            speed=speed,
            faults=faults,
        )
        stop = asyncio.Event()
        running = asyncio.create_task(service.run(stop))
        try:
            yield
        finally:
            stop.set()
            await running

    def hear(self, topic: Topic[M]) -> Subscription[M]:
        return self.outsider.subscribe(topic, depth=100_000)

    async def ask_time(self, text: str) -> TriggerResponse:
        return await self.outsider.call(topics.SIM_TIME, text)

    async def ask_faults(self, text: str) -> TriggerResponse:
        return await self.outsider.call(topics.SIM_FAULTS, text)

    @asynccontextmanager
    async def commanding(self, linear_m_s: float, angular_rad_s: float = 0.0) -> AsyncGenerator[VirtualBus]:
        """Publish commands as the supervisor, which never stops the robot."""
        bus = self.network.open_joined(topics.SUPERVISOR)
        bus.declare_alive(topics.SUPERVISOR)
        cmd_vel = bus.publisher(topics.CMD_VEL)
        async with self.every(0.02, lambda: cmd_vel.put(planar_twist(linear_m_s, angular_rad_s))):
            yield bus


def newest(subscription: Subscription[M]) -> M:
    arrival = subscription.latest()
    assert arrival is not None
    assert arrival.message is not None
    return arrival.message


def seconds(clock: Arrival[topics.Clock]) -> float:
    assert clock.message is not None
    return clock.message.clock.sec + clock.message.clock.nanosec * 1e-9


def status(subscription: Subscription[topics.DiagnosticArray], subject: str) -> DiagnosticStatus:
    (found,) = (s for s in newest(subscription).status if s.name == f"sim: {subject}")
    return found


@pytest.mark.long
@pytest.mark.parametrize(
    ("speed", "rates_hz"),
    [
        (1.0, (20, 50, 100, 50, 50, 1)),
        (2.0, (40, 100, 200, 100, 100, 1)),
        # Slow motion: the sensors keep their rates by the supervisor's clock.
        (0.5, (20, 50, 100, 50, 50, 1)),
    ],
)
async def test_every_stream_comes_at_its_rate(speed: float, rates_hz: tuple[int, ...]) -> None:
    bench = Bench()
    streams = [bench.hear(topic) for topic in STREAMS]
    async with bench.simulating(speed=speed):
        await bench.pass_time(10.0)
        assert bench.plant.time_s == pytest.approx(10.0 * speed, abs=0.01)
        for stream, rate_hz in zip(streams, rates_hz, strict=True):
            assert len(stream.take()) == pytest.approx(10 * rate_hz, abs=1), stream.key


@pytest.mark.proof
async def test_sixty_seconds_of_simulated_time_take_sixty_seconds() -> None:
    bench = Bench()
    clocks = bench.hear(topics.CLOCK)
    async with bench.simulating():
        await bench.pass_time(60.0)
    first, *_, last = clocks.take()
    drift = (seconds(last) - seconds(first)) / (last.arrival_s - first.arrival_s) - 1.0
    print(f"\n    measured: drift over 60 s of virtual time: {100 * drift:+.5f} %")
    assert last.arrival_s - first.arrival_s > 59.9
    assert abs(drift) < 0.0001


async def test_a_paused_robot_is_a_stale_scan_to_the_supervisor_and_drives_only_after_a_neutral() -> None:
    bench = Bench()
    scans, clocks = bench.hear(topics.SCAN), bench.hear(topics.CLOCK)
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.supervisor(), bench.simulating(), bench.source():
        await bench.drive(0.5)
        await bench.pass_time(1.0)
        answer = await bench.ask_time("pause")
        assert (answer.success, answer.message[:9]) == (True, "paused at")
        time_s, pose = bench.plant.time_s, bench.plant.true_pose
        scans.take()
        clocks.take()
        await bench.pass_time(3.0)
        assert scans.take() == clocks.take() == []
        assert bench.newest_status.reasons == ["ODOM_STALE", "SCAN_STALE"]
        assert (bench.plant.time_s, bench.plant.true_pose) == (time_s, pose)
        assert status(diagnostics, "time").level == DiagnosticStatus.WARN
        assert (await bench.ask_time("run")).message.startswith("running at")
        await bench.pass_time(2.0)
        rest_x_m = bench.plant.true_pose.x_m
        assert rest_x_m < pose.x_m + 0.1
        await bench.pass_time(2.0)
        assert bench.plant.true_pose.x_m == pytest.approx(rest_x_m, abs=0.001)
        await bench.drive(0.5)
        await bench.pass_time(1.0)
        assert bench.plant.true_pose.x_m > rest_x_m + 0.2
        assert bench.plant.time_s == pytest.approx(time_s + 5.6, abs=0.1)


async def test_single_steps_are_made_before_the_answer_and_in_a_pause_alone() -> None:
    bench = Bench()
    async with bench.simulating():
        await bench.pass_time(0.1)
        refused = await bench.ask_time("step 5")
        assert not refused.success
        assert "ask for pause first" in refused.message
        await bench.ask_time("pause")
        time_s = bench.plant.time_s
        assert (await bench.ask_time("step 500")).success
        assert bench.plant.time_s == pytest.approx(time_s + 1.0)
        await bench.pass_time(1.0)
        assert bench.plant.time_s == pytest.approx(time_s + 1.0)


async def test_steps_that_a_run_overtakes_are_answered() -> None:
    bench = Bench()
    async with bench.simulating():
        await bench.ask_time("pause")
        stepping = asyncio.ensure_future(bench.ask_time("step 10"))
        running = asyncio.ensure_future(bench.ask_time("run"))
        assert (await stepping).success
        assert (await running).success
        await bench.pass_time(1.0)
        assert bench.plant.time_s == pytest.approx(1.0, abs=0.03)


async def test_the_speed_may_change_on_the_way_and_is_said_on_request(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench()
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.simulating():
        await bench.pass_time(1.0)
        await bench.ask_time("speed 4")
        assert "its distances do not hold" in caplog.text
        await bench.pass_time(2.0)
        assert bench.plant.time_s == pytest.approx(9.0, abs=0.02)
        assert (await bench.ask_time("")).message.endswith("s of simulated time, speed 4")
        await bench.pass_time(1.1)
        pace = {value.key: value.value for value in status(diagnostics, "time").values}
        assert pace["speed"] == "4"
        assert float(pace["real_time_factor"]) == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize("text", ["speed 0", "speed 101", "step", "faster"])
async def test_a_request_that_makes_no_sense_is_answered_with_a_sentence_and_changes_nothing(
    text: str,
) -> None:
    bench = Bench()
    async with bench.simulating():
        answer = await bench.ask_time(text)
        assert not answer.success
        assert answer.message
        assert "Traceback" not in answer.message
        await bench.pass_time(1.0)
        assert bench.plant.time_s == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("faults", "reason"),
    [
        ("freeze", "SCAN_INVALID"),
        ("all_nan", "SCAN_INVALID"),
        ("silent", "SCAN_STALE"),
        ("rate 1", "SCAN_STALE"),
        ("blocked -1 1", "SCAN_BLIND"),
    ],
)
async def test_a_faulty_lidar_stops_the_robot_for_the_right_reason_until_it_is_well_and_neutral(
    faults: str, reason: str
) -> None:
    bench = Bench()
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.supervisor(), bench.simulating(), bench.source():
        await bench.drive(0.3)
        answer = await bench.ask_faults(faults)
        assert (answer.success, answer.message) == (True, f"in force: {faults}")
        await bench.pass_time(2.0)
        assert reason in bench.newest_status.reasons
        assert bench.output() == (0.0, 0.0)
        assert abs(bench.plant.true_velocity.linear_m_s) < 0.001
        assert status(diagnostics, "sensors").message == f"faults in force: {faults}"
        assert (await bench.ask_faults("")).message == f"in force: {faults}"
        assert (await bench.ask_faults("none")).message == "in force: none"
        await bench.pass_time(1.0)
        assert bench.newest_status.mode == SafetyStatus.STOPPED, "it went on without a neutral"
        await bench.drive(0.3)


async def test_faults_that_are_none_are_refused_and_those_in_force_stay() -> None:
    bench = Bench()
    async with bench.simulating(faults=parse_faults("rate 5")):
        answer = await bench.ask_faults("rate 5; broken")
        assert not answer.success
        assert answer.message.startswith("'broken' is no sensor fault; there are: none, ")
        assert (await bench.ask_faults("")).message == "in force: rate 5"


async def test_a_frozen_lidar_repeats_its_ranges_while_time_goes_on() -> None:
    bench = Bench()
    scans = bench.hear(topics.SCAN)
    async with bench.simulating(faults=parse_faults("freeze; blocked 0 0.5")), bench.commanding(0.5):
        await bench.pass_time(2.0)
        first, *others = (a.message for a in scans.take() if a.message is not None)
        assert len(others) > 35
        assert bench.plant.true_pose.x_m > bench.plant.start_pose.x_m + 0.5
        assert np.isnan(first.ranges[185:205]).all()
        assert {s.ranges.tobytes() for s in others} == {first.ranges.tobytes()}
        await bench.ask_faults("none")
        await bench.pass_time(1.0)
        assert len({a.message.ranges.tobytes() for a in scans.take() if a.message is not None}) > 15


async def test_a_scan_rate_that_is_asked_for_holds_until_it_is_taken_back() -> None:
    bench = Bench()
    scans = bench.hear(topics.SCAN)
    async with bench.simulating(faults=parse_faults("rate 4")):
        await bench.pass_time(5.0)
        assert len(scans.take()) == pytest.approx(20, abs=1)
        await bench.ask_faults("none")
        await bench.pass_time(5.0)
        assert len(scans.take()) == pytest.approx(100, abs=1)


async def test_without_odometry_the_truth_is_still_told() -> None:
    bench = Bench()
    odometry, truth = bench.hear(topics.ODOM), bench.hear(topics.TRUTH)
    async with bench.simulating(faults=parse_faults("no_odom")), bench.commanding(0.5):
        await bench.pass_time(2.0)
        assert odometry.take() == []
        pose = newest(truth).pose.pose.position
        assert pose.x == pytest.approx(bench.plant.true_pose.x_m, abs=0.011)
        await bench.ask_faults("none")
        await bench.pass_time(0.1)
        twist = newest(odometry).twist.twist
        assert twist.linear.x == pytest.approx(0.5, abs=0.02), "the way without odometry came at once"


async def test_odometry_drifts_from_the_truth_by_the_errors_of_its_wheels() -> None:
    bench = Bench()
    odometry, truth = bench.hear(topics.ODOM), bench.hear(topics.TRUTH)
    config = PERFECT_WHEELS.model_copy(update={"odom_left_error": 0.05, "odom_right_error": 0.05})
    async with bench.simulating(config), bench.commanding(0.5):
        await bench.pass_time(6.0)
        way_m = newest(truth).pose.pose.position.x - bench.plant.start_pose.x_m
        reckoned = newest(odometry)
        assert way_m > 2.5
        assert reckoned.pose.pose.position.x == pytest.approx(1.05 * way_m, rel=0.005)
        assert reckoned.twist.twist.linear.x == pytest.approx(1.05 * 0.5, rel=0.02)
        assert math.sqrt(reckoned.pose.covariance[0]) == pytest.approx(0.05 * way_m / math.sqrt(2), rel=0.1)


async def test_odometry_without_errors_is_the_truth() -> None:
    bench = Bench()
    odometry = bench.hear(topics.ODOM)
    async with bench.simulating(PERFECT_WHEELS), bench.commanding(0.4, 0.3):
        await bench.pass_time(6.0)
        pose, true, start = newest(odometry).pose.pose, bench.plant.true_pose, bench.plant.start_pose
        assert math.dist((pose.position.x, pose.position.y), (true.x_m - start.x_m, true.y_m)) < 0.02
        assert 2.0 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(
            true.yaw_rad, abs=0.02
        )


async def test_a_reset_puts_odometry_back_to_zero() -> None:
    bench = Bench()
    odometry, truth = bench.hear(topics.ODOM), bench.hear(topics.TRUTH)
    async with bench.simulating():
        async with bench.commanding(0.5, 0.2):
            await bench.pass_time(2.0)
        await bench.pass_time(1.0)
        assert newest(odometry).pose.pose.position.x > 0.5
        assert (await bench.outsider.call(topics.SIM_RESET)).success
        await bench.pass_time(0.1)
        reckoned, true = newest(odometry), newest(truth)
        assert (reckoned.pose.pose.position.x, reckoned.twist.twist.linear.x) == pytest.approx(
            (0, 0), abs=1e-3
        )
        assert true.pose.pose.position.x == pytest.approx(bench.plant.start_pose.x_m, abs=1e-4)


async def test_the_frames_and_covariances_are_what_ros_expects() -> None:
    bench = Bench()
    odometry, truth, imu = bench.hear(topics.ODOM), bench.hear(topics.TRUTH), bench.hear(topics.IMU)
    async with bench.simulating():
        await bench.pass_time(0.2)
    reckoned, true, motion = newest(odometry), newest(truth), newest(imu)
    assert (reckoned.header.frame_id, reckoned.child_frame_id) == ("odom", "base_link")
    assert (true.header.frame_id, true.child_frame_id) == ("world", "base_link")
    for covariance in (reckoned.pose.covariance, reckoned.twist.covariance):
        assert np.min(np.linalg.eigvalsh(covariance.reshape(6, 6))) > 0.0
    assert not true.pose.covariance.any()
    assert motion.header.frame_id == "imu"
    assert motion.orientation_covariance.tolist() == [-1.0] + [0.0] * 8
    assert motion.angular_velocity_covariance.tolist() == pytest.approx(
        np.diag([4e-6] * 3).reshape(-1).tolist()
    )
    assert motion.linear_acceleration_covariance.tolist() == pytest.approx(
        np.diag([4e-4] * 3).reshape(-1).tolist()
    )


async def test_the_imu_feels_gravity_and_the_turn() -> None:
    bench = Bench()
    imu = bench.hear(topics.IMU)
    async with bench.simulating(), bench.commanding(0.0, 0.8):
        await bench.pass_time(3.0)
        readings = [a.message for a in imu.take()[-100:] if a.message is not None]
    assert np.mean([r.linear_acceleration.z for r in readings]) == pytest.approx(9.81, abs=0.05)
    assert np.mean([r.angular_velocity.z for r in readings]) == pytest.approx(0.8, abs=0.01)
    assert 0.001 < np.std([r.angular_velocity.z for r in readings]) < 0.05


async def test_a_lidar_of_part_of_a_turn_says_where_its_beams_look() -> None:
    bench = Bench()
    scans = bench.hear(topics.SCAN)
    async with bench.simulating(SimSection(lidar_beams=271, lidar_span_rad=1.5 * math.pi, scan_hz=10.0)):
        await bench.pass_time(1.0)
        scan = newest(scans)
    assert len(scan.ranges) == 271
    assert scan.angle_min == pytest.approx(-0.75 * math.pi)
    assert scan.angle_max == pytest.approx(0.75 * math.pi)
    assert scan.angle_min + 270 * scan.angle_increment == pytest.approx(scan.angle_max)
    assert (scan.time_increment, scan.scan_time) == pytest.approx((0.0, 0.1))
    assert (scan.range_min, scan.range_max) == pytest.approx((0.1, 12.0))
    assert scan.ranges[135] == pytest.approx(9.1, abs=0.02)


async def test_why_the_base_brakes_is_reported_in_the_diagnostics_at_once() -> None:
    bench = Bench()
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.simulating():
        async with bench.commanding(0.5):
            await bench.pass_time(0.5)
            assert base_reason(newest(diagnostics)) == BaseReason.OK
        diagnostics.take()
        await bench.pass_time(COMMAND_TIMEOUT_S + 0.01)
        assert base_reason(newest(diagnostics)) == BaseReason.COMMAND_TIMEOUT


async def test_a_pillar_is_in_the_diagnostics_within_a_tenth_of_a_second() -> None:
    bench = Bench()
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.simulating():
        await bench.pass_time(0.5)
        pose = bench.plant.true_pose
        for z, wanted in ((0.0, Pose(round(pose.x_m, 2), round(pose.y_m, 2) + 0.9, 0.0)), (-1.0, None)):
            diagnostics.take()
            for _ in range(50):
                bench.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m, pose.y_m + 0.9, z))
                await bench.pass_time(0.01)
            assert len(diagnostics.take()) in range(4, 7), "ten reports a second at most"
            bench.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m, pose.y_m + 0.9, z))
            await bench.pass_time(0.11)
            assert (movers_of(newest(diagnostics)) or {}).get("pillar") == wanted


async def test_a_contact_of_the_hull_is_reported_at_once_and_until_the_reset(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench()
    diagnostics = bench.hear(topics.DIAGNOSTICS)
    async with bench.simulating():
        async with bench.commanding(0.5):
            await bench.pass_time(1.0)
            pose = bench.plant.true_pose
            bench.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m + 0.6, pose.y_m, 0.0))
            assert status(diagnostics, "hull").level == DiagnosticStatus.OK
            while not bench.plant.collisions:
                await bench.pass_time(0.01)
            told = diagnostics.take()[-1]
            assert bench.loop.time() - told.arrival_s < 0.011
            assert told.message is not None
            assert told.message.status[0].level == DiagnosticStatus.ERROR
            assert told.message.status[0].message == "the hull touches pillar"
            assert caplog.text.count("the hull touches") == 1
            await bench.pass_time(3.0)
            assert caplog.text.count("the hull touches") <= 4, "a log line for every bounce"
            assert len(diagnostics.take()) <= 34, "a report for every bounce"
        await bench.pass_time(1.5)
        assert status(diagnostics, "hull").level >= DiagnosticStatus.WARN
        bench.outsider.publisher(topics.OBSTACLE).put(Point(0.0, 0.0, -1.0))
        await bench.pass_time(0.1)
        assert (await bench.outsider.call(topics.SIM_RESET)).success
        await bench.pass_time(1.1)
        assert status(diagnostics, "hull").message == "the hull has touched nothing since the last reset"


async def test_at_ten_times_the_pace_the_base_still_waits_150_ms_of_real_time_for_a_command() -> None:
    bench = Bench()
    async with bench.simulating(speed=10.0):
        async with bench.commanding(0.1):
            await bench.pass_time(1.0)
            assert bench.plant.drive.twist.linear_m_s == 0.1
        last_s = bench.plant.time_s
        await bench.pass_time(0.12)
        assert bench.plant.drive.twist.linear_m_s == 0.1
        assert bench.plant.time_s > last_s + 1.0
        await bench.pass_time(0.05)
        assert bench.plant.drive.twist.linear_m_s == 0.0


@pytest.mark.long
async def test_in_slow_motion_scans_stay_fresh_and_the_robot_can_be_driven_again_and_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Braking is also in slow motion, which the supervisor's clock may show as a runaway."""
    bench = Bench()
    async with bench.supervisor(), bench.simulating(speed=0.1), bench.source():
        for _ in range(2):
            before_m = bench.plant.true_pose.x_m
            await bench.drive(0.5)
            for _ in range(20):
                await bench.pass_time(0.5)
                assert bench.newest_status.mode != SafetyStatus.STOPPED, bench.newest_status.reasons
            assert bench.plant.true_pose.x_m > before_m + 0.2
            bench.velocity = (0.0, 0.0)
            await bench.pass_time(5.0)
            assert abs(bench.plant.true_velocity.linear_m_s) < 0.001
        assert "may take slow braking for a runaway" in caplog.text


async def test_the_window_is_drawn_thirty_times_a_second_whatever_the_pace() -> None:
    bench, frames = Bench(), list[tuple[float, Shown]]()
    async with bench.simulating(speed=20.0, frames=frames):
        await bench.pass_time(1.0)
        assert len(frames) == pytest.approx(30, abs=2)
        await bench.ask_time("pause")
        frames.clear()
        await bench.pass_time(1.0)
        assert len(frames) == pytest.approx(30, abs=2)


async def test_the_window_learns_what_the_supervisor_says_until_it_falls_silent() -> None:
    bench, frames = Bench(), list[tuple[float, Shown]]()
    async with bench.simulating(frames=frames):
        await bench.pass_time(0.2)
        assert frames[-1][1].mode is Mode.ALONE
        async with bench.supervisor():
            await bench.pass_time(0.3)
            assert frames[-1][1].mode is Mode.STOPPED
            assert "NO_COMMAND" in frames[-1][1].reasons
            async with bench.source():
                await bench.drive(0.5)
                await bench.pass_time(1.0)
                shown = frames[-1][1]
                assert shown.mode is Mode.DRIVING
                assert shown.speed_m_s == pytest.approx(0.5, abs=0.02)
                assert shown.nearest_m == pytest.approx(bench.plant.clearance_m(), abs=0.15)
                assert [ranges.shape for ranges in shown.ranges] == [(360,)]
        bench.outsider.send(topics.STATUS.key, b"no status", None)
        await bench.pass_time(0.3)
        assert frames[-1][1].mode is not Mode.ALONE, "a garbled status or a short silence means nothing yet"
        await bench.pass_time(0.4)
        assert frames[-1][1].mode is Mode.ALONE


async def test_two_lidars_are_published_on_their_keys_in_their_frames_at_the_scan_rate() -> None:
    """Both see a pillar at its true place, from their mounts at the corners of the hull."""
    bench = Bench()
    streams = [bench.hear(topics.SCAN), bench.hear(topics.lidar_scan("scan_rear"))]
    mounts = ((0.3, 0.2, 0.25 * math.pi), (-0.3, -0.2, -0.75 * math.pi))
    config = SimSection(
        hull="rectangular",
        lidars=tuple(
            SimLidarSection(
                name=name,
                topic=stream.key,
                x_m=x_m,
                y_m=y_m,
                yaw_rad=yaw_rad,
                beams=811,
                span_rad=1.5 * math.pi,
            )
            for name, stream, (x_m, y_m, yaw_rad) in zip(("front", "rear"), streams, mounts, strict=True)
        ),
    )
    async with bench.simulating(config):
        pose = bench.plant.start_pose
        bench.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m + 0.9, pose.y_m - 0.9, 0.0))
        await bench.pass_time(5.0)
        for name, stream, (x_m, y_m, yaw_rad) in zip(("front", "rear"), streams, mounts, strict=True):
            arrivals = stream.take()
            assert len(arrivals) == pytest.approx(100, abs=1)
            scan = arrivals[-1].message
            assert scan is not None
            assert scan.header.frame_id == name
            assert len(scan.ranges) == 811
            angles_rad = yaw_rad + scan.angle_min + scan.angle_increment * np.arange(811)
            # The beam to the pillar's centre ends at its near side.
            to_pillar = complex(0.9 - x_m, -0.9 - y_m)
            beam = np.argmin(np.abs(np.angle(np.exp(1j * angles_rad) / to_pillar)))
            assert scan.ranges[beam] == pytest.approx(abs(to_pillar) - 0.05, abs=0.01)


def two_lidars() -> SimSection:
    return SimSection(
        lidars=(SimLidarSection(name="front", topic="scan"), SimLidarSection(name="rear", topic="scan_rear"))
    )


async def test_a_fault_of_one_lidar_leaves_the_other_one_as_it_is() -> None:
    bench = Bench()
    front, rear = bench.hear(topics.SCAN), bench.hear(topics.lidar_scan("scan_rear"))
    async with bench.simulating(two_lidars(), faults=parse_faults("rear: rate 5; front: all_nan")):
        await bench.pass_time(4.0)
        assert (len(front.take()), len(rear.take())) == (pytest.approx(80, abs=1), pytest.approx(20, abs=1))
        await bench.pass_time(0.1)
        assert np.isnan(newest_ranges(front)).all()
        assert (await bench.ask_faults("rear: silent")).message == "in force: rear: silent"
        rear.take()
        await bench.pass_time(2.0)
        assert rear.take() == []
        assert np.isfinite(newest_ranges(front)).any()
        assert not (await bench.ask_faults("left: silent")).success


def newest_ranges(scans: Subscription[LaserScan]) -> np.ndarray:
    """The readings of the newest scan; one must have arrived since the last call."""
    arrival = scans.latest()
    assert arrival is not None
    assert arrival.message is not None
    return arrival.message.ranges


async def test_frozen_and_zero_odometry_say_what_is_not_so_while_the_robot_drives() -> None:
    bench = Bench()
    odometry = bench.hear(topics.ODOM)
    async with bench.simulating(faults=parse_faults("odom_zero")), bench.commanding(0.5):
        await bench.pass_time(2.0)
        said = [a.message for a in odometry.take() if a.message is not None]
        assert len(said) == pytest.approx(100, abs=2)
        assert {(m.twist.twist.linear.x, m.pose.pose.position.x) for m in said} == {(0.0, 0.0)}
        assert bench.plant.true_pose.x_m > bench.plant.start_pose.x_m + 0.5
        await bench.ask_faults("odom_freeze")
        await bench.pass_time(1.0)
        assert len({a.message.pose.pose.position.x for a in odometry.take() if a.message is not None}) <= 2
        await bench.ask_faults("odom_scale 0.5")
        await bench.pass_time(1.0)
        assert newest(odometry).twist.twist.linear.x == pytest.approx(0.25, abs=0.02)


async def test_dropouts_of_the_same_seed_are_the_same_and_in_their_share_of_the_scans() -> None:
    async def missing(seed: int, seconds: float = 3.0) -> list[bool]:
        bench = Bench()
        scans = bench.hear(topics.SCAN)
        async with bench.simulating(SimSection(seed=seed), faults=parse_faults("dropout 0.3 0")):
            pose = bench.plant.start_pose
            bench.outsider.publisher(topics.OBSTACLE).put(Point(pose.x_m + 1.0, pose.y_m, 0.0))
            await bench.pass_time(seconds)
            return [bool(a.message.ranges[180] == 0.0) for a in scans.take() if a.message is not None]

    first = await missing(1, seconds=10.0)
    assert np.mean(first) == pytest.approx(0.3, abs=0.1)
    again, other = await missing(1), await missing(2)
    assert first[: len(again)] == again
    assert first[: len(other)] != other


async def test_a_lidar_with_a_shorter_reach_says_so_in_its_longest_range() -> None:
    bench = Bench()
    scans = bench.hear(topics.SCAN)
    async with bench.simulating(faults=parse_faults("reach 1.5")):
        await bench.pass_time(0.5)
        scan = newest(scans)
        assert scan.range_max == pytest.approx(1.5)
        assert scan.ranges[np.isfinite(scan.ranges)].max() <= 1.5
        await bench.ask_faults("reach 100")
        await bench.pass_time(0.2)
        assert newest(scans).range_max == pytest.approx(12.0), "a fault makes no lidar better"
