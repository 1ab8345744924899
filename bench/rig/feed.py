"""Plays sensors, operator and base of one robot or of many: `python -m bench.rig.feed PLAN`.

The plan is JSON (`Plan`). One thread sends prepared bytes at their times, and Zenoh's threads record what arrives, so the program
needs little CPU. The streams are spread evenly over their periods. Each line on the standard input is a command: `release NUMBER …`
removes the operator of these robots, and `end` ends the program, as does the end of the input. Prints `driving` when every robot has
moved, and at the end all recorded messages as one line of JSON.
"""

import asyncio
import heapq
import itertools
import json
import struct
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from bench.rig import scenery
from wire import topics
from wire.bus_config import BusConfig
from wire.message_types import MODES
from wire.messages import (
    SafetyStatus,
    UndecodableError,
    decode,
    encode,
    laser_scan,
    odometry,
    planar_twist,
)
from wire.stamp import parse_stamp
from wire.zenoh.connect import open_session
from wire.zenoh.session import ZenohSession

COMMAND_HZ, SCAN_HZ, ODOM_HZ = 20.0, 20.0, 50.0
CRUISE_M_S = 0.3
BEAMS, SCANS = 360, 64
NEUTRAL_EVERY = 10
"""While its robot is stopped, an operator sends one neutral command in this many: only neutral ends a stop."""
SPREAD = 0.618034
"""The golden ratio's fraction: its multiples are spread evenly between 0 and 1."""
_TWIST = struct.Struct("<4x6d")

Motion = tuple[float, float]
"""Linear [m/s] and angular [rad/s] velocity."""
Act = tuple[Callable[[], None], float]
"""What is done at a rate [Hz]."""


@dataclass(frozen=True)
class Plan:
    """Which robots are played, and how."""

    robots: Sequence[tuple[str, str]]
    """Endpoint and namespace of each."""
    operators: Sequence[tuple[str, str, str] | None]
    """One for each robot, or none at all: endpoint, namespace and bundle of a router, or None for the robot's own session."""
    wall_m: float = scenery.ROOM_M
    """Distance of the wall ahead."""
    speed_m_s: float = CRUISE_M_S

    def words(self) -> list[str]:
        """Return the arguments of the program."""
        return [json.dumps(asdict(self))]


