"""Run one trial of the virtual campaign; the same seed always gives the same record."""

import asyncio
import gc
import hashlib
import itertools
import logging
import struct
from collections.abc import Generator
from contextlib import contextmanager

from faults.demands import Done, asked_age_s, demands, may_be_locked_out, tolerance_m
from faults.measure import NOTICED_WITHIN_S, injected, stop_after
from faults.port import PAGE
from faults.promises import Bounds, Demand, Kind, violations
from faults.seen import Seen
from faults.simulated.fault_injection import Injector
from faults.simulated.operator import Operator, reset_from_outside
from faults.simulated.scenario import EPISODE_S, RECOVERY_S, Drivers, draw
from faults.simulated.world import World
from faults.trial import BrokenPromise, Injected, Trial, timeline
from supervisor.config import SupervisorSection
from virtual.loop import VirtualLoop, VirtualTimeError
from wire import topics

AGAIN_S = 0.2
FREE_S = 0.6
"""Time without a stop after all faults are lifted; longer than any lease or backlog."""
FREE_STATUSES = 5
"""Minimum number of statuses in that time, which shows that the supervisor is not silent."""
LOOK_S = 0.05
FOLLOWS_S = 0.5
"""A stop that begins later than this after a fault's end is not a consequence of the fault."""


def run_trial(
    seed: int, revision: str = "", *, config: SupervisorSection | None = None, with_timeline: bool = False
) -> Trial:
    """Run the trial of a seed.

    Args:
        seed: determines every event.
        revision: the revision of the code, for the record.
        config: the configuration of the supervisor; None: the default.
        with_timeline: whether the record contains the motions; one with violations always does.
    """
    scenario = draw(seed)
    loop = VirtualLoop()
    world = World(loop, scenario, config)
    injector = Injector(world)
    with _undisturbed():
        try:
            loop.run_until_complete(_play(world, injector))
        except VirtualTimeError as error:
            world.crashes.append((loop.time(), "the clock", str(error)))
        world.end()
        loop.close()
    return _judge(world, injector.finished(), revision, with_timeline=with_timeline)


async def _play(world: World, injector: Injector) -> None:
    operator = Operator(world)
    world.start_all()
    tasks = [
        asyncio.ensure_future(work)
        for work in (
            world.watch(),
            operator.run(),
            reset_from_outside(world),
            injector.connect(),
            injector.put_pillars(),
            *(injector.run(fault) for fault in world.scenario.faults),
        )
    ]
    await asyncio.sleep(EPISODE_S)
    for task in tasks[5:]:
        task.cancel()
    await asyncio.sleep(0)
    operator.is_patient = True
    tasks.append(asyncio.ensure_future(mend(world, injector)))
    await _until_drivable(world)
    for task in tasks:
        task.cancel()
    await asyncio.wait(tasks)


async def _until_drivable(world: World) -> None:
    """Wait until the robot has not been stopped for a while, or the recovery time is over."""
    loop = world.loop
    await asyncio.sleep(FREE_S)
    while loop.time() < EPISODE_S + RECOVERY_S:
        since_s = loop.time() - FREE_S
        newest = reversed(world.seen.statuses)
        recent = list(itertools.takewhile(lambda status: status.arrival_s >= since_s, newest))  # noqa: B023 - called at once
        if len(recent) >= FREE_STATUSES and not any(status.is_stopped for status in recent):
            return
        await asyncio.sleep(LOOK_S)


async def mend(world: World, injector: Injector) -> None:
    """Lift all remaining faults, as an operator of the machine would."""
    injector.end_attacks()
    world.may_reset = True
    for name in (topics.TELEOP, topics.SIM):
        injector.heal(name)
    for life in list(world.lives.values()):
        world.let_go(life)
    names = {one.name for one in injector.finished()}
    begins_anew = {Drivers.STUBBORN: topics.TELEOP, Drivers.STATION: PAGE}.get(world.scenario.drivers)
    if begins_anew is not None and may_be_locked_out(names):
        world.kill(begins_anew)
    world.start_all()
    await injector.mend_sensors()
    while True:  # what ends only now is started again as well
        world.start_all()
        await asyncio.sleep(AGAIN_S)


def _judge(world: World, done: list[Done], revision: str, *, with_timeline: bool) -> Trial:
    seen, scenario = world.seen, world.scenario
    alone = scenario.drivers is not Drivers.BOTH
    wanted = demands(done, alone=alone)
    end_s = world.loop.time()
    wanted.append(Demand(Kind.DRIVABLE, 8, "everything is mended", EPISODE_S, end_s))
    age_s = asked_age_s(done)
    bounds = Bounds(tolerance_m=tolerance_m(done), asked_age_s=age_s, neutral_leeway_s=age_s)
    broken = [*violations(seen, wanted, bounds), *world.broken]
    broken += [
        BrokenPromise(8, time_s, f"{name} ended by an error of its own: {why}")
        for time_s, name, why in world.crashes
    ]
    return Trial(
        mode="virtual",
        revision=revision,
        seed=scenario.seed,
        duration_s=round(end_s, 3),
        faults=tuple(_injected(one, world) for one in done),
        smallest_clearance_m=round(min(motion.clearance_m for motion in seen.motions), 4),
        contacts=world.contacts,
        violations=tuple(broken),
        digest=digest(seen),
        timeline=tuple(timeline(seen)) if with_timeline or broken else (),
    )


def _injected(one: Done, world: World) -> Injected:
    within_s = min(one.until_s - one.at_s + FOLLOWS_S, NOTICED_WITHIN_S)
    stop = stop_after(world.seen, one.at_s, world.base, within_s)
    return injected(one.name, one.at_s, one.parameters, stop)


def digest(seen: Seen) -> str:
    """Return the digest of all observations, exact to the bit."""
    sha = hashlib.sha256()
    for command in seen.commands:
        sha.update(struct.pack("<3d", *command))
    for motion in seen.motions:
        sha.update(struct.pack("<7d?d", *motion))
    for status in seen.statuses:
        sha.update(repr(status).encode())
    return sha.hexdigest()[:16]


@contextmanager
def _undisturbed() -> Generator[None]:
    """Suppress the logs of the services and cyclic garbage collection.

    The collection takes a tenth of a trial's time and frees nothing before its end.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    logging.disable()
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
        if was_enabled:
            gc.enable()
