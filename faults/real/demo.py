"""`lifeline demo`: the promises of the design, measured on the running robot.

Each fault is a trial of the real campaign (faults/real): the real teleop is driven by key presses, the fault is
injected while the robot drives, the stop is measured on cmd_vel and at the wheels, and the robot must be drivable again by
neutral alone. After the faults, the robot drives at a rack and backs out.
"""

import json
import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum

from rich.console import Console
from rich.text import Text

from deploy.stack.table import Column, Table
from deploy.stack.takedown import Say
from faults.classes import BY_NAME
from faults.promises import KILL_MEDIAN_S, Bounds, violations
from faults.real.rig.stage import Stage, StageError
from faults.real.trial_run import LEEWAY_S, complete_trial, standing_since_s
from faults.report.figures import stop_s
from faults.report.table import broken_sentences
from faults.seen import Seen
from faults.trial import Injected, Trial
from wire import topics
from wire.reasons import StopReason
from wire.text import printable

BASE_REACTION_S = 0.03
"""From zero on cmd_vel to the first deceleration of the wheels."""
FULL_SPEED_KEYS = "w" * 10
BACK_OUT_KEYS = "s" + "x" * 3
BACKED_OUT_M = 0.2
RACK_LIMIT_S = 20.0
MOVE_LIMIT_S = 5.0
ENTER, PRESENCE_PERIOD_S = "\r", 5.0
RACK_TRIES = 3
"""A busy machine may delay a process until the robot stops for another reason than the rack."""
QUIET_S = 0.6
DRIVABLE_LIMIT_S = 12.0
"""Maximum time from the end of a fault until the robot is ready, including the restart of a process."""
TRIES = 3
"""Trials of a class until one has measured its stop; an obstacle may have stopped the robot just before the fault."""

MIN_WIDTH = 110
"""Width of the table in columns if the output is not a terminal."""

MEASURING_S = 0.010
"""Delay that a busy machine may add to a time measured from outside the process."""

HUNG, SUPERVISOR_KILLED, SCANS_GONE = "teleop_sigstop", "supervisor_sigkill", "sim_scan_silent"
TELEOP_KILLED = "teleop_sigkill"


class Outcome(StrEnum):
    """Outcome of the check of a promise."""

    KEPT = "kept"
    LATE = "late"
    """Beyond the bound by at most `MEASURING_S`: reported, but not counted as broken."""
    BROKEN = "BROKEN"


COLOURS = {Outcome.KEPT: "green", Outcome.LATE: "yellow", Outcome.BROKEN: "bold red"}


@dataclass(frozen=True, slots=True)
class Verdict:
    """A line of the demo's table."""

    number: int
    """Number of the promise; faults/promises.py lists them."""
    promise: str
    bound: str
    measured: str
    outcome: Outcome


def play(say: Say, *, quick: bool, viewer: bool, as_json: bool = False) -> int:
    """Start a robot of its own, play, and take it down; return 0 if every promise was kept, else 1.

    Raises:
        DeployError: the robot could not be started, or did not come to a fault.
    """
    trials: list[Trial] = []
    rack: list[Verdict] = []

    async def all_chapters() -> None:
        kills = 3 if quick else 5
        for name, times, does in (
            (TELEOP_KILLED, kills, f"killing teleop at speed, {kills} times"),
            (HUNG, 1, "suspending teleop with SIGSTOP at speed, then continuing it"),
            (SUPERVISOR_KILLED, 1, "killing the supervisor at speed"),
            (SCANS_GONE, 1, "silencing the lidar at speed"),
        ):
            say(does)
            seeds = range(0, times * TRIES, TRIES)
            trials.extend([await _measured_trial(stage, name, seed, say) for seed in seeds])
        say("driving at a rack at full speed")
        rack.extend(await _drive_at_rack(stage, say))
        say("taking everything down")

    say("starting sim and supervisor")
    stage = Stage(sim_options="--viewer" if viewer else "--no-viewer", say=say, small_disk=False)
    interrupted = stage.run(all_chapters)
    if interrupted is not None:
        raise interrupted
    verdicts = [*_of_trials(trials), *rack]
    if as_json:
        print(json.dumps([asdict(verdict) for verdict in verdicts], indent=2))
    else:
        print_verdicts(verdicts)
    for sentence in broken_sentences(trials):
        say(sentence)
    say(summary(verdicts))
    return int(any(verdict.outcome is Outcome.BROKEN for verdict in verdicts))


async def _measured_trial(stage: Stage, name: str, first_seed: int, say: Say) -> Trial:
    """Run a trial whose fault stopped a driving robot."""
    for seed in range(first_seed, first_seed + TRIES):
        trial = await complete_trial(stage, name, seed, "", say)
        fault = trial.faults[0]
        if fault.to_standstill_s is not None and not math.isnan(_to_stop_s(fault)):
            say(
                f"  at {fault.speed_m_s:.2f} m/s: zero after {_ms(_to_stop_s(fault))}, standing after "
                f"{_ms(fault.to_standstill_s)} and {_cm(_distance_m(fault))}"
            )
            return trial
    raise StageError(f"{name} did not stop a driving robot in {TRIES} trials: is the machine too busy?")


