"""An exam: for each fault, start the program anew, drive, inject the fault, and watch the wheels until the robot has stopped."""

import asyncio
import math
import os
import signal
import tempfile
import time
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterator, Sequence
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from deploy.stack import errors
from deploy.stack.errors import DeployError
from deploy.stack.takedown import Say
from faults.grade import leftovers
from faults.grade.marks import HULL_RADIUS_M, TITLES, WATCHED_S, Fault, Grade, Mark, mark, observed, untested
from faults.grade.program import Program, found
from faults.grade.robot import Robot, Setup, running
from faults.grade.rubric import Rubric
from faults.measure import MOVING_M_S
from faults.real.rig.cable import why_not
from faults.real.rig.janitor import hire
from recordings.incidents.braking import Motion
from wire.text import printable

T = TypeVar("T")

ALMOST = 0.95
"""A robot at this share of the wanted speed has reached it."""
STEADY_S, STEADY_M_S = 1.0, 0.02
"""A speed that has changed by less than this for this time is the one that the program reaches."""
BEFORE_S = 0.5
"""Time at speed before a fault."""
DRIVE_LIMIT_S = 40.0
FIRST_OUTPUT_S, FIRST_KEY_S, KEY_S, PAUSE_S, HELD_LIMIT_S = 3.0, 2.0, 0.15, 0.5, 4.0
KEYS_AT_MOST = 40
LOOK_S = 0.02
RESUMED_S = 3.0
TRIES = 3
"""Of one fault, until the machine was not too busy."""
PILLAR_RADIUS_M = 0.05
HEADING_M = 0.02
"""Travel from which the heading of the robot is known."""
GARBAGE = b"\xff\xfe\x80\xc3\x28\x00\x1b[99~\xe2\x82\x1b[\x07\xf0\x9f\x92\xa5" * 4
"""Bytes that are no keys: not UTF-8, control characters that end nothing, unknown and unfinished escape sequences."""


@dataclass(frozen=True)
class Exam:
    """What is graded, and how it is driven.

    Attributes:
        command: the command line of the program.
        setup: what it drives.
        rubric: points and limits.
        keys: the keys that make the robot drive forward, in this order; empty: the program drives by itself.
        stop_key: pressed before each attempt to drive; empty: none.
        whole_group: whether the program and everything that it starts is killed and stopped.
    """

    command: tuple[str, ...]
    setup: Setup
    rubric: Rubric
    keys: str = ""
    stop_key: str = ""
    whole_group: bool = False


class NotGradedError(DeployError):
    """The program could not be graded."""


def grade(exam: Exam, say: Say) -> Grade:
    """Start the robot, inject every fault, and return the marks; everything that was started has ended then.

    Raises:
        DeployError: the program could not be graded, or the robot could not be started.
    """
    found(exam.command, os.environ.get("PATH", os.defpath))
    marks = in_directory(lambda directory: _all(exam, directory, say))
    if all(one.observed is None for one in marks):
        reasons = [one.sentence for one in marks] or ["the rubric gives no points"]
        raise NotGradedError(f"the program could not be graded: {'; '.join(reasons)}")
    words = " ".join(exam.command)
    return Grade(printable(words), str(exam.setup), exam.rubric.exam.pass_percent, tuple(marks))


def in_directory(play: Callable[[Path], Coroutine[Any, Any, T]]) -> T:
    """Run something with a new directory, and at the end, whatever happens, end every process that carries its mark.

    Raises:
        KeyboardInterrupt: a signal has ended it.
    """
    with ExitStack() as ending:
        directory = Path(tempfile.mkdtemp(prefix="lifeline-grade-")).resolve()
        ending.callback(hire("faults.grade.leftovers", directory).communicate)
        ending.callback(leftovers.sweep, directory, os.getpid())
        with errors.interrupts():
            try:
                return asyncio.run(play(directory))
            finally:
                errors.ignore()


async def _all(exam: Exam, directory: Path, say: Say) -> list[Mark]:
    marks: list[Mark] = []

    def done(one: Mark) -> None:
        say(f"{TITLES[one.fault]}: {one.points:g} of {one.of}; {one.sentence}")
        marks.append(one)

    say(f"starting {exam.setup}")
    async with running(exam.setup, directory) as robot:
        for fault in counting(exam.rubric):
            if fault is Fault.UNPLUGGED and exam.setup.ros2:
                await _unplugged(exam, directory, say, done)
            elif fault is not Fault.RESUMED:
                for one in await _trial(exam, robot, fault, say):
                    done(one)
    return marks


def counting(rubric: Rubric) -> Iterator[Fault]:
    """Yield the faults that have points; the program must hang before it can continue."""
    for fault in Fault:
        needed = (fault, Fault.RESUMED) if fault is Fault.STOPPED else (fault,)
        if any(getattr(rubric, one).points for one in needed):
            yield fault


