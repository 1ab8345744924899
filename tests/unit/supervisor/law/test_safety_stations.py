"""The law with e-stop stations: what stops, what a reset needs, and when the permission of a lease expires."""

import math
from dataclasses import replace

import pytest

from supervisor.law.decision import Decision
from supervisor.law.estop_stations import Phase, Presence, StationConfig, TokenEnd
from supervisor.law.model import Inputs
from supervisor.law.reckoning import STANDSTILL, Velocity
from supervisor.law.safety import ROUNDING_S, runs_out_s
from tests.unit.supervisor.law.law_harness import CONFIG, FORWARD, NEUTRAL, TICK_S, Law
from wire.lease import LEASE_S
from wire.reasons import StopReason

DOOR = StationConfig("door", required=True)
LOST = StopReason.ESTOP_STATION_LOST


class Site(Law):
    """A law with stations that answer, at every tick, the challenge of the tick before, unless they are silent."""

    def __init__(self, *stations: StationConfig, estop: bool = False) -> None:
        self.silent: set[str] = set()
        self.pressed: set[str] = set()
        self.number = 0
        super().__init__(replace(CONFIG, estop_stations=stations or (DOOR,)))
        self.state = self.state._replace(interlock=self.state.interlock._replace(estop=estop))

    def go(self, velocity: Velocity = NEUTRAL, ticks: int = 1, **inputs: object) -> Decision:
        for _ in range(ticks):
            presences = tuple(
                Presence(s.name, 1, self.number, stop=s.name in self.pressed, leaves=False, epoch=b"A")
                for s in self.config.estop_stations
                if s.name not in self.silent
            )
            self.number += 1
            self.tick(("teleop", velocity), presences=presences, station_challenge=self.number, **inputs)
        return self.decision

    def start(self) -> Decision:
        self.go(ticks=3)
        return self.go(FORWARD)

    def reset(self, velocity: Velocity = NEUTRAL) -> tuple[bool, str]:
        reply = self.go(velocity, reset=True).reset_reply
        assert reply is not None
        return reply.success, reply.message


def test_a_heard_station_lets_the_robot_drive() -> None:
    assert Site().start().output == FORWARD


def test_until_its_required_station_is_heard_the_robot_stands_and_then_needs_a_neutral_and_no_reset() -> None:
    site = Site()
    site.silent.add("door")
    site.go(ticks=5)
    decision = site.go(FORWARD)
    assert decision.output == STANDSTILL
    assert decision.causes == (LOST,)
    assert decision.detail == "door was not heard yet"
    assert not site.state.interlock.is_estop_latched
    site.silent.clear()
    assert site.go(FORWARD, ticks=3).output == STANDSTILL
    assert LOST in site.decision.latched
    site.go(NEUTRAL)
    assert site.go(FORWARD).output == FORWARD


def test_a_silent_station_stops_the_robot_when_its_lease_ends_and_the_caller_knows_when() -> None:
    site = Site()
    site.start()
    proven_s = site.now_s - TICK_S  # the newest answer was to the challenge of the tick before
    site.silent.add("door")
    while site.now_s + TICK_S < proven_s + LEASE_S:
        assert site.go(FORWARD).output == FORWARD
    assert runs_out_s(site.state) == pytest.approx(
        min(proven_s + LEASE_S, site.now_s + CONFIG.command_timeout_s) + ROUNDING_S, abs=1e-9
    )
    site.now_s = runs_out_s(site.state)
    decision = site.step(Inputs())
    assert decision.output == STANDSTILL
    assert decision.causes == (LOST,)
    assert decision.detail == "door is silent"


def test_the_end_of_a_token_stops_the_robot_in_the_same_step() -> None:
    site = Site()
    site.start()
    assert site.go(FORWARD, station_ends=(TokenEnd("door", b"A"),)).output == STANDSTILL
    assert site.state.interlock.is_estop_latched
    assert not site.state.interlock.estop


