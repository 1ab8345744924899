"""How often the age of the commands limits a robot, and how much its speed varies: `python -m bench.command_age`.

Runs the law in virtual time, so that the result depends on no machine. `python -m docs.generate.command_age` writes the table into
docs/decisions/0052-speed-follows-the-link.md.
"""

import argparse
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count

from bench.rig import scenery
from bench.rig.options import failing_in_a_sentence
from bench.rig.sheet import Sheet, show
from supervisor.config import SupervisorSection
from supervisor.law.model import STANDSTILL, Command, Inputs, LaserScan, Mode, Odometry, State, Velocity
from supervisor.law.safety import initial_state, step
from wire.freshness import Sent
from wire.reasons import Limit

TICK_S = 0.02
SCAN_TICKS = 5
DELAY_S = 0.02
NEUTRAL_S = 1.0
"""Time before the drive, in which the source arms and its smallest delay becomes known."""
DRIVE_S = 120.0
BEAMS = 120
ROOM_M = 10.0
LOWEST_PERCENT = 1.0
SMALLEST_M = 0.5
"""Diameter of the smallest obstacle: with few beams, smaller ones would limit the speed as well."""


@dataclass(frozen=True)
class Link:
    """Commands of a source, and what happens to them on their way."""

    hz: float
    jitter_s: float
    """Scale of the half-normal delay of each command; a command that would overtake another waits for it."""
    loss: float

    def __str__(self) -> str:
        jitter = f"{1000 * self.jitter_s:g} ms jitter" if self.jitter_s else "no jitter"
        return f"{self.hz:g} Hz, {jitter}, {100 * self.loss:g} % loss"


LINKS = (
    Link(20.0, 0.0, 0.0),
    Link(20.0, 0.02, 0.0),
    Link(20.0, 0.04, 0.05),
    Link(20.0, 0.0, 0.05),
    Link(10.0, 0.0, 0.0),
)
SPEEDS_M_S = (0.5, 1.0, 2.0)


@dataclass(frozen=True)
class Ride:
    """What a drive of `DRIVE_S` was like."""

    speed_m_s: float
    limited: float
    """Share of the moving ticks that the age of the command limited."""
    lowest_m_s: float
    """Percentile `LOWEST_PERCENT` of the outputs of moving ticks."""
    stops: int

    @property
    def ripple_m_s(self) -> float:
        return self.speed_m_s - self.lowest_m_s


def ride(link: Link, speed_m_s: float, seed: int = 1) -> Ride:
    """Drive straight ahead in an open room."""
    config = SupervisorSection(max_linear_m_s=2.0, smallest_obstacle_m=SMALLEST_M).law()
    ranges = scenery.scans(BEAMS, 32, wall_m=ROOM_M)
    for one in ranges:
        one[:] = one - one.mean() + ROOM_M
    state: State = initial_state(config)
    commands = _commands(link, speed_m_s, random.Random(seed))
    following = next(commands)
    numbers, outputs, limited, stops = count(1), list[float](), 0, 0
    was_moving = is_armed = False
    for tick in range(round((NEUTRAL_S + DRIVE_S) / TICK_S)):
        now_s = 1000.0 + tick * TICK_S
        while following.arrival_s < now_s:
            # After a stop, the operator sends neutral, and drives again.
            command = following if is_armed else replace(following, velocity=STANDSTILL)
            state, decision = step(state, following.arrival_s, Inputs(commands=(command,)))
            is_armed = decision.mode is not Mode.STOPPED
            following = next(commands)
        scans: tuple[LaserScan, ...] = ()
        if tick % SCAN_TICKS == 0:
            number = next(numbers)
            scans = (
                LaserScan(
                    ranges[number % len(ranges)],
                    scenery.ANGLE_MIN,
                    scenery.angle_increment(BEAMS),
                    scenery.RANGE_MIN_M,
                    2.0 * ROOM_M,
                    now_s,
                    Sent(b"lidar", number, now_s),
                ),
            )
        odometry = Odometry(state.output, now_s)
        state, decision = step(state, now_s, Inputs(scans=scans, odometry=odometry))
        is_moving = decision.mode is not Mode.STOPPED and decision.output.linear_m_s > 0.0
        stops += was_moving and not is_moving
        is_armed = is_armed and decision.mode is not Mode.STOPPED
        was_moving = is_moving
        if is_moving:
            outputs.append(decision.output.linear_m_s)
            limited += decision.limit is Limit.COMMAND_AGE
    outputs.sort()
    lowest_m_s = outputs[int(len(outputs) * LOWEST_PERCENT / 100)] if outputs else 0.0
    return Ride(speed_m_s, limited / max(1, len(outputs)), lowest_m_s, stops)


def _commands(link: Link, speed_m_s: float, chance: random.Random) -> Iterator[Command]:
    """Yield the commands in the order of their arrival."""
    newest_s = 0.0
    for number in count():
        sent_s = 1000.0 + number / link.hz
        is_lost = number > NEUTRAL_S * link.hz and chance.random() < link.loss
        arrival_s = sent_s + DELAY_S + abs(chance.gauss(0.0, link.jitter_s))
        newest_s = max(newest_s, arrival_s)
        if not is_lost:
            velocity = Velocity(speed_m_s if number > NEUTRAL_S * link.hz else 0.0, 0.0)
            yield Command("teleop", velocity, newest_s, Sent(b"operator", number, sent_s))


def sheet() -> Sheet:
    """Return a row for each kind of commands, with two columns for each speed."""
    rows: list[tuple[str, ...]] = []
    for link in LINKS:
        cells = [str(link)]
        for speed_m_s in SPEEDS_M_S:
            one = ride(link, speed_m_s)
            cells += [f"{100 * one.limited:.0f} %", f"{one.ripple_m_s:.2f}"]
        rows.append(tuple(cells))
    columns = [word for speed in SPEEDS_M_S for word in (f"limited at {speed:g} m/s", "ripple [m/s]")]
    return Sheet(
        "Limits by the age of the command, with the defaults",
        ("commands", *columns),
        tuple(rows),
        (
            f"limited: share of the moving ticks, in {DRIVE_S:g} s of virtual time.",
            f"ripple: the commanded speed minus the speed that {100 - LOWEST_PERCENT:g} % of the moving ticks reach.",
            "jitter: scale of a half-normal delay; a command never overtakes another.",
        ),
    )


if __name__ == "__main__":
    argparse.ArgumentParser(prog="python -m bench.command_age", description=__doc__).parse_args()
    with failing_in_a_sentence("bench.command_age"):
        show([sheet()], [])