# --- verdicts on the trials


def _of_trials(trials: Sequence[Trial]) -> list[Verdict]:
    faults = [trial.faults[0] for trial in trials]
    killed = [fault for fault in faults if fault.fault == TELEOP_KILLED]
    hung, braked, blind = (
        next(fault for fault in faults if fault.fault == name)
        for name in (HUNG, SUPERVISOR_KILLED, SCANS_GONE)
    )
    zeros_s = [_to_stop_s(fault) for fault in killed]
    typical_s, longest_s = statistics.median(zeros_s), max(zeros_s)
    worst_stop = max(killed, key=lambda fault: _distance_m(fault) - _bound_m(fault))
    broken = {violation.promise for trial in trials for violation in trial.violations}

    def verdict(promise: int, what: str, bound: str, measured: str, outcome: Outcome) -> Verdict:
        return Verdict(promise, what, bound, measured, worst(outcome, judged(kept=promise not in broken)))

    return [
        verdict(
            1,
            "cmd_vel is within its limits, and zero while a stop holds",
            "always",
            f"in {len(trials)} drives",
            Outcome.KEPT,
        ),
        verdict(
            2,
            "teleop killed: zero on cmd_vel",
            f"≤ {_ms(KILL_MEDIAN_S)} (median)",
            f"{_ms(typical_s)} (median of {len(killed)}; worst {_ms(longest_s)})",
            worst(timed(typical_s, KILL_MEDIAN_S), judged(kept=longest_s < _bound_s(HUNG))),
        ),
        verdict(2, "… and the robot stands", *_stopping(worst_stop)),
        verdict(
            3,
            "teleop hung: zero on cmd_vel",
            f"≤ {_ms(_bound_s(HUNG))}",
            f"{_ms(_to_stop_s(hung))}, standing after {_cm(_distance_m(hung))}",
            timed(_to_stop_s(hung), _bound_s(HUNG)),
        ),
        verdict(4, "supervisor killed: the base brakes by itself", *_stopping(braked)),
        verdict(
            5,
            "lidar silent: zero on cmd_vel",
            f"≤ {_ms(_bound_s(SCANS_GONE))}",
            f"{_ms(_to_stop_s(blind))}, standing after {_cm(_distance_m(blind))}",
            timed(_to_stop_s(blind), _bound_s(SCANS_GONE)),
        ),
        verdict(
            7,
            "after each stop, nothing moves before a neutral command",
            "always",
            f"in {len(trials)} stops",
            Outcome.KEPT,
        ),
        verdict(
            8,
            "after each fault, drivable by a neutral command alone",
            f"≤ {DRIVABLE_LIMIT_S:g} s",
            *drivable_again(faults),
        ),
    ]


def drivable_again(faults: Sequence[Injected]) -> tuple[str, Outcome]:
    """Return the longest time until a neutral command permitted driving, and the verdict; a trial without it records no time."""
    if not all("to_ready_s" in fault.parameters for fault in faults):
        return "not drivable", Outcome.BROKEN
    worst_s = max(float(f.parameters["to_alive_s"]) + float(f.parameters["to_ready_s"]) for f in faults)
    return f"{worst_s:.1f} s (worst)", judged(kept=worst_s <= DRIVABLE_LIMIT_S)


def _bound_s(name: str) -> float:
    bound_s = BY_NAME[name].bound_s
    assert bound_s is not None
    return bound_s


def _to_stop_s(fault: Injected) -> float:
    """Time from the fault to zero on cmd_vel, or to the base's own stop [s]; NaN if it was not measured."""
    time_s = stop_s("real", fault)
    return math.nan if time_s is None else time_s


def _distance_m(fault: Injected) -> float:
    return math.nan if fault.distance_m is None else fault.distance_m


def _stopping(fault: Injected) -> tuple[str, str, Outcome]:
    """Return the bound of the stopping distance, the measured one, and the verdict."""
    bound_m = _bound_m(fault)
    measured = f"{_cm(_distance_m(fault))} in {_ms(fault.to_standstill_s or math.nan)}, from {fault.speed_m_s:.2f} m/s"
    return f"≤ {_cm(bound_m)}", measured, judged(kept=_distance_m(fault) <= bound_m)


def _bound_m(fault: Injected) -> float:
    """Return the stopping distance at the trusted deceleration after the death of a process [m]."""
    speed_m_s = fault.speed_m_s
    return speed_m_s * (KILL_MEDIAN_S + BASE_REACTION_S) + speed_m_s**2 / (2 * Bounds().trusted_braking_m_s2)


# --- the rack


