"""The ROS 2 process on the virtual network: a node without ROS, a robot's lidar, and programs that command it."""

import asyncio
import itertools
from collections.abc import AsyncGenerator, Awaitable, Callable, Collection, Mapping
from contextlib import asynccontextmanager
from typing import Any, TypeVar, cast

import numpy as np

from ros2.config import Ros2Section
from ros2.ros import TWIST, Endpoint
from ros2.samples import Sample
from ros2.service import Ros2Service
from tests.component.rig import Rig, laser_scan
from tests.unit.ros2.fake_ros import NAME, FakeRos
from tests.unit.ros2.programs import WALL_S, Program
from virtual.network import VirtualBus
from wire import cdr, topics
from wire.inbox import Inbox, LivelinessChange, NoReplyError, Token
from wire.messages import encode, odometry
from wire.stamp import Stamp, Stamper, parse_stamp
from wire.topics import Topic
from wire.zenoh.session import Push, ZenohSession

R = TypeVar("R")

CMD_VEL, TELEOP, SCAN, ODOM = "/cmd_vel", "/teleop/cmd_vel", "/scan", "/odom"
OWN = Endpoint(NAME, TWIST, b"own process " + b"0001")
BASE = Endpoint("/base", TWIST, b"base process" + b"0001")


class _Push:
    """Stands for a subscription on a virtual bus."""

    def __init__(self, push: Push) -> None:
        self.push = push


class _RawPublisher:
    def __init__(self, session: "VirtualSession", key: str) -> None:
        self._session, self._key = session, key
        self._stamper = Stamper(session.bus.network.new_gid())

    @property
    def epoch(self) -> bytes:
        return self._stamper.gid

    def next_stamp(self, true_at_s: float | None = None) -> Stamp:
        now_s = self._session.bus.network.loop.time()
        return self._stamper.next(now_s if true_at_s is None else true_at_s)

    def put_bytes(self, payload: bytes, attachment: bytes | None = None) -> None:
        bus = self._session.bus
        stamp = attachment or self.next_stamp().pack()
        parsed = parse_stamp(stamp)
        assert parsed is not None
        self._session.sent.setdefault(self._key, []).append((payload, parsed))
        bus.send(self._key, payload, stamp)


class VirtualSession:
    """The part of a `ZenohSession` that the ROS 2 process uses, on a virtual bus."""

    def __init__(self, bus: VirtualBus) -> None:
        self.bus = bus
        self.sent: dict[str, list[tuple[bytes, Stamp]]] = {}
        """All samples that were put, by key."""

    def publisher_raw(self, topic: Topic[Any]) -> _RawPublisher:
        return _RawPublisher(self, topic.key)

    def subscribe_raw(self, key: str, push: Push) -> None:
        self.bus.subscriptions.setdefault(key, []).append(cast("Any", _Push(push)))
        self.bus.network.listened.add(key)

    def declare_alive(self, node: str, epoch: bytes = b"") -> Token:
        return self.bus.declare_alive(node, epoch)

    def watch_alive(
        self, wake: asyncio.Event | None = None, nodes: Collection[str] | None = None
    ) -> Inbox[LivelinessChange]:
        return self.bus.watch_alive(wake, nodes)

    async def call_raw(
        self, key: str, request: bytes | None, read: Callable[[bytes], R | None], *, timeout_s: float
    ) -> R:
        assert request is None
        answer = read(encode(await self.bus.call(topics.Service(key, "anyone"), timeout_s=timeout_s)))
        if answer is None:
            raise NoReplyError(key)
        return answer


