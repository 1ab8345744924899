"""The monitors: each at its boundary, over drives of the law, and over traces that are broken in one place."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faults.simulated.rules import RuleJudge
from faults.trial import BrokenPromise
from recordings.judge.monitors import (
    GRACE_S,
    MAX_VIOLATIONS,
    Estop,
    Event,
    FreshCommand,
    Monitor,
    Monitors,
    Motion,
    NeutralFirst,
    Output,
    Pressed,
    Released,
    Request,
    SameStep,
    Step,
)
from recordings.judge.own import events_of_step
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs
from supervisor.law.reckoning import Velocity
from supervisor.law.state import State
from tests.unit.supervisor.blackbox.black_boxes import Drive
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, on_time

TIMEOUT_S = CONFIG.command_timeout_s


def step(
    time_s: float, *, moves: bool = False, causes: str = "", latched: str = "", owner: str = "teleop"
) -> Step:
    now, over = frozenset(causes.split()), frozenset(latched.split())
    return Step(time_s, moves, now, now | over, owner)


def ask(time_s: float, *, neutral: bool = False, source: str = "teleop") -> Request:
    return Request(time_s, source, neutral)


def broken(monitor: Monitor, *events: Event) -> int:
    for event in events:
        monitor.hear(event)
    verdict = monitor.verdict()
    assert verdict.is_judged, verdict.why_not
    return verdict.broken


# --- a stop reason ⇒ zero in the same step


@pytest.mark.parametrize("reason", ["SCAN_STALE", "ESTOP", "COMMAND_TIMEOUT", "A_REASON_OF_A_LATER_VERSION"])
def test_motion_in_the_step_of_a_cause_breaks_the_rule(reason: str) -> None:
    assert broken(SameStep(), step(1.0, causes=reason)) == 0
    assert broken(SameStep(), step(1.0, causes=reason, moves=True)) == 1


def test_motion_with_a_latched_reason_breaks_the_rule() -> None:
    assert broken(SameStep(), step(1.0, latched="OBSTACLE", moves=True)) == 1


def test_an_obstacle_or_a_limit_that_only_slows_the_robot_down_breaks_nothing() -> None:
    for name in ("OBSTACLE", "SCAN_BLIND", "COMMAND_AGE", "BASE_WEAK"):
        monitor = SameStep()
        monitor.hear(Step(1.0, True, frozenset({name}), frozenset(), "teleop"))  # noqa: FBT003
        assert monitor.verdict().broken == 0


def test_a_command_to_the_base_between_two_steps_of_a_stop_breaks_the_rule() -> None:
    before, moves, after = step(1.0, causes="ESTOP"), Output(1.2, moves=True), step(1.4, causes="ESTOP")
    assert broken(SameStep(0.1), before, moves, after) == 1
    assert broken(SameStep(0.1), before, Output(1.2, moves=False), after) == 0
    assert broken(SameStep(0.1), before, Output(1.05, moves=True), after) == 0
    assert broken(SameStep(0.1), before, moves, step(1.25, causes="ESTOP"), step(1.3)) == 0
    assert broken(SameStep(0.1), before, moves, step(1.3)) == 0


def test_after_a_pause_the_past_is_unknown() -> None:
    monitors = Monitors(TIMEOUT_S)
    for event in (
        ask(1.0, neutral=True),
        step(1.0, causes="OVERRUN"),
        Pressed(1.0),
        step(1.1, causes="ESTOP"),
    ):
        assert monitors.hear(event) == []
    monitors.forget()
    for event in (step(60.0, moves=True), Output(60.0, moves=True), Motion(60.0, 0.5)):
        assert monitors.hear(event) == []


def test_one_occasion_counts_once_however_long_it_lasts() -> None:
    moving = [step(0.02 * k, causes="ESTOP", moves=True) for k in range(100)]
    assert broken(SameStep(), *moving, step(3.0, causes="ESTOP"), *moving) == 2


def test_of_many_violations_the_first_are_kept_and_all_are_counted() -> None:
    monitor = SameStep()
    for k in range(3 * MAX_VIOLATIONS):
        monitor.hear(step(k, causes="ESTOP", moves=k % 2 == 0))
    verdict = monitor.verdict()
    assert len(verdict.violations) == MAX_VIOLATIONS
    assert verdict.broken == 3 * MAX_VIOLATIONS / 2


# --- motion ⇒ no cause since the last neutral command


def test_motion_after_a_stop_needs_a_neutral_command_that_is_later_than_the_cause() -> None:
    cause, moves = step(1.0, causes="SCAN_STALE"), step(2.0, moves=True)
    assert broken(NeutralFirst(), ask(0.9, neutral=True), cause, ask(1.5), moves) == 1
    assert broken(NeutralFirst(), cause, ask(1.0, neutral=True), ask(1.5), moves) == 1
    assert broken(NeutralFirst(), cause, ask(math.nextafter(1.0, 2.0), neutral=True), moves) == 0


def test_a_neutral_command_of_another_source_does_not_count() -> None:
    stopped, other = step(1.0, causes="OVERRUN"), ask(1.5, neutral=True, source="joy")
    assert broken(NeutralFirst(), stopped, other, ask(1.6), step(2.0, moves=True)) == 1
    assert broken(NeutralFirst(), stopped, other, step(2.0, moves=True, owner="joy")) == 0


def test_a_source_that_dies_while_it_drives_stops_every_source_and_at_rest_only_itself() -> None:
    dies, joy = step(1.0, causes="SOURCE_LOST"), step(2.0, moves=True, owner="joy")
    assert broken(NeutralFirst(), ask(0.5), step(0.98, moves=True), dies, joy) == 1
    at_rest = NeutralFirst()
    for event in (ask(0.5), step(0.98), dies, joy):
        at_rest.hear(event)
    assert at_rest.verdict().broken == 0


def test_a_stop_by_the_barrier_ends_without_a_neutral_command() -> None:
    monitor = NeutralFirst()
    for event in (ask(0.5), step(1.0, causes="OBSTACLE"), step(2.0, moves=True)):
        monitor.hear(event)
    assert monitor.verdict().why_not == "no motion after a stop was recorded"


def test_what_happened_before_the_recording_breaks_nothing() -> None:
    first = NeutralFirst()
    for event in (ask(0.0), step(0.0, moves=True)):
        first.hear(event)
    assert first.verdict().broken == 0
    assert broken(FreshCommand(), ask(0.0), step(0.1, moves=True)) == 0


def test_events_of_different_topics_may_be_recorded_out_of_order_by_the_leeway() -> None:
    events = (ask(0.95, neutral=True), step(1.0, causes="OVERRUN"), step(1.1, moves=True))
    assert broken(NeutralFirst(), *events) == 1
    assert broken(NeutralFirst(0.1), *events) == 0


# --- e-stop ⇒ zero until a reset


def test_after_an_estop_any_motion_before_the_reset_breaks_the_rule() -> None:
    for moving in (step(1.0, moves=True), step(9.0, moves=True), Output(9.0, moves=True)):
        assert broken(Estop(), step(0.0), Pressed(1.0), step(1.0), moving) == 1
    assert broken(Estop(), Pressed(1.0), step(1.0), Released(2.0), step(2.0, moves=True)) == 0


def test_a_second_press_needs_another_reset() -> None:
    events = (Pressed(1.0), step(1.0), Released(2.0), Pressed(3.0), step(3.0), step(4.0, moves=True))
    assert broken(Estop(), *events) == 1


def test_without_an_estop_its_rule_is_not_judged() -> None:
    monitor = Estop()
    monitor.hear(step(1.0, moves=True))
    assert monitor.verdict().why_not == "no e-stop was recorded"


# --- motion ⇒ a fresh command


def test_a_command_is_fresh_up_to_its_timeout_and_not_beyond() -> None:
    def at(age_s: float) -> int:
        return broken(FreshCommand(0.0, TIMEOUT_S), ask(1.0), step(1.0 + age_s, moves=True))

    assert at(TIMEOUT_S) == 0
    assert at(TIMEOUT_S + 1e-5) == 1


def test_the_command_must_be_that_of_the_source_that_drives() -> None:
    events = (ask(0.0), ask(1.0, source="joy"), step(1.1, moves=True))
    assert broken(FreshCommand(0.0, TIMEOUT_S), *events) == 1


def test_a_base_without_a_supervisor_has_the_time_to_brake() -> None:
    limit_s = TIMEOUT_S + 0.6 / 1.5 + GRACE_S

    def at(age_s: float, *before: Event) -> int:
        return broken(FreshCommand(0.0, TIMEOUT_S, 1.5), ask(1.0), *before, Motion(1.0 + age_s, 0.6))

    assert at(limit_s) == 0
    assert at(limit_s + 1e-5) == 1
    assert at(limit_s, Motion(1.0 + TIMEOUT_S, 0.5)) == 1
    assert at(limit_s + 0.5, Motion(1.0 + TIMEOUT_S, 1.5)) == 0


def test_after_an_estop_a_base_without_a_supervisor_has_the_time_to_brake() -> None:
    def at(age_s: float) -> int:
        return broken(Estop(0.0, 1.5), Motion(0.9, 0.6), Pressed(1.0), Motion(1.0 + age_s, 0.1))

    limit_s = 0.6 / 1.5 + GRACE_S
    assert at(limit_s - 1e-5) == 0
    assert at(limit_s + 1e-5) == 1
    events = (Motion(0.9, 0.6), Pressed(1.0), Motion(1.9, 0.0), Released(2.0), Motion(3.0, 0.6))
    assert broken(Estop(), *events) == 0
    assert broken(Estop(), Motion(0.9, 0.6), Pressed(1.0), Motion(3.0, 0.0)) == 0


def test_a_base_at_rest_needs_no_command() -> None:
    monitor = FreshCommand()
    for event in (ask(0.0), Motion(60.0, 0.0)):
        monitor.hear(event)
    assert monitor.verdict().why_not == "no motion was recorded"


def test_what_was_not_recorded_is_named() -> None:
    verdicts = Monitors(TIMEOUT_S).verdicts()
    assert [verdict.is_judged for verdict in verdicts] == [False] * 4
    assert verdicts[0].why_not == "no status of a supervisor; no commands"


# --- over drives of the law


@dataclass
class Steps:
    """The events of a drive."""

    events: list[Event] = field(default_factory=list[Event])

    def record(self, now_s: float, inputs: Inputs, _state: State, decision: Decision) -> None:
        self.events += events_of_step(now_s, inputs, decision)


def driven(drive: Callable[[Drive], object]) -> list[Event]:
    steps = Steps()
    drive(Drive(cast("Any", steps)))
    return steps.events


@pytest.mark.long
@given(st.integers(0, 2**20))
def test_no_drive_of_the_law_breaks_a_rule(seed: int) -> None:
    monitors = Monitors(TIMEOUT_S)
    found = [monitors.hear(event) for event in driven(lambda drive: drive.anything(2.0, seed))]
    assert [violation for violations in found for violation in violations] == []


@cache
def whole_drive() -> tuple[Event, ...]:
    """Two drives, between them a silence of the source; then an e-stop, a reset, and a third drive."""

    def drive(one: Drive) -> None:
        one.drive(0.5)
        one.hold(0.3, Velocity(0.3, 0.2))
        for _ in range(20):
            one.step(Inputs(scans=(one.scan(one.now_s + 0.02),)))
        one.drive(0.5)
        one.step(Inputs(estop=True))
        one.hold(0.3, NEUTRAL)
        one.step(Inputs(reset=True, commands=(on_time("teleop", NEUTRAL, one.now_s + 0.02),)))
        one.drive(0.5)

    return tuple(driven(drive))


def verdicts_of(events: Iterable[Event]) -> dict[str, int]:
    monitors = Monitors(TIMEOUT_S)
    for event in events:
        monitors.hear(event)
    assert all(verdict.is_judged for verdict in monitors.verdicts())
    return {verdict.rule: verdict.broken for verdict in monitors.verdicts()}


def test_the_whole_drive_keeps_every_rule_and_is_about_each() -> None:
    assert verdicts_of(whole_drive()) == dict.fromkeys(
        (NeutralFirst.rule, Estop.rule, FreshCommand.rule, SameStep.rule), 0
    )
    assert sum(isinstance(event, Step) and event.moves for event in whole_drive()) > 60


def stops() -> list[int]:
    return [k for k, event in enumerate(whole_drive()) if isinstance(event, Step) and event.reasons]


def motions() -> list[int]:
    return [k for k, event in enumerate(whole_drive()) if isinstance(event, Step) and event.moves]


@given(st.sampled_from(stops()))
def test_motion_in_any_step_of_a_stop_is_found(at: int) -> None:
    events = list(whole_drive())
    events[at] = cast("Step", events[at])._replace(moves=True)
    assert verdicts_of(events)[SameStep.rule] == 1


@given(st.sampled_from(motions()))
def test_a_motion_without_the_commands_of_its_last_timeout_is_found(at: int) -> None:
    moving = whole_drive()[at]
    since_s = moving.time_s - TIMEOUT_S - 1e-3
    events = [
        event
        for event in whole_drive()
        if not (isinstance(event, Request) and since_s <= event.time_s <= moving.time_s)
    ]
    first_s = whole_drive()[0].time_s
    is_known = since_s > first_s
    assert (verdicts_of(events)[FreshCommand.rule] > 0) == is_known


def test_each_stop_without_its_neutral_commands_is_found() -> None:
    """Each stop of the drive is followed by motion."""
    steps = [event for event in whole_drive() if isinstance(event, Step)]
    starts = [one.time_s for before, one in pairwise(steps) if one.moves and not before.moves]
    ends = [one.time_s for before, one in pairwise(steps) if before.moves and not one.moves]
    for stop_s, start_s in zip(ends, starts[1:], strict=False):
        events = [
            event
            for event in whole_drive()
            if not (isinstance(event, Request) and event.is_neutral and stop_s <= event.time_s <= start_s)
        ]
        assert verdicts_of(events)[NeutralFirst.rule] == 1, (stop_s, start_s)
    assert len(starts) == 3


def test_a_reset_that_never_happened_is_found() -> None:
    events = [event for event in whole_drive() if not isinstance(event, Released)]
    assert verdicts_of(events)[Estop.rule] == 1


# --- in the simulated campaign


def test_the_campaign_names_the_promise_that_a_step_breaks() -> None:
    found: list[BrokenPromise] = []
    judge = RuleJudge(TIMEOUT_S, found)

    class Wrong:
        """A supervisor that ignores a lost scan."""

        def record(self, now_s: float, inputs: Inputs, state: State, decision: Decision) -> None:
            if decision.reasons and now_s > 1001.0:
                decision = decision._replace(output=FORWARD)
            judge.record(now_s, inputs, state, decision)

    drive = Drive(cast("Any", Wrong()))
    drive.drive(1.0)
    assert found == []
    for _ in range(40):
        drive.step(Inputs(commands=(on_time("teleop", FORWARD, drive.now_s + 0.02),)))
    judge.close()
    assert {one.promise for one in found} == {1, 7}
    assert all(one.time_s > 1001.0 for one in found)
