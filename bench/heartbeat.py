"""Measures the lateness of the real teleop's heartbeat while it draws in a pseudo-terminal."""

import asyncio
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rig import scenery
from bench.rig.feed import (
    BEAMS,
    ODOM_HZ,
    SCANS,
    Robot,
    Stream,
    at_rate,
    client,
    feeding,
    mode_of,
    supervisor,
)
from bench.rig.sheet import Column, Sheet, Times, Verdict
from bench.rig.terminal import Terminal, teleop
from wire import topics
from wire.bus import Subscription
from wire.messages import SafetyStatus
from wire.zenoh.bus import ZenohBus

BEAT_S = 0.05
EARLIEST_S = 0.01
"""No beat is earlier than the mean by this much."""
WARM_UP_S, MEASURED_S = 3.0, 30.0
TYPE_PERIOD_S = 0.33
FULL_SPEED = "w" * 12
"""More presses than speed steps: a further press changes nothing and sends no extra command."""
TARGET_P99_MS = 5.0


@dataclass(frozen=True)
class Screen:
    """A display mode and terminal size of teleop."""

    name: str
    columns: int
    rows: int
    arguments: tuple[str, ...] = ()


SCREENS = (
    Screen("dashboard", 80, 24),
    Screen("dashboard", 160, 50),
    Screen("one line (--plain)", 80, 24, ("--plain",)),
)


@dataclass(frozen=True)
class Heartbeat:
    """Lateness of the commands of one run against a 50 ms grid through the earliest command."""

    screen: Screen
    seconds: float
    mode: str
    """The mode of the last status."""
    beats: int
    missed: int
    sent: Times
    """By the source time that teleop stamps on its commands."""
    arrival: Times
    """By the time of arrival in this process, through the supervisor's hub."""
    output_kb_s: float
    """Output of teleop to the terminal."""


def measure_heartbeats() -> list[Heartbeat]:
    """Start a supervisor, simulate its robot, and drive it with one teleop for each screen.

    Raises:
        RuntimeError: a process does not start or sends nothing.
    """
    with supervisor() as hub:
        return asyncio.run(_measure(hub.endpoint))


def lateness_ms(times_s: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], int]:
    """Compute the lateness of each beat against the grid through the earliest, and count the empty grid places.

    The circular mean of the beats locates the grid, so that a beat almost a period late is not taken for the next.
    """
    since_s = times_s - times_s[0]
    turns = np.exp(2j * math.pi * since_s / BEAT_S)
    phase_s = float(np.angle(turns.mean())) / math.tau * BEAT_S
    offsets_s = since_s - phase_s + EARLIEST_S
    places = np.floor(offsets_s / BEAT_S).astype(np.int64)
    late_s = offsets_s - BEAT_S * places
    missed = int(places[-1] - places[0]) + 1 - len(np.unique(places))
    return 1000.0 * (late_s - late_s.min()), missed


async def _measure(endpoint: str) -> list[Heartbeat]:
    async with client(endpoint) as bus:
        robot = _Robot(bus)
        async with feeding(robot.feeds()):
            return [await robot.measure(screen, endpoint) for screen in SCREENS]


