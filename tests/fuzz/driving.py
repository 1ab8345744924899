"""The real supervisor on a perfect network in virtual time: armed, driven, fed, and driven again.

Each scene has a world of its own and consists of episodes: sim and teleop are restarted (a client that copies a source's
epoch or sequence locks that source out until it restarts), the robot is armed and driven, a burst arrives on one or
all keys during the valid traffic, and then the robot must be drivable again.
"""

import asyncio
import itertools
import logging
from collections import deque
from collections.abc import Generator
from contextlib import contextmanager, suppress
from random import Random
from typing import NamedTuple

import numpy as np

from supervisor.blackbox.file import Order
from supervisor.blackbox.recorder import MEMORY_BYTES, BlackBox
from supervisor.config import SupervisorSection
from supervisor.estop_record import MemoryRecord
from supervisor.service import SupervisorService
from tests.fuzz import payloads
from tests.fuzz.decoding import Finding
from tests.fuzz.warned import Warned, warned
from virtual.loop import VirtualLoop
from virtual.network import VirtualBus, VirtualNetwork
from wire import topics
from wire.bus import Token
from wire.messages import (
    Bool,
    LaserScan,
    Message,
    Odometry,
    SafetyStatus,
    Twist,
    encode,
    header,
    laser_scan,
    odometry,
    planar_twist,
)
from wire.stamp import Stamp

SCENE_PAYLOADS = 2000
BURST = (1, 60)
APART_S = 0.004
ROOM_M = 3.0
ARM_LIMIT_S, DRIVE_LIMIT_S = 5.0, 1.0
AFTER_S = 0.1
SETTLE_S = 0.15
"""Until the loss of the token that went has been told, and the new one."""
SPEEDS = ((0.5, 0.0), (1.0, 0.3), (-0.3, 0.0), (0.0, 1.5), (0.2, -2.0))
KEPT = 6
"""Number of the last payloads that are reported with a finding."""
STATUS_LIMIT_BYTES = 1 << 17
NAMES = ("teleop", "joy", "path", "sim", "supervisor", "stranger", "", "*", "teleop ", "x" * 200)


class Met(NamedTuple):
    """The result of one scene."""

    payloads: int
    while_driving: int
    steps: int
    """Commands on cmd_vel: a step gives at most one."""
    longest_status_bytes: int
    findings: tuple[Finding, ...]
    warned: Warned


class _UnfitError(AssertionError):
    """Findings."""


class _Nowhere:
    """Discards black boxes."""

    def submit(self, order: Order) -> None: ...

    def close(self) -> None: ...


class _Tap:
    """Checks the invariant on the supervisor's messages in their order."""

    limits = (1.0, 2.0)

    def __init__(self) -> None:
        self.steps = self.longest_status_bytes = 0
        self.status = SafetyStatus(header("", 0))
        self.output = (0.0, 0.0)
        self.wrong: list[str] = []
        self.epochs: dict[str, bytes] = {}
        """Of sim and teleop, by key."""
        self._unexplained = False
        """A motion was commanded after a status of a stop; the next status must explain it."""

    def __call__(self, node: str, key: str, message: Message, stamp: Stamp) -> None:
        payload = encode(message)
        if node in {topics.SIM, topics.TELEOP}:
            self.epochs[key] = stamp.gid
        if isinstance(message, SafetyStatus):
            self.longest_status_bytes = max(self.longest_status_bytes, len(payload))
            if len(payload) > STATUS_LIMIT_BYTES:
                self.wrong.append(f"a status of {len(payload)} bytes")
            self.status = message
            self._explain()
        elif key == topics.CMD_VEL.key and isinstance(message, Twist):
            self._commanded(message)

    def _commanded(self, twist: Twist) -> None:
        self._explain()
        self.steps += 1
        (v, w), (most_v, most_w) = (twist.linear.x, twist.angular.z), self.limits
        others = (twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y)
        if not (abs(v) <= most_v and abs(w) <= most_w) or any(others):
            self.wrong.append(f"cmd_vel is ({v}, {w}), {others}")
        self.output = (v, w)
        self._unexplained = self.is_stopped and self.output != (0.0, 0.0)

    def _explain(self) -> None:
        if self._unexplained and self.is_stopped:
            self.wrong.append(f"cmd_vel is {self.output} despite {self.status.reasons}")
        self._unexplained = False

    @property
    def is_stopped(self) -> bool:
        return self.status.mode == SafetyStatus.STOPPED


