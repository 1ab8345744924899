"""The gamepad's pilot: no motion without the dead-man button, and bounded motion with it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.gamepad.pad import MAX_DEAD_ZONE, SETTLE_S, Axis, Gamepad, PadEvent, PadState, Phase, deflection
from teleop.pilots.config import GamepadSection
from teleop.pilots.keys import FOCUS_OUT, PASTED
from teleop.pilots.pilot import NEUTRAL, KeyEvent, KeyKind, Pilot, Velocity
from tests.unit.teleop.pads import (
    DROPPED,
    DUALSHOCK4,
    LAYOUT,
    MAX_ANGULAR_RAD_S,
    MAX_LINEAR_M_S,
    REPORT,
    TL,
    TR,
    XBOX360,
    Sample,
    X,
    Y,
    button,
    load_pad,
    stick,
)

RANGE = Axis(0, -1000, 1000)
UP, DOWN, LEFT = -1000, 1000, -1000
START_S = 100.0
ARMED_S = START_S + SETTLE_S
SILENCE_S, PULSE_S = LAYOUT.section.silence_limit_s, LAYOUT.section.pulse_limit_s


def state(*pressed: int, x: int = 0, y: int = 0) -> PadState:
    return PadState(frozenset(pressed), {X: RANGE._replace(value=x), Y: RANGE._replace(value=y)})


def plugged_in(*pressed: int, x: int = 0, y: int = 0) -> Gamepad:
    pilot = Gamepad(LAYOUT)
    pilot.plug_in("pad", state(*pressed, x=x, y=y), START_S)
    return pilot


def reported() -> Gamepad:
    """A pad that has reported a centred stick."""
    pilot = plugged_in()
    tell(pilot, stick(Y, 0))
    return pilot


def tell(pilot: Gamepad, *samples: Sample, at_s: float = ARMED_S) -> Velocity:
    """Send one report; return the pilot's velocity."""
    for sample in (*samples, REPORT):
        pilot.take(PadEvent(*sample), at_s)
    return pilot.velocity(at_s)


def driving(y: int = UP, x: int = 0) -> Gamepad:
    pilot = reported()
    tell(pilot, button(TL, 1))
    tell(pilot, stick(Y, y), stick(X, x))
    return pilot


# --- the stick


def axis_of(low: int, width: int, value: int, flat: int) -> Axis:
    return Axis(value, low, low + width, flat)


axes = st.builds(
    axis_of,
    st.integers(-(2**31), 2**31 - 1),
    st.integers(1, 2**31),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-10, 2**31 - 1),
)
zones = st.floats(0.001, MAX_DEAD_ZONE)


@given(axes, zones)
def test_a_deflection_is_bounded_whatever_the_driver_says(axis: Axis, zone: float) -> None:
    assert -1.0 <= deflection(axis, zone) <= 1.0


@given(axes, zones)
def test_the_ends_of_the_range_are_full_deflection_and_beyond_them_is_no_more(
    axis: Axis, zone: float
) -> None:
    for beyond in (0, 1, 10**9):
        assert deflection(axis._replace(value=axis.maximum + beyond), zone) == 1.0
        assert deflection(axis._replace(value=axis.minimum - beyond), zone) == -1.0


@given(st.integers(1, 2**15), zones, st.floats(-1, 1))
def test_a_deflection_is_zero_in_the_dead_zone_and_only_there(half: int, zone: float, where: float) -> None:
    axis = Axis(round(where * half), -half, half)
    assert (deflection(axis, zone) == 0.0) == (abs(axis.value / half) <= zone)


@given(st.integers(2, 2**15), st.integers(0, 2**15), zones, st.floats(-1, 1))
def test_one_unit_of_the_axis_never_makes_a_jump(half: int, flat: int, zone: float, where: float) -> None:
    axis = Axis(round(where * half), -half, half, flat)
    step = deflection(axis._replace(value=axis.value + 1), zone) - deflection(axis, zone)
    assert 0.0 <= step <= 1 / half / (1 - MAX_DEAD_ZONE) + 1e-9