class _Robot(Robot):
    """A robot before a wall that moves, so that the whole display changes."""

    def __init__(self, bus: ZenohBus) -> None:
        walls_m = [1.5 + 0.3 * math.sin(math.tau * number / SCANS) for number in range(SCANS)]
        super().__init__(bus, [scenery.scans(BEAMS, 1, wall_m=wall_m)[0] for wall_m in walls_m])
        self._pose = (0.0, 0.0, 0.0)
        self._statuses: Subscription[SafetyStatus] = bus.subscribe(topics.STATUS)
        self._beats = Stream(bus, topics.source_cmd_vel(topics.TELEOP), depth=100_000)

    def pose(self) -> tuple[float, float, float]:
        (x_m, y_m, yaw_rad), (v, w) = self._pose, self.velocity
        step_s = 1.0 / ODOM_HZ
        yaw_rad += w * step_s
        self._pose = (x_m + v * math.cos(yaw_rad) * step_s, y_m + v * math.sin(yaw_rad) * step_s, yaw_rad)
        return self._pose

    async def measure(self, screen: Screen, endpoint: str) -> Heartbeat:
        """Start a teleop, drive at full speed, and record its commands."""
        terminal = Terminal(screen.columns, screen.rows)
        with teleop(terminal, "--endpoint", endpoint, *screen.arguments):
            await self._beats.next(of_new_run=True)  # commands of the previous teleop may arrive late
            terminal.type("s")
            await asyncio.sleep(WARM_UP_S / 2)
            terminal.type(FULL_SPEED)
            await asyncio.sleep(WARM_UP_S)
            self._beats.take()
            began_s, began_bytes = time.monotonic(), terminal.taken_bytes
            typing = asyncio.ensure_future(at_rate(1.0 / TYPE_PERIOD_S, lambda: terminal.type("w")))
            await asyncio.sleep(MEASURED_S)
            typing.cancel()
            took_s = time.monotonic() - began_s
            output_kb_s = (terminal.taken_bytes - began_bytes) / took_s / 1000.0
            beats, newest = self._beats.take(), self._statuses.latest()
        stamps = [beat.stamp for beat in beats]
        if len(beats) < 2 or None in stamps:
            raise RuntimeError(
                "the heartbeat cannot be measured: teleop sent no commands, or commands without a stamp"
            )
        sent_s = np.array([1e-9 * stamp.source_time_ns for stamp in stamps if stamp is not None])
        sent_ms, missed = lateness_ms(sent_s)
        arrival_ms, _ = lateness_ms(np.array([beat.arrival_s for beat in beats]))
        status = None if newest is None else newest.message
        return Heartbeat(
            screen=screen,
            seconds=took_s,
            mode="" if status is None else mode_of(status),
            beats=len(beats),
            missed=missed,
            sent=Times.of(sent_ms),
            arrival=Times.of(arrival_ms),
            output_kb_s=output_kb_s,
        )


COLUMNS: tuple[Column[Heartbeat], ...] = (
    ("screen", lambda one: one.screen.name),
    ("size", lambda one: f"{one.screen.columns}×{one.screen.rows}"),
    ("mode", lambda one: one.mode),
    ("s", lambda one: f"{one.seconds:.0f}"),
    ("beats", lambda one: f"{one.beats}"),
    ("missed", lambda one: f"{one.missed}"),
    *Times.columns("sent", lambda one: one.sent),
    *Times.columns("arrival", lambda one: one.arrival),
    ("kB/s", lambda one: f"{one.output_kb_s:.1f}"),
)


def heartbeat_sheet(heartbeats: Iterable[Heartbeat]) -> Sheet:
    return Sheet.of(
        "Teleop's heartbeat while it draws: lateness in ms against a grid of 50 ms",
        COLUMNS,
        heartbeats,
        (
            "The real teleop in a pseudo-terminal that reads all its output, with scans at 20 Hz, odometry at 50 Hz "
            "and the supervisor's status at 10 Hz, all of which change; at full speed, with three key presses a second."
        ),
        (
            "sent: by the source time in each command's stamp. arrival: at this program, through the hub; it "
            "includes this program's delays. The grid goes through the earliest beat."
        ),
        "kB/s: teleop's output to the terminal.",
    )


def verdicts(heartbeats: Iterable[Heartbeat]) -> list[Verdict]:
    return [
        Verdict(
            f"the heartbeat's lateness, p99, {beat.screen.name} at {beat.screen.columns}×{beat.screen.rows},",
            beat.sent.p99_ms,
            TARGET_P99_MS,
            "ms",
        )
        for beat in heartbeats
    ]
