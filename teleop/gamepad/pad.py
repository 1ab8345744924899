"""A gamepad's events -> velocity: the pilot of `--mode gamepad`, without the device.

The robot moves only while the dead-man button is held, after the press was received and the stick was centred since. The
stick must have been reported since the pad was connected. When the button is released, the velocity is zero immediately.
A doubtful state of the button also ends the hold: the pad was unplugged, events were lost, the pad was silent for too
long, or the operator stopped with a key. After that, the button must be released and pressed again.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import NamedTuple, assert_never

from teleop.pilots.config import GamepadSection
from teleop.pilots.keys import NO_MOTION, STOP_KEY, level_of
from teleop.pilots.pilot import LEVELS, NEUTRAL, KeyEvent, KeyKind, Velocity

EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
"""Types of events, from linux/input-event-codes.h."""
SYN_REPORT, SYN_DROPPED = 0, 3

MAX_DEAD_ZONE = 0.5
"""Maximum dead zone from a driver's `flat`; with a larger one, hardly any range of the stick would remain."""
SETTLE_S = 0.5
"""Time after connecting in which a press does not count: a driver knows the pad's state only after its first report, so
the button may have been held before."""
_LABELS = {
    "BTN_SOUTH": "A/cross",
    "BTN_EAST": "B/circle",
    "BTN_TL": "LB/L1",
    "BTN_TR": "RB/R1",
    "BTN_TL2": "LT/L2",
    "BTN_TR2": "RT/R2",
}


class PadEvent(NamedTuple):
    """An input event of Linux."""

    type: int
    code: int
    value: int


class Button(IntEnum):
    """An EV_KEY event's value."""

    RELEASED = 0
    PRESSED = 1


class Axis(NamedTuple):
    """Position and calibration of an axis: EVIOCGABS, in units of the axis."""

    value: int
    minimum: int
    maximum: int
    flat: int = 0
    """Noise on each side of the centre according to the driver."""


class PadState(NamedTuple):
    """The complete state of a pad."""

    pressed: frozenset[int]
    axes: Mapping[int, Axis]


@dataclass(frozen=True, slots=True)
class Layout:
    """The configuration of a pad, Linux's codes for the names of its axes and buttons, and the velocity at full deflection."""

    section: GamepadSection
    forward_axis: int
    turn_axis: int
    dead_man: int
    turbo: int
    most: Velocity

    @property
    def axes(self) -> tuple[int, int]:
        return self.forward_axis, self.turn_axis

    @property
    def buttons(self) -> tuple[int, int]:
        return self.dead_man, self.turbo


def label_of(button: str) -> str:
    """Return the label of a button on most pads; its name if it has none."""
    return _LABELS.get(button, button)


def deflection(axis: Axis, dead_zone: float) -> float:
    """Return the deflection of an axis, -1 to 1: zero in the dead zone, and continuous at its edge.

    The kernel does not enforce the range of an axis: values outside are clamped. An axis with an empty range counts as
    centred.
    """
    half = (axis.maximum - axis.minimum) / 2
    if half <= 0:
        return 0.0
    offset = max(-1.0, min(1.0, (axis.value - axis.minimum - half) / half))
    zone = min(MAX_DEAD_ZONE, max(dead_zone, axis.flat / half))
    beyond = abs(offset) - zone
    return math.copysign(beyond / (1 - zone), offset) if beyond > 0 else 0.0


class Phase(StrEnum):
    """Phases on the way to driving."""

    ABSENT = "absent"
    LOST = "lost"
    """Events were lost; the state is unknown until it has been read from the pad."""
    LET_GO = "let go"
    """The dead-man button is pressed, but must be released first."""
    READY = "ready"
    """The dead-man button is released."""
    CENTRE = "centre"
    """The dead-man button is held, but the stick has not been centred since."""
    DRIVING = "driving"