@given(axes, zones)
def test_left_and_right_are_alike(axis: Axis, zone: float) -> None:
    mirrored = axis._replace(value=axis.minimum + axis.maximum - axis.value)
    assert deflection(mirrored, zone) == pytest.approx(-deflection(axis, zone), abs=1e-6)


def test_a_driver_that_names_more_noise_than_the_dead_zone_gets_more() -> None:
    axis = Axis(300, -1000, 1000, flat=300)
    assert deflection(axis, 0.1) == 0.0
    assert deflection(axis._replace(value=301), 0.1) == pytest.approx(1 / 700)


def test_a_driver_cannot_call_more_than_half_of_the_stick_noise() -> None:
    assert deflection(Axis(501, -1000, 1000, flat=999), 0.1) > 0.0


@pytest.mark.parametrize("axis", [Axis(5, 0, 0), Axis(5, 10, -10)])
def test_a_range_that_is_none_is_a_centred_axis(axis: Axis) -> None:
    assert deflection(axis, 0.1) == 0.0


@pytest.mark.parametrize("value", [127, 128])
def test_an_axis_of_8_bits_rests_beside_its_centre(value: int) -> None:
    assert deflection(Axis(value, 0, 255), 0.02) == 0.0


# --- directions

FULL = Velocity(MAX_LINEAR_M_S / 2, 0.0)


def test_pushed_forward_and_to_the_left_it_drives_forward_and_turns_to_the_left() -> None:
    assert driving(y=UP, x=LEFT).velocity(ARMED_S) == (MAX_LINEAR_M_S / 2, MAX_ANGULAR_RAD_S / 2)
    assert driving(y=DOWN, x=-LEFT).velocity(ARMED_S) == (-MAX_LINEAR_M_S / 2, -MAX_ANGULAR_RAD_S / 2)


def test_axes_may_be_the_other_way_round() -> None:
    pilot = driving(y=UP, x=LEFT)
    pilot.layout = replace(LAYOUT, section=GamepadSection(forward_inverted=False, turn_inverted=False))
    assert pilot.velocity(ARMED_S) == (-MAX_LINEAR_M_S / 2, -MAX_ANGULAR_RAD_S / 2)


def test_a_zero_has_no_sign() -> None:
    velocity = driving(y=UP).velocity(ARMED_S)
    assert math.copysign(1.0, velocity.angular_rad_s) == 1.0


def test_turbo_gives_all_of_the_limits_while_it_is_held() -> None:
    pilot = driving()
    assert tell(pilot, button(TR, 1)).linear_m_s == MAX_LINEAR_M_S
    assert tell(pilot, button(TR, 0)).linear_m_s == MAX_LINEAR_M_S / 2


def test_turbo_alone_moves_nothing() -> None:
    pilot = plugged_in()
    tell(pilot, button(TR, 1))
    assert tell(pilot, stick(Y, UP)) == NEUTRAL


def test_a_level_is_a_share_in_fifths() -> None:
    pilot: Pilot = driving()
    assert pilot.level == 5
    pilot.on_key(KeyEvent("2"), ARMED_S)
    assert pilot.level == 2
    assert pilot.velocity(ARMED_S).linear_m_s == pytest.approx(0.4 * MAX_LINEAR_M_S / 2)


# --- the dead-man button


def test_the_stick_alone_moves_nothing() -> None:
    assert tell(plugged_in(), stick(Y, UP), stick(X, LEFT)) == NEUTRAL


def test_the_dead_man_button_released_is_zero_before_the_report_is_whole() -> None:
    pilot = driving()
    pilot.take(PadEvent(*button(TL, 0)), ARMED_S)
    assert pilot.velocity(ARMED_S) == pilot.wanted() == NEUTRAL


