"""The leases of the e-stop stations: which is heard, which is lost, and what is latched."""

import math
import random
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supervisor.law.estop_stations import (
    Phase,
    Presence,
    Station,
    StationConfig,
    Stations,
    TokenEnd,
    detail_of,
    hear,
    refusal,
    suspended,
)
from wire.lease import CHALLENGE_PERIOD_S, LEASE_S

DOOR, GATE = StationConfig("door", required=True), StationConfig("gate", required=False)


def stations(*configs: StationConfig) -> Stations:
    return Stations(tuple(Station(config) for config in configs or (DOOR,)))


@dataclass
class Leases:
    """The supervisor's side, and stations that answer when the test says so."""

    state: Stations = field(default_factory=stations)
    now_s: float = 100.0
    number: int = 0

    def step(self, *presences: Presence, ends: tuple[TokenEnd, ...] = (), challenge: int = 0) -> Stations:
        self.state = hear(self.state, self.now_s, presences, ends, challenge)
        return self.state

    def challenge(self) -> int:
        self.number += 1
        self.step(challenge=self.number)
        return self.number

    def join(self, name: str = "door", epoch: bytes = b"A") -> Stations:
        """A challenge, and its answer a millisecond later."""
        number = self.challenge()
        self.now_s += 0.001
        return self.step(presence(name, number, epoch=epoch))

    def phase(self, name: str = "door") -> Phase:
        return self.station(name).phase

    def station(self, name: str = "door") -> Station:
        return next(one for one in self.state.stations if one.config.name == name)


def presence(
    name: str = "door", response: int = 0, *, stop: bool = False, leaves: bool = False, epoch: bytes = b"A"
) -> Presence:
    return Presence(name, 1000 + response, response, stop, leaves, epoch)


# --- heard


def test_a_required_station_is_missing_until_it_answers_a_challenge_and_no_loss_is_latched() -> None:
    law = Leases()
    law.step()
    assert (law.phase(), law.state.missing, law.state.latched) == (Phase.UNHEARD, ("door",), False)
    law.join()
    assert (law.phase(), law.state.missing, law.state.latched) == (Phase.HEARD, (), False)
    assert (law.station().epoch, law.station().challenge) == (b"A", 1001)


def test_a_presence_that_answers_no_challenge_proves_nothing() -> None:
    law = Leases()
    law.challenge()
    for response in (0, 99):
        law.step(presence(response=response))
        assert law.phase() is Phase.UNHEARD


def test_a_presence_of_an_unknown_station_has_no_effect() -> None:
    law = Leases()
    number = law.challenge()
    law.step(presence("window", number), ends=(TokenEnd("window"),))
    assert law.phase() is Phase.UNHEARD


def test_an_answer_counts_until_the_lease_of_its_challenge_ends_and_not_just_after() -> None:
    for now_s, phase in ((LEASE_S, Phase.HEARD), (math.nextafter(LEASE_S, 1.0), Phase.UNHEARD)):
        law = Leases(now_s=0.0)
        number = law.challenge()
        law.now_s = now_s
        law.step(presence(response=number))
        assert law.phase() is phase
        assert not law.state.latched


def test_a_station_is_lost_just_after_the_lease_of_the_newest_challenge_that_it_answered() -> None:
    law = Leases(now_s=0.0)
    law.join()
    law.now_s = LEASE_S
    law.step()
    assert (law.phase(), law.state.expires_s) == (Phase.HEARD, LEASE_S)
    law.now_s = math.nextafter(LEASE_S, 1.0)
    law.step()
    assert (law.phase(), law.state.latched, law.state.missing) == (Phase.LOST, True, ("door",))
    assert (law.station().ended_s, law.station().challenge) == (law.now_s, 0)


def test_the_delay_of_an_answer_does_not_extend_the_lease() -> None:
    law = Leases(now_s=0.0)
    number = law.challenge()
    law.now_s = 0.2
    law.step(presence(response=number))
    assert law.state.expires_s == LEASE_S


def test_an_answer_to_an_older_challenge_does_not_shorten_the_lease() -> None:
    law = Leases(now_s=0.0)
    first = law.challenge()
    law.now_s = 0.1
    second = law.challenge()
    law.step(presence(response=second), presence(response=first))
    assert law.state.expires_s == 0.1 + LEASE_S


def test_a_replay_of_its_messages_does_not_keep_a_station_heard() -> None:
    law, recorded = Leases(), list[Presence]()
    for _ in range(20):
        number = law.challenge()
        recorded.append(presence(response=number))
        law.step(recorded[-1])
        law.now_s += 0.05
    for one in recorded * 2:
        law.challenge()
        law.step(one)
        law.now_s += 0.05
    assert law.phase() is Phase.LOST


def test_a_second_run_gets_the_lease_only_after_the_first_is_lost() -> None:
    law = Leases()
    law.join()
    number = law.challenge()
    law.step(presence(response=number, epoch=b"B"))
    assert law.station().epoch == b"A"
    law.step(ends=(TokenEnd("door", b"A"),))
    law.now_s += 0.01
    law.join(epoch=b"B")
    assert (law.phase(), law.station().epoch) == (Phase.HEARD, b"B")


