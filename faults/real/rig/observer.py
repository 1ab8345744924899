"""Observe a trial from outside, by a separate Zenoh client and the pipe from the wheels."""

import asyncio
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator

from deploy.stack.reach import seen_within
from faults.classes import BASE_TIMEOUT_S
from faults.measure import BaseReport
from faults.real.rig.wheels import WheelPipe, WheelSample
from faults.seen import Asked, Command, Seen, Status
from wire import topics
from wire.bus import Arrival, Subscription
from wire.messages import M, Twist
from wire.watchdog import BaseReason
from wire.zenoh.bus import ZenohBus

DEPTH = 20_000
"""Samples of a topic between two updates: a flood of two seconds."""
SOURCES = (topics.TELEOP, "joy", "path")
TRUSTED_STAMP_S = 60.0
"""Maximum plausible age of a stamp: here, all processes use one clock."""
BASE_REASONS = tuple(reason.value for reason in BaseReason)


class Observer:
    """Keeps all observations of one trial.

    Args:
        bus: an open bus; the caller closes it.
        wheels: the pipe from the sim.
    """

    def __init__(self, bus: ZenohBus, wheels: WheelPipe) -> None:
        self.bus = bus
        self._wheels = wheels
        self._wake = asyncio.Event()
        self._alive = bus.watch_alive(self._wake)
        self._commands = bus.subscribe(topics.CMD_VEL, depth=DEPTH, wake=self._wake)
        self._statuses = bus.subscribe(topics.STATUS, depth=DEPTH, wake=self._wake)
        self._asked = {name: bus.subscribe(topics.source_cmd_vel(name), depth=DEPTH) for name in SOURCES}
        asyncio.get_running_loop().add_reader(wheels.descriptor, self._wake.set)
        self._heard: defaultdict[bytes, Counter[str]] = defaultdict(Counter)
        """Number of samples of each epoch on each key."""
        self._lead_s: defaultdict[bytes, float] = defaultdict(float)
        """By how much the stamps of each epoch are ahead of this machine's clock, at least: those of a page, by what delayed its first message."""
        self.alive: set[str] = set()
        self.trusts_stamps = True
        """Whether the stamps of commands are valid; they are not while the sender's clock steps."""
        self.clear()

    def clear(self) -> None:
        """Begin a new trial."""
        self.began_s = time.monotonic()
        self.seen = Seen()
        self.base: list[BaseReport] = []
        self.undecodable = 0
        """Number of undecodable messages on cmd_vel."""
        self.late = 0
        """Number of commands that arrived older than the base's timeout, so that the base ignores them."""
        self.misdelivered = 0
        """Number of samples under a key on which their publisher does not publish."""
        self.contacts = 0
        for subscription in (self._commands, self._statuses, *self._asked.values()):
            subscription.take()
        self._wheels.take()

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._wheels.descriptor)

    def look(self) -> Seen:
        """Add the new arrivals, and return all observations."""
        seen = self.seen
        for change in self._alive.take():
            (self.alive.add if change.alive else self.alive.discard)(change.node)
        for command in self._delivered(self._commands):
            if command.message is None:
                self.undecodable += 1
            elif _age_s(command) > BASE_TIMEOUT_S:
                self.late += 1
            else:
                seen.commands.append(Command.of(command.arrival_s, command.message))
        for status in self._delivered(self._statuses):
            if status.message is not None:
                seen.statuses.append(Status.of(status.arrival_s, status.message))
        for name, subscription in self._asked.items():
            seen.asked += [
                Asked.of(self._sent_s(arrival), name, arrival.message)
                for arrival in self._delivered(subscription)
                if arrival.message is not None
            ]
        for sample in self._wheels.take():
            self._roll(sample)
        return seen

    async def until(self, condition: Callable[[Seen], bool], limit_s: float) -> bool:
        """Wait until the condition holds; return whether it did within `limit_s`."""
        return await seen_within(limit_s, self._wake, lambda: condition(self.look()))

    async def watch(self, duration_s: float) -> None:
        await self.until(lambda _: False, duration_s)

    def finished(self) -> Seen:
        """Return all observations of the trial in order of time."""
        seen = self.look()
        seen.asked.sort(key=lambda one: one.sent_s)
        return seen

    def _sent_s(self, arrival: Arrival[Twist]) -> float:
        """Return when a command was sent, by its stamp if it has a plausible one."""
        if arrival.stamp is None or not self.trusts_stamps:
            return arrival.arrival_s
        age_s, gid = _age_s(arrival), arrival.stamp.gid
        self._lead_s[gid] = max(self._lead_s[gid], -age_s)
        return arrival.arrival_s - age_s - self._lead_s[gid]

    def _delivered(self, subscription: Subscription[M]) -> Iterator[Arrival[M]]:
        """Yield the samples of a key from the publishers that mostly publish on it.

        After an expired lease, Zenoh delivers a few samples under another key (docs/decisions/0022).
        """
        for arrival in subscription.take():
            if arrival.stamp is not None:
                heard = self._heard[arrival.stamp.gid]
                heard[subscription.key] += 1
                if heard[subscription.key] < max(heard.values()):
                    self.misdelivered += 1
                    continue
            yield arrival

    def _roll(self, sample: WheelSample) -> None:
        motion, motions = sample.motion, self.seen.motions
        if motion.time_s < self.began_s:
            return
        self.contacts += motion.is_touching and not (motions and motions[-1].is_touching)
        # The approach of the first sample dates from before the trial.
        motions.append(motion if motions else motion._replace(own_approach_m=0.0))
        driven = self.seen.driven
        if not driven or driven[-1][1] != sample.is_driven:
            driven.append((motion.time_s, sample.is_driven))
        reason = BASE_REASONS[sample.reason]
        if not self.base or self.base[-1].reason != reason:
            self.base.append(BaseReport(motion.time_s, reason))


def _age_s(arrival: Arrival[Twist]) -> float:
    """Return the age at arrival by the sender's stamp, negative if the stamp is ahead; 0 without a plausible stamp."""
    if arrival.stamp is None:
        return 0.0
    age_s = arrival.arrival_s - arrival.stamp.source_time_ns * 1e-9
    return age_s if abs(age_s) < TRUSTED_STAMP_S else 0.0
