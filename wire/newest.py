"""What an inbox keeps between two takes: the newest samples, or the newest sample of each writer.

With one place for all writers of a key, a flood by one of them displaces every other writer's sample. With a place
for each writer, it displaces its own samples only. The number of places is bounded, and a flood may use a new writer's
name in every sample. A writer that was taken before therefore keeps its place for as long as it is heard, and
samples of unknown writers give way. A writer that copies another one's name shares its place.
"""

from collections import deque
from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar

PLACES = 8
"""Writers of one key that are kept apart."""
KEEPS_PLACE_S = 2.0
"""How long a silent writer keeps its place: longer than the pauses of a real sensor."""

T = TypeVar("T")


class Kept(Protocol[T]):
    """Items between two takes. Not safe for threads: the inbox holds its lock."""

    def add(self, item: T) -> int:
        """Keep an item; returns how many had to give way, this one included."""
        ...

    def take(self) -> list[T]:
        """Everything that is kept, oldest first; nothing is kept afterwards."""
        ...

    def __len__(self) -> int: ...


class Newest(Generic[T]):
    """The newest items, whoever wrote them.

    Args:
        depth: how many.
    """

    def __init__(self, depth: int) -> None:
        self._depth = depth
        self._items: deque[T] = deque(maxlen=depth)

    def __len__(self) -> int:
        return len(self._items)

    def add(self, item: T) -> int:
        gave_way = int(len(self._items) == self._depth)
        self._items.append(item)
        return gave_way

    def take(self) -> list[T]:
        items = list(self._items)
        self._items.clear()
        return items


class NewestOfEachWriter(Generic[T]):
    """The newest item of each of `PLACES` writers.

    Args:
        writer_of: who wrote an item.
        arrival_s_of: when it arrived [s]; it never goes back.
    """

    def __init__(self, writer_of: Callable[[T], Hashable], arrival_s_of: Callable[[T], float]) -> None:
        self._writer_of = writer_of
        self._arrival_s_of = arrival_s_of
        self._items: dict[Hashable, T] = {}
        """By writer, in the order of arrival."""
        self._known: dict[Hashable, float] = {}
        """The writers that have a place, and when each was last heard. Never more than `PLACES`."""

    def __len__(self) -> int:
        return len(self._items)

    def add(self, item: T) -> int:
        writer, now_s = self._writer_of(item), self._arrival_s_of(item)
        if writer in self._known:
            self._known[writer] = now_s
        if self._items.pop(writer, None) is not None:
            self._items[writer] = item
            return 1
        if len(self._items) < PLACES:
            self._items[writer] = item
            return 0
        if writer in self._known:
            # There are no more known writers than places: one of the others is unknown.
            del self._items[next(other for other in reversed(self._items) if other not in self._known)]
            self._items[writer] = item
        return 1

    def take(self) -> list[T]:
        items = list(self._items.values())
        if items:
            self._give_places(self._arrival_s_of(items[-1]))
        self._items.clear()
        return items

    def _give_places(self, now_s: float) -> None:
        """Places that have become free go to the writers of this take, in the order of arrival."""
        self._known = {w: heard_s for w, heard_s in self._known.items() if now_s - heard_s <= KEEPS_PLACE_S}
        for writer, item in self._items.items():
            if len(self._known) < PLACES:
                self._known.setdefault(writer, self._arrival_s_of(item))
