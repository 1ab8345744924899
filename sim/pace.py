"""Due times of the physics steps: in real time, at a multiple of it, or paused.

Pure: time is an argument, in seconds of any monotonic clock that is independent of the simulation. The robot and its
sensors run in simulated time; its commands and the base's watchdog run in real time.
"""

import math
from enum import StrEnum
from typing import NamedTuple

MIN_SPEED, MAX_SPEED = 0.1, 100.0
MAX_SINGLE_STEPS = 100_000

MAX_CATCH_UP_S = 0.1
"""Maximum time that a delayed process catches up; the remaining delay is skipped in simulated time."""

_ROUNDING_S = 1e-9
"""Tolerance so that a step is due at exactly its due time."""

_FORMS = f"pause, run, step N (1 to {MAX_SINGLE_STEPS}), speed FACTOR ({MIN_SPEED:g} to {MAX_SPEED:g})"


class TimeRequestError(ValueError):
    """The request cannot be fulfilled; the message lists the possible ones."""


class Request(StrEnum):
    """The kinds of request about simulated time."""

    ASK = "ask"
    PAUSE = "pause"
    RUN = "run"
    STEP = "step"
    SPEED = "speed"


class TimeRequest(NamedTuple):
    """A request, with the number of steps or the simulated seconds per second."""

    what: Request
    number: float = 0.0


def parse_time_request(text: str) -> TimeRequest:
    """Parse one line as a request; an empty line asks for the present pace.

    Raises:
        TimeRequestError: the line has none of the forms, or its number is out of bounds.
    """
    match text.split():
        case []:
            return TimeRequest(Request.ASK)
        case ["pause" | "run" as what]:
            return TimeRequest(Request(what))
        case ["step", number] if _is_count(number) and 1 <= int(number) <= MAX_SINGLE_STEPS:
            return TimeRequest(Request.STEP, int(number))
        case ["speed", number]:
            return TimeRequest(Request.SPEED, parse_speed(number))
        case _:
            raise TimeRequestError(f"{text!r} is not a time request; give one of: {_FORMS}")


def parse_speed(text: str) -> float:
    """Parse a speed.

    Raises:
        TimeRequestError: the text is not a number, or out of bounds.
    """
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not MIN_SPEED <= factor <= MAX_SPEED:
        raise TimeRequestError(
            f"the speed has to be a number from {MIN_SPEED:g} to {MAX_SPEED:g} times real time, not {text!r}"
        )
    return factor


class Measured(NamedTuple):
    """The achieved pace since the last measurement."""

    factor: float
    """Simulated time over real time; NaN if no time has passed."""
    lost_s: float
    """Simulated time that was due and skipped."""


class Pace:
    """Converts elapsed time to physics steps that are due.

    Args:
        timestep_s: The simulated time of one step.
        now_s: The start time; the first step is due one step later.
        speed: Simulated seconds in each second.
    """

    def __init__(self, timestep_s: float, now_s: float, speed: float = 1.0) -> None:
        self._timestep_s = timestep_s
        self.speed = speed
        self.paused = False
        """Whether the simulation is paused; single steps may still be due."""
        self.single_steps = 0
        """Number of requested single steps that are still to be made."""
        self._now_s = now_s
        self._owed_s = 0.0  # simulated time that has passed and is not stepped yet
        self._mark_s, self._steps, self._lost_s = now_s, 0, 0.0  # since the last measurement

    @property
    def is_due(self) -> bool:
        """Whether the next step is due at the time of the last `elapse`."""
        if self.paused:
            return self.single_steps > 0
        return self._owed_s >= self._timestep_s - _ROUNDING_S

    @property
    def due_s(self) -> float:
        """Return the time at which the next step is due; +inf if there is none."""
        if self.paused:
            return self._now_s if self.single_steps else math.inf
        return self._now_s + (self._timestep_s - self._owed_s) / self.speed

    def elapse(self, now_s: float) -> float:
        """Advance to `now_s`; return the simulated time in s that is skipped because it was too much to catch up."""
        elapsed_s, self._now_s = now_s - self._now_s, now_s
        if self.paused:
            return 0.0
        self._owed_s += elapsed_s * self.speed
        # The step in progress does not count as delay: in slow motion it may take long.
        too_much_s = max(0.0, self._owed_s - MAX_CATCH_UP_S * self.speed - self._timestep_s)
        self._owed_s -= too_much_s
        self._lost_s += too_much_s
        return too_much_s

    def stepped(self) -> None:
        """Record that one step was made."""
        self._steps += 1
        if self.paused:
            self.single_steps -= 1
        else:
            self._owed_s -= self._timestep_s

    def pause(self, now_s: float) -> None:
        """Pause; discard single steps that are not made yet."""
        self.elapse(now_s)
        self.paused = True
        self.single_steps = 0

    def run(self, now_s: float) -> None:
        """Continue in time from `now_s` on."""
        self.elapse(now_s)
        self.paused = False
        self.single_steps = 0

    def step(self, steps: int) -> None:
        """Make a number of steps due immediately.

        Raises:
            TimeRequestError: the simulation is not paused, or earlier single steps are still to be made.
        """
        if not self.paused:
            raise TimeRequestError("single steps need a paused simulation: ask for pause first")
        if self.single_steps:
            raise TimeRequestError(f"{self.single_steps} single steps are still to be made")
        self.single_steps = steps

    def set_speed(self, now_s: float, speed: float) -> None:
        """Change the speed from `now_s` on."""
        self.elapse(now_s)
        self.speed = speed

    def measure(self, now_s: float) -> Measured:
        """Return the achieved pace since the last measurement, and start a new one."""
        elapsed_s = now_s - self._mark_s
        factor = self._steps * self._timestep_s / elapsed_s if elapsed_s > 0.0 else math.nan
        measured = Measured(factor, self._lost_s)
        self._mark_s, self._steps, self._lost_s = now_s, 0, 0.0
        return measured


class Every:
    """Selects the physics steps after which a sensor is sampled.

    Args:
        rate_hz: Samples per second of simulated time; at most one after each step.
        timestep_s: The simulated time of one step.
    """

    def __init__(self, rate_hz: float, timestep_s: float) -> None:
        self._timestep_s = timestep_s
        self._last = 0.0
        self._period = 1.0
        self.rate_hz = rate_hz

    @property
    def rate_hz(self) -> float:
        return self._rate_hz

    @rate_hz.setter
    def rate_hz(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._period = max(1.0, 1.0 / (rate_hz * self._timestep_s))

    def period_s(self, speed: float = 1.0) -> float:
        """Return the simulated time between two samples."""
        return self._steps(speed) * self._timestep_s

    def due(self, step: int, speed: float = 1.0) -> bool:
        """Return whether to sample after this step; steps count from 1, and this is called once for each.

        In slow motion, samples keep their rate in real time, because the supervisor runs in real time and does not
        accept a scan that is 0.25 s old.
        """
        due = self._last + (self._period if speed >= 1.0 else self._steps(speed))
        if step < due - 1e-6:
            return False
        # The fraction is kept, so that the mean rate is exact; it is reset after a change of rate.
        self._last = due if step - due < 1.0 else float(step)
        return True

    def _steps(self, speed: float) -> float:
        return max(1.0, self._period * min(1.0, speed))


def _is_count(text: str) -> bool:
    """Return whether a text is a count, of few digits because Python refuses to parse thousands of them."""
    return text.isdecimal() and len(text) <= len(str(MAX_SINGLE_STEPS))
