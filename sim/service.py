"""The asyncio shell of the simulated robot: the keys that a real base would serve, in real time.

Physics follow the loop's monotonic clock step by step; a message never waits for a step to be due. The
base's own watchdog decides what the drive aims at, at every step.
"""

import asyncio
import logging
from collections.abc import Callable

import numpy as np

from sim.config import SimSection
from sim.plant import Plant
from sim.watchdog import BaseReason, Watchdog
from wire import topics
from wire.bus import Arrival, Bus, wait_until
from wire.messages import LaserScan, Point, TriggerResponse, Twist, header, odometry

_log = logging.getLogger(__name__)

MAX_CATCH_UP_S = 0.1
"""A process that was held up makes up for this much; the rest of the time has not happened."""
OBSTACLE_DEPTH = 16


class SimService:
    """One simulated robot on one Bus."""

    def __init__(
        self, bus: Bus, config: SimSection, plant: Plant, on_frame: Callable[[], None] | None = None
    ) -> None:
        self._bus = bus
        self._plant = plant
        self._on_frame = on_frame
        self._watchdog = Watchdog(config.command_timeout_s)
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._odom_steps = max(1, round(1.0 / (config.odom_hz * plant.timestep_s)))
        self._scan_steps = max(1, round(1.0 / (config.scan_hz * plant.timestep_s)))
        self._scan_period_s = self._scan_steps * plant.timestep_s
        self._steps = 0
        self._supervisor_changed_s = 0.0
        self._reason: BaseReason | None = None

        self._cmd_vel = bus.subscribe(topics.CMD_VEL, wake=self._wake)
        self._alive = bus.watch_alive(self._wake)
        self._obstacles = bus.subscribe(topics.OBSTACLE, depth=OBSTACLE_DEPTH, wake=self._wake)
        self._odom = bus.publisher(topics.ODOM)
        self._scan = bus.publisher(topics.SCAN)
        bus.serve(topics.SIM_RESET, self._on_reset)

    async def run(self, stop: asyncio.Event) -> None:
        """Simulate until `stop` is set."""
        token = self._bus.declare_alive(topics.SIM)
        dt_s = self._plant.timestep_s
        next_step_s = self._loop.time() + dt_s
        stopping = asyncio.ensure_future(stop.wait())
        stopping.add_done_callback(lambda _: self._wake.set())
        try:
            while not stop.is_set():
                await wait_until(self._wake, next_step_s)
                self._listen()
                now_s = self._loop.time()
                if now_s - next_step_s > MAX_CATCH_UP_S:
                    _log.warning("held up for %.2f s: that time is skipped", now_s - next_step_s)
                    next_step_s = now_s - MAX_CATCH_UP_S
                while next_step_s <= now_s:
                    self._step(now_s)
                    next_step_s += dt_s
        finally:
            stopping.cancel()
            token.withdraw()

    def _listen(self) -> None:
        """Take in the supervisor's token and command, and where the pillar is to be."""
        self._wake.clear()
        for change in self._alive.take():
            if change.node == topics.SUPERVISOR:
                self._supervisor_changed_s = change.arrival_s
                self._watchdog.supervisor_alive(change.alive)
        for command in self._cmd_vel.take():
            self._obey(command)
        for obstacle in self._obstacles.take():
            if obstacle.message is not None:
                self._place(obstacle.message)

    def _obey(self, command: Arrival[Twist]) -> None:
        twist = command.message
        if twist is not None and command.arrival_s >= self._supervisor_changed_s:
            self._watchdog.command(command.arrival_s, twist.linear.x, twist.angular.z)

    def _place(self, point: Point) -> None:
        if point.z < 0:
            self._plant.remove_pillar()
            return
        try:
            self._plant.place_pillar(point.x, point.y)
        except ValueError as error:
            _log.warning("%s: %s", topics.OBSTACLE.key, error)

    def _step(self, now_s: float) -> None:
        target = self._watchdog.target(now_s)
        if target.reason is not self._reason:
            self._reason = target.reason
            _log.info("base: %s", "follows cmd_vel" if target.reason is BaseReason.OK else target.reason)
        self._plant.step(target[:2])
        self._steps += 1
        if self._steps % self._odom_steps == 0:
            state = self._plant.odometry()
            self._odom.put(odometry(state[:3], state[3:]))
            if self._on_frame is not None:
                self._on_frame()
        if self._steps % self._scan_steps == 0:
            self._scan.put(self._scan_message())

    def _scan_message(self) -> LaserScan:
        lidar = self._plant.lidar
        return LaserScan(
            header("lidar"),
            angle_min=lidar.angle_min_rad,
            angle_max=lidar.angle_max_rad,
            angle_increment=lidar.angle_increment_rad,
            time_increment=0.0,
            scan_time=self._scan_period_s,
            range_min=lidar.range_min_m,
            range_max=lidar.range_max_m,
            ranges=self._plant.scan(),
            intensities=np.empty(0, dtype=np.float32),
        )

    async def _on_reset(self, _: str) -> TriggerResponse:
        try:
            self._plant.reset()
        except ValueError as error:
            return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=True, message="the robot is back at its start")
