"""The messages between page and server: JSON texts with exactly these fields (pure).

Each message of the server has a `kind`. The first message of a page is `{"code": ...}` or `{"token": ...}`, perhaps with its person's `name`; the
server answers with a `welcome`: the station, the token with which the page may connect again, and whether it may drive. From then on, the page
sends its side of the lease, `{"challenge", "response", "stop"}`, and receives the supervisor's side, and a `view` of what else it shows.
It may also send the person's name, `{"name": ...}`, and `{"press": true}` if it is touched again while it is pressed.
On a second connection, it receives the `robot` and each `picture`, and answers each picture with `{"drawn": ...}`.
On a third one, it asks to drive, drives with `{"linear", "angular", "time_s", "picture"}`, and requests `{"request": "reset"}` of the
e-stop or `{"hand_over": name}`. It receives whose `turn` it is, and an `answer`: the sentence with which a command or a request is refused.
The numbers of a lease have 64 bits, more than a JavaScript number, and are texts of digits.
"""

import re
from collections.abc import Mapping
from typing import Literal, NamedTuple, cast

from wire import foreign
from wire.message_types import EstopLease, SafetyStatus
from wire.reasons import StopReason, words_of
from wire.text import printable

MAX_MESSAGE_BYTES = 512
MAX_SECRET = 64
"""Characters of a code or a token."""
MAX_NAME = 24
"""Characters of a person's name. It is part of the reason that closes a websocket, which has at most 123 bytes."""
BLANK = re.compile(r"[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0]")
"""Characters that count as printable and show nothing: a name of them alone would name nobody."""
MAX_NUMBER = (1 << 64) - 1
MAX_TIME_S = 1e9
"""Of a page's clock, which begins when the page is loaded."""
DIGITS = re.compile(r"[0-9]{1,20}")
Fields = Mapping[str, object]
"""Of a message of the server, without its kind."""


class Hello(NamedTuple):
    """The first message of a page: a code or a token, the other one is empty."""

    code: str
    token: str
    name: str | None
    """Of the person; None: not given."""


class Wanted(NamedTuple):
    """What the person at a page wants now."""

    linear: float
    """Share of the largest velocity, from -1 to 1; positive: ahead."""
    angular: float
    """Share of the largest rate, from -1 to 1; positive: to the left."""
    time_s: float
    """Time of the input, by the page's own clock."""
    picture: int
    """The number of the newest picture that the page has drawn."""


class HandOver(NamedTuple):
    """The driver lets another person drive."""

    name: str
    """Of the person who asks, as the page shows it."""


class BadMessageError(ValueError):
    """A text is not a message of the page."""


def read_hello(text: str) -> Hello:
    """Return the first message of a page.

    Raises:
        BadMessageError: it is not one.
    """
    fields = dict(_fields(text))
    name = _name(fields.pop("name")) if "name" in fields else None
    match fields:
        case {"code": str(code)} if len(fields) == 1 and len(code) <= MAX_SECRET:
            return Hello(code, "", name)
        case {"token": str(token)} if len(fields) == 1 and len(token) <= MAX_SECRET:
            return Hello("", token, name)
        case _:
            raise BadMessageError("not the first message of a page")


def read_lease(text: str) -> EstopLease | str | None:
    """Return the page's side of the lease, the person's name, or None if the page was touched again while it is pressed.

    A page never says that it leaves: its end is always a loss.

    Raises:
        BadMessageError: it is none of these.
    """
    match fields := _fields(text):
        case {"challenge": str(challenge), "response": str(response), "stop": bool(stop)} if len(fields) == 3:
            return EstopLease(_number(challenge), _number(response), stop=stop)
        case {"name": name} if len(fields) == 1:
            return _name(name)
        case {"press": True} if len(fields) == 1:
            return None
        case _:
            raise BadMessageError("not a lease")


