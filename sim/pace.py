"""Which physics step is due when: real time, a multiple of it, or a pause.

Pure: time is an argument, in seconds of any one monotonic clock that goes on whatever the simulation does. The
robot with its sensors lives in simulated time; whoever commands it, and the base's own watchdog, in the other.
"""

import math
from typing import NamedTuple

MIN_SPEED, MAX_SPEED = 0.1, 100.0
MAX_SINGLE_STEPS = 100_000

MAX_CATCH_UP_S = 0.1
"""A process that was held up makes up for this much; the rest of the time has not happened."""

_ROUNDING_S = 1e-9
"""A timer that comes at a step's very time finds it due."""

_FORMS = f"pause, run, step N (1 to {MAX_SINGLE_STEPS}), speed FACTOR ({MIN_SPEED:g} to {MAX_SPEED:g})"


class TimeRequestError(ValueError):
    """What is wanted of time cannot be; the message says what can."""


class Ask(NamedTuple):
    """How does time pass now?"""


class Pause(NamedTuple):
    """Let no time pass."""


class Run(NamedTuple):
    """Let time pass again."""


class Step(NamedTuple):
    """Make so many physics steps of a paused simulation."""

    steps: int


class Speed(NamedTuple):
    """Let so much simulated time pass in each second."""

    factor: float


TimeRequest = Ask | Pause | Run | Step | Speed


def parse_time_request(text: str) -> TimeRequest:
    """What one line asks for; an empty one only asks.

    Raises:
        TimeRequestError: it is none of the forms, or its number is out of bounds.
    """
    match text.split():
        case []:
            return Ask()
        case ["pause"]:
            return Pause()
        case ["run"]:
            return Run()
        case ["step", number] if _is_count(number) and 1 <= int(number) <= MAX_SINGLE_STEPS:
            return Step(int(number))
        case ["speed", number]:
            return Speed(parse_speed(number))
        case _:
            raise TimeRequestError(f"{text!r} is nothing that can be asked of time; there are: {_FORMS}")


def parse_speed(text: str) -> float:
    """A speed as a person writes it.

    Raises:
        TimeRequestError: it is no number, or out of bounds.
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
    """What became of the pace since the last look."""

    factor: float
    """Simulated time over real time; NaN if no time has passed."""
    lost_s: float
    """Simulated time that was due and never came."""


class Pace:
    """Turns the time that passes into steps that are due.

    Args:
        timestep_s: The simulated time of one step.
        now_s: When it starts; the first step is due one step later.
        speed: Simulated seconds in each second.
    """

    def __init__(self, timestep_s: float, now_s: float, speed: float = 1.0) -> None:
        self._timestep_s = timestep_s
        self._speed = speed
        self._paused = False
        self._single_steps = 0
        self._now_s = now_s
        self._owed_s = 0.0  # simulated time that has passed and is not stepped yet
        self._mark_s, self._steps, self._lost_s = now_s, 0, 0.0  # since the last measurement

    @property
    def speed(self) -> float:
        return self._speed

    @property
    def paused(self) -> bool:
        """No time passes by itself; single steps may be on their way."""
        return self._paused

    @property
    def single_steps(self) -> int:
        """How many of the steps that were asked for in a pause are still to come."""
        return self._single_steps

    @property
    def is_due(self) -> bool:
        """Whether the next step is due, by the time that `elapse` was told last."""
        if self._paused:
            return self._single_steps > 0
        return self._owed_s >= self._timestep_s - _ROUNDING_S

    @property
    def due_s(self) -> float:
        """When the next step will be due; +inf while there is none."""
        if self._paused:
            return self._now_s if self._single_steps else math.inf
        return self._now_s + (self._timestep_s - self._owed_s) / self._speed

    def elapse(self, now_s: float) -> float:
        """Takes in that time has passed; returns the simulated time that was too much to catch up with, in s."""
        elapsed_s, self._now_s = now_s - self._now_s, now_s
        if self._paused:
            return 0.0
        self._owed_s += elapsed_s * self._speed
        # A step that is on its way counts for nothing here: in slow motion it may be long.
        too_much_s = max(0.0, self._owed_s - MAX_CATCH_UP_S * self._speed - self._timestep_s)
        self._owed_s -= too_much_s
        self._lost_s += too_much_s
        return too_much_s

    def stepped(self) -> None:
        """One step was made."""
        self._steps += 1
        if self._paused:
            self._single_steps -= 1
        else:
            self._owed_s -= self._timestep_s

    def pause(self, now_s: float) -> None:
        """Lets no more time pass; single steps that are not made yet will not be."""
        self.elapse(now_s)
        self._paused = True
        self._single_steps = 0

    def run(self, now_s: float) -> None:
        """Lets time pass from now on."""
        self.elapse(now_s)
        self._paused = False
        self._single_steps = 0

    def step(self, steps: int) -> None:
        """Makes so many steps due at once.

        Raises:
            TimeRequestError: time passes by itself, or earlier steps are still on their way.
        """
        if not self._paused:
            raise TimeRequestError("single steps need a paused simulation: ask for pause first")
        if self._single_steps:
            raise TimeRequestError(f"{self._single_steps} single steps are still to be made")
        self._single_steps = steps

    def set_speed(self, now_s: float, speed: float) -> None:
        """Passes time at another speed from now on."""
        self.elapse(now_s)
        self._speed = speed

    def measure(self, now_s: float) -> Measured:
        """How fast it really went since the last measurement."""
        elapsed_s = now_s - self._mark_s
        factor = self._steps * self._timestep_s / elapsed_s if elapsed_s > 0.0 else math.nan
        measured = Measured(factor, self._lost_s)
        self._mark_s, self._steps, self._lost_s = now_s, 0, 0.0
        return measured


class Every:
    """Which physics steps a sensor's samples come after.

    Args:
        rate_hz: Samples in a second of simulated time; at most one after each step.
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
        """Simulated time from one sample to the next."""
        return self._steps(speed) * self._timestep_s

    def due(self, step: int, speed: float = 1.0) -> bool:
        """Whether a sample comes after this step; steps count from 1 and each is asked about once.

        In slow motion samples come at their rate by the real clock, not more rarely: whoever supervises the
        robot lives in real time, and a scan that is 0.25 s old proves nothing to it.
        """
        due = self._last + self._steps(speed)
        if step < due - 1e-6:
            return False
        # The fraction is kept, so that the mean rate is exact; after a change of rate it starts anew.
        self._last = due if step - due < 1.0 else float(step)
        return True

    def _steps(self, speed: float) -> float:
        return max(1.0, self._period * min(1.0, speed))


def _is_count(text: str) -> bool:
    """Python refuses to read numbers of thousands of digits."""
    return text.isdecimal() and len(text) <= len(str(MAX_SINGLE_STEPS))