class Body:
    """Plays the sensors and the base of one robot, and records what its supervisor sends.

    Args:
        session: connected to the supervisor of this robot.
        scans: encoded scans.
        moved: called on Zenoh's thread when the robot moves for the first time.
    """

    def __init__(self, session: ZenohSession, scans: Sequence[bytes], moved: Callable[[], None]) -> None:
        self.heard: list[tuple[float, float, bool]] = []
        """For each command to the base: its arrival and decision time [s], and whether it moves the robot."""
        self.garbled = 0
        """Number of messages that their key does not permit."""
        self._statuses: list[tuple[float, bytes]] = []
        self._moved = moved
        self._session = session  # a session is closed when nothing refers to it
        self.motion: Motion = (0.0, 0.0)
        """What the supervisor has commanded last."""
        self._odometry_of: dict[Motion, bytes] = {}
        self._next_scan = itertools.cycle(scans)
        self._scans = session.publisher_raw(topics.SCAN)
        self._odometry = session.publisher_raw(topics.ODOM)
        session.subscribe_raw(topics.CMD_VEL.key, self._hear_cmd_vel)
        session.subscribe_raw(topics.STATUS.key, self._hear_status)

    def _hear_cmd_vel(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        if len(payload) != _TWIST.size:
            self.garbled += 1
            return
        linear_m_s, *_, angular_rad_s = _TWIST.unpack(payload)
        stamp = parse_stamp(attachment)
        decided_s = arrival_s if stamp is None else stamp.source_time_ns * 1e-9
        moves = linear_m_s != 0.0 or angular_rad_s != 0.0
        self.heard.append((arrival_s, decided_s, moves))
        self.motion = linear_m_s, angular_rad_s
        if moves:
            self._moved()

    def _hear_status(self, payload: bytes, _attachment: bytes | None, arrival_s: float) -> None:
        self._statuses.append((arrival_s, payload))

    def acts(self) -> list[Act]:
        """Return what is sent at which rates."""
        return [(self.put_scan, SCAN_HZ), (self.put_odometry, ODOM_HZ)]

    def put_scan(self) -> None:
        self._scans.put_bytes(next(self._next_scan))

    def put_odometry(self) -> None:
        motion = self.motion
        payload = self._odometry_of.get(motion)
        if payload is None:
            payload = self._odometry_of[motion] = encode(odometry((0.0, 0.0, 0.0), motion))
        self._odometry.put_bytes(payload)

    def statuses(self) -> list[tuple[float, str, list[str]]]:
        """Return for each status its arrival time [s], the mode, and the reasons."""
        found: list[tuple[float, str, list[str]]] = []
        for at_s, payload in self._statuses:
            try:
                status = decode(payload, SafetyStatus)
            except UndecodableError:
                self.garbled += 1
            else:
                found.append((at_s, MODES[status.mode], list(status.reasons)))
        return found


class Operator:
    """Drives a robot of the same process.

    Args:
        session: connected to the supervisor, or to a router.
        body: the robot.
        speed_m_s: what the operator commands.
    """

    def __init__(self, session: ZenohSession, body: Body, speed_m_s: float) -> None:
        self._session = session
        self._body = body
        self._number = itertools.count()
        self._is_here = True
        self._neutral, self._cruise = (encode(planar_twist(speed, 0.0)) for speed in (0.0, speed_m_s))
        self._commands = session.publisher_raw(topics.source_cmd_vel(topics.TELEOP))
        self._token = session.declare_alive(topics.TELEOP)

    def put_command(self) -> None:
        if not self._is_here:
            return
        releases = self._body.motion == (0.0, 0.0) and next(self._number) % NEUTRAL_EVERY == 0
        self._commands.put_bytes(self._neutral if releases else self._cruise)

    def leave(self) -> None:
        """Withdraw, so that the robot stops."""
        self._is_here = False
        self._token.withdraw()


def send(acts: Sequence[Act], ended: threading.Event) -> list[tuple[float, float]]:
    """Do everything at its rate until `ended` is set; return the due time [s] and the lateness [s] of each sample."""
    began_s = time.monotonic()
    due = [(began_s + number * SPREAD % 1.0 / rate_hz, number) for number, (_, rate_hz) in enumerate(acts)]
    heapq.heapify(due)
    late: list[tuple[float, float]] = []
    while not ended.is_set():
        due_s, number = due[0]
        now_s = time.monotonic()
        if now_s < due_s:
            time.sleep(due_s - now_s)
            now_s = time.monotonic()
        late.append((due_s, now_s - due_s))
        act, rate_hz = acts[number]
        act()
        heapq.heapreplace(due, (max(due_s + 1.0 / rate_hz, now_s), number))
    return late


def encoded_scans(wall_m: float = scenery.ROOM_M) -> list[bytes]:
    """Return scans of a full turn in a room, of a robot that stands."""
    range_m = scenery.RANGE_MIN_M, scenery.RANGE_MAX_M
    scans = scenery.scans(BEAMS, SCANS, wall_m=wall_m)
    return [encode(laser_scan(ranges, range_m=range_m, period_s=1.0 / SCAN_HZ)) for ranges in scans]


async def _sessions(configs: Sequence[BusConfig]) -> list[ZenohSession]:
    return [ZenohSession(await open_session(config, "client"), config.namespace) for config in configs]


def main() -> None:
    plan = Plan(**json.loads(sys.argv[1]))
    scans = encoded_scans(plan.wall_m)
    waiting, ended = set(range(len(plan.robots))), threading.Event()

    def moved(number: int) -> None:
        if number in waiting:
            waiting.discard(number)
            if not waiting:
                print("driving", flush=True)

    sessions = asyncio.run(_sessions([BusConfig(*robot) for robot in plan.robots]))
    bodies = [Body(session, scans, lambda n=number: moved(n)) for number, session in enumerate(sessions)]
    ways = [None if way is None else BusConfig(way[0], way[1], keys=Path(way[2])) for way in plan.operators]
    behind = iter(asyncio.run(_sessions([way for way in ways if way is not None])))
    operators = [
        Operator(session if way is None else next(behind), body, plan.speed_m_s)
        for way, session, body in zip(ways, sessions, bodies, strict=False)
    ]

    def read_commands() -> None:
        for line in sys.stdin:
            word, *numbers = line.split()
            if word == "end":
                break
            for number in numbers:
                operators[int(number)].leave()
        ended.set()

    threading.Thread(target=read_commands, daemon=True).start()
    acts = [act for body in bodies for act in body.acts()]
    late = send([*acts, *((one.put_command, COMMAND_HZ) for one in operators)], ended)
    found = [
        {"heard": body.heard.copy(), "statuses": body.statuses(), "garbled": body.garbled} for body in bodies
    ]
    print(json.dumps({"robots": found, "late": late}), flush=True)


if __name__ == "__main__":
    main()
