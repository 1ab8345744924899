"""Storage of an inbox between two takes: the newest samples, or the newest sample of each writer.

If all writers of a key share one place, a flood by one of them displaces every other writer's sample. If each writer
has a place, a flood displaces only its own samples. The number of places is bounded, and a flood may use a new writer
name in every sample. Therefore a writer whose sample was taken before keeps its place while it is heard, and samples
of unknown writers are dropped. A writer that copies another writer's name shares its place.
"""

from collections import deque
from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar

PLACES = 8
"""Maximum number of writers of one key with a place of their own."""
KEEPS_PLACE_S = 2.0
"""How long a silent writer keeps its place; longer than the pauses of a real sensor."""

T = TypeVar("T")


class Kept(Protocol[T]):
    """Interface to the items between two takes. Not thread-safe: the inbox holds a lock during every call."""

    def add(self, item: T) -> int:
        """Keep an item; return how many items were dropped, this one included."""
        ...

    def take(self) -> list[T]:
        """Remove and return all items, oldest first."""
        ...

    def __len__(self) -> int: ...


class Newest(Generic[T]):
    """The newest items of all writers together.

    Args:
        depth: the maximum number of items.
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


class NewestWithin(Generic[T]):
    """The newest items of all writers together, bounded by number and by size.

    Args:
        depth: the maximum number of items.
        size_limit: the maximum size of all items together; a larger single item is dropped.
        size_of: returns the size of an item.
    """

    def __init__(self, depth: int, size_limit: int, size_of: Callable[[T], int]) -> None:
        self._depth, self._size_limit, self._size_of = depth, size_limit, size_of
        self._items: deque[T] = deque()
        self._size = 0

    def __len__(self) -> int:
        return len(self._items)

    def add(self, item: T) -> int:
        self._items.append(item)
        self._size += self._size_of(item)
        dropped = 0
        while len(self._items) > self._depth or self._size > self._size_limit:
            self._size -= self._size_of(self._items.popleft())
            dropped += 1
        return dropped

    def take(self) -> list[T]:
        items = list(self._items)
        self._items.clear()
        self._size = 0
        return items


class NewestOfEachWriter(Generic[T]):
    """The newest item of each of `PLACES` writers.

    Args:
        writer_of: returns the writer of an item.
        arrival_s_of: returns the arrival time of an item [s]; it never decreases.
    """

    def __init__(self, writer_of: Callable[[T], Hashable], arrival_s_of: Callable[[T], float]) -> None:
        self._writer_of = writer_of
        self._arrival_s_of = arrival_s_of
        self._items: dict[Hashable, T] = {}
        """Items by writer, in the order of arrival."""
        self._known: dict[Hashable, float] = {}
        """The writers with a place, and when each was last heard; at most `PLACES`."""

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
            # There are at most as many known writers as places, so one of the stored writers is unknown.
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
        """Give free places to the writers of this take, in the order of arrival."""
        self._known = {w: heard_s for w, heard_s in self._known.items() if now_s - heard_s <= KEEPS_PLACE_S}
        for writer, item in self._items.items():
            if len(self._known) < PLACES:
                self._known.setdefault(writer, self._arrival_s_of(item))
