"""The asyncio shell of the simulated robot: it serves the keys of a real base at the requested pace.

The physics steps follow the loop's monotonic clock; a message never waits for the next step. At every step, the base's
watchdog decides the target of the drive. It uses real time at any pace, because commands arrive in real time: at ten
times the pace, two commands are 0.2 s of simulated time apart.
"""

import asyncio
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sim.config import SimSection
from sim.lidar import Ranges
from sim.lidar_config import LidarConfig
from sim.messages import (
    Health,
    contact_sentence,
    pace_sentence,
    to_clock,
    to_diagnostics,
    to_imu,
    to_odometry,
    to_scan,
    to_truth,
)
from sim.motion_sensors import Imu, Odometer
from sim.overlay import Shown
from sim.pace import Every, Measured, Pace, Request, TimeRequestError, parse_time_request
from sim.plant import Plant
from sim.sensor_faults import (
    NO_FAULTS,
    FaultError,
    FaultyLidar,
    FaultyOdometry,
    LidarFaults,
    SensorFaults,
    parse_faults,
)
from wire import topics
from wire.bus import Arrival, Bus, Publisher, woken_by
from wire.host.notify import Notifier
from wire.host.pauses import never_suspended
from wire.messages import LaserScan, Point, SafetyStatus, TriggerResponse, Twist
from wire.watchdog import BaseReason, Watchdog

_log = logging.getLogger(__name__)

OBSTACLE_DEPTH = 16
TRUTH_HZ, CLOCK_HZ = 50.0, 50.0

SLICE_S = 0.002
"""Maximum time for making due steps before commands and requests are processed again."""
FRAME_S = 1.0 / 30.0
REPORT_S = 1.0
CONTACT_REPORT_S = 0.1
"""Minimum time between two reports of contacts or of the pillar, for a hull that bounces along a rack; log lines are at least 1 s apart."""
CONTACT_LOG_S = 1.0
PACE_LOG_S = 10.0
FAULTS_STREAM = 1
"""Together with the seed and a lidar's number: a separate random stream for faults, so that they do not change the noise."""


@dataclass(slots=True)
class _Eye:
    """One of the plant's lidars, with its scan times and its publisher."""

    number: int
    lidar: LidarConfig
    times: Every
    out: Publisher[LaserScan]
    faulty: FaultyLidar
    faults: LidarFaults = NO_FAULTS
    last: Ranges = field(default_factory=lambda: np.empty(0, np.float32))