def scene(seed: int, number: int, count: int, replay: str) -> Met:
    """Feed so many payloads to a supervisor of its own, in virtual time.

    Args:
        seed: of the run.
        number: of the scene.
        count: of payloads.
        replay: the command that does it again.
    """
    loop = VirtualLoop()
    with _complaints() as complaints, warned() as warnings:
        try:
            loop.on_error = lambda name, error: complaints.append(f"{name}: {error!r}")
            play = _Scene(loop, Random((seed << 40) | (1 << 39) | number), complaints)
            try:
                loop.run_until_complete(play.run(count))
            except Exception as error:  # noqa: BLE001 - that there is none is what is tested
                complaints.append(f"{type(error).__name__}: {error}")
        finally:
            loop.close()
    fed = "\n".join(f"{key} {payload.hex()} {shown}" for key, payload, shown in play.last)
    return Met(
        play.fed,
        play.while_driving,
        play.tap.steps,
        play.tap.longest_status_bytes,
        tuple(Finding(f"supervisor: {what[:500]}", fed, replay) for what in complaints),
        warnings,
    )


class _Scene:
    def __init__(self, loop: VirtualLoop, random: Random, complaints: list[str]) -> None:
        self._random = random
        self._complaints = complaints
        self.network = VirtualNetwork(loop)
        self.network.tap = self.tap = _Tap()
        self._supervisor = self.network.open_hub(topics.SUPERVISOR)
        self._stranger = self.network.open_joined("stranger")
        self._good: list[VirtualBus] = []
        self._token: Token | None = None
        self.last: deque[tuple[str, bytes, str]] = deque(maxlen=KEPT)
        self.fed = self.while_driving = 0
        self._velocity = (0.0, 0.0)
        self._is_quiet = False
        self._gids = payloads.epochs(random, 3)

    async def run(self, count: int) -> None:
        config = SupervisorSection()
        box = BlackBox(config.law(), _Nowhere(), window_s=config.black_box_s, utc=lambda: 0.0)
        stop = asyncio.Event()
        service = SupervisorService(self._supervisor, config, box, MemoryRecord())
        running = asyncio.ensure_future(service.run(stop))
        self._start_anew()
        good = asyncio.ensure_future(self._good_traffic())
        try:
            while self.fed < count:
                await self._arm_and_drive(running)
                self._is_quiet = self._random.random() < 0.1
                await self._burst(min(count - self.fed, self._random.randint(*BURST)))
                await asyncio.sleep(AFTER_S)
                self._is_quiet = False
                self._check(running)
                if box.size > MEMORY_BYTES:
                    raise _UnfitError(f"the black box holds {box.size} bytes")
                self._start_anew()
            await self._arm_and_drive(running)
            stop.set()
            await running
            self._check(None)
        finally:
            for task in (good, running):
                task.cancel()
                with suppress(asyncio.CancelledError, Exception):
                    await task

    def _start_anew(self) -> None:
        """Restart sim and teleop, each with a new epoch."""
        if self._token is not None:
            self._token.withdraw()
        for bus in self._good:
            bus.leave(0.0)
        sim, teleop = self._good = [self.network.open_joined(name) for name in (topics.SIM, topics.TELEOP)]
        self._token = teleop.declare_alive(topics.TELEOP)
        self._scans = sim.publisher(topics.SCAN)
        self._odometry = sim.publisher(topics.ODOM)
        self._commands = teleop.publisher(topics.source_cmd_vel(topics.TELEOP))
        self._velocity = (0.0, 0.0)

    async def _good_traffic(self) -> None:
        """Publish the messages of a healthy robot and its operator: odometry, scans, and a heartbeat."""
        for tick in itertools.count():
            if not self._is_quiet:
                self._odometry.put(odometry((0.0, 0.0, 0.0), self.tap.output, time_ns=0))
                if tick % 3 == 0:
                    self._scans.put(_scan(tick))
                if tick % 3 == 1:
                    self._commands.put(planar_twist(*self._velocity))
            await asyncio.sleep(0.02)

    async def _arm_and_drive(self, running: "asyncio.Future[None]") -> None:
        """Send neutral until no reason holds, with a reset if needed; then the robot must move."""
        estop = self._stranger.publisher(topics.ESTOP)
        await asyncio.sleep(SETTLE_S)
        await self._until(self._ready, ARM_LIMIT_S, "is not ready again", running)
        self._velocity = self._random.choice(SPEEDS)
        await self._until(lambda: self.tap.output != (0.0, 0.0), DRIVE_LIMIT_S, "does not move", running)
        if self._random.random() < 0.02:
            estop.put(Bool(True))  # noqa: FBT003 - a Bool is what it is

    def _ready(self) -> bool:
        if "ESTOP" in self.tap.status.reasons:
            asyncio.ensure_future(self._stranger.call(topics.SUPERVISOR_RESET))  # noqa: RUF006 - its answer is the status
        return self.tap.status.mode != SafetyStatus.STOPPED

    async def _until(
        self, condition: "object", limit_s: float, complaint: str, running: "asyncio.Future[None]"
    ) -> None:
        assert callable(condition)
        loop = asyncio.get_running_loop()
        end_s = loop.time() + limit_s
        while not condition():
            if loop.time() > end_s:
                status = self.tap.status
                raise _UnfitError(
                    f"the robot {complaint} within {limit_s:g} s: mode {status.mode}, {status.reasons}"
                )
            await asyncio.sleep(0.02)
            self._check(running)

    async def _burst(self, count: int) -> None:
        random = self._random
        gids = [*self._gids, *self.tap.epochs.values()]
        only = random.choice((None, None, *_KEYS))
        for _ in range(count):
            if random.random() < 0.7:
                await asyncio.sleep(random.random() * APART_S)
            self.fed += 1
            self.while_driving += not self.tap.is_stopped
            dice = random.random()
            if dice < 0.02:
                self._supervisor.tell_alive(random.choice(NAMES), alive=random.random() < 0.5)
            elif dice < 0.04:
                reset = self._supervisor.services[topics.SUPERVISOR_RESET.key]
                asyncio.ensure_future(reset(payloads.text(random)))  # noqa: RUF006 - nobody waits for it
            else:
                self._feed(only or random.choice(_KEYS), gids)

    def _feed(self, key: str, gids: list[bytes]) -> None:
        random = self._random
        message_type = _TYPES.get(key, Twist)
        if key not in _TYPES and random.random() < 0.3:
            key = topics.source_cmd_vel(random.choice((*NAMES, payloads.text(random)[:500]))).key
        payload = payloads.mutated(random, message_type)
        stamp = payloads.attachment(random, asyncio.get_running_loop().time(), gids)
        self.last.append((key, payload, "no attachment" if stamp is None else stamp.hex()))
        self._stranger.send(key, payload, stamp)

    def _check(self, running: "asyncio.Future[None] | None") -> None:
        if running is not None and running.done():
            running.result()
            raise _UnfitError("the supervisor has ended")
        if self.tap.wrong or self._complaints:
            raise _UnfitError("; ".join(self.tap.wrong[:3]) or "see above")


_TYPES: dict[str, type[Message]] = {
    topics.SCAN.key: LaserScan,
    topics.ODOM.key: Odometry,
    topics.ESTOP.key: Bool,
}
_KEYS = (*_TYPES, *(topics.source_cmd_vel(name).key for name in ("teleop", "joy", "path")))


def _scan(tick: int) -> LaserScan:
    """A scan of a round room; like a real lidar's, no two are equal."""
    ranges = np.full(360, ROOM_M, np.float32)
    ranges[tick % 360] += 0.001
    return laser_scan(ranges, range_m=(0.05, 12.0), period_s=0.06, time_ns=0)


@contextmanager
def _complaints() -> Generator[list[str]]:
    """Collect the supervisor's error logs; other logs are hidden."""
    said: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: said.append(f"logged: {record.getMessage()}")
    logger = logging.getLogger("supervisor")
    before, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = before
