"""The leases of the e-stop stations: which stations are heard, and whether a loss is latched. Pure.

A station is heard while it answers challenges of this supervisor (wire/lease.py): until `LEASE_S` after the newest
challenge that it answered was issued. It is lost when that ends, or when its liveliness token is deleted. The loss of a
required station that was heard is latched until a reset. A required station that was not heard yet is no loss, but
nothing is proven either: the robot stands still until it is.

A press needs no proof: `stop` counts in every message of a station, also in one that answers nothing.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from wire.lease import LEASE_S, Challenges, issued, proven_s


@dataclass(frozen=True, slots=True)
class StationConfig:
    """Configuration of an e-stop station."""

    name: str
    required: bool


class Phase(IntEnum):
    """What is known of a station; the numbers are those of EstopStationStatus."""

    UNHEARD = 0
    HEARD = 1
    LOST = 2
    LEFT = 3


@dataclass(frozen=True, slots=True)
class Presence:
    """A message of a station."""

    station: str
    challenge: int
    response: int
    stop: bool
    leaves: bool
    epoch: bytes = b""
    """The run of the station: the gid of the attachment; empty without one."""


@dataclass(frozen=True, slots=True)
class TokenEnd:
    """A liveliness token of a station was deleted."""

    station: str
    epoch: bytes = b""
    """Of the token of one run; empty for the station's token, which other clients may hold too."""


class Station(NamedTuple):
    """State of one station."""

    config: StationConfig
    phase: Phase = Phase.UNHEARD
    proven_s: float = -math.inf
    """When the newest challenge was issued that it answered."""
    ended_s: float = -math.inf
    """When it was last lost or left: only the answer to a later challenge proves that it is back."""
    epoch: bytes = b""
    """The run that holds the lease."""
    challenge: int = 0
    """The newest challenge of that run; 0: none."""
    pressed: bool = False


class Stations(NamedTuple):
    """State of all stations."""

    stations: tuple[Station, ...] = ()
    challenges: Challenges = ()
    """Of this supervisor: one for all stations."""
    latched: bool = False
    """Whether a required station was lost and no reset has followed."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the required stations that are not heard."""
        return tuple(s.config.name for s in self.stations if s.config.required and s.phase is not Phase.HEARD)

    @property
    def pressed(self) -> tuple[str, ...]:
        """Names of the stations that are heard, and pressed."""
        return tuple(s.config.name for s in self.stations if s.phase is Phase.HEARD and s.pressed)

    @property
    def expires_s(self) -> float:
        """The time until which no heard, required station is lost if nothing arrives; infinite if there is none."""
        heard = (s for s in self.stations if s.config.required and s.phase is Phase.HEARD)
        return min((s.proven_s + LEASE_S for s in heard), default=math.inf)


def hear(
    before: Stations, now_s: float, presences: Iterable[Presence], ends: Iterable[TokenEnd], challenge: int
) -> Stations:
    """Process what was received since the last step, and return the new state.

    Args:
        before: the state after the last step.
        now_s: the present time.
        presences: messages of the stations, in order of arrival; those of unknown stations have no effect.
        ends: deleted tokens; they count after the messages, because a station's last messages come before its end.
        challenge: the number that is sent to all stations after this step; 0: none.
    """
    stations = {s.config.name: s for s in before.stations}
    latched = before.latched
    for presence in presences:
        if presence.station in stations:
            station = stations[presence.station]
            stations[presence.station] = _accept(station, presence, before.challenges, now_s)
    for end in ends:
        station = stations.get(end.station)
        if station is not None and station.phase is Phase.HEARD and end.epoch in (b"", station.epoch):
            stations[end.station] = _ended(station, Phase.LOST, now_s)
    after: list[Station] = []
    for was in before.stations:
        heard = stations[was.config.name]
        is_over = heard.phase is Phase.HEARD and now_s - heard.proven_s > LEASE_S
        station = _ended(heard, Phase.LOST, now_s) if is_over else heard
        latched |= station.config.required and station.ended_s > was.ended_s
        after.append(station)
    challenges = issued(before.challenges, challenge, now_s) if challenge else before.challenges
    return Stations(tuple(after), challenges, latched)


def _accept(station: Station, presence: Presence, challenges: Challenges, now_s: float) -> Station:
    """Process one message. Another run gets the lease only after the one that holds it is lost or has left."""
    if presence.stop:
        station = station._replace(pressed=True)
    proof_s = proven_s(challenges, presence.response)
    is_other = station.phase is Phase.HEARD and presence.epoch != station.epoch
    if proof_s <= station.ended_s or now_s - proof_s > LEASE_S or is_other:
        return station
    if presence.leaves:
        return _ended(station._replace(pressed=presence.stop), Phase.LEFT, now_s)
    return station._replace(
        phase=Phase.HEARD,
        proven_s=max(station.proven_s, proof_s),
        epoch=presence.epoch,
        challenge=presence.challenge,
        pressed=presence.stop,
    )


def _ended(station: Station, phase: Phase, now_s: float) -> Station:
    return station._replace(phase=phase, ended_s=now_s, challenge=0)


def suspended(before: Stations, suspended_s: float) -> Stations:
    """Return the state after a suspend of the machine, in which the clock stood still: the leases went on."""
    return before._replace(
        stations=tuple(s._replace(proven_s=s.proven_s - suspended_s) for s in before.stations),
        challenges=tuple(one._replace(issued_s=one.issued_s - suspended_s) for one in before.challenges),
    )


def refusal(stations: Stations) -> str | None:
    """Return why a reset is refused, as a sentence; None if the stations permit it."""
    if stations.pressed:
        return f"the e-stop station {' and '.join(stations.pressed)} is pressed: release it there first"
    if stations.missing:
        return f"the required e-stop station {' and '.join(stations.missing)} is not heard: start it first"
    return None


def detail_of(stations: Stations) -> str:
    """Return which stations are pressed or missing, as part of a sentence; empty if none is."""
    missing = stations.missing
    words = [f"{name} is pressed" for name in stations.pressed]
    words += [f"{s.config.name} {_MISSING[s.phase]}" for s in stations.stations if s.config.name in missing]
    return "; ".join(words)


_MISSING = {Phase.UNHEARD: "was not heard yet", Phase.LOST: "is silent", Phase.LEFT: "has left"}
