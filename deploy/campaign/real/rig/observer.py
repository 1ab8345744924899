"""Whoever watches a trial from outside: a client of the wire of its own, and the pipe from the wheels."""

import asyncio
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator

from deploy.campaign.classes import BASE_TIMEOUT_S
from deploy.campaign.measure import BaseReport
from deploy.campaign.real.rig.wheels import WheelPipe, WheelSample
from deploy.campaign.seen import Asked, Command, Motion, Seen, Status
from deploy.stack.observe import seen_within
from sim.watchdog import BaseReason
from wire import topics
from wire.bus import Arrival, Bus, Subscription
from wire.messages import M, SafetyStatus, Twist
from wire.zenoh_bus import ZenohBus

DEPTH = 20_000
"""Samples of a topic between two looks: a flood of two seconds."""
SOURCES = (topics.TELEOP, "joy", "path")
TRUSTED_STAMP_S = 60.0
"""A command is as old as its sender says, unless that makes no sense: all of them run by one clock here."""
BASE_REASONS = tuple(reason.value for reason in BaseReason)


class Observer:
    """Keeps everything of one trial.

    Args:
        bus: open; the caller closes it.
        wheels: from the sim.
    """

    def __init__(self, bus: ZenohBus, wheels: WheelPipe) -> None:
        self.bus = bus
        self._wheels = wheels
        self._wake = asyncio.Event()
        self._subscribe(bus)
        asyncio.get_running_loop().add_reader(wheels.descriptor, self._wake.set)
        self._heard: defaultdict[bytes, Counter[str]] = defaultdict(Counter)
        """How often each epoch was heard on which key."""
        self.alive: set[str] = set()
        self.trusts_stamps = True
        """Whether commands tell when they were sent; not while their sender's clock steps."""
        self.clear()

    def _subscribe(self, bus: Bus) -> None:
        self._alive = bus.watch_alive(self._wake)
        self._commands = bus.subscribe(topics.CMD_VEL, depth=DEPTH, wake=self._wake)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=self._wake)
        self._asked = {name: bus.subscribe(topics.source_cmd_vel(name), depth=DEPTH) for name in SOURCES}

    def clear(self) -> None:
        """A trial begins."""
        self.began_s = time.monotonic()
        self.seen = Seen()
        self.base: list[BaseReport] = []
        self.status: SafetyStatus | None = None
        self.undecodable = 0
        """What came on cmd_vel and is no command."""
        self.late = 0
        """Commands that were older than the base's timeout when they came: it obeys none of them."""
        self.misdelivered = 0
        """What came under a key that its publisher does not speak on."""
        self.contacts = 0
        self._touching = False
        for subscription in (self._commands, self._statuses, *self._asked.values()):
            subscription.take()
        self._wheels.take()

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._wheels.descriptor)

    def look(self) -> Seen:
        """Take in what came since the last look, and return everything."""
        seen = self.seen
        for change in self._alive.take():
            (self.alive.add if change.alive else self.alive.discard)(change.node)
        for command in self._delivered(self._commands):
            if command.message is None:
                self.undecodable += 1
            elif _age_s(command) > BASE_TIMEOUT_S:
                self.late += 1
            else:
                seen.commands.append(
                    Command(command.arrival_s, command.message.linear.x, command.message.angular.z)
                )
        for status in self._delivered(self._statuses):
            if status.message is not None:
                self.status = status.message
                seen.statuses.append(_status(status.arrival_s, status.message))
        for name, subscription in self._asked.items():
            seen.asked += [
                self._ask(name, arrival, arrival.message)
                for arrival in self._delivered(subscription)
                if arrival.message is not None
            ]
        for sample in self._wheels.take():
            self._roll(sample)
        return seen

    async def until(self, condition: Callable[[Seen], bool], limit_s: float) -> bool:
        """Wait for something to be seen; whether it was, within `limit_s`."""
        return await seen_within(limit_s, self._wake, lambda: condition(self.look()))

    async def watch(self, duration_s: float) -> None:
        await self.until(lambda _: False, duration_s)

    def finished(self) -> Seen:
        """Everything of the trial, in order of time."""
        seen = self.look()
        seen.asked.sort(key=lambda one: one.sent_s)
        return seen

    def _delivered(self, subscription: Subscription[M]) -> Iterator[Arrival[M]]:
        """What came on a key from those who speak on it, as far as most of what they said tells.

        After a lapsed lease Zenoh delivers a few samples under another one's key (docs/decisions/0022).
        """
        for arrival in subscription.take():
            if arrival.stamp is not None:
                heard = self._heard[arrival.stamp.gid]
                heard[subscription.key] += 1
                if heard[subscription.key] < max(heard.values()):
                    self.misdelivered += 1
                    continue
            yield arrival

    def _ask(self, source: str, arrival: Arrival[Twist], twist: Twist) -> Asked:
        age_s = _age_s(arrival) if self.trusts_stamps else 0.0
        return Asked(arrival.arrival_s - age_s, source, twist.linear.x, twist.angular.z)

    def _roll(self, sample: WheelSample) -> None:
        if sample.time_s < self.began_s:
            return
        motions = self.seen.motions
        # The first sample's approach is from where the robot stood before the trial.
        own_approach_m = sample.own_approach_m if motions else 0.0
        motions.append(
            Motion(
                sample.time_s,
                sample.x_m,
                sample.y_m,
                sample.linear_m_s,
                sample.angular_rad_s,
                sample.clearance_m,
                own_approach_m,
                sample.is_touching,
            )
        )
        self.contacts += sample.is_touching and not self._touching
        self._touching = sample.is_touching
        driven = self.seen.driven
        if not driven or driven[-1][1] != sample.is_driven:
            driven.append((sample.time_s, sample.is_driven))
        reason = BASE_REASONS[sample.reason]
        if not self.base or self.base[-1].reason != reason:
            self.base.append(BaseReport(sample.time_s, reason))


def _age_s(arrival: Arrival[Twist]) -> float:
    """How old it was when it came, if its sender says so, and what it says makes sense."""
    if arrival.stamp is None:
        return 0.0
    age_s = arrival.arrival_s - arrival.stamp.source_time_ns * 1e-9
    return age_s if 0.0 <= age_s < TRUSTED_STAMP_S else 0.0


def _status(arrival_s: float, status: SafetyStatus) -> Status:
    commanded = (status.commanded.linear.x, status.commanded.angular.z)
    return Status(arrival_s, tuple(status.reasons), status.owner, commanded)
