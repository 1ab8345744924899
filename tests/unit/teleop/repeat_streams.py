"""The key streams of terminals for a held key, and three methods to detect that it is held.

Run it to see the table of docs/decisions/0014: `python -m tests.unit.teleop.repeat_streams`.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

from teleop.pilots.keyboard import Repeats

SAMPLE_S = 0.001
HELD_S = 3.0
RELEASES = 41
"""Number of moments between two repeats at which the key is released."""


class Keyboard(NamedTuple):
    """A key repeat's usual setting."""

    name: str
    delay_s: float
    interval_s: float


KEYBOARDS = (
    Keyboard("X11", 0.660, 0.040),
    Keyboard("Linux console", 0.250, 0.033),
    Keyboard("macOS", 0.500, 0.033),
    Keyboard("Windows", 0.500, 0.030),
)


class Outcome(NamedTuple):
    """The behaviour that the operator notices."""

    start_s: float
    """From the press to the first motion."""
    stutter_s: float
    """Standstill although the key is held."""
    runs_on_s: float
    """Moving after the release, at worst."""
    tap_s: float
    """Moving after a tap of 0.1 s."""


Presses = list[float]
Detector = Callable[[], Callable[[float, bool], bool]]
"""Makes a function of the time, and whether the key arrives then, that tells whether the robot moves."""


def arrivals(keyboard: Keyboard, held_s: float) -> Presses:
    """Times at which the key's bytes arrive."""
    times, at_s = [0.0], keyboard.delay_s
    while at_s < held_s:
        times.append(at_s)
        at_s += keyboard.interval_s
    return times


def by_repeats() -> Callable[[float, bool], bool]:
    """Our method."""
    repeats = Repeats()

    def moves(now_s: float, arrives: bool) -> bool:  # noqa: FBT001
        if arrives:
            repeats.press("i", now_s)
        return repeats.held(now_s) is not None

    return moves


def with_timeout(timeout_s: float) -> Detector:
    """Each press moves for this time, like key_timeout of teleop_twist_keyboard."""

    def detector() -> Callable[[float, bool], bool]:
        last_s = [-10.0]

        def moves(now_s: float, arrives: bool) -> bool:  # noqa: FBT001
            if arrives:
                last_s[0] = now_s
            return now_s - last_s[0] < timeout_s

        return moves

    return detector


DETECTORS: tuple[tuple[str, Detector], ...] = (
    ("immediately, for 0.6 s after each press", with_timeout(0.6)),
    ("immediately, for 0.15 s after each press", with_timeout(0.15)),
    ("when the key repeats (ours)", by_repeats),
)


def observe(detector: Detector, keyboard: Keyboard) -> Outcome:
    """Hold the key, let go at many moments between two repeats, and tap it."""
    runs_on_s, start_s, stutter_s = 0.0, 0.0, 0.0
    for n in range(RELEASES):
        held_s = HELD_S + keyboard.interval_s * n / (RELEASES - 1)
        moving = _moving(detector, arrivals(keyboard, held_s))
        start_s = moving[0]
        stutter_s = sum(later - earlier for earlier, later in pairwise(moving) if later - earlier > 0.0015)
        runs_on_s = max(runs_on_s, moving[-1] - held_s)
    tapped = _moving(detector, arrivals(keyboard, 0.1))
    tap_s = max(0.0, tapped[-1] - 0.1) if tapped else 0.0
    return Outcome(*(round(value, 2) for value in (start_s, stutter_s, runs_on_s, tap_s)))


def _moving(detector: Detector, presses: Presses) -> list[float]:
    """Times at which the robot moves."""
    moves, moving, waiting = detector(), list[float](), list(presses)
    for sample in range(int((presses[-1] + 2.0) / SAMPLE_S)):
        now_s = sample * SAMPLE_S
        arrives = bool(waiting) and waiting[0] <= now_s + SAMPLE_S / 2
        if arrives:
            waiting.pop(0)
        if moves(now_s, arrives):
            moving.append(now_s)
    return moving


def table() -> list[str]:
    """Return the table in Markdown."""
    rows = [
        "| the robot moves | keyboard | first motion after | interruption | motion after the release | motion after a tap |",
        "|---|---|---|---|---|---|",
    ]
    for name, detector in DETECTORS:
        for keyboard in KEYBOARDS:
            outcome = observe(detector, keyboard)
            rows.append(
                f"| {name} | {keyboard.name} | " + " | ".join(f"{value:.2f} s" for value in outcome) + " |"
            )
    return rows


if __name__ == "__main__":
    print("\n".join(table()))