class Ros2Robot:
    """The ROS 2 process of one robot.

    Args:
        sources: entries of `[[ros2.sources]]`.
        stamped: whether the base listens to TwistStamped.
        stamp: `[ros2] stamp`.
    """

    def __init__(
        self, *sources: Mapping[str, object], stamped: bool = False, stamp: str | None = None
    ) -> None:
        self.rig = Rig()
        self._stamped = stamped
        self.node = FakeRos()
        self.node.listed[CMD_VEL] = [OWN]
        self.node.listening[CMD_VEL] = [BASE]
        self.suspended_s = 0.0
        self.session = VirtualSession(self.rig.network.open_joined(topics.ROS2))
        config = Ros2Section.model_validate({"sources": list(sources), "stamped": stamped, "stamp": stamp})
        self.service = Ros2Service(
            cast("ZenohSession", self.session),
            self.node,
            config,
            command_timeout_s=0.2,
            lidar_topics=(topics.SCAN.key,),
            suspended_s=self._take_suspended_s,
        )
        self.ranges = np.full(360, 3.0)
        self.program = Program()
        self.velocity: tuple[float, float] | None = None
        """What the program publishes at 20 Hz; None: nothing."""
        self.base_ahead_s: float | None = None
        """The base's clock less this computer's: it publishes odometry that follows its commands; None: no odometry."""
        self.header_late_s: float | None = None
        """Age of the program's headers; None: it publishes Twist."""
        self._odometries, self._measured = Program(), cdr.STANDSTILL
        self._jitter = itertools.cycle((0.0, 1e-4))  # no real scan repeats itself
        self._scans = Program()

    def _take_suspended_s(self) -> float:
        suspended_s, self.suspended_s = self.suspended_s, 0.0
        return suspended_s

    @asynccontextmanager
    async def running(self) -> AsyncGenerator["Ros2Robot"]:
        """Run the process, the lidar at 20 Hz and the program."""
        stop = asyncio.Event()
        running = asyncio.create_task(self.service.run(stop))
        try:
            async with self.rig.every(0.05, self._publish), self.rig.every(0.02, self._measure):
                yield self
        finally:
            stop.set()
            await running

    def _publish(self) -> None:
        scan = encode(laser_scan(self.ranges + next(self._jitter)))
        self.hear(SCAN, self._scans.sample(scan, self.now_s))
        if self.velocity is not None:
            self.say(*self.velocity)

    def _measure(self) -> None:
        if self.base_ahead_s is None:
            return
        self._measured = next(reversed(self.outputs()), self._measured)
        stamp_ns = round((self.now_s + WALL_S + self.base_ahead_s) * 1e9)
        message = odometry((0.0, 0.0, 0.0), self._measured, time_ns=stamp_ns)
        self.hear(ODOM, self._by_wall_clock(self._odometries, encode(message)))

    def _by_wall_clock(self, program: Program, payload: bytes) -> Sample:
        """Return a message whose header is stamped by the wall clock."""
        sample = program.sample(payload, self.now_s)
        return sample._replace(source_time_ns=round(self.now_s * 1e9), clock_ns=round(WALL_S * 1e9))

    @property
    def now_s(self) -> float:
        return self.rig.loop.time()

    def hear(self, topic: str, sample: Sample) -> None:
        """Let a message arrive, at each subscription of its topic."""
        for heard in self.node.heard[topic]:
            heard(sample)

    def say(self, linear_m_s: float, angular_rad_s: float = 0.0, late_s: float = 0.0) -> None:
        """Publish one command of the program."""
        velocity = cdr.Planar(linear_m_s, angular_rad_s)
        if self.header_late_s is None:
            self.hear(TELEOP, self.program.sample(cdr.twist(velocity), self.now_s, late_s))
            return
        stamp_ns = round((self.now_s + WALL_S - self.header_late_s) * 1e9)
        self.hear(TELEOP, self._by_wall_clock(self.program, cdr.twist_stamped(velocity, stamp_ns, "")))

    def discover(self, *programs: Endpoint) -> None:
        """Set the publishers of the command topic that discovery knows."""
        self.node.listed[TELEOP] = list(programs)
        self.node.matched()

    async def request(self, service: str) -> tuple[bool, str]:
        """Call a service of the node, as its thread does in the event loop."""
        handler: Any = self.node.services[service]
        answer: Callable[[], Awaitable[tuple[bool, str]]] = handler.args[0]
        return await answer()

    async def pass_time(self, seconds: float) -> list[cdr.Planar]:
        """Let time pass; return what was published on the base's command topic."""
        self.node.published[CMD_VEL] = []
        await self.rig.pass_time(seconds)
        return self.outputs()

    def outputs(self) -> list[cdr.Planar]:
        twists = [
            cdr.twist_of(payload, stamped=self._stamped) for payload in self.node.published.get(CMD_VEL, [])
        ]
        planar = [cdr.planar_of(twist or b"") for twist in twists]
        return [velocity for velocity in planar if velocity is not None]

    async def drive(self, linear_m_s: float = 0.5) -> None:
        """Arm the steady program, and drive."""
        self.velocity = (0.0, 0.0)
        await self.pass_time(0.6)
        assert self.rig.newest_status.reasons == []
        self.velocity = (linear_m_s, 0.0)
        outputs = await self.pass_time(0.2)
        assert outputs[-1] == (linear_m_s, 0.0)
