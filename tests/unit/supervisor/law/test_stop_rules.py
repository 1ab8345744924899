"""The law follows its table: on which sources each stop reason is latched, and what clears it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from supervisor.law.decision import Decision
from supervisor.law.estop_stations import Presence, StationConfig, TokenEnd
from supervisor.law.model import Command, Inputs, SourceConfig
from supervisor.law.reckoning import Velocity
from supervisor.law.stop_rules import STOP_RULES, RaisedBy, StopRule, cleared_by
from tests.unit.supervisor.law.closed_loop import World
from tests.unit.supervisor.law.law_harness import (
    BACK,
    CONFIG,
    FORWARD,
    NEUTRAL,
    TICK_S,
    Law,
    back,
    lost,
    odometry,
    on_time,
    ring,
)
from wire.freshness import Sent
from wire.reasons import StopReason

CLEAR = ring()
CORNERS = 4.0 * np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
A_ROOM = World(
    np.array([(2.0, 2.0), (-2.5, 1.5)]), np.array([0.2, 0.3]), CORNERS, np.roll(CORNERS, -1, axis=0)
)
BLIND = np.where(np.abs(np.arange(360) - 180) < 20, np.float32("nan"), CLEAR)


class Stage(Law):
    """Two sources command at every tick: `other`, and `teleop`, which the courses change or silence.

    Args:
        teleop: commanded by `teleop` after arming.
        other: commanded by `other` after arming.
        first: the source with the higher priority.
        stations: the e-stop stations; each answers the challenge of the tick before while `answers` is set.
    """

    def __init__(
        self, *, teleop: Velocity, other: Velocity, first: str, stations: tuple[StationConfig, ...] = ()
    ) -> None:
        self.first: dict[StopReason, set[str]] = {}
        self.teleop: Velocity | None = NEUTRAL
        self.other, self.speaks = NEUTRAL, True
        sources = tuple(SourceConfig(name, 100 if name == first else 10) for name in ("teleop", "other"))
        self.answers, self.ticks = True, 0
        self.unrecorded = False
        super().__init__(replace(CONFIG, sources=sources, estop_stations=stations))
        self.go(2 + len(stations))
        self.first.clear()
        self.teleop, self.other = teleop, other
        self.go(2)
        assert self.decision.output == FORWARD
        assert not self.first

    def go(self, ticks: int = 1, **inputs: object) -> None:
        for _ in range(ticks):
            self.now_s += TICK_S
            self.ticks += 1
            if self.config.estop_stations and self.answers:
                inputs |= {"station_challenge": self.ticks, "presences": self.presences()}
            inputs["estop_unrecorded"] = self.unrecorded
            commands = [on_time("other", self.other, self.now_s)]
            if self.speaks:
                commands.append(on_time("teleop", self.teleop, self.now_s))
            self.step(Inputs(commands=tuple(commands), **inputs))  # type: ignore[arg-type]

    def presences(self) -> tuple[Presence, ...]:
        return tuple(
            Presence(station.name, 9, self.ticks - 1, stop=False, leaves=False)
            for station in self.config.estop_stations
        )

    def step(self, inputs: Inputs | None = None) -> Decision:
        decision = super().step(inputs)
        for reason in StopReason:
            if latched := self.latched(reason):
                self.first.setdefault(reason, latched)
        return decision

    def latched(self, reason: StopReason) -> set[str]:
        """The sources on which it is latched."""
        return {source.config.name for source in self.decision.sources if reason in source.latched}


# --- what happens


def press(law: Stage) -> None:
    law.go(estop=True)


def reset(law: Stage) -> None:
    law.teleop = NEUTRAL
    law.go()
    law.speaks = False
    law.go(reset=True)
    law.go()


def lose_station(law: Stage) -> None:
    law.answers = False
    law.go(station_ends=(TokenEnd("door"),))


def find_station_and_reset(law: Stage) -> None:
    law.answers = True
    law.go(3)
    reset(law)


def fill_the_disk(law: Stage) -> None:
    law.unrecorded = True
    law.go()


def free_the_disk(law: Stage) -> None:
    law.unrecorded = False
    law.go()


def run_away(law: Stage) -> None:
    law.teleop = NEUTRAL
    while not law.latched(StopReason.BASE_RUNAWAY):
        law.go(odometry=odometry(0.4, law.now_s + TICK_S))


def halt(law: Stage) -> None:
    law.teleop = FORWARD
    law.go(odometry=odometry(0.0, law.now_s + TICK_S))


def hang(law: Stage) -> None:
    law.now_s += 0.13
    law.go()


def two_writers(law: Stage) -> None:
    while not law.latched(StopReason.SENSOR_CONFLICT):
        law.go(odometry=odometry(0.5, law.now_s + TICK_S), odometry_writers=(b"one", b"another"))


def one_writer(law: Stage) -> None:
    for _ in range(100):
        law.go(
            odometry=odometry(law.decision.output.linear_m_s, law.now_s + TICK_S), odometry_writers=(b"one",)
        )


def see_as_if_turned(law: Stage) -> None:
    """The lidar is turned by 180 degrees against its configuration."""
    x_m = -1.0
    while not law.latched(StopReason.SENSOR_MISMATCH):
        x_m += 0.5 * TICK_S
        law.ranges = np.roll(A_ROOM.ranges(x_m, 0.0, 0.0), 180)
        law.go(odometry=odometry(0.5, law.now_s + TICK_S))


def see_as_configured(law: Stage) -> None:
    for step in range(60):
        law.ranges = A_ROOM.ranges(0.5 * TICK_S * step, 0.0, 0.0)
        law.go(odometry=odometry(0.5, law.now_s + TICK_S))
    for _ in range(200):  # it was pushed, so that it counts as rolling for a while
        law.go(odometry=odometry(0.0, law.now_s + TICK_S))


def stand_still_under_command(law: Stage) -> None:
    while not law.latched(StopReason.BASE_UNRESPONSIVE):
        law.go(odometry=odometry(0.0, law.now_s + TICK_S))


def rest(law: Stage) -> None:
    law.go(5, odometry=odometry(0.0, law.now_s + TICK_S))


def lose_odometry(law: Stage) -> None:
    law.go(odometry=odometry(0.5, law.now_s))
    while not law.latched(StopReason.ODOM_STALE):
        law.go()


def odometry_again(law: Stage) -> None:
    law.go(odometry=odometry(0.0, law.now_s + TICK_S))


def contradict(law: Stage) -> None:
    law.ranges = np.full(360, np.nan, dtype=np.float32)
    law.go(20)


def see(law: Stage) -> None:
    law.ranges, law.scanning = CLEAR, True
    law.go(2)


def stop_scanning(law: Stage) -> None:
    law.scanning = False
    law.go(20)


def vanish(law: Stage) -> None:
    law.speaks = False
    law.go(liveliness=lost())


def return_(law: Stage) -> None:
    law.speaks = True
    law.go(liveliness=back())


def garble(law: Stage) -> None:
    law.teleop = None
    law.go()


def speak(law: Stage) -> None:
    law.speaks, law.teleop = True, FORWARD
    law.go(2)


def replay(law: Stage) -> None:
    law.speaks = False
    for _ in range(40):
        law.now_s += TICK_S
        sent = Sent(b"teleop", 0, law.now_s)
        law.step(
            Inputs(
                commands=(on_time("other", law.other, law.now_s), Command("teleop", FORWARD, law.now_s, sent))
            )
        )


def fall_silent(law: Stage) -> None:
    law.speaks = False
    law.go(15)


def leave(law: Stage) -> None:
    law.teleop = NEUTRAL
    law.go()
    law.speaks = False
    law.go(liveliness=lost())


def come_back_driving(law: Stage) -> None:
    law.teleop, law.speaks = FORWARD, True
    law.go(liveliness=back())


def meet_something(law: Stage) -> None:
    law.ranges = ring(ahead_m=0.5)
    law.go(2)


def meet_the_unseen(law: Stage) -> None:
    law.ranges = BLIND
    law.go(20)


def drive_away(law: Stage) -> None:
    law.teleop = BACK
    law.go()


@dataclass(frozen=True)
class Course:
    """How a reason is raised, and how its cause ends without a neutral command."""

    comes: Callable[[Stage], None]
    ends: Callable[[Stage], None]


COURSES = {
    StopReason.ESTOP: Course(press, reset),
    StopReason.ESTOP_STATION_LOST: Course(lose_station, find_station_and_reset),
    StopReason.ESTOP_UNRECORDED: Course(fill_the_disk, free_the_disk),
    StopReason.BASE_RUNAWAY: Course(run_away, halt),
    StopReason.OVERRUN: Course(hang, speak),
    StopReason.SENSOR_CONFLICT: Course(two_writers, one_writer),
    StopReason.SENSOR_MISMATCH: Course(see_as_if_turned, see_as_configured),
    StopReason.BASE_UNRESPONSIVE: Course(stand_still_under_command, rest),
    StopReason.ODOM_STALE: Course(lose_odometry, odometry_again),
    StopReason.SCAN_INVALID: Course(contradict, see),
    StopReason.SCAN_STALE: Course(stop_scanning, see),
    StopReason.SOURCE_LOST: Course(vanish, return_),
    StopReason.COMMAND_INVALID: Course(garble, speak),
    StopReason.COMMAND_STALE: Course(replay, speak),
    StopReason.COMMAND_TIMEOUT: Course(fall_silent, speak),
    StopReason.NO_COMMAND: Course(leave, come_back_driving),
    StopReason.SCAN_BLIND: Course(meet_the_unseen, drive_away),
    StopReason.OBSTACLE: Course(meet_something, drive_away),
}


def stage(reason: StopReason) -> Stage:
    """`teleop` drives, with an e-stop station where the reason needs one."""
    stations = (StationConfig("door", required=True),) if reason is StopReason.ESTOP_STATION_LOST else ()
    return Stage(teleop=FORWARD, other=NEUTRAL, first="teleop", stations=stations)


def test_every_reason_has_a_row_and_a_course() -> None:
    assert list(STOP_RULES) == list(StopReason)
    assert list(COURSES) == list(StopReason)


@pytest.mark.parametrize("reason", StopReason)
def test_a_stop_of_the_owner_is_latched_on_every_source_and_cleared_as_the_table_says(
    reason: StopReason,
) -> None:
    law, course = stage(reason), COURSES[reason]
    course.comes(law)
    assert law.first[reason] == {"teleop", "other"}
    # The status names the owner's own causes only, and the other live source has become the owner.
    assert STOP_RULES[reason].raised_by is RaisedBy.SOURCE or reason in law.decision.causes
    law.teleop = FORWARD
    course.ends(law)
    assert reason not in law.decision.causes
    if STOP_RULES[reason].raised_by is RaisedBy.BARRIER:
        assert not law.latched(reason)
        assert law.decision.output == BACK
        return
    assert "teleop" in law.latched(reason), "the cause has ended, and no neutral has come"
    assert law.decision.output == NEUTRAL
    law.speaks, law.teleop = True, NEUTRAL
    law.go()
    assert not law.latched(reason)


@pytest.mark.parametrize(
    "reason",
    [
        StopReason.ESTOP,
        StopReason.ESTOP_STATION_LOST,
        StopReason.ESTOP_UNRECORDED,
        StopReason.BASE_RUNAWAY,
        StopReason.SENSOR_CONFLICT,
        StopReason.ODOM_STALE,
        StopReason.SCAN_INVALID,
        StopReason.SCAN_STALE,
        StopReason.SOURCE_LOST,
    ],
)
def test_neutral_clears_nothing_while_the_cause_holds(reason: StopReason) -> None:
    """Without those reasons whose cause ends with the next step, with zero, or with a valid command."""
    law = stage(reason)
    COURSES[reason].comes(law)
    law.speaks, law.teleop = True, NEUTRAL
    law.go(2)
    assert "teleop" in law.latched(reason)


@pytest.mark.parametrize("reason", [r for r, rule in STOP_RULES.items() if rule.raised_by is RaisedBy.SOURCE])
def test_a_reason_of_a_source_that_is_not_the_owner_is_latched_on_it_alone(reason: StopReason) -> None:
    law = Stage(teleop=FORWARD, other=FORWARD, first="other")
    COURSES[reason].comes(law)
    assert law.first[reason] == {"teleop"}
    assert law.decision.output == FORWARD


def test_what_clears_a_reason_is_put_into_words() -> None:
    assert cleared_by(StopRule(RaisedBy.SOURCE, "fresh commands")) == "fresh commands; then neutral"
    assert cleared_by(StopRule(RaisedBy.BARRIER, "a turn")) == "neutral, or a turn"
