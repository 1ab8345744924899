"""Carries the packets of a pair of namespaces, and loses, delays and reorders them: `python -m bench.link.relay A_FD B_FD PLAN`.

`Router` is pure: time is an argument, and all chance comes from one seeded generator. The program around it is started by
bench/link/run.py.

The plan is JSON: the paths by number, and the seed. Each line of the standard input is a command:

    lose      begin to lose and reorder packets
    cut       let no packet pass
    mend      let packets pass again
    end       print counts and lateness as a line of JSON, and end

At the end of the input, the program ends at once: the process that started it is dead.
"""

import gc
import heapq
import json
import os
import random
import select
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import NamedTuple

from bench.link.stops import Lateness

_VERSION, _IPV4, _PATH = 0, 4, 14
"""Places in an IPv4 packet: the version in the high half of the first byte; the third byte of the source address."""
SHORTEST = 20
LARGEST = 2048
TURN = 64
"""Maximum number of packets that are read before due packets leave."""
STDIN = 0


@dataclass(frozen=True, order=True)
class Path:
    """What a link does to the packets of one direction."""

    loss: float
    """Share of the packets that are lost, 0 to 1."""
    delay_s: float
    jitter_s: float
    """Standard deviation of the delay: packets may overtake each other."""


class Due(NamedTuple):
    """A packet that leaves the router."""

    due_s: float
    order: int
    """Number of the packet: packets of the same moment keep their order."""
    to: int
    """The side to which it goes."""
    packet: bytes


@dataclass
class Counts:
    """What has happened to the packets."""

    passed: int = 0
    lost: int = 0
    cut: int = 0
    foreign: int = 0
    """Not IPv4, or of no path."""


class Router:
    """The packets in transit. Both ends of a path have addresses with the path's number in their third byte.

    Args:
        paths: by number; both directions have the same properties.
        seed: of the losses and the jitter.
    """

    def __init__(self, paths: Mapping[int, Path], seed: int) -> None:
        self.paths = dict(paths)
        self.is_cut = False
        """While true, no packet passes; those in transit arrive."""
        self.is_calm = False
        """While true, no packet is lost, and all packets of a path take the same time."""
        self.counts = Counts()
        self._chance = random.Random(seed)
        self._order = 0
        self._waiting: list[Due] = []

    @property
    def next_s(self) -> float | None:
        """When the next packet is due; None if no packet is in transit."""
        return self._waiting[0].due_s if self._waiting else None

    def take(self, packet: bytes, to: int, now_s: float) -> None:
        """Take a packet for one side: lose it, or keep it until it is due."""
        path = self._path(packet)
        if path is None:
            self.counts.foreign += 1
        elif self.is_cut:
            self.counts.cut += 1
        elif not self.is_calm and self._chance.random() < path.loss:
            self.counts.lost += 1
        else:
            self.counts.passed += 1
            self._order += 1
            jitter_s = self._chance.gauss(0.0, path.jitter_s) if path.jitter_s and not self.is_calm else 0.0
            due_s = now_s + max(0.0, path.delay_s + jitter_s)
            heapq.heappush(self._waiting, Due(due_s, self._order, to, packet))

    def due(self, now_s: float) -> list[Due]:
        """Remove and return the packets that are due, in the order of their times."""
        found: list[Due] = []
        while self._waiting and self._waiting[0].due_s <= now_s:
            found.append(heapq.heappop(self._waiting))
        return found

    def _path(self, packet: bytes) -> Path | None:
        if len(packet) < SHORTEST or packet[_VERSION] >> 4 != _IPV4:
            return None
        return self.paths.get(packet[_PATH])


def relay(router: Router, fds: tuple[int, int]) -> Lateness:
    """Carry packets until the input says `end`; return how late they left."""
    late = Lateness()
    typed = b""
    while True:
        for due_s, _, to, packet in router.due(time.monotonic()):
            with suppress(OSError):  # a full device loses the packet, as a full queue does
                os.write(fds[to], packet)
            late.add(due_s, time.monotonic())
        next_s = router.next_s
        wait_s = None if next_s is None else max(0.0, next_s - time.monotonic())
        ready, _, _ = select.select([STDIN, *fds], [], [], wait_s)
        for side in (0, 1):
            if fds[side] in ready:
                _read(router, fds[side], 1 - side)
        if STDIN in ready:
            read = os.read(STDIN, 4096)
            if not read:
                os._exit(1)
            *lines, typed = (typed + read).split(b"\n")
            for line in lines:
                if line == b"end":
                    return late
                _obey(router, line)


def _read(router: Router, fd: int, to: int) -> None:
    for _ in range(TURN):
        try:
            packet = os.read(fd, LARGEST)
        except BlockingIOError:
            return
        router.take(packet, to, time.monotonic())


def _obey(router: Router, line: bytes) -> None:
    match line:
        case b"lose":
            router.is_calm = False
        case b"cut":
            router.is_cut = True
        case b"mend":
            router.is_cut = False
        case _:
            raise ValueError(f"not a command of the relay: {line!r}")
    print("done", flush=True)


def main() -> None:
    a_fd, b_fd, plan = sys.argv[1:]
    given = json.loads(plan)
    router = Router({int(number): Path(*path) for number, path in given["paths"].items()}, given["seed"])
    router.is_calm = True
    with suppress(PermissionError):  # then the bench reports how late it is
        # Above the flows, which may have real-time priority as well.
        priority = os.sched_getparam(0).sched_priority + 1
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    gc.freeze()
    gc.disable()  # a collection would delay all packets
    print("ready", flush=True)
    late = relay(router, (int(a_fd), int(b_fd)))
    print(json.dumps({"counts": asdict(router.counts), "late": late.report()}), flush=True)
    sys.stdout.close()


if __name__ == "__main__":
    main()
