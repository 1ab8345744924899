"""Challenges of a lease: who answers one proves that it was alive after the challenge was issued (pure).

The supervisor and each e-stop station challenge each other with random numbers. An answer in the backlog of a stalled
link, or in a replay, answers a challenge that has expired, and proves nothing.
"""

import math
from typing import NamedTuple

LEASE_S = 0.3
"""How long the answer to a challenge proves presence, from when the challenge was issued: delays in the network do not
extend it."""
CHALLENGE_PERIOD_S = 0.05
"""Several challenges or answers in succession may be lost without an end of the lease."""
PRESENCE_PERIOD_S = 0.1
"""Maximum time between two messages of a station, which otherwise answers each challenge at once."""


class Challenge(NamedTuple):
    number: int
    issued_s: float


Challenges = tuple[Challenge, ...]
"""The unexpired challenges of one side, the oldest first."""


def issued(challenges: Challenges, number: int, now_s: float) -> Challenges:
    """Return the challenges with a new one, without those that have expired."""
    kept = (one for one in challenges if now_s - one.issued_s <= LEASE_S)
    return (*kept, Challenge(number, now_s))


def proven_s(challenges: Challenges, response: int) -> float:
    """Return when the challenge was issued that this response answers; -inf if it answers none of them."""
    return next((one.issued_s for one in challenges if one.number == response), -math.inf)
