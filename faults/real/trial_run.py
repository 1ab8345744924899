"""One trial of the real campaign: drive, break something, watch, recover, judge.

drive      press keys in teleop's terminal until the robot is faster than 0.3 m/s, and for a random time longer
break      inject the fault at a random moment, while the operator continues to request motion
watch      wait until the robot stands, and for one second more; killed processes are restarted meanwhile
recover    send neutral; then the robot must drive again
judge      check every sample against the promises, and the times against the bounds of the class
"""

import asyncio
import itertools
import math
import os
import time
from collections.abc import Callable
from contextlib import aclosing, suppress
from dataclasses import dataclass, field
from random import Random

from faults.classes import BY_NAME, Effect, Group
from faults.demands import Done, asked_age_s, demands
from faults.measure import (
    STALL_S,
    injected,
    longest_gap_s,
    since,
    stood_s,
    stop_after,
    to_lasting_rest_s,
    to_lasting_zero_s,
)
from faults.port import Fault, Pillar
from faults.promises import KILL_MEDIAN_S, Bounds, Demand, Kind, violations
from faults.real.real_faults import planned
from faults.real.rig.stage import NODES, PRESS_AGAIN_S, Stage, StageError
from faults.report.drawing import AFTER_S, BEFORE_S
from faults.seen import Seen
from faults.trial import FINE_S, BrokenPromise, Injected, Trial, thinned, timeline
from wire import topics

FAULT_SPEED_M_S = 0.3
"""A fault counts only at this speed or above."""
DRIVE_LIMIT_S = 4.0
DRIVE_TRIES = 4
PILLAR_SHARE = 0.4
"""Share of the trials with a pillar."""
PILLAR_AHEAD_M = (1.8, 3.0)
PILLAR_BESIDE_M = 0.4
LAST_KEYS_S = 0.3
"""Maximum time from the required speed to the fault."""
KEYS = {
    Pillar.BY_CHANCE: ("w", "w", "a", "d", "x", "s"),
    Pillar.AHEAD: ("w", "w", "ww", "ww", "www", "wwww", "s"),
    Pillar.NONE: ("w",),
}
"""The keys that the operator presses at random meanwhile, unless the fault must stop the robot; after a stop at the pillar,
the operator re-arms and drives at it again."""
PAIR_APART_S = 0.4
STAND_LIMIT_S = 4.0
QUIET_S = 1.0
"""Time for which the robot is observed at rest while the operator requests motion."""
QUIET_AFTER_LIFT_S = 0.5
"""Minimum time of observation after a stopped or disconnected process returned."""
HARMLESS_QUIET_S = 0.2
STAGE_TRIES = 3
LOOK_S = 0.05
SCANS_S = 0.2
MOVES_LIMIT_S = 3.0
SENDING_S = 0.03
"""Time from a key press to the observer."""
LEEWAY_S = 0.05
"""Tolerance of a bound in a single trial for the scheduling of a loaded machine. The record contains the measured time,
and the report's percentiles have no tolerance."""


@dataclass(slots=True)
class _Run:
    """The state of one trial."""

    name: str
    seed: int
    faults: list[tuple[str, Fault[Stage]]]
    done: list[Done] = field(default_factory=list[Done])
    begun_late_s: float = 0.0
    """Maximum delay of a sensor fault after its recorded begin, because the sim confirms it later."""
    complaints: list[BrokenPromise] = field(default_factory=list[BrokenPromise])
    recovering_s: float = 0.0

    @property
    def stops(self) -> bool:
        """Whether at least one of the faults must stop the robot."""
        return any(BY_NAME[name].bound_s is not None or fault.also for name, fault in self.faults)

    @property
    def pillar(self) -> Pillar:
        """Faults that need a pillar at a certain place are never part of a pair."""
        return self.faults[0][1].pillar

    @property
    def is_straight(self) -> bool:
        return self.pillar is not Pillar.BY_CHANCE

    @property
    def leeway_s(self) -> float:
        return LEEWAY_S + max(self.begun_late_s, *(fault.leeway_s for _, fault in self.faults))

    def may_end(self, node: str) -> bool:
        """Return whether one of the faults may end this process."""
        return any(
            BY_NAME[name].target in ("", node)
            or BY_NAME[name].group is Group.SUPERVISORD
            or node in name
            or fault.also
            for name, fault in self.faults
        )


async def complete_trial(
    stage: Stage, name: str, seed: int, revision: str, say: Callable[[str], None]
) -> Trial:
    """Run one trial and leave a drivable stage; rebuild the stage and try again if the trial does not reach its fault.

    Raises:
        StageError: it does not reach its fault in `STAGE_TRIES` tries.
    """
    for tries_left in reversed(range(STAGE_TRIES)):
        try:
            trial, is_drivable = await _run_trial(stage, name, seed, revision)
        except StageError as error:
            if not tries_left:
                raise
            say(f"{name}, seed {seed}: {error}; rebuilding the stage")
        else:
            if not is_drivable:
                await stage.restart_stack()
            return trial
        await stage.restart_stack()
    raise AssertionError("the last try returns or raises")