async def _drive_at_rack(stage: Stage, say: Say) -> list[Verdict]:
    """Drive at the rack at full speed until the robot stands, then back out."""
    for _ in range(RACK_TRIES):
        await stage.alive(topics.TELEOP)
        await stage.neutral()
        await stage.back_to_start()
        stage.observer.clear()
        stage.teleop.press(FULL_SPEED_KEYS)
        began_s = time.monotonic()
        if not await _until_it_stands(stage, began_s):
            continue
        await stage.observer.watch(QUIET_S)
        if StopReason.OBSTACLE in stage.observer.look().statuses[-1].reasons:
            return await _back_out(stage, say)
        say("  the robot stopped for another reason; driving again")
    raise StageError(f"the robot did not come to the rack in {RACK_TRIES} drives: is the machine too busy?")


async def _until_it_stands(stage: Stage, began_s: float) -> bool:
    """Wait until the robot has driven and stands; meanwhile, the operator shows presence."""
    for _ in range(round(RACK_LIMIT_S / PRESENCE_PERIOD_S)):
        if await stage.observer.until(lambda seen: _stands(seen, began_s), PRESENCE_PERIOD_S):
            return True
        stage.teleop.press(ENTER)
    return False


def _stands(seen: Seen, began_s: float) -> bool:
    has_driven = any(not motion.is_still for motion in seen.motions)
    return has_driven and standing_since_s(seen, began_s) is not None


async def _back_out(stage: Stage, say: Say) -> list[Verdict]:
    observer = stage.observer
    motions = observer.look().motions
    final_m, top_m_s = motions[-1].clearance_m, max(motion.linear_m_s for motion in motions)
    say(f"  standing {_cm(final_m)} before it; backing out")
    backed_out = False
    for _ in range(RACK_TRIES):
        stage.teleop.press(BACK_OUT_KEYS)
        backed_out = await observer.until(
            lambda seen: seen.motions[-1].clearance_m > final_m + BACKED_OUT_M, MOVE_LIMIT_S
        )
        stage.teleop.press("s")
        if backed_out:
            break
        reasons = " ".join(observer.look().statuses[-1].reasons)
        say(f"  the robot did not back out ({reasons}); again")
    pressed_s = time.monotonic()
    await observer.until(lambda seen: standing_since_s(seen, pressed_s) is not None, MOVE_LIMIT_S)
    seen = observer.finished()
    least_m, away_m = min(motion.clearance_m for motion in seen.motions), seen.motions[-1].clearance_m
    found = violations(seen, (), Bounds(status_leeway_s=LEEWAY_S, neutral_leeway_s=LEEWAY_S))
    for one in found:
        say(f"  promise {one.promise}: {one.sentence}")
    bound_m = Bounds().stop_distance_m - Bounds().tolerance_m
    return [
        Verdict(
            6,
            f"driven at a rack at {top_m_s:.2f} m/s: least clearance of the hull",
            f"≥ {_cm(bound_m)}",
            f"{_cm(least_m)}, standing at {_cm(final_m)}",
            judged(kept=least_m >= bound_m and not found),
        ),
        Verdict(6, "… and it may back out", "by keys alone", f"to {_cm(away_m)}", judged(kept=backed_out)),
    ]


def _ms(duration_s: float) -> str:
    milliseconds = duration_s * 1000
    return f"{milliseconds:.1f} ms" if milliseconds < 100 else f"{milliseconds:.0f} ms"


def _cm(distance_m: float) -> str:
    return f"{distance_m * 100:.1f} cm"


# --- outcomes


def judged(*, kept: bool) -> Outcome:
    """Return the outcome of a promise that has no time tolerance."""
    return Outcome.KEPT if kept else Outcome.BROKEN


def timed(measured_s: float, bound_s: float) -> Outcome:
    """Return the outcome of a promise about a time."""
    if measured_s <= bound_s:
        return Outcome.KEPT
    return Outcome.LATE if measured_s <= bound_s + MEASURING_S else Outcome.BROKEN


def worst(*outcomes: Outcome) -> Outcome:
    return max(outcomes, key=list(Outcome).index)


def summary(verdicts: Sequence[Verdict]) -> str:
    """Summarize the verdicts in one sentence."""
    counts = {outcome: sum(v.outcome is outcome for v in verdicts) for outcome in Outcome}
    sentence = f"{counts[Outcome.KEPT]} of {len(verdicts)} promises kept"
    if counts[Outcome.LATE]:
        sentence += f", {counts[Outcome.LATE]} late by at most {MEASURING_S * 1000:.0f} ms (a busy machine?)"
    if counts[Outcome.BROKEN]:
        sentence += f", {counts[Outcome.BROKEN]} BROKEN"
    return sentence


def print_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print the verdicts as a table, in order of their numbers."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=MIN_WIDTH)
    columns = ("promise", "bound", "measured", "")
    table = Table(Column("№", right=True), *columns, title="promises and measurements")
    for verdict in sorted(verdicts, key=lambda v: v.number):
        word = Text(printable(verdict.outcome), style=COLOURS[verdict.outcome])
        table.add_row(str(verdict.number), verdict.promise, verdict.bound, verdict.measured, word)
    console.print(table)