def read_drawn(text: str) -> int:
    """Return the number of the picture that a page has drawn.

    Raises:
        BadMessageError: it is not one.
    """
    match fields := _fields(text):
        case {"drawn": int(number)} if len(fields) == 1 and not isinstance(number, bool):
            return number
        case _:
            raise BadMessageError("not the number of a picture")


def read_wanted(text: str) -> Wanted | HandOver | Literal["reset"]:
    """Return the command or the request of a page that drives.

    Raises:
        BadMessageError: it is not one.
    """
    match fields := _fields(text):
        case {"request": "reset"} if len(fields) == 1:
            return "reset"
        case {"hand_over": str(name)} if len(fields) == 1:
            return HandOver(name)
        case {
            "linear": int() | float() as linear,
            "angular": int() | float() as angular,
            "time_s": int() | float() as time_s,
            "picture": int(picture),
        } if len(fields) == 4 and not any(isinstance(one, bool) for one in fields.values()):
            if abs(linear) <= 1.0 and abs(angular) <= 1.0 and abs(time_s) < MAX_TIME_S:
                return Wanted(float(linear), float(angular), float(time_s), picture)
        case _:
            pass
    raise BadMessageError("not a command")


def _fields(text: str) -> Fields:
    try:
        document = foreign.from_json(text)
    except foreign.ForeignError as error:
        raise BadMessageError("not JSON") from error
    return cast("Fields", document) if isinstance(document, dict) else {}


def _name(name: object) -> str:
    """Return the name of a person, without what shows nothing.

    Raises:
        BadMessageError: it is not one.
    """
    if not isinstance(name, str) or len(name) > MAX_NAME:
        raise BadMessageError("not a name")
    return printable(BLANK.sub("", name).strip())


def _number(digits: str) -> int:
    if DIGITS.fullmatch(digits) is None or int(digits) > MAX_NUMBER:
        raise BadMessageError("not a number of 64 bits")
    return int(digits)


def lease(message: EstopLease) -> Fields:
    """Return the supervisor's side of the lease."""
    return {"challenge": str(message.challenge), "response": str(message.response), "stop": message.stop}


def is_latched(status: SafetyStatus) -> bool:
    """Return whether a status shows a latched e-stop."""
    return StopReason.ESTOP in status.reasons


def cause_of(status: SafetyStatus) -> tuple[str, str]:
    """Return the most severe reason of a status in words, and what to do, as in `wire.reasons`; both are empty if there is none."""
    causes, latched = status.causes_and_latched()
    names = causes or latched
    words = words_of(names[0]) if names else None
    if words is None:
        return printable(", ".join(names)), ""
    text = words.now if causes else words.over
    return text.replace("WHO", printable(status.owner) or "the command source"), words.step


def view(
    station: str,
    endpoint: str,
    status: SafetyStatus | None,
    driver: str,
    *,
    has_rival: bool,
    is_seen: bool = False,
) -> Fields:
    """Return what a page shows besides its lease.

    Args:
        station: the name of the station.
        endpoint: of the supervisor.
        status: the newest one; None if it is missing or outdated.
        driver: the name of the person who drives; empty: nobody.
        has_rival: whether another page or program is the same station.
        is_seen: whether a status has shown the e-stop since this page was pressed.
    """
    stations = [] if status is None else status.estop_stations
    own = next((one for one in stations if one.name == station), None)
    if status is None:
        problem = f"Waiting for the supervisor at {printable(endpoint)}: start it if it does not run."
    elif has_rival:
        problem = "Another page or program is this station until it ends. A press here stops the robot, too."
    elif own is None:
        problem = f"The supervisor has no station {station}: add it to [[supervisor.estop_stations]]."
    else:
        problem = "The robot does not hear this station: wait; if this lasts, check the network."
    return {
        "problem": problem,  # why the page is not heard, if it is not
        "cause": "" if status is None else cause_of(status)[0],
        "latched": status is not None and is_latched(status),
        "seen": is_seen,
        "required": own is not None and own.required,
        "driver": driver,
    }