def test_after_a_loss_only_the_return_of_the_station_and_a_reset_and_a_neutral_let_it_drive() -> None:
    site = Site()
    site.start()
    site.silent.add("door")
    site.go(station_ends=(TokenEnd("door"),))
    assert site.reset() == (False, "the required e-stop station door is not heard: start it first")
    site.silent.clear()
    site.go(ticks=5)
    assert site.decision.causes == (LOST,), "the station is back, and no reset has come"
    assert site.decision.detail == ""
    assert not site.reset(FORWARD)[0], "a source requests motion"
    site.go()
    assert site.reset() == (True, "the emergency stop is reset")
    assert site.go(FORWARD).output == STANDSTILL
    site.go()
    assert site.go(FORWARD).output == FORWARD


def test_a_press_latches_the_estop_and_holding_it_prevents_a_reset() -> None:
    site = Site()
    site.start()
    site.pressed.add("door")
    decision = site.go(FORWARD)
    assert (decision.output, decision.causes) == (STANDSTILL, (StopReason.ESTOP,))
    assert decision.detail == "door is pressed"
    assert site.reset() == (False, "the e-stop station door is pressed: release it there first")
    site.pressed.clear()
    site.go(ticks=2)
    assert site.decision.causes == (StopReason.ESTOP,)
    assert site.reset()[0]
    site.go(ticks=2)
    assert site.go(FORWARD).output == FORWARD


def test_a_press_without_a_proof_stops_too() -> None:
    site = Site()
    site.start()
    unproven = Presence("door", 1, 0, stop=True, leaves=False, epoch=b"B")
    decision = site.tick(("teleop", FORWARD), presences=(unproven,))
    assert (decision.output, decision.causes) == (STANDSTILL, (StopReason.ESTOP,))


def test_a_press_of_an_unheard_station_refuses_a_reset_in_the_same_step() -> None:
    site = Site(StationConfig("gate", required=False), estop=True)
    site.silent.add("gate")
    site.go(ticks=2)
    unproven = Presence("gate", 1, 0, stop=True, leaves=False)
    reply = site.tick(("teleop", NEUTRAL), presences=(unproven,), reset=True).reset_reply
    assert reply is not None
    assert (reply.success, reply.message) == (False, "the emergency stop is being pressed")
    assert site.state.interlock.estop


def test_a_station_that_is_not_required_stops_by_its_press_and_not_by_its_loss() -> None:
    site = Site(StationConfig("gate", required=False))
    site.silent.add("gate")
    assert site.start().output == FORWARD
    site.silent.clear()
    site.go(FORWARD, ticks=2)
    assert site.go(FORWARD, station_ends=(TokenEnd("gate"),)).output == FORWARD
    assert site.decision.stations[0].phase is Phase.LOST
    site.pressed.add("gate")
    assert site.go(FORWARD).output == STANDSTILL


def test_an_estop_from_before_the_start_is_not_reset_before_the_required_station_is_heard() -> None:
    site = Site(estop=True)
    site.silent.add("door")
    site.go(ticks=3)
    assert site.decision.causes == (StopReason.ESTOP, LOST)
    assert not site.reset()[0]
    site.silent.clear()
    site.go(ticks=3)
    assert site.reset()[0]


def test_after_a_suspend_the_station_counts_as_lost() -> None:
    site = Site()
    site.start()
    decision = site.go(FORWARD, suspended_s=5.0)
    assert LOST in decision.causes
    assert site.state.interlock.stations.latched


def test_a_reset_without_anything_to_reset_says_so() -> None:
    site = Site()
    site.silent.add("door")
    assert site.reset() == (True, "there was no emergency stop to reset")


def test_without_stations_nothing_is_missing_and_no_lease_expires() -> None:
    law = Law()
    law.drive()
    assert law.state.interlock.stations.expires_s == math.inf
    assert law.state.interlock.stations.missing == ()