def test_it_drives_only_from_the_end_of_a_report() -> None:
    pilot = plugged_in()
    pilot.take(PadEvent(*button(TL, 1)), ARMED_S)
    pilot.take(PadEvent(*stick(Y, UP)), ARMED_S)
    pilot.take(PadEvent(*REPORT), ARMED_S)
    assert pilot.velocity(ARMED_S) == NEUTRAL


def test_a_press_with_the_stick_pushed_moves_nothing_until_it_was_centred() -> None:
    pilot = plugged_in()
    tell(pilot, stick(Y, UP))
    assert tell(pilot, button(TL, 1)) == NEUTRAL
    assert "centre" in pilot.note
    assert tell(pilot, stick(X, LEFT)) == NEUTRAL
    tell(pilot, stick(Y, 0))
    assert tell(pilot, stick(X, 0)) == NEUTRAL
    assert tell(pilot, stick(Y, UP)) == FULL


@pytest.mark.parametrize(("before", "value"), [((TL,), 1), ((TL,), 2), ((), 2)])
def test_only_a_press_after_a_release_is_a_press(before: tuple[int, ...], value: int) -> None:
    pilot = plugged_in(*before)
    tell(pilot, button(TL, value))
    assert tell(pilot, stick(Y, UP)) == NEUTRAL


def test_a_button_held_at_the_start_counts_once_it_was_released_and_pressed_again() -> None:
    pilot = plugged_in(TL)
    assert "let go" in pilot.note
    assert tell(pilot, stick(Y, UP)) == NEUTRAL
    tell(pilot, stick(Y, 0))
    tell(pilot, button(TL, 0))
    tell(pilot, button(TL, 1))
    assert tell(pilot, stick(Y, UP)) == FULL


def test_a_button_that_the_first_report_shows_pressed_was_held_before() -> None:
    pilot = plugged_in()
    tell(pilot, button(TL, 1), at_s=math.nextafter(ARMED_S, 0))
    assert tell(pilot, stick(Y, UP)) == NEUTRAL


@pytest.mark.parametrize("first", [(), (stick(Y, UP),), (stick(X, LEFT), stick(Y, UP))])
def test_a_pad_moves_nothing_until_it_has_reported_a_centred_stick(first: tuple[Sample, ...]) -> None:
    """Before the first report, the kernel assumes that the stick is at 0."""
    pilot = plugged_in()
    tell(pilot, button(TL, 1))
    assert "move the stick" in pilot.note
    assert tell(pilot, *first) == tell(pilot, stick(Y, UP)) == NEUTRAL
    tell(pilot, stick(Y, 0), stick(X, 0))
    assert tell(pilot, stick(Y, UP)) == FULL


def test_a_pad_that_is_connected_again_must_report_its_stick_again() -> None:
    pilot = driving()
    pilot.plug_in("pad", state(), START_S)
    tell(pilot, button(TL, 1))
    assert tell(pilot, stick(Y, UP)) == NEUTRAL


def test_a_button_pressed_after_the_pad_has_settled_counts() -> None:
    pilot = reported()
    tell(pilot, button(TL, 1), at_s=ARMED_S)
    assert tell(pilot, stick(Y, UP)) == FULL


# --- what ends a hold


def press_again(pilot: Gamepad, at_s: float = ARMED_S) -> Velocity:
    """Centre the stick, release and press the button, push the stick forward."""
    tell(pilot, stick(Y, 0), stick(X, 0), at_s=at_s)
    tell(pilot, button(TL, 0), at_s=at_s)
    tell(pilot, button(TL, 1), at_s=at_s)
    return tell(pilot, stick(Y, UP), at_s=at_s)