class SimService:
    """One simulated robot on one Bus.

    Args:
        bus: the bus for all messages.
        config: `[sim]`.
        plant: the robot in its world.
        on_frame: draws the world with the given values, 30 times a second, even while paused.
        speed: initial simulated seconds per second.
        faults: initial sensor faults.
        suspended_s: returns how long the machine was suspended since the last call [s].
        notifier: reports in each turn that the loop runs; None reports nothing.
    """

    def __init__(
        self,
        bus: Bus,
        config: SimSection,
        plant: Plant,
        on_frame: Callable[[Shown], None] | None = None,
        *,
        speed: float = 1.0,
        faults: SensorFaults = NO_FAULTS,
        suspended_s: Callable[[], float] = never_suspended,
        notifier: Notifier | None = None,
    ) -> None:
        self._bus = bus
        self._notifier = Notifier() if notifier is None else notifier
        self._config = config
        self._plant = plant
        self._on_frame = on_frame
        self._watchdog = Watchdog(config.command_timeout_s)
        self._suspended_s = suspended_s
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._supervisor_changed_s = 0.0
        self._reason = BaseReason.NO_COMMAND

        dt_s = plant.timestep_s
        self._pace = Pace(dt_s, self._loop.time(), speed)
        self._single_steps_made: asyncio.Future[None] | None = None
        """Done when the single steps are made or cancelled."""
        self._steps = 0
        self._odom_times = Every(config.odom_hz, dt_s)
        self._imu_times = Every(config.imu_hz, dt_s)
        self._truth_times = Every(TRUTH_HZ, dt_s)
        self._clock_times = Every(CLOCK_HZ, dt_s)

        self._odometer = Odometer(plant.wheels, config.encoders(), config.seed)
        self._odometer.reset(*plant.wheel_angles_rad)
        self._odom_read_s = plant.time_s
        self._faulty_odometry = FaultyOdometry()
        self._imu = Imu(config.imu(), config.seed)
        self._eyes = [
            _Eye(
                number,
                lidar,
                Every(config.scan_hz, dt_s),
                bus.publisher(topics.lidar_scan(lidar.topic)),
                FaultyLidar(
                    lidar.angles_rad,
                    plant.way_out_m(number),
                    lidar.range_min_m,
                    (config.seed, number, FAULTS_STREAM),
                ),
            )
            for number, lidar in enumerate(plant.lidars)
        ]
        self._faults = NO_FAULTS
        self._put_in_force(faults)

        self._collisions = plant.collisions
        self._measured = Measured(math.nan, 0.0)
        self._next_report_s = self._loop.time()
        self._next_frame_s = math.inf if on_frame is None else self._loop.time()
        self._next_contact_report_s = self._next_contact_log_s = self._next_pace_log_s = 0.0

        # An unchanged command does not wake the loop: it is processed before the next step, which is soon enough.
        self._cmd_vel = bus.subscribe(topics.CMD_VEL, wake=self._wake, repeats_wake=False)
        self._alive = bus.watch_alive(self._wake, [topics.SUPERVISOR])
        self._obstacles = bus.subscribe(topics.OBSTACLE, depth=OBSTACLE_DEPTH, wake=self._wake)
        self._statuses = None if on_frame is None else bus.subscribe(topics.STATUS)  # for display only
        self._status: SafetyStatus | None = None
        self._status_s = -math.inf
        self._odom_out = bus.publisher(topics.ODOM)
        self._imu_out = bus.publisher(topics.IMU)
        self._truth_out = bus.publisher(topics.TRUTH)
        self._clock_out = bus.publisher(topics.CLOCK)
        self._diagnostics_out = bus.publisher(topics.DIAGNOSTICS)
        bus.serve(topics.SIM_RESET, self._on_reset)
        bus.serve(topics.SIM_FAULTS, self._on_faults)
        bus.serve(topics.SIM_TIME, self._on_time)

    async def run(self, stop: asyncio.Event) -> None:
        """Simulate until `stop` is set."""
        token = self._bus.declare_alive(topics.SIM)
        stopping = asyncio.ensure_future(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        self._warn_of_speed()
        try:
            while not stop.is_set():
                if self._pace.is_due:
                    await asyncio.sleep(0)  # behind schedule: process requests, but do not wait
                else:
                    due_s = min(self._pace.due_s, self._next_report_s, self._next_frame_s)
                    await woken_by(self._wake, due_s)
                self._listen()
                now_s = self._loop.time()
                self._pace.elapse(now_s)
                self._make_steps(now_s)
                if now_s >= self._next_frame_s and self._on_frame is not None:
                    self._next_frame_s = now_s + FRAME_S
                    self._on_frame(self._shown(now_s))
                if now_s >= self._next_report_s:
                    self._next_report_s = now_s + REPORT_S
                    self._measure(now_s)
                    self._diagnostics_out.put(to_diagnostics(self._health()))
                self._notifier.running(now_s)
        finally:
            self._notifier.stopping()
            stopping.cancel()
            self._end_of_single_steps()
            token.withdraw()

    def _listen(self) -> None:
        """Process the supervisor's token, its commands, and requests to place the pillar."""
        self._wake.clear()
        for change in self._alive.take():
            if change.node == topics.SUPERVISOR and not change.epoch:
                self._supervisor_changed_s = change.arrival_s
                self._watchdog.supervisor_alive(change.alive)
        for command in self._cmd_vel.take():
            self._obey(command)
        for obstacle in self._obstacles.take():
            if obstacle.message is not None:
                self._place(obstacle.message)
        # Evaluated last, so that it covers a suspend while the messages were taken.
        if self._suspended_s() > 0.0:
            self._watchdog.resumed(self._loop.time())

    def _obey(self, command: Arrival[Twist]) -> None:
        twist = command.message
        if twist is not None and command.arrival_s >= self._supervisor_changed_s:
            sent = None if command.stamp is None else command.stamp.sent()
            self._watchdog.command(command.arrival_s, twist.linear.x, twist.angular.z, sent)

    def _place(self, point: Point) -> None:
        self._next_report_s = min(self._next_report_s, self._loop.time() + CONTACT_REPORT_S)
        if point.z < 0:
            self._plant.remove_pillar()
            return
        try:
            self._plant.place_pillar(point.x, point.y)
        except ValueError as error:
            _log.warning("%s: %s", topics.OBSTACLE.key, error)

    def _make_steps(self, now_s: float) -> None:
        """Make the steps that are due, for `SLICE_S` at most, all with the present command."""
        end_s = now_s + SLICE_S
        twist_target = self._aim(now_s) if self._pace.is_due else (0.0, 0.0)
        while self._pace.is_due:
            self._step(twist_target, now_s)
            self._pace.stepped()
            if self._loop.time() >= end_s:
                break
        if self._pace.paused and not self._pace.single_steps:
            self._end_of_single_steps()

    def _aim(self, now_s: float) -> tuple[float, float]:
        """Return the target twist (v, ω) of the drive from the base's watchdog."""
        target = self._watchdog.target(now_s)
        if target.reason is not self._reason:
            self._reason = target.reason
            _log.info("base: %s", "follows cmd_vel" if target.reason is BaseReason.OK else target.reason)
            self._diagnostics_out.put(to_diagnostics(self._health()))
        return target.linear_m_s, target.angular_rad_s

    def _step(self, twist_target: tuple[float, float], now_s: float) -> None:
        self._plant.step(twist_target)
        self._steps += 1
        if self._plant.collisions > self._collisions:
            self._report_contact(now_s)
        self._collisions = self._plant.collisions
        self._publish()

    def _publish(self) -> None:
        """Publish the sensors' samples after this step, each at its own rate."""
        step, speed, plant = self._steps, self._pace.speed, self._plant
        if self._odom_times.due(step, speed):
            elapsed_s, self._odom_read_s = plant.time_s - self._odom_read_s, plant.time_s
            counted = self._odometer.read(*plant.wheel_angles_rad, elapsed_s)
            said = self._faulty_odometry.spoil(self._faults, counted)
            if said is not None:
                self._odom_out.put(to_odometry(said))
        if self._truth_times.due(step, speed):
            self._truth_out.put(to_truth(plant.true_pose, plant.true_velocity))
        if self._imu_times.due(step, speed):
            self._imu_out.put(to_imu(self._imu.read(*plant.imu()), self._imu.config))
        if self._clock_times.due(step, speed):
            self._clock_out.put(to_clock(plant.time_s))
        for eye in self._eyes:
            if eye.times.due(step, speed) and not eye.faults.silent:
                eye.last = eye.faulty.spoil(eye.faults, plant.scan(eye.number))
                eye.out.put(to_scan(eye.last, eye.lidar, eye.times.period_s(speed), eye.faults.reach_m))

    def _shown(self, now_s: float) -> Shown:
        """Return the values for display."""
        for arrival in () if self._statuses is None else self._statuses.take():
            if arrival.message is not None:
                self._status, self._status_s = arrival.message, arrival.arrival_s
        speed_m_s, ranges = self._plant.true_velocity.linear_m_s, [eye.last for eye in self._eyes]
        return Shown.of(self._status, now_s - self._status_s, speed_m_s, ranges)

    def _put_in_force(self, faults: SensorFaults) -> None:
        if faults != self._faults:
            _log.info("sensor faults in force: %s", faults)
        self._faults = faults
        for eye in self._eyes:
            eye.faults = faults.of(eye.lidar.name)
            eye.faulty.thaw()
            eye.times.rate_hz = eye.faults.rate_hz or self._config.scan_hz

    def _health(self) -> Health:
        plant, pace = self._plant, self._pace
        return Health(
            base=self._reason,
            touches=plant.hull_contacts > 0,
            collisions=plant.collisions,
            last_contact=plant.last_contact,
            time_s=plant.time_s,
            speed=pace.speed,
            paused=pace.paused,
            measured=self._measured,
            faults=self._faults,
            movers=plant.movers,
        )

    def _report_contact(self, now_s: float) -> None:
        health = self._health()
        if now_s >= self._next_contact_report_s:
            self._next_contact_report_s = now_s + CONTACT_REPORT_S
            self._diagnostics_out.put(to_diagnostics(health))
        if now_s >= self._next_contact_log_s:
            self._next_contact_log_s = now_s + CONTACT_LOG_S
            _log.warning("%s (contact %d since the last reset)", contact_sentence(health), health.collisions)

    def _measure(self, now_s: float) -> None:
        self._measured = self._pace.measure(now_s)
        if self._measured.lost_s > 0.0 and now_s >= self._next_pace_log_s:
            self._next_pace_log_s = now_s + PACE_LOG_S
            _log.warning(pace_sentence(self._pace.speed, self._measured))

    def _warn_of_speed(self) -> None:
        """Log a warning if the pace is not real time: the supervisor runs in real time, so its guarantees change."""
        speed = self._pace.speed
        if speed != 1.0:
            effect = "slower, so it may take slow braking for a runaway"
            if speed > 1.0:
                effect = "faster, so it reacts that much later, and its distances do not hold"
            _log.warning("%g times real time: the supervisor's clock does not run %s", speed, effect)

    async def _on_reset(self, _: str) -> TriggerResponse:
        try:
            self._plant.reset()
        except ValueError as error:
            return TriggerResponse(success=False, message=str(error))
        self._odometer.reset(*self._plant.wheel_angles_rad)
        self._faulty_odometry.reset()
        self._collisions = 0
        return TriggerResponse(success=True, message="the robot is back at its start")

    async def _on_faults(self, text: str) -> TriggerResponse:
        if text.strip():
            try:
                self._put_in_force(parse_faults(text, [eye.lidar.name for eye in self._eyes]))
            except FaultError as error:
                return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=True, message=f"in force: {self._faults}")

    async def _on_time(self, text: str) -> TriggerResponse:
        pace, now_s = self._pace, self._loop.time()
        try:
            match parse_time_request(text):
                case (Request.ASK, _):
                    pass
                case (Request.PAUSE, _):
                    pace.pause(now_s)
                    self._end_of_single_steps()
                case (Request.RUN, _):
                    pace.run(now_s)
                    self._end_of_single_steps()
                case (Request.STEP, steps):
                    pace.step(int(steps))
                    self._single_steps_made = self._loop.create_future()
                    self._wake.set()
                    await self._single_steps_made
                case (Request.SPEED, factor):
                    pace.set_speed(now_s, factor)
                    self._warn_of_speed()
        except TimeRequestError as error:
            return TriggerResponse(success=False, message=str(error))
        self._wake.set()
        how = "paused" if pace.paused else "running"
        sentence = f"{how} at {self._plant.time_s:.3f} s of simulated time, speed {pace.speed:g}"
        if text.strip():
            _log.info("%s: %s", text.strip(), sentence)
        return TriggerResponse(success=True, message=sentence)

    def _end_of_single_steps(self) -> None:
        """Wake the requests that wait for the single steps."""
        if self._single_steps_made is not None:
            self._single_steps_made.set_result(None)
            self._single_steps_made = None
