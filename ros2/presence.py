"""Which programs publish on the topics of the command sources, and which of them are alive.

ROS's discovery lists a killed program for up to 20 s. Its process, if it runs on this host, and the token of
`lifeline ros2 exec` show its end at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from ros2.guard import Guard, of_this_process
from ros2.ros import Endpoint, Ros

PREFIX_BYTES = 12
"""All endpoints of one process have the same first bytes."""
MAX_GUARDED = 8
"""Number of programs on one topic whose processes are watched."""


@dataclass(slots=True)
class Programs:
    """The programs on one topic."""

    topic: str
    type_name: str
    discovery: str = "discovery"
    """What shows the end of its programs."""
    everyone: list[Endpoint] = field(default_factory=list[Endpoint])
    """All publishers but those that have died, whatever their type is."""
    live: list[Endpoint] = field(default_factory=list[Endpoint])
    """The publishers of the expected type that have not died."""
    outlived: list[Endpoint] = field(default_factory=list[Endpoint])
    """Publishers whose `lifeline ros2 exec` has ended, although they have not."""
    pid: int | None = None
    """The watched process of the only live program; None if it is not known."""
    stopped: bool = False
    """Whether a live program is stopped by a signal."""
    wrapped: bool = False
    """Whether a program started by `lifeline ros2 exec` holds the source."""

    @property
    def only(self) -> bytes | None:
        """The identity of the only live program; None if there is none, if it is stopped, or if there are several."""
        return self.live[0].gid if len(self.live) == 1 and not self.stopped else None

    def runs_any(self, publishers: frozenset[bytes]) -> bool:
        """Return whether one of these publishers is live on the topic."""
        return any(publisher.gid in publishers for publisher in self.live)


class Presence:
    """Watches the programs of several topics.

    Args:
        ros: the node.
        changed: called in the event loop when the programs of a topic may have changed.
    """

    def __init__(self, ros: Ros, changed: Callable[[Programs], None]) -> None:
        self._ros = ros
        self._changed = changed
        self._guard = Guard(self._on_death)
        self._dead: set[bytes] = set()
        """Publishers whose process has ended, although discovery still lists them."""
        self._unheld: set[bytes] = set()
        """Publishers whose `lifeline ros2 exec` is not heard."""
        self._own_gid = b""
        self._topics: list[Programs] = []

    def watch(self, topic: str, type_name: str) -> Programs:
        """Watch a topic; the returned record is updated."""
        programs = Programs(topic, type_name, self._ros.discovery)
        self._topics.append(programs)
        return programs

    def look(self) -> None:
        """Ask discovery for the publishers of all topics."""
        listed: set[bytes] = set()
        for programs in self._topics:
            listed |= self.look_at(programs)
        self._dead &= listed
        self._unheld &= listed
        self._guard.forget(listed - self._dead)

    def look_at(self, programs: Programs) -> set[bytes]:
        """Ask discovery for the publishers of one topic, and return their identities."""
        publishers = self._ros.publishers(programs.topic)
        programs.everyone = self.without_dead(publishers)
        programs.live = [p for p in programs.everyone if p.type_name == programs.type_name]
        programs.outlived = [p for p in publishers if p.gid in self._unheld - self._dead]
        # Several are refused, but each is watched, so that a killed one does not hinder its successor.
        pids = [self._guard.watch(p.gid, self._own_gid) for p in programs.live[:MAX_GUARDED]]
        programs.pid = pids[0] if len(pids) == 1 else None
        programs.stopped = programs.runs_any(self._guard.stopped())
        self._changed(programs)
        return {publisher.gid for publisher in publishers}

    def poll(self) -> None:
        """Check whether a watched process was stopped or continued."""
        stopped = self._guard.stopped()
        for programs in self._topics:
            before, programs.stopped = programs.stopped, programs.runs_any(stopped)
            if programs.stopped != before:
                self._changed(programs)

    def without_dead(self, endpoints: list[Endpoint]) -> list[Endpoint]:
        """Return the endpoints whose process has not ended."""
        return [endpoint for endpoint in endpoints if endpoint.gid not in self._dead | self._unheld]

    def others(self, topic: str) -> list[Endpoint]:
        """Return the publishers of a topic in other processes."""
        publishers = self._ros.publishers(topic)
        if not self._own_gid:
            self._own_gid = of_this_process([p.gid for p in publishers if p.node == self._ros.name])
        own = self._own_gid[:PREFIX_BYTES]
        return self.without_dead([p for p in publishers if p.gid[:PREFIX_BYTES] != own])

    def wrapper(self, programs: Programs, *, alive: bool) -> None:
        """Process the token of `lifeline ros2 exec`: if it goes, its program counts as ended until it returns.

        A token that goes and returns is one whose link was cut, whose process was stopped, or whose supervisor restarted.
        """
        programs.wrapped = alive
        if alive:
            self._unheld -= {publisher.gid for publisher in self._ros.publishers(programs.topic)}
        else:
            self._unheld |= {publisher.gid for publisher in programs.live}
        self.look_at(programs)

    def _on_death(self, gid: bytes) -> None:
        self._dead.add(gid)
        for programs in self._topics:
            if any(publisher.gid == gid for publisher in programs.live):
                self.look_at(programs)
