"""Control by keys: by steps, the default, or by holding a key.

By steps, each key press changes the requested velocity, which holds until the next press. A stop by the supervisor does
not change the requested velocity. The law waits for a neutral command, which must come from the operator: a program that
sent it automatically would re-arm the robot without the operator's knowledge.

By holding, in the layout of teleop_twist_keyboard, the robot moves only while a key is held. If the terminal reports
releases, a key is held from its press to its release, and several held keys add up. Repeats are then no presses, so that
after any stop a key must be pressed again. On other terminals, a held key is detected from its repeats.
"""

import math
from collections import deque
from collections.abc import Callable

from teleop.pilots.keys import FOCUS_OUT, NO_MOTION, PRESENCE_KEY, STOP_KEY, level_of
from teleop.pilots.pilot import LEVELS, NEUTRAL, KeyEvent, KeyKind, Ramp, Velocity, amount

DIGITS = 9
"""Decimal places for rounding: finer than any step, coarser than floating-point errors (3 x 0.1 is 0.3)."""


class _KeyPilot:
    """What both pilots share: the speed level, the requested velocity, and the ramp toward it."""

    def __init__(self, most: Velocity, ramp: Ramp, level: int) -> None:
        self._most, self._ramp, self.level = most, ramp, level
        self._wanted = NEUTRAL

    @property
    def limit(self) -> Velocity:
        return self._most.scaled(self.level / LEVELS)

    @property
    def next_s(self) -> float:
        return self._ramp.next_s

    def wanted(self) -> Velocity:
        return self._wanted

    def let_go(self) -> None:
        self._wanted = NEUTRAL
        self._ramp.reset()


# --- steps

DEFAULT_STEP, DEFAULT_MOST = Velocity(0.1, 0.2), Velocity(1.0, 2.0)
STEPS = {"w": (1, 0), "x": (-1, 0), "a": (0, 1), "d": (0, -1)}
"""Steps (forward, left) of the keys."""


class Incremental(_KeyPilot):
    """A `Pilot` that counts key presses.

    Sums of steps are rounded: ten steps up and ten down give exactly zero, and only exact zero is neutral. A step never
    crosses zero but stops at it, even after a change of level.

    Args:
        ramp: limits the acceleration of the sent velocity.
        step: step of each velocity at the highest speed level, above zero.
        most: maximum of each velocity at the highest speed level, above zero.
        level: the initial speed level.
        unanswered_m_s: maximum forward velocity until the terminal answers a status request: without answers, a dead
            link to the terminal is not detected.
    """

    def __init__(
        self,
        ramp: Ramp,
        step: Velocity = DEFAULT_STEP,
        most: Velocity = DEFAULT_MOST,
        level: int = LEVELS,
        *,
        unanswered_m_s: float = math.inf,
    ) -> None:
        super().__init__(most, ramp, level)
        self._full_step = step
        self._cap_m_s = unanswered_m_s
        self._has_said = False
        self.say: Callable[[str], None] | None = None
        """Shows the operator once that the terminal limits the speed."""

    @property
    def limit(self) -> Velocity:
        linear_m_s, angular_rad_s = super().limit
        return Velocity(min(linear_m_s, self._cap_m_s), angular_rad_s)

    @property
    def _step(self) -> Velocity:
        """Step of each velocity at this speed level."""
        return self._full_step.scaled(self.level / LEVELS)

    @property
    def note(self) -> str:
        if self._is_capped:
            return f"no answer from terminal: {amount(self._cap_m_s)} m/s"
        return f"each press: {amount(self._step.linear_m_s)} m/s or {amount(self._step.angular_rad_s)} rad/s"

    @property
    def _is_capped(self) -> bool:
        """Whether the terminal's silence limits the speed."""
        return self._cap_m_s < super().limit.linear_m_s

    def rely_on_answers(self) -> None:
        """Permit all speeds: the terminal has answered a status request."""
        self._cap_m_s = math.inf

    def on_key(self, event: KeyEvent, now_s: float) -> bool:  # noqa: ARG002 - a step is a step at any time
        if event.kind is KeyKind.RELEASE:
            return True
        key = event.key.lower()
        level = level_of(key)
        if key == STOP_KEY:
            self.let_go()
        elif key in STEPS:
            self._move(STEPS[key])
        elif level is not None:
            self.level = level
            self._move((0, 0))  # down to the maximum of the level
        elif key not in NO_MOTION and key != PRESENCE_KEY:
            self.let_go()
            return False
        return True

    def velocity(self, now_s: float) -> Velocity:
        return self._ramp.toward(self._wanted, now_s)

    def _move(self, steps: tuple[int, int]) -> None:
        self._wanted = Velocity(
            *(
                _stepped(velocity, count * step, limit)
                for velocity, count, step, limit in zip(
                    self._wanted, steps, self._step, self.limit, strict=True
                )
            )
        )
        if self._is_capped and self._wanted.linear_m_s and self.say is not None and not self._has_said:
            self._has_said = True
            self.say(f"the terminal answers no status requests: at most {amount(self._cap_m_s)} m/s")