# --- lost


@pytest.mark.parametrize("epoch", [b"", b"A"])
def test_the_end_of_its_token_or_of_that_of_its_run_ends_the_lease_at_once(epoch: bytes) -> None:
    law = Leases()
    law.join()
    law.step(ends=(TokenEnd("door", epoch),))
    assert (law.phase(), law.state.latched) == (Phase.LOST, True)


def test_the_end_of_another_runs_token_changes_nothing() -> None:
    law = Leases()
    law.join()
    law.step(ends=(TokenEnd("door", b"B"),))
    assert law.phase() is Phase.HEARD


def test_the_end_of_a_token_counts_after_the_messages_of_the_same_step() -> None:
    law = Leases()
    number = law.challenge()
    law.now_s += 0.01
    law.step(presence(response=number), ends=(TokenEnd("door"),))
    assert (law.phase(), law.state.latched) == (Phase.LOST, True)


def test_the_end_of_the_token_of_a_station_that_was_not_heard_latches_nothing() -> None:
    law = Leases()
    law.step(ends=(TokenEnd("door"),))
    assert (law.phase(), law.state.latched) == (Phase.UNHEARD, False)


def test_only_the_answer_to_a_challenge_from_after_the_loss_proves_that_it_is_back() -> None:
    law = Leases()
    law.join()
    before = law.challenge()
    law.step(ends=(TokenEnd("door"),), challenge=77)
    law.step(presence(response=before))
    law.step(presence(response=77))
    assert law.phase() is Phase.LOST, "both were issued before the loss was noticed, or with it"
    law.now_s += 0.001
    law.join()
    assert law.phase() is Phase.HEARD
    assert law.state.latched, "the station is back, and no reset has come"


def test_a_lost_station_that_is_not_required_stops_nothing() -> None:
    law = Leases(stations(DOOR, GATE))
    law.join("door")
    law.join("gate")
    law.step(ends=(TokenEnd("gate"),))
    assert law.phase("gate") is Phase.LOST
    assert (law.state.missing, law.state.latched) == ((), False)


def test_one_of_two_lost_stations_that_is_back_leaves_the_other_missing() -> None:
    law = Leases(stations(DOOR, StationConfig("hall", required=True)))
    law.join("door")
    law.join("hall")
    law.step(ends=(TokenEnd("door"), TokenEnd("hall")))
    law.now_s += 0.01
    law.join("door")
    assert law.state.missing == ("hall",)
    assert refusal(law.state) == "the required e-stop station hall is not heard: start it first"


# --- leaving


def test_a_required_station_that_leaves_stops_the_robot_and_latches() -> None:
    law = Leases()
    law.join()
    law.now_s += 0.01
    number = law.challenge()
    law.now_s += 0.01
    law.step(presence(response=number, leaves=True))
    assert (law.phase(), law.state.missing, law.state.latched) == (Phase.LEFT, ("door",), True)
    law.step(ends=(TokenEnd("door"),))
    assert law.phase() is Phase.LEFT, "its token ends after it has left"


def test_an_unproven_goodbye_has_no_effect() -> None:
    law = Leases()
    law.join()
    law.step(presence(response=99, leaves=True))
    assert law.phase() is Phase.HEARD


def test_a_late_message_of_a_station_that_has_left_does_not_bring_it_back() -> None:
    law = Leases(stations(GATE))
    law.join("gate")
    number = law.challenge()
    law.now_s += 0.01
    law.step(presence("gate", number, leaves=True))
    law.step(presence("gate", number))
    assert law.phase("gate") is Phase.LEFT
    law.now_s += 1.0
    law.step()
    assert law.phase("gate") is Phase.LEFT


# --- pressed


def test_a_press_counts_without_a_proof_and_its_release_only_with_one() -> None:
    law = Leases()
    law.join()
    law.step(presence(response=99, stop=True))
    assert law.state.pressed == ("door",)
    law.step(presence(response=99))
    assert law.state.pressed == ("door",)
    law.join()
    assert law.state.pressed == ()


def test_a_press_remains_until_the_message_without_it_and_a_reset_is_refused_meanwhile() -> None:
    law = Leases(stations(DOOR, GATE))
    law.join()
    law.join("gate")
    number = law.challenge()
    law.step(presence(response=number, stop=True))
    assert refusal(law.state) == "the e-stop station door is pressed: release it there first"
    law.step(presence("gate", number, stop=True))
    assert refusal(law.state) == "the e-stop station door and gate is pressed: release it there first"
    law.step(presence(response=number), presence("gate", number))
    assert refusal(law.state) is None


def test_a_lost_station_that_is_not_required_does_not_refuse_a_reset_even_if_it_was_pressed() -> None:
    law = Leases(stations(GATE))
    law.join("gate")
    law.step(presence("gate", law.challenge(), stop=True))
    assert law.state.pressed == ("gate",)
    law.step(ends=(TokenEnd("gate"),))
    assert law.state.pressed == ()
    assert refusal(law.state) is None