@pytest.mark.parametrize("key", ["s", "S"])
def test_the_stop_key_ends_the_hold(key: str) -> None:
    pilot = driving()
    pilot.on_key(KeyEvent(key), ARMED_S)
    assert pilot.velocity(ARMED_S) == NEUTRAL
    assert tell(pilot, stick(Y, 0)) == tell(pilot, stick(Y, UP)) == NEUTRAL
    assert press_again(pilot) == FULL


@pytest.mark.parametrize(
    "event", [KeyEvent("s", KeyKind.RELEASE), KeyEvent("?"), KeyEvent(FOCUS_OUT), KeyEvent("5")]
)
def test_a_key_released_and_a_key_of_the_program_change_nothing(event: KeyEvent) -> None:
    pilot = driving()
    assert pilot.on_key(event, ARMED_S)
    assert pilot.velocity(ARMED_S) == FULL


@pytest.mark.parametrize("key", ["up", "^", "0", "w", PASTED])
def test_a_key_without_a_function_ends_the_hold(key: str) -> None:
    pilot = driving()
    assert not pilot.on_key(KeyEvent(key), ARMED_S)
    assert pilot.velocity(ARMED_S) == NEUTRAL
    assert press_again(pilot) == FULL


def test_letting_go_counts_before_the_stick_was_centred_too() -> None:
    pilot = plugged_in(y=UP)
    tell(pilot, button(TL, 1))
    pilot.let_go()
    tell(pilot, stick(Y, 0))
    assert tell(pilot, stick(Y, UP)) == NEUTRAL


@pytest.mark.parametrize("phase", [Phase.ABSENT, Phase.READY])
def test_letting_go_of_nothing_changes_nothing(phase: Phase) -> None:
    pilot = Gamepad(LAYOUT) if phase is Phase.ABSENT else plugged_in()
    pilot.let_go()
    assert pilot.phase is phase


def test_an_unplugged_pad_is_neutral_and_says_so() -> None:
    pilot = driving()
    pilot.unplug("gamepad unplugged")
    assert pilot.velocity(ARMED_S) == NEUTRAL
    assert pilot.note == "stopped: gamepad unplugged"
    assert press_again(pilot) == NEUTRAL


def test_plugged_in_again_with_everything_held_it_moves_nothing() -> None:
    pilot = driving()
    pilot.unplug("gamepad unplugged")
    pilot.plug_in("pad", state(TL, y=UP), START_S)
    assert pilot.velocity(ARMED_S) == NEUTRAL
    assert tell(pilot, stick(Y, 0)) == tell(pilot, stick(Y, UP)) == NEUTRAL
    assert press_again(pilot) == FULL


def test_lost_events_stop_it_and_what_follows_is_ignored_until_the_state_is_known() -> None:
    pilot = driving()
    pilot.take(PadEvent(*DROPPED), ARMED_S)
    assert pilot.needs_state
    assert pilot.velocity(ARMED_S) == NEUTRAL
    assert press_again(pilot) == NEUTRAL
    pilot.resync(state())
    assert not pilot.needs_state
    assert press_again(pilot) == FULL


def test_a_button_still_held_after_lost_events_may_have_been_released_among_them() -> None:
    pilot = driving()
    pilot.take(PadEvent(*DROPPED), ARMED_S)
    pilot.resync(state(TL))
    assert "events were lost" in pilot.note
    assert tell(pilot, stick(Y, UP)) == NEUTRAL
    assert press_again(pilot) == FULL


# --- silence


def test_a_pad_that_is_silent_for_its_limit_while_driving_is_taken_for_lost() -> None:
    pilot = driving()
    assert pilot.next_s == ARMED_S + SILENCE_S
    assert pilot.velocity(math.nextafter(pilot.next_s, 0)) == FULL
    assert pilot.velocity(ARMED_S + SILENCE_S) == NEUTRAL
    assert "nothing heard from it for 2.0 s" in pilot.note
    assert press_again(pilot, ARMED_S + SILENCE_S) == FULL


