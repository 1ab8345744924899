"""The station's side of the lease with the supervisor, and its screen: the button, and whether the station is heard. Pure.

The station answers each challenge of the supervisor, and challenges it in return (wire/lease.py). It is heard while the
supervisor answers: the supervisor answers only what it accepted, so the robot then depends on this station's button.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from teleop.screen.view import Line, Segment, Tone, plain
from wire.lease import LEASE_S, PRESENCE_PERIOD_S, Challenges, issued, proven_s
from wire.message_types import EstopLease, EstopStationStatus, SafetyStatus
from wire.reasons import StopReason


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


# --- the screen: one large word, and what to do

KEYS = ("SPACE or any key: STOP", "Ctrl-R: release the button", "q or Ctrl-C: leave")
TONES = {Word.HEARD: Tone.GOOD, Word.NOT_HEARD: Tone.CAUTION, Word.STOPPED: Tone.STOP}
LETTERS = {
    " ": ("    ", "    ", "    ", "    ", "    "),
    "A": (" ## ", "#  #", "####", "#  #", "#  #"),
    "D": ("### ", "#  #", "#  #", "#  #", "### "),
    "E": ("####", "#   ", "### ", "#   ", "####"),
    "H": ("#  #", "#  #", "####", "#  #", "#  #"),
    "N": ("#  #", "## #", "# ##", "#  #", "#  #"),
    "O": (" ## ", "#  #", "#  #", "#  #", " ## "),
    "P": ("### ", "#  #", "### ", "#   ", "#   "),
    "R": ("### ", "#  #", "### ", "# # ", "#  #"),
    "S": (" ###", "#   ", " ## ", "   #", "### "),
    "T": ("####", " ## ", " ## ", " ## ", " ## "),
}
ROWS = 5


@dataclass(frozen=True, slots=True)
class Look:
    """The displayed values of a station."""

    name: str
    endpoint: str
    word: Word
    is_connected: bool = False
    is_pressed: bool = False
    is_confirmed: bool = False
    has_rival: bool = False
    """Whether another program is the same station."""
    status: SafetyStatus | None = None
    """The newest status; None if it is missing or outdated."""

    @property
    def own(self) -> EstopStationStatus | None:
        """This station in the status; None if it is not configured."""
        stations = () if self.status is None else self.status.estop_stations
        return next((one for one in stations if one.name == self.name), None)

    @property
    def is_needed(self) -> bool:
        """Whether the robot stops when this program ends: the station is required, and this program is heard as it."""
        return self.word is not Word.NOT_HEARD and self.own is not None and self.own.required


def headline(look: Look) -> Line:
    """Return the word and what it means, enough for a display of one line."""
    return Segment(f"{look.name}: {look.word}", TONES[look.word]), Segment(f" - {sentence(look)}")


def picture(look: Look, columns: int, rows: int, *, unicode: bool = True) -> list[Line]:
    """Return the lines of the screen, the most important first; the large word is left out unless all lines fit."""
    word, meaning = headline(look)
    first, *others = _wrapped(word.text + meaning.text, columns)
    size = len(word.text)
    head = [(Segment(first[:size], word.tone), Segment(first[size:])), *((Segment(text),) for text in others)]
    keys = "    ".join(KEYS)
    leaving = "Leaving stops the robot: this station is required." if look.is_needed else ""
    place = f"e-stop station {look.name} of {plain(look.endpoint)}"
    foot = [
        *((Segment(text, Tone.DIM),) for text in ([keys] if len(keys) <= columns else KEYS)),
        *((Segment(text),) for text in (*_wrapped(leaving, columns), *_wrapped(place, columns))),
    ]
    letters = large(look.word, columns, unicode=unicode)
    body = [(), *((Segment(row, word.tone),) for row in letters), ()]
    has_room = len(letters[0]) <= columns and len(head) + len(body) + len(foot) <= rows
    return [*head, *(body if has_room else ()), *foot]


def _wrapped(text: str, columns: int) -> list[str]:
    return textwrap.wrap(text, columns, break_on_hyphens=False)


def large(word: str, columns: int, *, unicode: bool) -> Sequence[str]:
    """Return a word in letters of five rows, twice as wide if there is room."""
    rows = [" ".join(LETTERS[letter][row] for letter in word) for row in range(ROWS)]
    if 2 * len(rows[0]) <= columns:
        rows = ["".join(cell * 2 for cell in row) for row in rows]
    return [row.replace("#", "█") if unicode else row for row in rows]


def sentence(look: Look) -> str:
    """Return what the word means now, and what to do."""
    match look.word:
        case Word.NOT_HEARD:
            return f"{_press(look)}{_why_not_heard(look)}"
        case Word.STOPPED if look.is_pressed:
            # A release before the confirmation has no effect, so the screen must not ask for it yet.
            release = "release it with Ctrl-R, then reset with r in teleop"
            return f"pressed here: {release if look.is_confirmed else 'waiting for the confirmation'}"
        case Word.STOPPED:
            why = "" if look.status is None else plain(look.status.why())
            return f"the robot is stopped{f': {why}' if why else ''}"
        case _:
            return "stopping" if look.is_pressed else "any key stops the robot"


def farewell(look: Look) -> str:
    """Return the last sentence of a station that has left."""
    if look.is_needed:
        what = ": the robot stops, because this station is required"
    else:
        what = "; it was not heard" if look.word is Word.NOT_HEARD else ""
    return f"e-stop station {look.name} has left{what}"


def _press(look: Look) -> str:
    """Return what is known of a press on a station that is not heard."""
    if not look.is_pressed or look.is_confirmed:
        return ""
    is_stopped = look.status is not None and StopReason.ESTOP in look.status.reasons
    return "pressed, and the robot is stopped; " if is_stopped else "PRESSED, not confirmed; "


def _why_not_heard(look: Look) -> str:
    if not look.is_connected:
        return f"waiting for the supervisor at {plain(look.endpoint)}"
    if look.has_rival:
        return f"another program is the station {look.name}: end it, or use another name"
    if look.status is not None and look.own is None:
        return f"the supervisor has no station {look.name}: add it to [[supervisor.estop_stations]]"
    return "the robot does not hear this station"