@pytest.mark.parametrize("stop", [False, True])
def test_a_goodbye_has_the_state_of_the_button_too(stop: bool) -> None:  # noqa: FBT001 - a parameter of the test
    law = Leases()
    law.join()
    law.step(presence(response=99, stop=True))
    law.now_s += 0.01
    number = law.challenge()
    law.now_s += 0.01
    law.step(presence(response=number, leaves=True, stop=stop))
    assert law.station().pressed is stop


# --- suspend, and words


def test_a_lease_goes_on_while_the_machine_is_suspended() -> None:
    law = Leases()
    law.join()
    number = law.challenge()
    law.state = suspended(law.state, 10.0)
    law.step(presence(response=number))
    assert (law.phase(), law.state.latched) == (Phase.LOST, True)


def test_a_suspend_that_is_shorter_than_the_lease_shortens_it() -> None:
    law = Leases(now_s=0.0)
    law.join()
    law.state = suspended(law.state, 0.25)
    assert law.state.expires_s == pytest.approx(LEASE_S - 0.25)
    assert law.state.challenges[0].issued_s == -0.25


def test_the_detail_names_each_station_that_is_pressed_or_missing() -> None:
    names = ("a", "b", "c", "d", "e")
    law = Leases(stations(*(StationConfig(name, required=True) for name in names), GATE))
    for name in ("b", "c", "d"):
        law.join(name)
    law.now_s += 0.01
    number = law.challenge()
    law.now_s += 0.01
    law.step(presence("c", number, leaves=True), presence("d", number, stop=True), ends=(TokenEnd("b"),))
    assert (
        detail_of(law.state)
        == "d is pressed; a was not heard yet; b is silent; c has left; e was not heard yet"
    )
    assert detail_of(stations(GATE)) == ""
    assert refusal(stations(DOOR, StationConfig("hall", required=True))) == (
        "the required e-stop station door and hall is not heard: start it first"
    )


def test_only_a_heard_required_station_has_a_lease_that_expires() -> None:
    law = Leases(stations(DOOR, GATE))
    assert law.state.expires_s == math.inf
    law.join("gate")
    assert law.state.expires_s == math.inf
    law.join("door")
    assert law.state.expires_s < math.inf
    law.step(ends=(TokenEnd("door"),))
    assert law.state.expires_s == math.inf


# --- false stops


@pytest.mark.parametrize(
    ("loss", "round_trip_s", "most"), [(0.02, 0.02, 0), (0.05, 0.02, 2), (0.05, 0.1, 60)]
)
def test_a_link_that_loses_messages_seldom_ends_a_lease(loss: float, round_trip_s: float, most: int) -> None:
    """One station for an hour, its link losing this share of the messages in each direction."""
    chance, law, false_stops = random.Random(1), Leases(now_s=0.0), 0
    waiting: list[tuple[float, int]] = []
    while law.now_s < 3600.0:
        due = [number for arrival_s, number in waiting if arrival_s <= law.now_s]
        waiting = waiting[len(due) :]
        before = law.phase()
        law.number += 1
        law.step(*(presence(response=number) for number in due), challenge=law.number)
        false_stops += before is Phase.HEARD and law.phase() is Phase.LOST
        if chance.random() < (1.0 - loss) ** 2:
            waiting.append((law.now_s + round_trip_s, law.number))
        law.now_s += CHALLENGE_PERIOD_S
    print(
        f"\n    measured: {false_stops} false stops in an hour at {loss:.0%} loss, round trip {round_trip_s} s"
    )
    assert law.phase() is Phase.HEARD
    assert false_stops <= most


# --- at random

EVENTS = st.one_of(
    st.tuples(st.just("wait"), st.floats(0.0, 0.2)),
    st.tuples(st.just("challenge"), st.just(0.0)),
    st.tuples(st.sampled_from(["answer", "leave", "press"]), st.integers(0, 12).map(float)),
    st.tuples(st.just("end"), st.sampled_from([0.0, 1.0])),
)


@given(st.lists(EVENTS, max_size=60))
def test_a_heard_station_has_answered_a_challenge_within_the_lease_and_each_loss_is_latched(
    events: list[tuple[str, float]],
) -> None:
    """Against an oracle that knows all challenges and all answers, and nothing of phases."""
    law = Leases(now_s=0.0)
    issued_s: dict[int, float] = {}
    answered: list[float] = []
    was_heard = False
    for kind, value in events:
        number = int(value)
        match kind:
            case "wait":
                law.now_s += value
                law.step()
            case "challenge":
                issued_s[law.challenge()] = law.now_s
            case "end":
                law.step(ends=(TokenEnd("door", b"A" if number else b"B"),))
            case _:
                law.step(presence(response=number, leaves=kind == "leave", stop=kind == "press"))
                if number in issued_s and kind != "leave":
                    answered.append(issued_s[number])
        is_heard = law.phase() is Phase.HEARD
        if is_heard:
            assert law.now_s - max(answered) <= LEASE_S
            assert law.state.expires_s >= law.now_s
        assert (law.state.missing == ()) == is_heard
        if was_heard and not is_heard:
            assert law.state.latched
        was_heard = is_heard
