"""One person at a time drives the robot, as a command source like any other; others ask, and drive in this order.

A driver hands over, or loses control after `IDLE_S` without a request for motion: the next person waits no longer for an idle driver.
Every command is one message of the page, sent on at once, with the page's own time as its stamp: the server repeats nothing, and
renews no age. A command must carry the number of the newest picture that the page has drawn; if that picture is too old, zero is
sent instead, until the page itself has sent zero. The source ends with the page's connection.
"""

import math
from dataclasses import dataclass
from typing import Protocol

from station.messages import BadMessageError, Fields, Wanted

STALE_S = 0.3
"""A command on an older picture is refused, counted from its oldest scan by the server's clock."""
MAX_PICTURES = 64
"""The numbers that are remembered; a page draws at most 20 a second."""
IDLE_S = 30.0
"""A driver who requests no motion for longer loses control. This is long enough to look around, to read a request and to touch
the stick, and short enough to wait for a driver who has left the page open."""
LEFT = "The driver handed over to a person who has left: press Drive again."


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

    @property
    def is_contested(self) -> bool:
        """Whether another program drives as the same source since the link was lost."""
        ...

    def release(self) -> None:
        """End the run at once: the robot stops if it drives."""
        ...

    def record(self, page: object, act: str) -> None:
        """Keep the report of what a person at a page did, for the black box; a page displaces only its own reports, and a repeated act replaces the one before."""
        ...


class Pictures:
    """When the scans of the pictures of one page were taken."""

    def __init__(self) -> None:
        self._scan_s = dict[int, float]()

    def sent(self, number: int, scan_s: float) -> None:
        """Remember a picture.

        Args:
            number: of the picture; they count up.
            scan_s: when its oldest scan arrived; -inf if it shows none.
        """
        self._scan_s[number] = scan_s
        self._scan_s.pop(number - MAX_PICTURES, None)

    def age_s(self, number: int, now_s: float) -> float:
        """Return the age of a picture; infinite if there was none with this number."""
        return now_s - self._scan_s.get(number, -math.inf)


class Commands:
    """The commands of one page, which holds the wheel."""

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
            return "The robot is not seen: wait for its picture, then hold again."
        if age_s > STALE_S:
            return f"The picture is {age_s:.1f} s old: let go, and hold again."
        return "Let go first." if self._needs_zero else ""


@dataclass(eq=False, slots=True)
class Person:
    """Who drives or asks to, at one page; compared by identity."""

    name: str
    page: object
    """Compared by identity."""
    commands: Commands
    moved_s: float = -math.inf
    """When the person last requested motion that was not refused, or began to drive."""
    ending: str = ""
    """How the turn ends, for the incidents; empty before it begins."""


class Driving:
    """Gives the wheel to one person at a time. All times are of one monotonic clock."""

    def __init__(self, wheel: Wheel) -> None:
        self._wheel, self.record = wheel, wheel.record
        self._people: list[Person] = []
        """The first one drives, or is next; the others ask."""
        self._driver: Person | None = None
        self._named: Person | None = None
        """To whom the driver has handed over, until this person begins to drive."""

    @property
    def driver(self) -> str:
        """The name of the person who has the wheel; empty: nobody."""
        return "" if self._driver is None else self._driver.name

    @property
    def _asker(self) -> str:
        return self._people[1].name if len(self._people) > 1 else ""

    def has(self, page: object) -> bool:
        """Return whether a person at this page drives, or asks to: each page has one place in the queue."""
        return any(person.page is page for person in self._people)

    def has_name(self, name: str) -> bool:
        """Return whether a person with this name, in capital or small letters, drives or asks to: a hand-over names one person."""
        return any(person.name.casefold() == name.casefold() for person in self._people)

    def enter(self, name: str, page: object) -> Person:
        """Let a person ask to drive whose page and name have no place yet; the caller ends this with `leave` in every case."""
        person = Person(name, page, Commands(self._wheel))
        if self._people:
            self.record(page, f"{name} asked to drive")
        self._people.append(person)
        return person

    async def take(self, person: Person, now_s: float) -> str:
        """Let a person drive who is next, if nobody drives; return why the wheel cannot be taken, or an empty text."""
        if self._driver is not None or self._people[:1] != [person]:
            return ""
        self._driver, person.moved_s = person, now_s
        if not (problem := await self._wheel.take()):
            person.ending, self._named = "ended driving", None
            self.record(person.page, f"{person.name} began to drive")
        return problem

    def hear(self, person: Person, wanted: Wanted, pictures: Pictures | None, now_s: float) -> str:
        """Send the driver's command on, as `Commands.hear`; that of another person has no effect."""
        if self._driver is not person:
            return ""
        problem = person.commands.hear(wanted, pictures, now_s)
        if not problem and (wanted.linear, wanted.angular) != (0.0, 0.0):
            person.moved_s = now_s
        return problem

    async def reset(self, person: Person) -> str:
        """Reset a latched e-stop for the driver; return the answer as a sentence."""
        if self._driver is not person:
            return "Only the driver resets: wait until you drive."
        self.record(person.page, f"{person.name} requested a reset")
        return await self._wheel.reset()

    def ending(self, person: Person, now_s: float, hand_over_to: str = "") -> str:
        """Return in a sentence why a driver's turn ends now, and the caller must call `leave`; empty: the turn continues.

        Args:
            person: the driver, or a person who asks, whose request ends only if the driver hands over to somebody who then leaves.
            now_s: the present time.
            hand_over_to: the name of the person to whom the driver hands over; only the one who is next drives. Empty: nobody.
        """
        if person not in self._people:
            return LEFT
        if self._driver is not person:
            return ""
        if now_s - person.moved_s > IDLE_S:
            person.ending = f"lost control after {IDLE_S:.0f} s without motion"
        elif self._wheel.is_contested:
            person.ending = "lost control to another program"
        elif hand_over_to and hand_over_to == self._asker:
            person.ending = f"handed over to {hand_over_to}"
            self._named = self._people[1]
        else:
            return ""
        return f"You {person.ending}. Press Drive to drive again."

    def turn(self, person: Person, now_s: float) -> Fields:
        """Return what the page of a person shows about whose turn it is: whether it drives, who asks it to hand over, and a sentence."""
        drives, asker, sentence = self._driver is person, "", ""
        if self._driver is not None:
            left_s = math.ceil(self._driver.moved_s + IDLE_S - now_s)
            if not drives:
                sentence = f"Wait for {self.driver}, who loses control after {left_s} s without motion."
            elif asker := self._asker:
                sentence = f"{asker} asks to drive: hand over, or drive on within {left_s} s."
        return {"drives": drives, "asker": asker, "sentence": sentence}

    def leave(self, person: Person) -> None:
        """End the turn or the request of a person; a driver's run ends at once."""
        if person in self._people:
            self._people.remove(person)
        if self._named is person:
            # The driver chose this person: nobody else gets the wheel by that, and who asks must ask again.
            self._named = None
            self._people.clear()
        if self._driver is person:
            self._driver = None
            self._wheel.release()
            if person.ending:
                self.record(person.page, f"{person.name} {person.ending}")