def _stepped(velocity: float, step: float, limit: float) -> float:
    there = round(velocity + step, DIGITS)
    if velocity * there < 0.0:
        return 0.0
    top = round(limit, DIGITS)
    return max(-top, min(top, there)) + 0.0


# --- holding

MOTIONS = {
    "u": (1, 1),
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "l": (0, -1),
    "m": (-1, -1),
    ",": (-1, 0),
    ".": (-1, 1),
    "up": (1, 0),
    "down": (-1, 0),
    "left": (0, 1),
    "right": (0, -1),
}
"""Directions (forward, left) of the keys, as in teleop_twist_keyboard."""
STOPS = ("k", STOP_KEY, FOCUS_OUT)
"""Keys that stop like any other key, but are known as such."""
UP, DOWN = 1.1, 0.9
SPEEDS = {
    "q": (UP, UP),
    "z": (DOWN, DOWN),
    "w": (UP, 1.0),
    "x": (DOWN, 1.0),
    "e": (1.0, UP),
    "c": (1.0, DOWN),
}
"""Factors of the forward velocity and of the turn rate."""
LEAST = 0.05
"""Minimum speed as a share of the maximum: below it, a robot hardly moves, and steps of 10 % have no effect."""


UNPROVEN_S = 1.0
"""Until the first release, a key counts for this long after its press or newest repeat: the terminal may send no releases."""


class Hold(_KeyPilot):
    """A `Pilot` that moves while a key is held; any key without another meaning stops.

    Args:
        speed: the velocity while a key is held.
        most: the maximum of this velocity.
        ramp: limits the acceleration of the sent velocity.
        level: the initial speed level.
    """

    def __init__(self, speed: Velocity, most: Velocity, ramp: Ramp, level: int = LEVELS) -> None:
        super().__init__(most, ramp, level)
        self._speed = speed
        self._reports_releases = False
        self._has_released = False
        """Whether the terminal has reported a release."""
        self._held: dict[str, float] = {}
        """The held keys where releases are reported, with the time of their press or newest repeat."""
        self._repeats = Repeats()
        self._void_unsaid = False
        """Whether a stop has released a key, of which the operator has not been shown that its repeats are void."""
        self.say: Callable[[str], None] = lambda _: None
        """Shows the operator why a key does not move the robot."""

    @property
    def note(self) -> str:
        speed, how = self._allowed(), "releases reported" if self._reports_releases else "by key repeat"
        return f"{how}: {speed.linear_m_s:.2f} m/s, {speed.angular_rad_s:.2f} rad/s"

    @property
    def explanation(self) -> str:
        """A sentence that explains when a key counts as held on this terminal."""
        if self._reports_releases:
            return "the terminal reports key releases: it moves from a key's press to its release"
        return "no key releases from this terminal: it moves once a held key repeats, and 0.1 s longer"

    @property
    def next_s(self) -> float:
        expiry_s = self._repeats.until_s if self._wanted != NEUTRAL and not self._held else math.inf
        if self._held and not self._has_released:
            expiry_s = min(self._held.values()) + UNPROVEN_S
        return min(super().next_s, expiry_s)

    def rely_on_releases(self, *, reported: bool) -> None:
        """Set whether the terminal reports key releases; a change makes the pilot neutral."""
        if reported is not self._reports_releases:
            self._reports_releases, self._has_released = reported, False
            self.let_go()

    def on_key(self, event: KeyEvent, now_s: float) -> bool:
        key = event.key.lower()
        level = level_of(key)
        if event.kind is KeyKind.RELEASE:
            self._has_released = True
            self._held.pop(key, None)
        elif key in MOTIONS:
            self._on_motion(key, event.kind, now_s)
        elif key in SPEEDS:
            self._speed = Velocity(
                *(
                    max(LEAST * most, min(most, speed * factor))
                    for speed, most, factor in zip(self._speed, self._most, SPEEDS[key], strict=True)
                )
            )
        elif level is not None:
            self.level = level
        else:
            self.let_go()
            return key in STOPS
        return True

    def velocity(self, now_s: float) -> Velocity:
        self._end_unproven(now_s)
        if self._repeats.was_tap(now_s):
            self.say("a tap is too short to move the robot: hold the key until it repeats")
        key = self._repeats.held(now_s)
        keys = tuple(self._held) if key is None else (key,)
        speed = self._allowed()
        self._wanted = Velocity(
            *(
                max(-1, min(1, sum(MOTIONS[key][axis] for key in keys))) * speed[axis] + 0.0
                for axis in range(len(speed))
            )
        )
        return self._ramp.toward(self._wanted, now_s)

    def let_go(self) -> None:
        self._void_unsaid |= self._repeats.forget(next(reversed(self._held), ""))
        self._held.clear()
        super().let_go()

    def _on_motion(self, key: str, kind: KeyKind, now_s: float) -> None:
        if self._reports_releases:
            counts = kind is KeyKind.PRESS or key in self._held
            if counts:
                self._held[key] = now_s
        else:
            counts = self._repeats.press(key, now_s)
        if self._void_unsaid and not counts:
            self._void_unsaid = False
            self.say("a key that was held at a stop moves nothing: let go of it, and press it again")

    def _end_unproven(self, now_s: float) -> None:
        """Release the keys of a terminal that has reported no release yet, and that sends no more repeats."""
        if self._has_released:
            return
        for key, newest_s in tuple(self._held.items()):
            if now_s >= newest_s + UNPROVEN_S:
                del self._held[key]
                self.say(f"no key release from this terminal yet: a key counts for {UNPROVEN_S:g} s")

    def _allowed(self) -> Velocity:
        return Velocity(*map(min, self._speed, self.limit))