async def _run_trial(stage: Stage, name: str, seed: int, revision: str) -> tuple[Trial, bool]:
    """Run one trial; return its record and whether the stage is drivable after it.

    Raises:
        StageError: it did not reach its fault.
    """
    run = _Run(name, seed, planned(name, seed))
    chance = Random(f"{name} {seed} driving")  # noqa: S311 - as above
    await stage.prepare([name for name, _ in run.faults])
    if any(run.may_end(node) for node in NODES):
        await stage.settled()
    await _drive(stage, run, chance)
    pids = {node: stage.pid(node) for node in NODES}
    load = os.getloadavg()[0]
    await _break(stage, run, chance)
    await _watch(stage, run)
    drivable = await _recover(stage, run)
    for node, pid in pids.items() if drivable else ():
        if not run.may_end(node) and stage.pid(node) != pid:
            sentence = f"{node} ended by itself:\n{stage.state.last_lines(node)}"
            run.complaints.append(BrokenPromise(8, time.monotonic(), sentence))
    trial = _judge(stage, run, revision, load)
    stage.observer.trusts_stamps = True
    return trial, drivable


# --- drive


async def _drive(stage: Stage, run: _Run, chance: Random) -> None:
    """Drive until the robot is fast enough and no stop holds.

    Raises:
        StageError: the robot does not drive.
    """
    for number in range(DRIVE_TRIES):
        if number or not stage.is_ready:
            await stage.alive(topics.TELEOP)
            await stage.neutral()
        stage.is_ready = False
        await _let_go(stage)
        await stage.back_to_start()
        _put_pillar(stage, run, chance)
        stage.observer.clear()
        presses = chance.randint(4, 10)
        wanted_m_s = chance.uniform(FAULT_SPEED_M_S, 0.09 * presses)
        turn = "" if run.is_straight else chance.choice(("", "", "a", "d", "aa", "dd"))
        stage.operator.press("w" * presses + turn)
        if not await stage.observer.until(
            lambda seen: bool(seen.motions) and seen.motions[-1].linear_m_s >= wanted_m_s,  # noqa: B023 - called at once
            DRIVE_LIMIT_S,
        ):
            continue
        until_s = time.monotonic() + chance.uniform(0.0, LAST_KEYS_S)
        while (left_s := until_s - time.monotonic()) > 0.0:
            await stage.observer.watch(min(left_s, chance.uniform(0.03, 0.15)))
            stage.operator.press("w" if run.is_straight else chance.choice("wwad"))
        seen = stage.observer.look()
        if not seen.statuses[-1].is_stopped and seen.motions[-1].linear_m_s >= FAULT_SPEED_M_S:
            return
    statuses = stage.observer.seen.statuses
    reasons = ", ".join(statuses[-1].reasons) if statuses else "no status"
    raise StageError(f"the robot does not drive by keys ({reasons})")


def _put_pillar(stage: Stage, run: _Run, chance: Random) -> None:
    """Place a pillar on the path or beside it, as the fault requires."""
    if run.pillar is Pillar.AHEAD:
        stage.put_pillar(chance.uniform(*PILLAR_AHEAD_M), 0.0)
    elif run.pillar is Pillar.BY_CHANCE and chance.random() < PILLAR_SHARE:
        ahead_m = chance.uniform(*PILLAR_AHEAD_M)
        stage.put_pillar(ahead_m, chance.uniform(-PILLAR_BESIDE_M, PILLAR_BESIDE_M))


async def _let_go(stage: Stage) -> None:
    """Send neutral, so that earlier requests do not affect the trial."""
    pressed_s = time.monotonic()
    stage.press_neutral()
    await stage.observer.until(
        lambda seen: (
            bool(seen.commands)
            and seen.commands[-1].is_zero
            and seen.commands[-1].arrival_s > pressed_s + SENDING_S
        ),
        STAND_LIMIT_S,
    )


# --- break


async def _break(stage: Stage, run: _Run, chance: Random) -> None:
    """Run every fault from its beginning to its end."""
    pauses_s = [0.0, *(chance.uniform(0.0, PAIR_APART_S) for _ in run.faults[1:])]
    tasks = [
        asyncio.ensure_future(_inject(stage, run, name, fault, pause_s))
        for (name, fault), pause_s in zip(run.faults, pauses_s, strict=True)
    ]
    meanwhile = [asyncio.ensure_future(_take_care(stage, run))]
    if not run.stops:
        meanwhile.append(asyncio.ensure_future(_go_on_typing(stage, run, chance)))
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in (*tasks, *meanwhile):
            task.cancel()
        await asyncio.gather(*tasks, *meanwhile, return_exceptions=True)