def test_an_event_that_comes_after_the_limit_does_not_make_up_for_the_silence() -> None:
    assert tell(driving(), stick(Y, UP), at_s=ARMED_S + SILENCE_S) == NEUTRAL


def test_any_event_is_a_sign_of_life() -> None:
    pilot = driving()
    later_s = ARMED_S + 0.9 * SILENCE_S
    tell(pilot, (4, 4, 1), (3, 40, 7), (1, 999, 1), at_s=later_s)  # MSC_SCAN, an axis and a key of no meaning
    assert pilot.next_s == later_s + SILENCE_S


def test_a_pad_may_be_silent_for_ever_while_it_asks_for_nothing() -> None:
    pilot = reported()
    tell(pilot, button(TL, 1))
    assert pilot.next_s == math.inf
    assert tell(pilot, stick(Y, UP), at_s=ARMED_S + 1000) == FULL


def test_a_pad_with_a_pulse_may_keep_its_stick_still() -> None:
    pilot = driving()
    pilot.pulse(ARMED_S)
    for tenth in range(1, 100):
        pilot.pulse(ARMED_S + tenth / 10)
        assert pilot.velocity(ARMED_S + tenth / 10) == FULL


def test_a_pulse_that_ends_stops_it_although_the_stick_still_talks() -> None:
    pilot = driving()
    pilot.pulse(ARMED_S)
    assert tell(pilot, stick(Y, UP), at_s=ARMED_S + 0.9 * PULSE_S) == FULL
    assert pilot.velocity(ARMED_S + PULSE_S) == NEUTRAL
    assert press_again(pilot, ARMED_S + 1) == NEUTRAL
    pilot.pulse(ARMED_S + 1)
    assert press_again(pilot, ARMED_S + 1) == FULL


def test_a_pulse_that_comes_too_late_does_not_make_up_for_the_gap() -> None:
    pilot = driving()
    pilot.pulse(ARMED_S)
    pilot.pulse(ARMED_S + PULSE_S)
    assert pilot.velocity(ARMED_S + PULSE_S) == NEUTRAL


def test_another_pad_need_not_have_the_pulse_of_the_last() -> None:
    pilot = driving()
    pilot.pulse(ARMED_S)
    pilot.plug_in("another", state(), ARMED_S + 10)
    assert press_again(pilot, ARMED_S + 11) == FULL


# --- any history

samples = st.one_of(
    st.tuples(st.just(1), st.sampled_from([TL, TR, 304]), st.sampled_from([0, 1, 2])),
    st.tuples(st.just(3), st.sampled_from([X, Y, 2]), st.integers(-2000, 2000) | st.sampled_from([0, -1000])),
    st.just(REPORT),
    st.just(DROPPED),
)
deeds = st.one_of(
    samples,
    st.tuples(st.just("plug_in"), st.booleans(), st.integers(-1000, 1000)),
    st.tuples(st.just("resync"), st.booleans(), st.integers(-1000, 1000)),
    st.tuples(st.sampled_from(["unplug", "let_go", "s", "pulse"])),
    st.tuples(st.just("wait"), st.floats(0, 3)),
)


@dataclass
class Onlooker:
    """The state of the button, as an observer knows it."""

    held: bool = True
    """It was pressed after the last doubt, and not released since."""
    was_up: bool = True
    """It was seen or reported released since the last doubt."""

    def doubt(self, *, was_up: bool) -> None:
        self.held, self.was_up = False, was_up

    def see(self, value: int) -> None:
        self.held, self.was_up = (value == 1 and self.was_up), (value == 0 or self.was_up)


def tell_of(pilot: Gamepad, sample: Sample, onlooker: Onlooker, now_s: float) -> None:
    hears = pilot.phase not in (Phase.ABSENT, Phase.LOST)
    pilot.take(PadEvent(*sample), now_s)
    if sample == DROPPED:
        onlooker.doubt(was_up=False)
    if hears and sample[:2] == (1, TL) and sample[2] in (0, 1):
        onlooker.see(sample[2])