PROOF_S = 0.11
"""The same key again within this time is a repeat by the terminal: a finger needs longer."""
MIN_WINDOW_S = 0.1
WINDOW_INTERVALS = 2.5
"""A key counts as released after this many repeat intervals without a repeat."""
TAP_S = 0.8
"""A key that has not repeated for this long was tapped: terminals begin to repeat a held key within 0.66 s."""
REMEMBERED = 20
"""Number of recent intervals of which the longest is used, to allow for a link with uneven delivery."""


class Repeats:
    """Detects a held key from its repeats alone.

    A terminal without release reports sends a held key once, then nothing for its initial delay (a quarter to two thirds of
    a second), then repeatedly at short intervals. A key counts as held as soon as it arrives twice within a time shorter
    than a finger needs. It counts as released after a pause longer than its repeat interval explains (docs/decisions/0014).
    """

    def __init__(self) -> None:
        self._key = ""
        self._last_s = -math.inf
        self.until_s = -math.inf
        """Time until which the key counts as held; `-math.inf` if none does."""
        self._void_key, self._void_s = "", -math.inf
        """The key that was held when it was forgotten, and its newest repeat since then; infinite before the first one.
        Keys on a screen that is not seen do not arrive here: the time since the stop is no pause of the key.
        """
        self._intervals_s: deque[float] = deque(maxlen=REMEMBERED)

    @property
    def window_s(self) -> float:
        """Time after its last repeat for which a key counts as held."""
        return max(MIN_WINDOW_S, WINDOW_INTERVALS * max(self._intervals_s, default=0.0))

    def press(self, key: str, now_s: float) -> bool:
        """Take a press or a repeat; return False if it is a void repeat."""
        if key == self._void_key and now_s - self._void_s <= self.window_s:
            is_new = self._void_s == math.inf  # it may be a new press: only a pause tells
            self._void_s = now_s
            return is_new
        self._void_key = ""
        interval_s = now_s - self._last_s
        if key == self._key and interval_s <= PROOF_S:
            self._intervals_s.append(interval_s)
            self.until_s = now_s + self.window_s
        elif key != self._key or now_s >= self.until_s:
            self.until_s = -math.inf
        self._key, self._last_s = key, now_s
        return True

    def held(self, now_s: float) -> str | None:
        """Return the key that is held at `now_s`; None if none is."""
        return self._key if now_s < self.until_s else None

    def was_tap(self, now_s: float) -> bool:
        """Return once whether a key was pressed and did not repeat; the key no longer counts then."""
        is_tap = self._key != "" and self.until_s == -math.inf and now_s - self._last_s >= TAP_S
        if is_tap:
            self._key = ""
        return is_tap

    def forget(self, held: str = "") -> bool:
        """Release the held key, whose further repeats are void until a pause among them; keep the learned repeat intervals.

        Args:
            held: a key that was held by its press and release; its repeats are void too.

        Returns:
            Whether a key was held.
        """
        if not held and self.until_s > -math.inf:
            held = self._key
        self._void_key, self._void_s = held or self._void_key, math.inf
        self._key, self._last_s, self.until_s = "", -math.inf, -math.inf
        return bool(held)