async def _unplugged(exam: Exam, directory: Path, say: Say, done: Callable[[Mark], None]) -> None:
    """Unplug the cable of a ROS 2 program; it and its robot need a network of their own."""
    reason = why_not()
    if reason is not None:
        done(untested(Fault.UNPLUGGED, reason, exam.rubric))
        return
    folder = directory / Fault.UNPLUGGED
    folder.mkdir()
    say("starting another robot, with a cable to the program")
    behind_cable = replace(exam, setup=replace(exam.setup, cable=True))
    async with running(behind_cable.setup, folder) as robot:
        for one in await _trial(behind_cable, robot, Fault.UNPLUGGED, say):
            done(one)


async def _trial(exam: Exam, robot: Robot, fault: Fault, say: Say) -> list[Mark]:
    """Inject one fault, and return its mark; the program that hung is also continued.

    Raises:
        NotGradedError: the robot did not drive.
    """
    marks: list[Mark] = []
    for tries_left in reversed(range(TRIES)):
        say(f"driving; then: {TITLES[fault]}")
        marks, is_sound = await _tried(exam, robot, fault)
        if is_sound:
            return marks
        if tries_left:
            say("the machine was too busy: repeating the measurement")
    return [replace(one, sentence=f"{one.sentence} (on a machine that was too busy)") for one in marks]


async def _tried(exam: Exam, robot: Robot, fault: Fault) -> tuple[list[Mark], bool]:
    """Drive and inject one fault; return the marks, and whether the simulation ran all the time."""
    async with driving(exam, robot) as program:
        if fault is Fault.STOPPED:
            program.let_go()  # the program must not find the key in its terminal when it continues
        begin_s = at_s = await _inject(exam, robot, program, fault)
        await _pass(robot, at_s + WATCHED_S - time.monotonic())
        if (
            robot.second is not None
            and program.greets
            and not (robot.second.greets or robot.second.has_ended)
        ):
            reason = f"the second instance printed nothing within {WATCHED_S:g} s, unlike the first one"
            return [untested(fault, reason, exam.rubric)], True
        marks = [_mark(exam, robot, program, fault, at_s)]
        if fault is Fault.STOPPED:
            robot.clear()
            at_s = program.send(signal.SIGCONT)
            await _pass(robot, RESUMED_S)
            marks.append(_mark(exam, robot, program, Fault.RESUMED, at_s))
        return marks, not robot.has_stalled(begin_s)


def _mark(exam: Exam, robot: Robot, program: Program, fault: Fault, at_s: float) -> Mark:
    swing_m_s = exam.rubric.second.swing_m_s
    seen = observed(robot.look(), at_s, swing_m_s, ended=program.has_ended and fault is not Fault.KILLED)
    return mark(fault, seen, exam.rubric)


async def _inject(exam: Exam, robot: Robot, program: Program, fault: Fault) -> float:
    """Inject a fault; return the time just before."""
    at_s = time.monotonic()
    match fault:
        case Fault.KILLED:
            at_s = program.send(signal.SIGKILL)
        case Fault.STOPPED | Fault.RESUMED:
            at_s = program.send(signal.SIGSTOP)
        case Fault.UNPLUGGED:
            at_s = await robot.cut()
        case Fault.GARBAGE:
            program.type(GARBAGE)
        case Fault.OBSTACLE:
            ahead_m = HULL_RADIUS_M + exam.rubric.obstacle.ahead_m + PILLAR_RADIUS_M
            robot.place_pillar(*place_ahead(robot.look(), ahead_m))
        case Fault.SECOND:
            robot.second = robot.start_program(exam.command, whole_group=exam.whole_group)
    return at_s


def place_ahead(motions: Sequence[Motion], ahead_m: float) -> tuple[float, float]:
    """Return a place ahead of the robot, in the direction of its last travel."""
    now = motions[-1]
    for before in reversed(motions):
        x_m, y_m = now.x_m - before.x_m, now.y_m - before.y_m
        if (way_m := math.hypot(x_m, y_m)) >= HEADING_M:
            return now.x_m + x_m * ahead_m / way_m, now.y_m + y_m * ahead_m / way_m
    return now.x_m + ahead_m, now.y_m


async def _pass(robot: Robot, duration_s: float) -> None:
    until_s = time.monotonic() + duration_s
    while time.monotonic() < until_s:
        await asyncio.sleep(LOOK_S)
        robot.look()


# --- driving


