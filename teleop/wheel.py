"""The command source of teleop for a driver in another program: the page of a station."""

import time
from typing import NamedTuple

from teleop.holder import HeldError, Holder, about_this_process
from wire import topics
from wire.bus import Bus, NoReplyError
from wire.messages import planar_twist
from wire.text import printable

RESET_LIMIT_S = 1.0
MAX_ACTS = 6
"""The newest reports of what people did, for the supervisor, which asks after each change."""
MAX_OF_PAGE = 3
"""Of these, from one page: whatever it repeats, what people did at other pages is still reported."""


class Act(NamedTuple):
    """What a person did."""

    page: object
    text: str
    time: str


class SourceWheel:
    """The command source of the robot's teleop, for the page that drives: only one program holds it at a time.

    Args:
        source: its name.
        most: the largest velocity [m/s] and rate [rad/s].
    """

    def __init__(self, source: str, most: tuple[float, float]) -> None:
        self._source, self._most = source, most
        self._holder: Holder | None = None
        self._acts: list[Act] = []
        """Oldest first."""

    def join(self, bus: Bus) -> None:
        """Use an open bus from now on."""
        self._commands = bus.publisher(topics.source_cmd_vel(self._source))
        self._bus = bus
        self._about = f"the page of {about_this_process('station')}"
        self._holder = Holder(bus, self._source, self._commands, self._about)
        self._holder.serve()  # before anyone drives: the supervisor asks who pressed the e-stop

    async def take(self) -> str:
        if self._holder is None:
            return "The supervisor was not found yet: start it, and press Drive again."
        self._commands.begin_anew()
        try:
            await self._holder.claim()
        except HeldError as error:
            return f"End the program that drives the robot: {printable(str(error))}."
        return ""

    def put(self, linear: float, angular: float, true_at_s: float) -> None:
        most_m_s, most_rad_s = self._most
        self._commands.put(planar_twist(most_m_s * linear, most_rad_s * angular), true_at_s)

    async def reset(self) -> str:
        try:
            reply = await self._bus.call(topics.SUPERVISOR_RESET, timeout_s=RESET_LIMIT_S)
        except NoReplyError:
            return "The supervisor did not answer: press Reset again."
        return "" if reply.success else f"Not reset: {printable(reply.message)}"

    @property
    def is_contested(self) -> bool:
        return self._holder is not None and self._holder.is_contested

    def release(self) -> None:
        if self._holder is not None:
            self._holder.drop()

    def record(self, page: object, act: str) -> None:
        own = [one for one in self._acts if one.page is page]
        # A repeated act replaces the one before.
        if own and (own[-1].text == act or len(own) == MAX_OF_PAGE):
            self._acts.remove(own[-1] if own[-1].text == act else own[0])
        self._acts.append(Act(page, act, time.strftime("%H:%M:%S")))
        del self._acts[:-MAX_ACTS]
        if self._holder is not None:
            # The newest first: the supervisor keeps the beginning of a long report.
            acts = [f"{one.time} {one.text}" for one in reversed(self._acts)]
            self._holder.about = "; ".join((self._about, *acts))
