"""Apply the scenario's faults to the simulated processes, and record when each was applied."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from functools import partial
from random import Random
from typing import Any

import numpy as np

from faults import writers
from faults.demands import Done
from faults.seen import Asked
from faults.simulated.scenario import MOVING_LIMIT_S, STRAIGHT_LIMIT_S, Planned
from faults.simulated.world import RESTART_S, SOURCES, World
from virtual.network import Conditions
from wire import topics
from wire.bus import NoReplyError
from wire.messages import (
    Bool,
    Header,
    LaserScan,
    Point,
    Time,
    Twist,
    UndecodableError,
    decode,
    encode,
    odometry,
    planar_twist,
    zero_twist,
)
from wire.stamp import Stamp

LEAST_M_S, MOST_M_S = 0.1, 0.9
"""The speed that a fault waits for, by its strength."""
LOOK_S = 0.02
PILLAR_AHEAD_M = (1.0, 2.2)
"""Distance between the centres."""
PAUSE_AFTER_S, PAUSE_S = 0.6, 0.6
FLOOD_S, MANY_HZ = 1.5, 100.0
ESTOP_ALONE_S = 0.3
"""Maximum time from an e-stop to the death of a process."""
TELEOP_CMD_VEL = topics.source_cmd_vel(topics.TELEOP).key

Parameters = dict[str, float | str]
Fault = Callable[["Injector", Planned, Parameters], Awaitable[None]]


class NotDoneError(Exception):
    """The target of the fault does not exist at this moment."""


class Injector:
    """Applies the faults of a scenario to a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._random: Random = world.scenario.stream("injector")
        self.done: list[Done] = []
        self._open: list[tuple[str, float, Parameters]] = []
        self._rogue = world.network.open_client("rogue")

    async def run(self, fault: Planned) -> None:
        """Wait for the fault's moment, apply it, and lift it at its end."""
        world, loop = self._world, self._world.loop
        await asyncio.sleep(max(0.0, fault.at_s - loop.time()))
        limit_s = loop.time() + (STRAIGHT_LIMIT_S if world.scenario.straight else MOVING_LIMIT_S)
        enough_m_s = LEAST_M_S + (MOST_M_S - LEAST_M_S) * fault.strength
        while world.speed_m_s < enough_m_s and loop.time() < limit_s:  # noqa: ASYNC110 - nothing tells it
            await asyncio.sleep(LOOK_S)
        parameters: Parameters = {"lasts_s": round(fault.lasts_s, 3)}
        entry = (fault.name, loop.time(), parameters)
        self._open.append(entry)
        is_done = True
        try:
            await FAULTS[fault.name](self, fault, parameters)
        except NotDoneError:
            is_done = False
        finally:
            self._open.remove(entry)
            if is_done:
                self.done.append(Done(fault.name, entry[1], loop.time(), parameters))

    def finished(self) -> list[Done]:
        """Return the applied faults in order of time; those not lifted yet end now."""
        now_s = self._world.loop.time()
        still = [Done(name, at_s, now_s, parameters) for name, at_s, parameters in self._open]
        return sorted([*self.done, *still], key=lambda one: (one.at_s, one.name))

    async def connect(self) -> None:
        await self._rogue.connect()

    async def put_pillars(self) -> None:
        """Place a pillar ahead of the robot from time to time."""
        world, random = self._world, self._random
        for at_s in world.scenario.pillars:
            await asyncio.sleep(max(0.0, at_s - world.loop.time()))
            pose, ahead_m, aside_m = (
                world.plant.true_pose,
                random.uniform(0.5, 2.0),
                random.uniform(-0.4, 0.4),
            )
            cos, sin = float(np.cos(pose.yaw_rad)), float(np.sin(pose.yaw_rad))
            x_m = pose.x_m + ahead_m * cos - aside_m * sin
            y_m = pose.y_m + ahead_m * sin + aside_m * cos
            self.say(topics.OBSTACLE.key, encode(Point(x_m, y_m, 0.0)), None)

    # --- processes

    async def sigkill(self, fault: Planned, _: Parameters, *, names: tuple[str, ...]) -> None:
        for name in names:
            self._world.kill(name)
        await asyncio.sleep(max(RESTART_S, fault.lasts_s))
        for name in names:
            self._world.start(name)

    async def sigterm(self, fault: Planned, _: Parameters, *, name: str) -> None:
        self._world.terminate(name)
        await asyncio.sleep(max(RESTART_S, fault.lasts_s))
        self._world.start(name)

    async def end_of_input(self, fault: Planned, _: Parameters) -> None:
        keyboard = self._world.keyboard
        if keyboard is None:
            self._world.terminate(topics.TELEOP)
        else:
            keyboard.end()
        await asyncio.sleep(max(RESTART_S, fault.lasts_s))
        self._world.start(topics.TELEOP)

    async def hold(
        self, fault: Planned, _: Parameters, *, name: str, deaf: bool = False, stopped: bool = False
    ) -> None:
        life = self._world.hold(name, deaf=deaf, stopped=stopped)
        await asyncio.sleep(fault.lasts_s)
        if life is not None:
            self._world.let_go(life)

    # --- sensors

    async def sensors(self, fault: Planned, parameters: Parameters, *, spec: str) -> None:
        start_rad = 6.28 * (fault.strength - 0.5)
        text = spec.format(
            start=f"{start_rad:.3f}",
            end=f"{start_rad + 0.3 + 2.0 * fault.strength:.3f}",
            rate=f"{2.0 + 12.0 * fault.strength:.2f}",
        )
        await self._spoil(fault, parameters, text)

    async def _spoil(self, fault: Planned, parameters: Parameters, text: str) -> None:
        parameters["spec"] = text
        if not await self._ask_sim(text):
            raise NotDoneError(text)
        await asyncio.sleep(fault.lasts_s)
        await self._ask_sim("none")

    async def in_the_way(self, fault: Planned, parameters: Parameters, *, spec: str) -> None:
        """Apply a lidar fault, with a pillar straight ahead."""
        self._put_pillar_ahead(parameters)
        await self.sensors_by_strength(fault, parameters, spec=spec)

    async def sensors_by_strength(self, fault: Planned, parameters: Parameters, *, spec: str) -> None:
        """Apply a lidar fault whose parameters depend on its strength."""
        strength = fault.strength
        half_rad = math.radians(0.5 + 9.5 * strength)
        text = spec.format(
            start=f"{-half_rad:.3f}",
            end=f"{half_rad:.3f}",
            share=f"{0.02 + 0.28 * strength:.3f}",
            reach=f"{0.5 + 0.5 * strength:.2f}",
            rate=20.0 if self._random.random() < 0.5 else 5.5,
        )
        await self._spoil(fault, parameters, text)

    def _put_pillar_ahead(self, parameters: Parameters) -> None:
        pose = self._world.plant.true_pose
        parameters["pillar_m"] = ahead_m = round(self._random.uniform(*PILLAR_AHEAD_M), 3)
        x_m = pose.x_m + ahead_m * math.cos(pose.yaw_rad)
        y_m = pose.y_m + ahead_m * math.sin(pose.yaw_rad)
        self.say(topics.OBSTACLE.key, encode(Point(x_m, y_m, 0.0)), None)

    async def calm_sensors(self) -> None:
        """Lift all sensor faults as soon as a sim runs."""
        while not await self._ask_sim("none"):  # noqa: ASYNC110 - nothing tells it
            await asyncio.sleep(LOOK_S)

    async def _ask_sim(self, text: str) -> bool:
        """Return whether the sim answered; a sim that does not run has no faults."""
        try:
            return (await self._rogue.call(topics.SIM_FAULTS, text, timeout_s=0.2)).success
        except NoReplyError:
            return False

    # --- network

    async def cut(
        self, fault: Planned, _: Parameters, *, name: str, up: bool = True, down: bool = True
    ) -> None:
        network = self._world.network
        network.cut(name, up=up, down=down)
        await asyncio.sleep(fault.lasts_s)
        network.heal(name)

    async def healed(self, fault: Planned, parameters: Parameters, *, name: str) -> None:
        parameters["lasts_s"] = lasts_s = (0.3, 1.0, 3.0)[int(2.999 * fault.strength)]
        self._world.network.cut(name)
        await asyncio.sleep(lasts_s)
        self._world.network.heal(name)

    async def disturb(
        self, fault: Planned, parameters: Parameters, *, name: str, how: Callable[[Conditions, float], None]
    ) -> None:
        up, down = self._world.network.link(name)
        for conditions in (up, down):
            how(conditions, fault.strength)
        parameters["delay_s"] = round(up.delay_s + up.jitter_s, 4)
        await asyncio.sleep(fault.lasts_s)
        for conditions in (up, down):
            calm(conditions)

    async def flap(self, _fault: Planned, _: Parameters) -> None:
        self._world.network.flap(topics.TELEOP)

    # --- the wire

    def say(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Publish bytes on a key; a message under a source's name counts as that source's request."""
        world = self._world
        self._rogue.send(key, payload, attachment)
        source = topics.source_of(key)
        if source in SOURCES:
            try:
                twist = decode(payload, Twist)
            except UndecodableError:
                return
            world.seen.asked.append(Asked(world.loop.time(), source, twist.linear.x, twist.angular.z))

    async def speak(
        self,
        fault: Planned,
        _: Parameters,
        *,
        words: Callable[["Injector"], tuple[str, bytes, bytes | None]],
    ) -> None:
        """Publish random messages for a while, 5 to 105 per second."""
        loop = self._world.loop
        end_s, period_s = loop.time() + min(fault.lasts_s, 1.0), 1.0 / (5.0 + 100.0 * fault.strength)
        while loop.time() < end_s:
            self.say(*words(self))
            await asyncio.sleep(period_s)

    async def flood(self, fault: Planned, parameters: Parameters) -> None:
        choice = int(fault.strength * 2.999)
        parameters["what"] = ("commands", "scans", "no e-stop")[choice]
        for _ in range(1000):
            match choice:
                case 0:
                    self.say(TELEOP_CMD_VEL, encode(planar_twist(0.5, 0.0)), None)
                case 1:
                    self.say(topics.SCAN.key, b"\x00\x01\x00\x00", None)
                case _:
                    self.say(topics.ESTOP.key, encode(Bool(data=False)), None)

    async def rogue_cmd_vel(self, fault: Planned, _: Parameters) -> None:
        end_s = self._world.loop.time() + fault.lasts_s
        while self._world.loop.time() < end_s:
            self.say(topics.CMD_VEL.key, encode(planar_twist(1.0, 0.0)), None)
            await asyncio.sleep(0.01)

    async def second_teleop(self, fault: Planned, _: Parameters) -> None:
        self._world.start("teleop2")
        await asyncio.sleep(fault.lasts_s)
        self._world.kill("teleop2")

    async def second_lidar(self, fault: Planned, _: Parameters) -> None:
        """Publish another client's scans of NaN, which prove nothing."""
        end_s = self._world.loop.time() + min(fault.lasts_s, 1.0)
        while self._world.loop.time() < end_s:
            self.say(topics.SCAN.key, encode(_scan(self._header())), None)
            await asyncio.sleep(0.05)

    async def second_writer(self, fault: Planned, parameters: Parameters, *, rate_hz: float) -> None:
        """Publish another client's scans of free space, with a pillar ahead and one pause of the real lidar."""
        self._put_pillar_ahead(parameters)
        loop, now_s = self._world.loop, self._world.loop.time()
        end_s = now_s + (fault.lasts_s if rate_hz < MANY_HZ else FLOOD_S)
        pausing = asyncio.ensure_future(self._pause_lidar(now_s + PAUSE_AFTER_S))
        try:
            for attachment in writers.attachments(self._random, rate_hz):
                if loop.time() >= end_s:
                    break
                scan = writers.free_scan(self._random, round(loop.time() * 1e9))
                self.say(topics.SCAN.key, encode(scan), attachment)
                await asyncio.sleep(1.0 / rate_hz)
        finally:
            pausing.cancel()
        await self._ask_sim("none")

    async def _pause_lidar(self, at_s: float) -> None:
        await asyncio.sleep(at_s - self._world.loop.time())
        await self._ask_sim("silent")
        await asyncio.sleep(PAUSE_S)
        await self._ask_sim("none")

    async def clock_step(self, fault: Planned, parameters: Parameters) -> None:
        name = self._random.choice((topics.TELEOP, topics.SIM))
        step_s = (fault.strength - 0.5) * self._random.choice((0.1, 1.0, 20.0))
        parameters["process"], parameters["step_s"] = name, round(step_s, 4)
        life = self._world.lives.get(name)
        if life is not None:
            life.bus.clock_offset_s += step_s

    async def estop(self, _fault: Planned, _: Parameters) -> None:
        self.say(topics.ESTOP.key, encode(Bool(data=True)), None)

    async def estop_and_sigkill(self, fault: Planned, _: Parameters, *, name: str) -> None:
        """Press the e-stop, kill a process and restart it; nobody resets, and the operator continues to command motion."""
        world = self._world
        world.may_reset = False
        try:
            self.say(topics.ESTOP.key, encode(Bool(data=True)), None)
            await asyncio.sleep(fault.strength * ESTOP_ALONE_S)
            world.kill(name)
            await asyncio.sleep(RESTART_S)
            world.start(name)
            await asyncio.sleep(fault.lasts_s)
        finally:
            world.may_reset = True

    async def suspend(self, fault: Planned, parameters: Parameters) -> None:
        """Suspend the machine; by the monotonic clock, all data is as fresh as before."""
        parameters["slept_s"] = slept_s = round(0.2 + 60.0 * fault.strength**2, 3)
        self._world.machine.sleep(slept_s)
        await asyncio.sleep(LOOK_S)

    # --- words

    def _a_key(self) -> str:
        keys = (TELEOP_CMD_VEL, topics.SCAN.key, topics.ODOM.key, topics.ESTOP.key, topics.OBSTACLE.key)
        others = (topics.CMD_VEL.key, topics.STATUS.key, topics.source_cmd_vel("stranger").key)
        return self._random.choice((*keys, TELEOP_CMD_VEL, TELEOP_CMD_VEL, *others))

    def malformed(self) -> tuple[str, bytes, bytes | None]:
        random = self._random
        return (
            self._a_key(),
            random.randbytes(random.randrange(200)),
            random.randbytes(random.choice((0, 5, 33))),
        )

    def truncated(self) -> tuple[str, bytes, bytes | None]:
        payload = encode(
            self._random.choice((planar_twist(0.5, 0.5), Bool(data=True), _scan(self._header())))
        )
        return self._a_key(), payload[: self._random.randrange(len(payload))], None

    def oversized(self) -> tuple[str, bytes, bytes | None]:
        return self._a_key(), encode(planar_twist(0.5, 0.0)) + bytes(1 << 20), None

    def wrong_type(self) -> tuple[str, bytes, bytes | None]:
        key = self._a_key()
        twist, scan = planar_twist(0.5, 0.5), _scan(self._header())
        messages: dict[str, Any] = {
            topics.SCAN.key: twist,
            topics.ODOM.key: scan,
            topics.ESTOP.key: twist,
            topics.OBSTACLE.key: Bool(data=True),
        }
        return key, encode(messages.get(key, scan)), None

    def not_finite(self) -> tuple[str, bytes, bytes | None]:
        value = self._random.choice((float("nan"), float("inf"), -float("inf")))
        return self._extreme(value)

    def huge(self) -> tuple[str, bytes, bytes | None]:
        value = self._random.choice((1e3, -1e3, 1e300, 42.0))
        return self._extreme(value)

    def _extreme(self, value: float) -> tuple[str, bytes, bytes | None]:
        """Return a random message with this value. Scans are excluded, because a false scan of free space breaks every promise."""
        time_ns = round(self._world.loop.time() * 1e9)
        choices: tuple[tuple[str, Any], ...] = (
            (TELEOP_CMD_VEL, planar_twist(value, 0.0)),
            (TELEOP_CMD_VEL, planar_twist(0.0, value)),
            (topics.ODOM.key, odometry((0.0, 0.0, 0.0), (value, value), time_ns=time_ns)),
            (topics.OBSTACLE.key, Point(value, 0.0, 0.0)),
        )
        key, message = self._random.choice(choices)
        return key, encode(message), None

    def _header(self) -> Header:
        """Return a header with the time of the virtual clock, because a wall clock would make every run different."""
        seconds, nanoseconds = divmod(round(self._world.loop.time() * 1e9), 1_000_000_000)
        return Header(Time(seconds, nanoseconds), "rogue")

    def attachments(self) -> tuple[str, bytes, bytes | None]:
        """Return a command with a malformed, false or replayed attachment."""
        random, now_ns = self._random, round(self._world.loop.time() * 1e9)
        heard = self._world.heard
        message = random.choice((planar_twist(0.5, 0.0), planar_twist(0.0, 1.0), zero_twist()))
        gid = heard[-1][1].gid if heard else bytes(16)
        attachment: bytes | None
        match random.randrange(7):
            case 0:
                attachment = None
            case 1:
                attachment = random.randbytes(random.choice((0, 1, 32, 33, 34)))
            case 2:  # from the future
                attachment = Stamp(1 << 40, now_ns + 3_600_000_000_000, gid).pack()
            case 3:  # from long ago, with a sequence of far ahead
                attachment = Stamp(1 << 50, 0, gid).pack()
            case 4:
                attachment = Stamp(-(1 << 62), -(1 << 62), bytes(16)).pack()
            case 5:
                attachment = Stamp(1, now_ns, random.randbytes(16)).pack()
            case _:
                message, stamp = random.choice(heard) if heard else (message, Stamp(1, now_ns, gid))
                attachment = stamp.pack()
        return TELEOP_CMD_VEL, encode(message), attachment


def _scan(header: Header) -> LaserScan:
    """Return a scan that proves nothing."""
    return LaserScan(
        header,
        angle_min=-3.14,
        angle_max=3.14,
        angle_increment=0.0175,
        time_increment=0.0,
        scan_time=0.05,
        range_min=0.1,
        range_max=12.0,
        ranges=np.full(360, np.nan, dtype=np.float32),
        intensities=np.empty(0, dtype=np.float32),
    )


def slow(conditions: Conditions, strength: float) -> None:
    conditions.delay_s = 0.05 + 0.35 * strength
    conditions.jitter_s = 0.1 * strength


def lossy(conditions: Conditions, strength: float) -> None:
    conditions.loss = 0.1 + 0.7 * strength


def unordered(conditions: Conditions, strength: float) -> None:
    conditions.in_order = False
    conditions.jitter_s = 0.05 + 0.2 * strength


def calm(conditions: Conditions) -> None:
    """Restore the initial conditions of a link, except for cuts."""
    conditions.delay_s = conditions.jitter_s = conditions.loss = 0.0
    conditions.in_order = True


TELEOP, SUPERVISOR, SIM = topics.TELEOP, topics.SUPERVISOR, topics.SIM

FAULTS: dict[str, Fault] = {
    "teleop_sigkill": partial(Injector.sigkill, names=(TELEOP,)),
    "teleop_sigterm": partial(Injector.sigterm, name=TELEOP),
    "teleop_sigstop": partial(Injector.hold, name=TELEOP, stopped=True),
    "teleop_blocked": partial(Injector.hold, name=TELEOP),
    "teleop_gil": partial(Injector.hold, name=TELEOP, deaf=True),
    "teleop_end_of_input": Injector.end_of_input,
    "supervisor_sigkill": partial(Injector.sigkill, names=(SUPERVISOR,)),
    "supervisor_sigstop": partial(Injector.hold, name=SUPERVISOR, stopped=True),
    "supervisor_blocked": partial(Injector.hold, name=SUPERVISOR),
    "supervisor_and_teleop_sigkill": partial(Injector.sigkill, names=(SUPERVISOR, TELEOP)),
    "supervisor_restart": partial(Injector.sigterm, name=SUPERVISOR),
    "sim_sigkill": partial(Injector.sigkill, names=(SIM,)),
    "sim_sigstop": partial(Injector.hold, name=SIM, stopped=True),
    "sim_scan_frozen": partial(Injector.sensors, spec="freeze"),
    "sim_scan_nan": partial(Injector.sensors, spec="all_nan"),
    "sim_scan_blocked": partial(Injector.sensors, spec="blocked {start} {end}"),
    "sim_scan_silent": partial(Injector.sensors, spec="silent"),
    "sim_scan_rate": partial(Injector.sensors, spec="rate {rate}"),
    "sim_odom_gone": partial(Injector.sensors, spec="no_odom"),
    "sim_scan_dirt": partial(Injector.in_the_way, spec="blocked {start} {end}"),
    "sim_scan_dropout": partial(Injector.in_the_way, spec="dropout {share}; rate {rate}"),
    "sim_scan_short": partial(Injector.in_the_way, spec="reach {reach}; beams 0.02"),
    "sim_scan_stray": partial(Injector.sensors_by_strength, spec="stray 0.04"),
    "sim_scan_frozen_no_odom": partial(Injector.in_the_way, spec="freeze; no_odom"),
    "sim_scan_frozen_odom_zero": partial(Injector.in_the_way, spec="freeze; odom_zero"),
    "net_cut": partial(Injector.cut, name=TELEOP),
    "net_cut_base": partial(Injector.cut, name=SIM),
    "net_healed": partial(Injector.healed, name=TELEOP),
    "net_healed_base": partial(Injector.healed, name=SIM),
    "net_delayed": partial(Injector.disturb, name=TELEOP, how=slow),
    "net_delayed_base": partial(Injector.disturb, name=SIM, how=slow),
    "net_up_only": partial(Injector.cut, name=TELEOP, up=False),
    "net_down_only": partial(Injector.cut, name=TELEOP, down=False),
    "net_base_deaf": partial(Injector.cut, name=SIM, up=False),
    "net_base_mute": partial(Injector.cut, name=SIM, down=False),
    "net_lossy": partial(Injector.disturb, name=TELEOP, how=lossy),
    "net_reordered": partial(Injector.disturb, name=TELEOP, how=unordered),
    "net_flapping": Injector.flap,
    "wire_malformed": partial(Injector.speak, words=Injector.malformed),
    "wire_truncated": partial(Injector.speak, words=Injector.truncated),
    "wire_oversized": partial(Injector.speak, words=Injector.oversized),
    "wire_wrong_type": partial(Injector.speak, words=Injector.wrong_type),
    "wire_not_finite": partial(Injector.speak, words=Injector.not_finite),
    "wire_huge": partial(Injector.speak, words=Injector.huge),
    "wire_attachments": partial(Injector.speak, words=Injector.attachments),
    "wire_flood": Injector.flood,
    "wire_rogue_cmd_vel": Injector.rogue_cmd_vel,
    "wire_second_teleop": Injector.second_teleop,
    "wire_second_lidar": Injector.second_lidar,
    "wire_second_lidar_steady": partial(Injector.second_writer, rate_hz=20.0),
    "wire_second_lidar_flood": partial(Injector.second_writer, rate_hz=1000.0),
    "wire_clock_step": Injector.clock_step,
    "wire_estop": Injector.estop,
    "estop_teleop_sigkill": partial(Injector.estop_and_sigkill, name=TELEOP),
    "estop_supervisor_sigkill": partial(Injector.estop_and_sigkill, name=SUPERVISOR),
    "estop_sim_sigkill": partial(Injector.estop_and_sigkill, name=SIM),
    "machine_suspend": Injector.suspend,
}
"""The function that applies each class of faults."""