async def _inject(stage: Stage, run: _Run, name: str, fault: Fault[Stage], pause_s: float) -> None:
    if pause_s > 0.0:
        await asyncio.sleep(pause_s)
    async with aclosing(fault.steps(stage)) as steps:
        try:
            at_s = await anext(steps)
        except (StageError, OSError):
            # The other fault of a pair has removed its target, so it does not count.
            if len(run.faults) == 1:
                raise
            return
        run.done.append(Done(name, at_s, at_s, fault.parameters))
        if Effect.SENSOR in BY_NAME[name].effect:
            run.begun_late_s = max(run.begun_late_s, time.monotonic() - at_s)
        try:
            await asyncio.sleep(fault.lasts_s)
        finally:
            with suppress(StageError, OSError):
                await anext(steps, None)


async def _take_care(stage: Stage, run: _Run) -> None:
    """Restart teleop when it has ended, as an operator would."""
    while True:
        await asyncio.sleep(LOOK_S)
        await _start_what_ended(stage, run)


async def _start_what_ended(stage: Stage, run: _Run) -> None:
    if stage.operator.running:
        return
    if not run.may_end(topics.TELEOP):
        sentence = f"teleop ended by itself; its last lines: {stage.operator.last_lines}"
        run.complaints.append(BrokenPromise(8, time.monotonic(), sentence))
    # Start it only after the loss was detected, because starting a program occupies the processor.
    await asyncio.sleep(3 * LOOK_S)
    await stage.start_teleop()


async def _go_on_typing(stage: Stage, run: _Run, chance: Random) -> None:
    """Press random keys, including neutral, if no fault must stop the robot."""
    while True:
        await asyncio.sleep(chance.uniform(0.05, 0.3))
        stage.operator.press(chance.choice(KEYS[run.pillar]))


# --- watch


async def _watch(stage: Stage, run: _Run) -> None:
    """Wait until the robot stands, and a while longer; the operator continues to request motion."""
    observer, lifted_s = stage.observer, time.monotonic()
    until_s = lifted_s + HARMLESS_QUIET_S
    if run.stops:
        last_s = max(one.at_s for one in run.done)
        await observer.until(lambda seen: standing_since_s(seen, last_s) is not None, STAND_LIMIT_S)
        rest_s = standing_since_s(observer.look(), last_s) or time.monotonic()
        until_s = max(rest_s + QUIET_S, lifted_s + QUIET_AFTER_LIFT_S)
    while (left_s := until_s - time.monotonic()) > 0.0:
        await observer.watch(min(left_s, LOOK_S))
        await _start_what_ended(stage, run)


def standing_since_s(seen: Seen, since_s: float) -> float | None:
    """Return since when the robot has been standing; None if it moves, or if that is unknown."""
    still = list(itertools.takewhile(lambda m: m.is_still and m.time_s > since_s, reversed(seen.motions)))
    return still[-1].time_s if still else None


# --- recover


async def _recover(stage: Stage, run: _Run) -> bool:
    """Recover by neutral alone, and drive; return whether this worked. If not, a promise is broken."""
    began_s = time.monotonic()
    await _start_what_ended(stage, run)
    try:
        await stage.alive(topics.TELEOP)
        run.recovering_s = time.monotonic()
        neutral_s = await stage.neutral()
        await stage.back_to_start()
        if run.is_straight:  # the next scans show that the pillar is gone
            await stage.observer.watch(SCANS_S)
            await stage.neutral()
        await _move(stage)
    except StageError as error:
        if run.recovering_s == 0.0:
            run.recovering_s = time.monotonic()
        because = " and ".join(name for name, _ in run.faults)
        run.complaints.append(
            BrokenPromise(8, time.monotonic(), f"not drivable again after {because}: {error}")
        )
        return False
    await _let_go(stage)
    stage.is_ready = True
    for _, fault in run.faults:
        fault.parameters["to_alive_s"] = round(run.recovering_s - began_s, 3)
        fault.parameters["to_ready_s"] = round(neutral_s, 3)
    return True


async def _move(stage: Stage) -> None:
    """Press w until the robot is commanded to move.

    Keys are pressed repeatedly, as a person would: while the rest of a flood still arrives, another client publishes as
    teleop, and teleop returns to zero.

    Raises:
        StageError: it does not drive within `MOVES_LIMIT_S`.
    """
    deadline_s = time.monotonic() + MOVES_LIMIT_S
    while (pressed_s := time.monotonic()) < deadline_s:
        stage.operator.press("ww")
        if await stage.observer.until(
            lambda seen: (
                bool(seen.commands)
                and not seen.commands[-1].is_zero
                and seen.commands[-1].arrival_s > pressed_s
            ),
            PRESS_AGAIN_S,
        ):
            return
    raise StageError(f"the robot is ready, but no motion was commanded within {MOVES_LIMIT_S:g} s")


