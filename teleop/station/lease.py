"""The station's side of the lease with the supervisor: its button, and whether it is heard. Pure.

The station answers each challenge of the supervisor, and challenges it in return (wire/lease.py). It is heard while the
supervisor answers: the supervisor answers only what it accepted, so the robot then depends on this station's button.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from wire.lease import LEASE_S, PRESENCE_PERIOD_S, Challenges, issued, proven_s
from wire.message_types import EstopLease


class Word(StrEnum):
    """What the station shows in large letters."""

    HEARD = "HEARD"
    NOT_HEARD = "NOT HEARD"
    STOPPED = "STOPPED"


@dataclass(frozen=True, slots=True)
class Lease:
    """State of the station. Times are of its own monotonic clock."""

    challenges: Challenges = ()
    """Its own challenges that have not expired."""
    heard_s: float = -math.inf
    """When the newest of its challenges was issued that the supervisor answered."""
    response: int = 0
    """The newest challenge of the supervisor; 0: none."""
    is_stopped: bool = False
    """Whether the supervisor's newest answer reports a latched e-stop."""
    sent_s: float = -math.inf
    pressed_s: float = math.inf
    """When the button was pressed; infinite while it is not."""

    @property
    def is_pressed(self) -> bool:
        return self.pressed_s < math.inf

    @property
    def is_confirmed(self) -> bool:
        """Whether the supervisor has accepted a message that said that the button is pressed."""
        return self.heard_s >= self.pressed_s

    @property
    def due_s(self) -> float:
        """When the next message is due if no challenge comes before."""
        return self.sent_s + PRESENCE_PERIOD_S

    def is_heard(self, now_s: float) -> bool:
        return now_s - self.heard_s <= LEASE_S

    def word(self, now_s: float) -> Word:
        if not self.is_heard(now_s):
            return Word.NOT_HEARD
        return Word.STOPPED if self.is_stopped else Word.HEARD


def pressed(lease: Lease, now_s: float) -> Lease:
    """Return the lease with the button pressed; it stays so until it is released."""
    return lease if lease.is_pressed else replace(lease, pressed_s=now_s)


def released(lease: Lease) -> Lease:
    """Return the lease with the button released; without the supervisor's confirmation, it stays pressed."""
    return replace(lease, pressed_s=math.inf) if lease.is_confirmed else lease


def received(lease: Lease, message: EstopLease) -> Lease:
    """Process a message of the supervisor; one that answers no unexpired challenge proves nothing about this station."""
    proof_s = proven_s(lease.challenges, message.response)
    lease = replace(lease, response=message.challenge)
    if proof_s < lease.heard_s or math.isinf(proof_s):
        return lease
    return replace(lease, heard_s=proof_s, is_stopped=message.stop)


def sent(lease: Lease, challenge: int, now_s: float, *, leaves: bool = False) -> tuple[Lease, EstopLease]:
    """Return the lease after a message that is sent now, and the message.

    Args:
        lease: the lease.
        challenge: a random number.
        now_s: the present time.
        leaves: whether the station leaves on purpose.
    """
    message = EstopLease(challenge, lease.response, stop=lease.is_pressed, leaves=leaves)
    return replace(lease, challenges=issued(lease.challenges, challenge, now_s), sent_s=now_s), message
