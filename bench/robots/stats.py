"""Computes gaps, stops and their reasons from the commands and statuses of a robot (pure)."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

Heard = tuple[float, float, bool]
"""A command to the base: its arrival and decision time [s], and whether it moves the robot."""
Status = tuple[float, bool, Sequence[str]]
"""A status: its arrival time [s], whether the robot is stopped, and the reasons."""
Window = tuple[float, float]
"""Begin and end of an interval [s]."""


def within(window: Window, commands: Iterable[Heard]) -> list[Heard]:
    """Return the commands that arrived within a window."""
    begin_s, end_s = window
    return [command for command in commands if begin_s <= command[0] < end_s]


def gaps_ms(window: Window, commands: Iterable[Heard], *, decided: bool = False) -> list[float]:
    """Return the times between one command and the next one [ms].

    Args:
        window: only commands that arrived within it count.
        commands: of one robot, in their order.
        decided: measure between the decisions, not between the arrivals.
    """
    times_s = [command[1 if decided else 0] for command in within(window, commands)]
    return [1000.0 * (later - earlier) for earlier, later in pairwise(times_s)]


def transits_ms(window: Window, commands: Iterable[Heard]) -> list[float]:
    """Return the time from the decision of each command to its arrival [ms]; both times are by one clock."""
    return [1000.0 * (arrival_s - decided_s) for arrival_s, decided_s, _ in within(window, commands)]


def stood(window: Window, commands: Iterable[Heard]) -> bool:
    """Return whether a robot that should drive throughout the window got a zero command, or no command at all."""
    found = within(window, commands)
    return not found or not all(moves for _, _, moves in found)


def reasons(window: Window, statuses: Iterable[Status]) -> set[str]:
    """Return the reasons of all stops in a window."""
    begin_s, end_s = window
    return {
        reason for at_s, stopped, found in statuses if stopped and begin_s <= at_s < end_s for reason in found
    }


def stop_ms(killed_s: float, commands: Sequence[Heard]) -> float | None:
    """Return the time from a kill to the first zero command [ms].

    None if the robot did not move when its operator was killed, or never stopped.
    """
    before = [moves for arrival_s, _, moves in commands if arrival_s < killed_s]
    if not before or not before[-1]:
        return None
    return next(
        (
            1000.0 * (arrival_s - killed_s)
            for arrival_s, _, moves in commands
            if arrival_s >= killed_s and not moves
        ),
        None,
    )
