"""Loses, delays and reorders packets (pure): time is an argument, and all chance comes from one seeded generator."""

import heapq
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from bench.link.conditions import Path

_VERSION, _IPV4, _PATH = 0, 4, 14
"""Places in an IPv4 packet: the version in the high half of the first byte; the third byte of the source address."""
SHORTEST = 20


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