@asynccontextmanager
async def driving(exam: Exam, robot: Robot) -> AsyncGenerator[Program]:
    """Start the program and drive until the robot has its speed; afterwards, end the program and put the robot back.

    Raises:
        NotGradedError: the program ended, or the robot did not move.
    """
    program = robot.start_program(exam.command, whole_group=exam.whole_group)
    try:
        robot.clear()
        try:
            async with asyncio.timeout(DRIVE_LIMIT_S):
                while not await _is_driven(exam, robot, program):
                    await robot.back_to_start()
        except TimeoutError as error:
            raise NotGradedError(_never_moved(exam, robot, program)) from error
        yield program
    finally:
        program.close()
        if robot.second is not None:
            robot.second.close()
            robot.second = None
        await robot.heal()
        await robot.back_to_start()


async def _is_driven(exam: Exam, robot: Robot, program: Program) -> bool:
    """Drive; return whether the robot keeps its speed: on a busy machine, a supervisor may stop it."""
    await (_by_keys(exam, robot, program) if exam.keys else _by_itself(robot, program))
    reached_m_s = _speed_m_s(robot)
    await _step(robot, program, BEFORE_S)
    return _speed_m_s(robot) > max(MOVING_M_S, ALMOST * reached_m_s)


def _never_moved(exam: Exam, robot: Robot, program: Program) -> str:
    fastest_m_s = max((abs(motion.linear_m_s) for motion in robot.motions), default=0.0)
    if fastest_m_s > MOVING_M_S:
        what = f"the robot did not reach a steady speed ({fastest_m_s:.2f} m/s at most) within {DRIVE_LIMIT_S:g} s"
    else:
        what = f"the robot did not move within {DRIVE_LIMIT_S:g} s"
    advice = (
        ["publish geometry_msgs/msg/Twist on /cmd_vel"]
        if exam.setup.ros2
        else [
            f"connect it to {exam.setup.endpoint}",
            "publish a Twist on robot/cmd_vel",
            "give --ros2 if it is a ROS 2 node",
        ]
    )
    advice += [] if exam.keys else ["give --keys if it is driven by keys"]
    return f"the program could not be graded: {what}: {', '.join(advice)}; {program.end}"


async def _step(robot: Robot, program: Program, duration_s: float) -> None:
    """Let time pass.

    Raises:
        NotGradedError: the program has ended.
    """
    await _pass(robot, duration_s)
    if program.has_ended:
        raise NotGradedError(f"the program could not be graded: it ended before the fault; {program.end}")


def _speed_m_s(robot: Robot) -> float:
    motions = robot.look()
    return motions[-1].linear_m_s if motions else 0.0


def is_steady(motions: Sequence[Motion]) -> bool:
    """Return whether the robot has moved forward at one speed for `STEADY_S`."""
    if not motions or motions[-1].time_s - motions[0].time_s < STEADY_S:
        return False
    since_s = motions[-1].time_s - STEADY_S
    speeds_m_s = [motion.linear_m_s for motion in motions if motion.time_s >= since_s]
    return min(speeds_m_s) > MOVING_M_S and max(speeds_m_s) - min(speeds_m_s) < STEADY_M_S


async def _by_itself(robot: Robot, program: Program) -> None:
    """Wait until a program without keys drives at a steady speed."""
    while not is_steady(robot.look()):
        await _step(robot, program, LOOK_S)


async def _by_keys(exam: Exam, robot: Robot, program: Program) -> None:
    """Press keys until the robot has the wanted speed, or the highest one of this program; or hold the last of them."""
    keys, wanted_m_s = os.fsencode(exam.keys), ALMOST * exam.rubric.exam.drive_m_s
    started_s = time.monotonic()
    while not program.greets and time.monotonic() < started_s + FIRST_OUTPUT_S:
        await _step(robot, program, LOOK_S)

    def is_fast() -> bool:
        return _speed_m_s(robot) >= wanted_m_s or is_steady(robot.look())

    while True:
        program.let_go()
        program.type(os.fsencode(exam.stop_key))
        await _step(robot, program, PAUSE_S)
        if exam.setup.hold:
            program.type(keys[:-1])
            program.hold(keys[-1:])
            await _step_until(is_fast, robot, program, HELD_LIMIT_S)
        else:
            await _press(is_fast, robot, program, keys)
        if is_fast():
            return


async def _press(is_fast: Callable[[], bool], robot: Robot, program: Program, keys: bytes) -> None:
    """Press keys, not too fast; the first ones may come before the program and the robot have found each other."""
    for _ in range(KEYS_AT_MOST):
        program.type(keys)
        await _step_until(lambda: _speed_m_s(robot) > MOVING_M_S, robot, program, FIRST_KEY_S)
        await _step(robot, program, KEY_S)
        if is_fast() or _speed_m_s(robot) <= MOVING_M_S:
            return


async def _step_until(condition: Callable[[], bool], robot: Robot, program: Program, limit_s: float) -> None:
    until_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < until_s:
        await _step(robot, program, LOOK_S)
