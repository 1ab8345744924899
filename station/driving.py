"""One page at a time drives the robot, as a command source like any other.

Every command is one message of the page, sent on at once, with the page's own time as its stamp: the server repeats nothing, and
renews no age. A command must carry the number of the newest picture that the page has drawn; if that picture is too old, zero is
sent instead, until the page itself has sent zero. The source ends with the page's connection.
"""

import math
from collections import OrderedDict
from typing import Protocol

from station.messages import BadMessageError, Wanted

STALE_S = 0.3
"""A command on an older picture is refused, counted from its oldest scan by the server's clock."""
MAX_PICTURES = 64
"""The numbers that are remembered; a page draws at most 20 a second."""


class Wheel(Protocol):
    """The command source of the pages."""

    async def take(self) -> str:
        """Begin a new run of the source; return why it cannot, or an empty text."""
        ...

    def put(self, linear: float, angular: float, true_at_s: float) -> None:
        """Send a command: shares of the largest velocities, from -1 to 1, and the time of its content."""
        ...

    async def reset(self) -> str:
        """Reset a latched e-stop; return the answer as a sentence."""
        ...

    def release(self) -> None:
        """End the run at once: the robot stops if it drives."""
        ...


class Pictures:
    """When the scans of the pictures of one page were taken."""

    def __init__(self) -> None:
        self._scan_s = OrderedDict[int, float]()

    def sent(self, number: int, scan_s: float) -> None:
        """Remember a picture.

        Args:
            number: of the picture.
            scan_s: when its oldest scan arrived; -inf if it shows none.
        """
        self._scan_s[number] = scan_s
        if len(self._scan_s) > MAX_PICTURES:
            self._scan_s.popitem(last=False)

    def age_s(self, number: int, now_s: float) -> float:
        """Return the age of a picture; infinite if there was none with this number."""
        return now_s - self._scan_s.get(number, -math.inf)


class Commands:
    """The commands of one page.

    Args:
        wheel: sends them on; the page holds it.
    """

    def __init__(self, wheel: Wheel) -> None:
        self._wheel = wheel
        self._offset_s: float | None = None
        self._needs_zero = True
        """Whether only the person's own zero permits motion: at the beginning, and after a refused command."""
        self._newest_s = -math.inf

    def hear(self, wanted: Wanted, pictures: Pictures | None, now_s: float) -> str:
        """Send a command on; return why it was refused, or an empty text.

        Args:
            wanted: the command.
            pictures: what the page was shown; None: nothing.
            now_s: the server's clock.

        Raises:
            BadMessageError: the page's time goes back.
        """
        if self._offset_s is None:
            self._offset_s = now_s - wanted.time_s
        if wanted.time_s < self._newest_s:
            raise BadMessageError("the page's time goes back")
        self._newest_s = wanted.time_s
        # Only differences of this time count, so it may be in the future of the server's clock.
        true_at_s = self._offset_s + wanted.time_s
        if (wanted.linear, wanted.angular) == (0.0, 0.0):
            self._needs_zero, problem = False, ""
        else:
            problem = self._problem(math.inf if pictures is None else pictures.age_s(wanted.picture, now_s))
        if problem:
            self._needs_zero = True
            self._wheel.put(0.0, 0.0, true_at_s)
        else:
            self._wheel.put(wanted.linear, wanted.angular, true_at_s)
        return problem

    def _problem(self, age_s: float) -> str:
        """Return why a motion is refused."""
        if math.isinf(age_s):
            return "The robot is not seen."
        if age_s > STALE_S:
            return f"The picture is {age_s:.1f} s old."
        return "Let go first." if self._needs_zero else ""


class Driving:
    """Gives the wheel to one page at a time.

    Args:
        wheel: the command source.
    """

    def __init__(self, wheel: Wheel) -> None:
        self._wheel = wheel
        self._driver: object | None = None

    async def take(self, page: object) -> str:
        """Let a page drive; return why it may not, or an empty text. The caller releases it in every case."""
        if self._driver is not None:
            return "Another page drives."
        self._driver = page
        return await self._wheel.take()

    def commands(self) -> Commands:
        """Return what hears the page that drives."""
        return Commands(self._wheel)

    async def reset(self) -> str:
        """Reset a latched e-stop; return the answer as a sentence."""
        return await self._wheel.reset()

    def release(self, page: object) -> None:
        """End the run of a page, unless it has ended before."""
        if self._driver is page:
            self._driver = None
            self._wheel.release()