def do(pilot: Gamepad, deed: tuple[object, ...], onlooker: Onlooker, now_s: float) -> None:
    match deed:
        case ("plug_in", bool(down), int(y)):
            pilot.plug_in("pad", state(*[TL] * down, y=y), now_s)
            onlooker.doubt(was_up=not down)
        case ("resync", bool(down), int(y)) if pilot.needs_state:
            pilot.resync(state(*[TL] * down, y=y))
            onlooker.doubt(was_up=not down)
        case ("unplug",):
            pilot.unplug("gone")
            onlooker.doubt(was_up=False)
        case ("let_go" | "s" as how,):
            pilot.let_go() if how == "let_go" else pilot.on_key(KeyEvent("s"), now_s)
            onlooker.doubt(was_up=onlooker.was_up and not onlooker.held)
        case ("pulse",):
            pilot.pulse(now_s)
        case (int(kind), int(code), int(value)):
            tell_of(pilot, (kind, code, value), onlooker, now_s)
        case _:
            pass


@given(st.lists(deeds, max_size=60))
def test_in_any_history_it_moves_only_while_the_button_is_held_and_within_the_limits(
    history: Iterable[tuple[object, ...]],
) -> None:
    pilot, onlooker, now_s = driving(), Onlooker(), ARMED_S
    for deed in history:
        if deed[0] == "wait":
            now_s += cast("float", deed[1])
        do(pilot, deed, onlooker, now_s)
        velocity = pilot.velocity(now_s)
        assert velocity == pilot.wanted()
        assert onlooker.held or velocity == NEUTRAL
        assert abs(velocity.linear_m_s) <= MAX_LINEAR_M_S
        assert abs(velocity.angular_rad_s) <= MAX_ANGULAR_RAD_S
        assert now_s < pilot.next_s
        assert pilot.note


# --- a drive on two pads

Moment = tuple[float, float, float]
DRIVE: list[Moment] = [
    (0.9, 0.0, 0.0),
    (1.1, 0.0, 0.0),
    (1.4, 0.5, 0.0),
    (1.6, 1.0, 0.0),
    (1.9, 0.5, 0.0),
    (2.1, 0.5, 1.0),
    (2.3, 0.5, 0.0),
    (2.8, -0.5, 0.0),
    (3.0, 0.0, 0.0),
    (3.2, 0.0, 0.0),
    (3.5, 0.0, 0.0),
    (3.8, 0.0, 0.0),
    (4.0, 0.5, 0.0),
    (4.2, 0.0, 0.0),
]
"""Time [s] after the pad was plugged in, forward [m/s], turn [rad/s]; see gamepads/README.md."""


@pytest.mark.parametrize("name", [XBOX360, DUALSHOCK4])
def test_the_same_drive_on_two_pads_gives_the_same_velocities(name: str) -> None:
    pad = load_pad(name)
    pilot = Gamepad(LAYOUT)
    pilot.plug_in(pad.name, pad.state(), 0.0)
    events = list(pad.events)
    for time_s, forward, turn in DRIVE:
        while events and events[0][0] <= time_s:
            pilot.take(events[0][1], events[0][0])
            events.pop(0)
        assert pilot.velocity(time_s) == pytest.approx((forward, turn), abs=1e-3), time_s


@pytest.mark.parametrize("name", [XBOX360, DUALSHOCK4])
def test_wherever_a_drive_is_cut_off_it_is_over_after_the_limit(name: str) -> None:
    pad = load_pad(name)
    for count in range(len(pad.events) + 1):
        pilot = Gamepad(LAYOUT)
        pilot.plug_in(pad.name, pad.state(), 0.0)
        last_s = 0.0
        for last_s, event in pad.events[:count]:
            pilot.take(event, last_s)
        assert pilot.velocity(last_s + SILENCE_S) == NEUTRAL