# --- judge


def _judge(stage: Stage, run: _Run, revision: str, load: float) -> Trial:
    observer = stage.observer
    began_s, end_s = observer.began_s, time.monotonic()
    seen, base = since(began_s, observer.finished(), observer.base)
    recovering_s = run.recovering_s - began_s
    # In the trial's own time, a fault is in force until the operator sends neutral.
    done = [Done(one.name, one.at_s - began_s, recovering_s, one.parameters) for one in run.done]
    also = {name: fault.also for name, fault in run.faults}
    late = [Done(one.name, one.at_s + run.leeway_s, one.until_s, one.parameters) for one in done]
    late += [Done(other, one.at_s + run.leeway_s, one.until_s) for one in done for other in also[one.name]]
    is_alone = not any(BY_NAME[one.name].group is Group.WIRE for one in done)
    stalled_s = longest_gap_s([m.time_s for m in seen.motions], done[0].at_s, recovering_s)
    wanted = [
        one for one in demands(late, alone=is_alone) if one.kind is not Kind.BRAKE or stalled_s <= STALL_S
    ]
    wanted.append(Demand(Kind.DRIVABLE, 8, "everything is mended", recovering_s, end_s - began_s))
    age_s = asked_age_s(done) + run.leeway_s
    # Without valid stamps, only arrival times are known, and a request may arrive after its effect.
    asked_s = age_s if observer.trusts_stamps else math.inf
    bounds = Bounds(asked_age_s=asked_s, status_leeway_s=LEEWAY_S, neutral_leeway_s=age_s)
    found = [
        *violations(seen, wanted, bounds),
        *(BrokenPromise(one.promise, one.time_s - began_s, one.sentence) for one in run.complaints),
    ]
    if observer.undecodable:
        found.append(BrokenPromise(1, 0.0, f"{observer.undecodable} undecodable messages on cmd_vel"))
    faults: list[Injected] = []
    for one in done:
        stop = stop_after(seen, one.at_s, base)
        wheels_s = to_lasting_rest_s(seen.driven, one.at_s, recovering_s)
        base_bound_s = _base_bound_s(one.name) if len(done) == 1 else None
        if base_bound_s is not None and _brakes_late(seen, one.at_s, wheels_s, base_bound_s + run.leeway_s):
            took = "did not brake" if wheels_s is None else f"braked after {1000 * wheels_s:.0f} ms"
            found.append(BrokenPromise(4, one.at_s, f"the base {took}: {one.name}"))
        measured = {} if wheels_s is None else {"to_wheels_s": round(wheels_s, 5)}
        parameters = {
            **one.parameters,
            **measured,
            "sim_stalled_s": round(stalled_s, 3),
            "load": round(load, 2),
            "leeway_s": round(run.leeway_s, 3),
            "late_commands": observer.late,
            "misdelivered": observer.misdelivered,
        }
        to_zero_s = to_lasting_zero_s(seen.commands, one.at_s, recovering_s)
        faults.append(injected(one.name, one.at_s, parameters, stop._replace(to_zero_s=to_zero_s)))
    clearances_m = [motion.clearance_m for motion in seen.motions]
    # The part to be drawn; everything if a promise was broken.
    window = (0.0, math.inf) if found else (done[0].at_s - BEFORE_S, done[-1].at_s + AFTER_S)
    return Trial(
        mode="real",
        revision=revision,
        seed=run.seed,
        duration_s=round(end_s - began_s, 3),
        faults=tuple(faults),
        smallest_clearance_m=round(min(clearances_m), 4) if clearances_m else 0.0,
        contacts=observer.contacts,
        violations=tuple(found),
        timeline=tuple(thinned(timeline(seen, FINE_S), *window)),
    )


def _base_bound_s(name: str) -> float | None:
    """Return the limit for zero at the wheels if only the base itself can stop the robot."""
    effect = BY_NAME[name].effect
    if Effect.SUPERVISOR_ENDS in effect:
        return KILL_MEDIAN_S
    if Effect.SUPERVISOR_SILENT in effect:
        return BY_NAME[name].bound_s or BY_NAME["supervisor_blocked"].bound_s
    return None


def _brakes_late(seen: Seen, at_s: float, wheels_s: float | None, bound_s: float) -> bool:
    """Return whether zero at the wheels came too late, not counting the time in which the simulation stood still."""
    return wheels_s is None or wheels_s - stood_s(seen.motions, at_s, at_s + wheels_s) > bound_s
