"""The conditions under which the links are measured (pure)."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

LOSSES = (0.0, 0.01, 0.02, 0.03, 0.05, 0.10)
ROUND_TRIPS_S = (0.0, 0.02, 0.1, 0.3)
JITTER = 0.1
"""Standard deviation of the delay, as a share of the delay."""
MAX_CONDITIONS = 254
"""A condition has a number in one byte of its addresses; 0 and 255 are not used."""


class Link(StrEnum):
    """What carries the commands."""

    TCP = "tcp"
    QUIC = "quic"
    """With mutual TLS: best effort as datagrams, reliable as streams."""
    UDP = "udp"
    """Without TLS, and nothing is repeated: a reference."""


@dataclass(frozen=True, order=True)
class Path:
    """What a link does to the packets of one direction."""

    loss: float
    """Share of the packets that are lost, 0 to 1."""
    delay_s: float
    jitter_s: float
    """Standard deviation of the delay: packets may overtake each other."""


@dataclass(frozen=True, order=True)
class Condition:
    """A link with its loss, each way, its round trip without jitter, and the lease of the session."""

    link: Link
    loss: float
    round_trip_s: float
    lease_s: float
    """How long a silent link counts as alive; Zenoh sends a keep-alive four times in a lease."""

    @property
    def path(self) -> Path:
        delay_s = self.round_trip_s / 2
        return Path(self.loss, delay_s, JITTER * delay_s)

    def __str__(self) -> str:
        return f"{self.link} at {100 * self.loss:g} % and {1000 * self.round_trip_s:g} ms"


def grid(
    links: Iterable[Link], losses: Iterable[float], round_trips_s: Iterable[float], leases_s: Iterable[float]
) -> list[Condition]:
    """Return all combinations."""
    return [Condition(*one) for one in itertools.product(links, losses, round_trips_s, leases_s)]
