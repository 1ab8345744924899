"""The messages between page and server: JSON texts with exactly these fields (pure).

The first message of a page is `{"code": ...}` or `{"token": ...}`; the server answers with a welcome. From then on, the page
sends its side of the lease, `{"challenge", "response", "stop"}`, and receives the supervisor's side, and what else it shows.
The numbers of a lease have 64 bits, more than a JavaScript number, and are texts of digits.
"""

import json
import re
from dataclasses import dataclass
from typing import cast

from wire import foreign
from wire.message_types import EstopLease, EstopStationStatus, SafetyStatus
from wire.reasons import StopReason
from wire.text import printable

MAX_MESSAGE_BYTES = 512
MAX_SECRET = 64
"""Characters of a code or a token."""
MAX_NUMBER = (1 << 64) - 1
DIGITS = re.compile(r"[0-9]{1,20}", re.ASCII)


class BadMessageError(ValueError):
    """A text is not a message of the page."""


@dataclass(frozen=True, slots=True)
class Hello:
    """The first message of a page; one of both is empty."""

    code: str = ""
    token: str = ""


def read_hello(text: str) -> Hello:
    """Return the first message of a page.

    Raises:
        BadMessageError: it is not one.
    """
    match _fields(text):
        case {"code": str(code), **others} if not others and 0 < len(code) <= MAX_SECRET:
            return Hello(code=code)
        case {"token": str(token), **others} if not others and 0 < len(token) <= MAX_SECRET:
            return Hello(token=token)
        case _:
            raise BadMessageError("not the first message of a page")


def read_lease(text: str) -> EstopLease:
    """Return the page's side of the lease. A page never says that it leaves: its end is always a loss.

    Raises:
        BadMessageError: it is not one.
    """
    match _fields(text):
        case {"challenge": str(challenge), "response": str(response), "stop": bool(stop), **others} if (
            not others
        ):
            return EstopLease(_number(challenge, at_least=1), _number(response), stop=stop)
        case _:
            raise BadMessageError("not a lease")


def _fields(text: str) -> dict[str, object]:
    try:
        document = foreign.from_json(text)
    except foreign.ForeignError as error:
        raise BadMessageError("not JSON") from error
    if not isinstance(document, dict):
        raise BadMessageError("not an object")
    return cast("dict[str, object]", document)


def _number(digits: str, at_least: int = 0) -> int:
    if DIGITS.fullmatch(digits) is None or not at_least <= int(digits) <= MAX_NUMBER:
        raise BadMessageError("not a number of 64 bits")
    return int(digits)


def welcome(station: str, token: str) -> str:
    """Return the answer to a page that is paired: its station, and the token with which it may connect again."""
    return json.dumps({"kind": "welcome", "station": station, "token": token})


def lease(message: EstopLease) -> str:
    """Return the supervisor's side of the lease."""
    fields = {"challenge": str(message.challenge), "response": str(message.response), "stop": message.stop}
    return json.dumps({"kind": "lease", **fields})


@dataclass(frozen=True, slots=True)
class View:
    """What a page shows besides its lease."""

    station: str
    endpoint: str
    is_connected: bool = False
    has_rival: bool = False
    """Whether another page or program is the same station."""
    status: SafetyStatus | None = None
    """The newest status; None if it is missing or outdated."""

    @property
    def own(self) -> EstopStationStatus | None:
        """This station in the status; None if it is not configured."""
        stations = () if self.status is None else self.status.estop_stations
        return next((one for one in stations if one.name == self.station), None)

    @property
    def is_latched(self) -> bool:
        """Whether the status shows a latched e-stop."""
        return self.status is not None and StopReason.ESTOP in self.status.reasons

    def problem(self) -> str:
        """Return why the page is not heard, if it is not."""
        if not self.is_connected or self.status is None:
            return f"waiting for the supervisor at {printable(self.endpoint)}"
        if self.has_rival:
            return f"another page or program is the station {self.station}: end it, or use another name"
        if self.own is None:
            return f"the supervisor has no station {self.station}: add it to [[supervisor.estop_stations]]"
        return "the robot does not hear this station"

    def text(self) -> str:
        """Return the message to the page."""
        return json.dumps(
            {
                "kind": "view",
                "problem": self.problem(),
                "reasons": "" if self.status is None else printable(self.status.why()),
                "latched": self.is_latched,
                "required": self.own is not None and self.own.required,
            }
        )
