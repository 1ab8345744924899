"""One trial: drive at 0.5 m/s, inject the fault, and measure until standstill."""

import itertools
import math
import random
import time
from collections.abc import Sequence
from contextlib import suppress

import pexpect

from bench.ros2_crash.stage import Stage, digest_of
from bench.ros2_crash.trial import LIMIT_S, SPEED_M_S, Case, Teleop, Trial
from tests.ros2.host import Line
from tests.ros2.keyboards import pressing

DRIVE_TRIES = 8
DRIVE_LIMIT_S = 2.5
AT_REST_M_S = 0.005
MOMENTS_S = 0.2
"""The fault comes at a random moment of this span after the robot has reached its speed."""
BEFORE_NS = 1_000_000_000
BETWEEN_KEYS_S = 0.5
"""Without this pause, the neutral command and the first motion command would arrive together."""
STOP_KEYS = {Teleop.LAB: "s", Teleop.KEYBOARD: "k"}
DRIVE_KEYS = {Teleop.LAB: "wwwww", Teleop.KEYBOARD: "i"}
HELD_KEYS = {Teleop.LAB: None, Teleop.KEYBOARD: "i"}


def run(made: Stage, case: Case, number: int, moments: random.Random) -> Trial:
    """Run one trial.

    Raises:
        AssertionError: a process does not start, or the robot does not drive.
    """
    with made.operator(case.teleop) as terminal:
        for _ in range(DRIVE_TRIES - 1):
            try:
                return _drive_and_measure(made, terminal, case, number, moments)
            except TimeoutError:
                continue  # DDS had not found the robot yet, or the supervisor was not ready
        return _drive_and_measure(made, terminal, case, number, moments)


def _drive_and_measure(
    made: Stage, terminal: "pexpect.spawn[str]", case: Case, number: int, moments: random.Random
) -> Trial:
    """Press the keys, inject the fault at speed, and measure.

    Raises:
        TimeoutError: the robot does not drive.
    """
    observer = made.observer
    terminal.send(STOP_KEYS[case.teleop])
    time.sleep(BETWEEN_KEYS_S)
    with pressing(terminal, DRIVE_KEYS[case.teleop], then=HELD_KEYS[case.teleop]):
        try:
            observer.until(_drives, f"{SPEED_M_S} m/s", after=len(observer.lines), within_s=DRIVE_LIMIT_S)
        except AssertionError as error:
            raise TimeoutError(str(error)) from error
        time.sleep(moments.uniform(0.0, MOMENTS_S))
        begin = len(observer.lines)
        begin_ns = time.monotonic_ns()
        made.inject(case.fault, terminal)
        with suppress(AssertionError):  # the robot may not stop
            observer.until(
                lambda line: line["at_ns"] >= begin_ns and _rests(line),
                "standstill",
                after=begin,
                within_s=LIMIT_S,
            )
    from_ns = begin_ns - BEFORE_NS
    return _measured(
        case, number, observer.of("odom", from_ns=from_ns), observer.of("cmd_vel", from_ns=from_ns), begin_ns
    )


def _drives(line: Line) -> bool:
    return line.get("topic") == "odom" and line["v"] > 0.95 * SPEED_M_S


def _rests(line: Line) -> bool:
    return line.get("topic") == "odom" and abs(line["v"]) < AT_REST_M_S


def _measured(
    case: Case, number: int, travel: Sequence[Line], commands: Sequence[Line], begin_ns: int
) -> Trial:
    """Return the trial.

    Args:
        case: its case.
        number: its number.
        travel: the true odometry before and after the fault.
        commands: what the robot received.
        begin_ns: the time of the fault.
    """
    before = [line for line in travel if line["at_ns"] < begin_ns]
    after = [line for line in travel if begin_ns <= line["at_ns"] <= begin_ns + LIMIT_S * 1e9]
    rest = next((index for index, line in enumerate(after) if _rests(line)), None)
    way = [before[-1], *after[: None if rest is None else rest + 1]]
    zero = next(
        (line for line in commands if line["at_ns"] >= begin_ns and line["v"] == line["w"] == 0), None
    )
    return Trial(
        case.teleop,
        case.fault,
        case.robot,
        case.lifeline,
        number,
        speed_m_s=before[-1]["v"],
        zero_s=None if zero is None else (zero["at_ns"] - begin_ns) / 1e9,
        standstill_s=None if rest is None else (after[rest]["at_ns"] - begin_ns) / 1e9,
        distance_m=sum(math.dist((a["x"], a["y"]), (b["x"], b["y"])) for a, b in itertools.pairwise(way)),
        program=digest_of(case.teleop),
    )