@dataclass(slots=True)
class Gamepad:
    """The pilot for the stick while the dead-man button is held. See `teleop.pilots.pilot.Pilot`.

    Time, in seconds of the loop's clock, is an argument. Between `lost` and `resync`, and before `plug_in`,
    events are ignored.
    """

    layout: Layout
    level: int = LEVELS
    """Speed level 1 to 5, in fifths of both velocities, with or without turbo."""
    phase: Phase = Phase.ABSENT
    name: str = ""
    _is_reported: bool = False
    """Whether the stick was reported since the pad was connected: before that, the kernel only assumes its position."""
    _why: str = "no gamepad"
    """Reason for the phases ABSENT, LOST and LET_GO."""
    _pressed: set[int] = field(default_factory=set[int])
    _axes: dict[int, Axis] = field(default_factory=dict[int, Axis])
    _settled_s: float = math.inf
    _heard_s: float = -math.inf
    _pulse_s: float | None = None

    # --- called by the device

    def plug_in(self, name: str, state: PadState, now_s: float) -> None:
        """Begin with a pad in this state; a button that is pressed now must be released first."""
        self.name = name
        self._settled_s = now_s + SETTLE_S
        self._heard_s, self._pulse_s = now_s, None
        self._is_reported = False
        self._take_state(state, "it was held when the gamepad came")

    def unplug(self, why: str) -> None:
        """End the hold because the pad was unplugged or cannot be used; `why` is shown on the screen."""
        self.phase, self._why = Phase.ABSENT, why

    def take(self, event: PadEvent, now_s: float) -> None:
        """Process one event, in the order of the device."""
        if self.phase in (Phase.ABSENT, Phase.LOST):
            return
        self._miss(now_s)
        self._heard_s = now_s
        if event.type == EV_KEY and event.code in self.layout.buttons:
            self._button(event.code, event.value, now_s)
        elif event.type == EV_ABS and event.code in self._axes:
            self._axes[event.code] = self._axes[event.code]._replace(value=event.value)
            self._is_reported = True
        elif event.type == EV_SYN and event.code == SYN_DROPPED:
            self.phase, self._why = Phase.LOST, "events were lost"
        elif (
            (event.type, event.code) == (EV_SYN, SYN_REPORT)
            and self.phase is Phase.CENTRE
            and self._is_centred
        ):
            # Only at the end of a report, buttons and axes are consistent.
            self.phase = Phase.DRIVING

    @property
    def needs_state(self) -> bool:
        """Whether events were lost; then empty the device's queue, read its state, and call `resync`."""
        return self.phase is Phase.LOST

    def resync(self, state: PadState) -> None:
        """Continue with this state after events were lost; one of them may be a release of the dead-man button."""
        self._take_state(state, self._why)

    def pulse(self, now_s: float) -> None:
        """Record a sign of life from the motion sensors; after the first one, they must continue."""
        self._miss(now_s)
        self._pulse_s = now_s

    # --- called by teleop

    def on_key(self, event: KeyEvent, now_s: float) -> bool:  # noqa: ARG002 - a key is a key at any time
        """Process a key: some select the speed level, none drives, and all without another function stop."""
        key, level = event.key.lower(), level_of(event.key)
        if event.kind is KeyKind.RELEASE or key in NO_MOTION:
            return True
        if level is None:
            self.let_go()
        self.level = level or self.level
        return key == STOP_KEY or level is not None

    def velocity(self, now_s: float) -> Velocity:
        """Return the velocity to send. There is no ramp: the operator controls the stick directly."""
        self._miss(now_s)
        return self.wanted()

    def wanted(self) -> Velocity:
        if self.phase is not Phase.DRIVING:
            return NEUTRAL
        layout, section, limit = self.layout, self.layout.section, self.limit
        forward = self._deflection(layout.forward_axis, inverted=section.forward_inverted)
        turn = self._deflection(layout.turn_axis, inverted=section.turn_inverted)
        return Velocity(forward * limit.linear_m_s, turn * limit.angular_rad_s)

    @property
    def limit(self) -> Velocity:
        section = self.layout.section
        share = section.turbo_share if self.layout.turbo in self._pressed else section.normal_share
        return self.layout.most.scaled(share * self.level / LEVELS)

    def let_go(self) -> None:
        if self.phase in (Phase.CENTRE, Phase.DRIVING):
            self._end_hold("stopped")

    @property
    def next_s(self) -> float:
        """Return the time at which a silent pad ends the hold."""
        if self.wanted().is_neutral:
            return math.inf
        section = self.layout.section
        return self._alive_s + (section.silence_limit_s if self._pulse_s is None else section.pulse_limit_s)

    @property
    def note(self) -> str:
        section = self.layout.section
        dead_man = label_of(section.dead_man_button)
        match self.phase:
            case Phase.ABSENT | Phase.LOST:
                return f"stopped: {self._why}"
            case Phase.LET_GO:
                return f"{self._why}: let go of {dead_man}, then hold it"
            case Phase.READY:
                return f"{self.name}: hold {dead_man} to drive, {label_of(section.turbo_button)} is turbo"
            case Phase.CENTRE:
                return "centre the stick first" if self._is_reported else "move the stick, and centre it"
            case Phase.DRIVING:
                return f"driving while {dead_man} is held"
            case _:
                assert_never(self.phase)

    # --- internal

    @property
    def _alive_s(self) -> float:
        """Return the time of the pad's last sign of life."""
        return self._heard_s if self._pulse_s is None else self._pulse_s

    @property
    def _is_centred(self) -> bool:
        return self._is_reported and not any(
            deflection(axis, self.layout.section.dead_zone) for axis in self._axes.values()
        )

    def _deflection(self, code: int, *, inverted: bool) -> float:
        value = deflection(self._axes[code], self.layout.section.dead_zone)
        return -value if inverted and value else value  # never -0.0 on the wire

    def _take_state(self, state: PadState, why: str) -> None:
        self._pressed = {code for code in self.layout.buttons if code in state.pressed}
        self._axes = {code: state.axes[code] for code in self.layout.axes}
        self.phase, self._why = Phase.READY, why
        if self.layout.dead_man in self._pressed:
            self.phase = Phase.LET_GO

    def _button(self, code: int, value: int, now_s: float) -> None:
        if value == Button.RELEASED:
            self._pressed.discard(code)
        else:
            self._pressed.add(code)
        if code != self.layout.dead_man:
            return
        if value == Button.RELEASED:
            self.phase = Phase.READY
        elif value == Button.PRESSED and self.phase is Phase.READY:
            self.phase = Phase.CENTRE
            if now_s < self._settled_s:
                self._end_hold("pressed too soon after the gamepad came")

    def _miss(self, now_s: float) -> None:
        if now_s >= self.next_s:
            self._end_hold(f"nothing heard from it for {now_s - self._alive_s:.1f} s")

    def _end_hold(self, why: str) -> None:
        self.phase, self._why = Phase.LET_GO, why
