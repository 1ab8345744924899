"""A simulated drive that a black box records, and a writer that writes immediately."""

import gzip
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from supervisor.blackbox.file import Order, write
from supervisor.blackbox.recorder import FILE_BYTES, BlackBox
from supervisor.law.decision import Decision
from supervisor.law.model import Command, Inputs, Liveliness, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import step
from supervisor.law.scan import LaserScan
from supervisor.law.state import State
from tests.unit.supervisor.law.law_harness import (
    CONFIG,
    FORWARD,
    NEUTRAL,
    TICK_S,
    laser_scan,
    on_time,
    proven_state,
    ring,
)
from wire.freshness import Sent

NOON_UTC_S = 1_783_166_400.0
"""2026-07-04 12:00:00 UTC"""


@dataclass
class WriterAtOnce:
    """Writes in the caller's own thread."""

    directory: Path
    max_files: int = 20
    max_bytes: int = FILE_BYTES
    paths: list[Path] = field(default_factory=list[Path])
    orders: list[Order] = field(default_factory=list[Order])

    def submit(self, order: Order) -> None:
        self.orders.append(order)
        self.paths.append(write(order, self.directory, max_files=self.max_files, max_bytes=self.max_bytes))

    def close(self) -> None:
        pass


@dataclass
class KeepingWriter:
    """Writes nothing."""

    orders: list[Order] = field(default_factory=list[Order])

    def submit(self, order: Order) -> None:
        self.orders.append(order)

    def close(self) -> None:
        pass


@dataclass
class Drive:
    """The law over time, with every step recorded."""

    box: BlackBox
    now_s: float = 1000.0

    def __post_init__(self) -> None:
        self.state: State = proven_state(CONFIG)
        self.sequence = 0
        self.rng = np.random.default_rng(1)

    def step(self, inputs: Inputs, after_s: float = TICK_S) -> Decision:
        self.now_s += after_s
        before = self.state
        self.state, decision = step(before, self.now_s, inputs)
        self.box.record(self.now_s, inputs, before, decision)
        return decision

    def tick(self, velocity: Velocity = NEUTRAL) -> Decision:
        """20 ms with a scan and a command that arrive at their end."""
        arrival_s = self.now_s + TICK_S
        return self.step(
            Inputs(commands=(on_time("teleop", velocity, arrival_s),), scans=(self.scan(arrival_s),))
        )

    def scan(self, arrival_s: float, *, ahead_m: float | None = None) -> LaserScan:
        """A room 3 m around, with the noise of a real sensor."""
        ranges = ring(ahead_m=ahead_m) + self.rng.normal(0.0, 0.002, 360).astype(np.float32)
        return laser_scan(ranges, arrival_s)

    def hold(self, seconds: float, velocity: Velocity = NEUTRAL) -> Decision:
        for _ in range(round(seconds / TICK_S) - 1):
            self.tick(velocity)
        return self.tick(velocity)

    def drive(self, seconds: float = 0.5) -> Decision:
        """Neutral, then forward."""
        self.hold(0.3)
        return self.hold(seconds, FORWARD)

    def stop(self) -> Decision:
        """An object stands 0.2 m ahead of the hull, and a second scan confirms it."""
        self._meet()
        return self._meet()

    def brake(self) -> None:
        """The base brakes from 0.5 m/s in 0.3 s."""
        for i in range(16):
            self.step(Inputs(odometry=Odometry(Velocity(0.5 - i * 0.5 / 15, 0.0), self.now_s + TICK_S)))

    def _meet(self) -> Decision:
        return self.step(
            Inputs(
                commands=(on_time("teleop", FORWARD, self.now_s + TICK_S),),
                scans=(self.scan(self.now_s + TICK_S, ahead_m=0.45),),
            )
        )

    def anything(self, seconds: float, seed: int) -> None:
        """Random inputs in any order and at any time; most of the time the robot can drive."""
        rng = np.random.default_rng(seed)
        end_s = self.now_s + seconds
        velocity = NEUTRAL
        next_scan_s = next_command_s = self.now_s
        while self.now_s < end_s:
            now_s = self.now_s + float(rng.choice([TICK_S, rng.uniform(0.0005, 0.02)]))
            if rng.random() < 0.001:
                now_s += rng.uniform(0.05, 0.4)
            told: dict[str, Any] = {}
            commands: list[Command] = []
            if now_s >= next_command_s:
                next_command_s = now_s + 0.05
                if rng.random() < 0.06:
                    velocity = Velocity(*rng.choice([0.0, -0.5, 0.3, 1.0, 1.5], 2).tolist())
                elif rng.random() < 0.06:
                    velocity = NEUTRAL
                self.sequence += 1
                sent = Sent(b"\0\xffepoch", self.sequence, now_s - 0.001 + 17.0)
                commands.append(Command("teleop", velocity, now_s, None if seed % 2 else sent))
            if rng.random() < 0.004:
                bad = [None, Velocity(math.nan, -math.inf), Velocity(-0.0, 99.0), Velocity(0.1, 0.1)]
                name = str(rng.choice(["joy", "path"]))
                commands.append(Command(name, bad[int(rng.integers(4))], now_s))
            if now_s >= next_scan_s:
                next_scan_s = now_s + 0.05
                near_m = float(rng.uniform(0.4, 1.5)) if rng.random() < 0.1 else None
                scan = self.scan(now_s, ahead_m=near_m)
                scan.ranges[rng.random(360) < 0.03] = rng.choice([np.nan, np.inf, -np.inf, 0.0])
                told["scans"] = (scan,)
            if rng.random() < 0.3:
                moved = Velocity(self.state.base.output.linear_m_s + rng.normal(0.0, 0.001), 0.0)
                told["odometry"] = Odometry(moved, now_s)
            if rng.random() < 0.002:
                told["liveliness"] = (Liveliness("teleop", alive=False), Liveliness("teleop", alive=True))
            told["estop"] = bool(rng.random() < 0.001)
            told["reset"] = bool(rng.random() < 0.01)
            self.step(Inputs(commands=tuple(commands), **told), now_s - self.now_s)


def rewrite(path: Path, change: Callable[[list[dict[str, Any]]], object]) -> None:
    """Change the lines of a black box."""
    with gzip.open(path, "rt") as file:
        lines = [json.loads(line) for line in file]
    change(lines)
    with gzip.open(path, "wt") as file:
        file.writelines(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
