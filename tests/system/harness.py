"""The robot as real processes on a free loopback port, and a separate observer."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from deploy.stack import processes, statedir
from supervisor.service import STALLED
from tests.system.operators import Operator
from tests.system.ports import free_endpoint
from tests.system.process_state import state_of
from wire import topics
from wire.bus import Subscription
from wire.cdr import ns_of
from wire.messages import Odometry, SafetyStatus, TriggerResponse, Twist, header, planar_twist
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

PATIENCE_S = 20.0
"""Time limit for expected events on a loaded machine."""
POLL_S = 0.01
DRIVE_TRIES = 4
VIEWER = "viewer"

T = TypeVar("T")


@dataclass
class Robot:
    """Starts, kills and watches the three processes."""

    endpoint: str
    logs: Path
    """Also the state directory, unless `state` names another."""
    state: Path | None = None
    keys: dict[str, Path] = field(default_factory=dict[str, Path])
    """Bundles by node, if the endpoint needs certificates; `viewer` is the observer's."""
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict[str, subprocess.Popen[bytes]])
    terminal: Operator | None = None
    """Teleop's terminal."""
    bus: ZenohBus | None = None

    @property
    def environment(self) -> dict[str, str]:
        return os.environ | {
            statedir.ENVIRONMENT: str(self.state or self.logs),
            processes.MARK: str(self.logs),
        }

    def start(self, node: str, *options: str) -> None:
        """Start `supervisor` or `sim` with additional options."""
        with (self.logs / f"{node}.log").open("ab") as log:
            self.processes[node] = subprocess.Popen(
                [sys.executable, "-m", node, "--endpoint", self.endpoint, *self.keys_of(node), *options],
                stdout=log,
                stderr=log,
                env=self.environment,
            )

    def keys_of(self, node: str) -> list[str]:
        """Return the options that name the bundle of a node."""
        return ["--keys", str(self.keys[node])] if node in self.keys else []

    def start_teleop(self, *options: str, module: str = topics.TELEOP, before: Sequence[str] = ()) -> None:
        """Start the real keyboard teleop in a terminal of its own, with additional options, and as an argument of `before`."""
        command = (*before, sys.executable, "-m", module, "--endpoint", self.endpoint, *options)
        self.terminal = Operator(*command, environment=self.environment)

    def type(self, keys: str) -> None:
        assert self.terminal is not None
        self.terminal.type(keys.encode())

    def pid(self, node: str) -> int:
        if node == topics.TELEOP:
            assert self.terminal is not None
            return self.terminal.process.pid
        return self.processes[node].pid

    def signal(self, node: str, number: signal.Signals) -> float:
        """Send a signal, and return when, by the monotonic clock; after SIGSTOP, once the process has stopped."""
        pid = self.pid(node)
        sent_s = time.monotonic()
        os.kill(pid, number)
        if number == signal.SIGSTOP:
            while state_of(pid) != "T":
                assert time.monotonic() < sent_s + PATIENCE_S, f"{node} has not stopped"
        return sent_s

    def kill(self, node: str) -> float:
        """SIGKILL, and reap it."""
        killed_s = self.signal(node, signal.SIGKILL)
        if node in self.processes:
            self.processes.pop(node).wait(PATIENCE_S)
        else:
            self._close_terminal()
        return killed_s

    def restart_supervisor(self, *options: str) -> None:
        """Kill the supervisor and restart it; a later status of the killed one is older than the empty status set here, so it is ignored."""
        self.kill(topics.SUPERVISOR)
        self.status = SafetyStatus(header(""))
        self.start(topics.SUPERVISOR, *options)

    def _close_terminal(self) -> None:
        if self.terminal is not None:
            self.terminal.close()
            self.terminal = None

    async def observe(self) -> None:
        """Open the observer's own session; the hub must be starting."""
        async with asyncio.timeout(PATIENCE_S):
            self.bus = await open_bus(BusConfig(self.endpoint, keys=self.keys.get(VIEWER)), "client")
        self.cmd_vel: Subscription[Twist] = self.bus.subscribe(topics.CMD_VEL, depth=5000)
        self.odom: Subscription[Odometry] = self.bus.subscribe(topics.ODOM, depth=5000)
        self.statuses: Subscription[SafetyStatus] = self.bus.subscribe(topics.STATUS, depth=500)
        self.status = SafetyStatus(header(""))
        self.speed_m_s = 0.0
        self.turn_rad_s = 0.0
        self.x_m = 0.0
        self.outputs: list[tuple[float, Twist]] = []
        self.travel: list[tuple[float, float, float]] = []
        """(arrival [s], x [m], speed [m/s])"""

    def look(self) -> None:
        """Add the arrivals since the last call."""
        for command in self.cmd_vel.take():
            if command.message is not None:
                self.outputs.append((command.arrival_s, command.message))
        for odom in self.odom.take():
            if odom.message is not None:
                self.speed_m_s = odom.message.twist.twist.linear.x
                self.turn_rad_s = odom.message.twist.twist.angular.z
                self.x_m = odom.message.pose.pose.position.x
                self.travel.append((odom.arrival_s, self.x_m, self.speed_m_s))
        for status in self.statuses.take():
            if status.message is not None and stamp_ns(status.message) >= stamp_ns(self.status):
                self.status = status.message

    async def until(self, condition: Callable[[], bool], what: str, within_s: float = PATIENCE_S) -> float:
        """Wait until a condition holds; return how long it took [s]."""
        started_s = time.monotonic()
        while True:
            self.look()
            if condition():
                return time.monotonic() - started_s
            if time.monotonic() - started_s > within_s:
                raise AssertionError(f"not seen within {within_s:g} s: {what}; {self.picture()}")
            await asyncio.sleep(POLL_S)

    async def never(self, condition: Callable[[], bool], what: str, for_s: float) -> None:
        """Check that a condition does not occur."""
        started_s = time.monotonic()
        while time.monotonic() - started_s < for_s:
            self.look()
            assert not condition(), f"{what}; {self.picture()}"
            await asyncio.sleep(POLL_S)

    def picture(self) -> str:
        logs = {path.name: path.read_text()[-600:] for path in self.logs.glob("*.log")}
        screen = "" if self.terminal is None else f"\n{self.terminal.picture}\n"
        return (
            f"mode {self.status.mode} {self.status.reasons}, {self.speed_m_s:.3f} m/s, {screen}logs: {logs}"
        )

    async def ready(self, within_s: float = PATIENCE_S) -> None:
        """Wait until the next command moves the robot, by the status, and by the screen of a teleop that was started."""
        await self.until(
            lambda: (
                self.status.mode == SafetyStatus.READY and (self.terminal is None or self.terminal.keys_count)
            ),
            "READY",
            within_s,
        )

    async def connected(self) -> None:
        """Wait until teleop's screen shows a status: before its connection, it discards the keys."""
        terminal = self.terminal
        assert terminal is not None
        await self.until(lambda: terminal.shows_status, "teleop's connection")

    async def press(self, keys: str, condition: Callable[[], bool], what: str) -> None:
        """Type the keys and wait for their effect; keys during a delay of teleop are discarded, so they are typed again."""

        async def attempt() -> None:
            self.type(keys)
            await self.until(condition, what, PATIENCE_S / DRIVE_TRIES)

        await self.connected()
        await patiently(attempt)

    async def drive(self, keys: str = "wwwww", speed_m_s: float = 0.5) -> None:
        """Re-arm with `s`, type the keys, and wait until the robot moves.

        On a busy machine, a late process may stop the robot; the operator then starts again.
        """

        async def attempt() -> None:
            self.type("s")
            await self.ready()
            self.type(keys)
            await self.until_it_drives(speed_m_s)

        await self.connected()
        await patiently(attempt)

    async def until_it_drives(self, speed_m_s: float) -> None:
        """Wait for at least 95 % of that speed, within the time of one attempt."""
        await self.until(
            lambda: self.speed_m_s > 0.95 * speed_m_s, f"{speed_m_s} m/s", PATIENCE_S / DRIVE_TRIES
        )

    async def answer_to_reset(self) -> TriggerResponse:
        """Call the supervisor's reset; repeat it while a busy machine has delayed the supervisor."""
        assert self.bus is not None
        while True:
            answer = await self.bus.call(topics.SUPERVISOR_RESET, timeout_s=PATIENCE_S)
            if answer.message != STALLED:
                return answer
            await asyncio.sleep(POLL_S)

    def first_zero_after(self, time_s: float) -> float:
        """Return the time of the first zero on cmd_vel after that time."""
        return next(at for at, twist in self.outputs if at >= time_s and is_zero(twist))

    async def zero_after(self, time_s: float) -> float:
        """Return the time from then to the first zero on cmd_vel [s]."""
        await self.until(
            lambda: any(at >= time_s and is_zero(t) for at, t in self.outputs), "a zero on cmd_vel"
        )
        return self.first_zero_after(time_s) - time_s

    async def standstill_after(self, time_s: float) -> tuple[float, float]:
        """Return the time and distance from then until the robot stopped [s, m]."""

        def rests() -> list[tuple[float, float, float]]:
            return [t for t in self.travel if t[0] >= time_s and abs(t[2]) < 0.005]

        await self.until(lambda: bool(rests()), "standstill")
        rest_s, rest_x_m, _ = rests()[0]
        at_x_m = next(x_m for at_s, x_m, _ in reversed(self.travel) if at_s <= time_s)
        return rest_s - time_s, rest_x_m - at_x_m

    async def close(self) -> None:
        for node in list(self.processes):
            process = self.processes.pop(node)
            process.send_signal(signal.SIGCONT)
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(5)
        self._close_terminal()
        if self.bus is not None:
            await self.bus.close()
        assert processes.end_keepers(self.logs, PATIENCE_S) == []


async def patiently(attempt: Callable[[], Awaitable[T]]) -> T:
    """Return the result of an attempt; repeat a failed attempt, and raise the error of the last one."""
    for _ in range(DRIVE_TRIES - 1):
        try:
            return await attempt()
        except AssertionError as error:
            print(f"again: {error}")
    return await attempt()


def stamp_ns(status: SafetyStatus) -> int:
    return ns_of(status.header.stamp.sec, status.header.stamp.nanosec)


def is_zero(twist: Twist) -> bool:
    return twist == planar_twist(0.0, 0.0)


@asynccontextmanager
async def robot(
    tmp_path: Path, *nodes: str, teleop: bool = True, config: Path | None = None, state: Path | None = None
) -> AsyncGenerator[Robot]:
    """A robot whose nodes start in the given order (default: supervisor, sim), and ended at the end."""
    options = [] if config is None else ["--config", str(config)]
    subject = Robot(free_endpoint(), tmp_path, state)
    try:
        for node in nodes or (topics.SUPERVISOR, topics.SIM):
            subject.start(node, *options)
        await subject.observe()
        if teleop:
            subject.start_teleop()
        yield subject
    finally:
        await subject.close()
