"""Model of a lidar: exact ray casting, then the sensor's imperfections.

Each object covers a run of adjacent beams. Only these beams are cast at it, so that the cost of a scan depends
mainly on the number of beams, not on the number of objects.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tests.scenes.scene import Lidar
from tests.scenes.world import Floats, World

MISSED_IN_A_ROW = 2
"""Maximum duration of a dropout [scans]. A longer one would be a hole."""

UNSEEN_MISSED_IN_A_ROW = 1
"""The maximum duration for an object that no scan has shown yet."""

NOBODY = -1

Ints = npt.NDArray[np.int64]
Ranges = npt.NDArray[np.float32]


class Cast(NamedTuple):
    """Exact distances."""

    distance_m: Floats
    """(n,): infinite where there is no object."""
    which: Ints
    """(n,): the object, or NOBODY."""


class Eye:
    """One lidar with independent random faults; poses are those of the base."""

    def __init__(self, lidar: Lidar, objects: int, seed: list[int]) -> None:
        self.lidar = lidar
        self._rng = np.random.default_rng(seed)
        angle = lidar.angle_min + lidar.angle_increment * np.arange(lidar.beams)
        self._cos, self._sin = np.cos(angle), np.sin(angle)
        self._hole = np.zeros(lidar.beams, dtype=np.bool_)
        for start, end in lidar.holes_rad:
            self._hole |= (angle - start) % (2 * math.pi) <= end - start
        self._no_return = math.inf if lidar.profile == "rep117" else 0.0
        self._shown = np.zeros(objects, dtype=np.bool_)
        self._missed = np.zeros(objects, dtype=np.int64)
        self._beam_missed = np.zeros(lidar.beams, dtype=np.int64)

    def scan(self, world: World, x_m: float, y_m: float, yaw_rad: float) -> Ranges:
        """Take a scan at this pose of the base; return readings (n,) [m]."""
        lidar, rng = self.lidar, self._rng
        distance, which = self.cast(world, x_m, y_m, yaw_rad)
        silent = distance > lidar.range_max
        if lidar.object_dropout:
            silent |= self._drop_objects(which, silent)
        if lidar.noise_m:
            distance += lidar.noise_m * rng.standard_normal(lidar.beams).clip(-3.0, 3.0)
        if lidar.stray and rng.random() < lidar.stray:
            beam = int(rng.integers(lidar.beams))
            distance[beam] = rng.uniform(0.1, min(lidar.range_max, distance.item(beam)))
            silent[beam] = False
        missing = self._hole if lidar.silent_holes else None
        silent = silent if missing is None else silent | missing
        invalid = None if lidar.silent_holes or not lidar.holes_rad else self._hole
        if lidar.beam_dropout:
            dropped = (rng.random(lidar.beams) < lidar.beam_dropout) & (self._beam_missed < MISSED_IN_A_ROW)
            self._beam_missed = np.where(dropped, self._beam_missed + 1, 0)
            if lidar.silent_dropout:
                silent = silent | dropped
            else:
                invalid = dropped if invalid is None else invalid | dropped
        distance[silent] = self._no_return
        if invalid is not None:
            distance[invalid] = math.nan
        return distance.astype(np.float32)

    def _drop_objects(self, which: Ints, silent: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        lidar = self.lidar
        in_view = np.zeros(len(self._shown), dtype=np.bool_)
        in_view[which[~silent]] = True
        patience = np.where(self._shown, MISSED_IN_A_ROW, UNSEEN_MISSED_IN_A_ROW)
        dropped = (
            in_view & (self._rng.random(len(in_view)) < lidar.object_dropout) & (self._missed < patience)
        )
        self._missed = np.where(dropped, self._missed + 1, 0)
        self._shown |= in_view & ~dropped
        missing: npt.NDArray[np.bool_] = dropped[which] & (which != NOBODY)
        return missing

    def cast(self, world: World, x_m: float, y_m: float, yaw_rad: float) -> Cast:
        """Find the nearest surface on each beam among the objects within `range_max`."""
        lidar = self.lidar
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        at_x = x_m + cos * lidar.x_m - sin * lidar.y_m
        at_y = y_m + sin * lidar.x_m + cos * lidar.y_m
        reach = world.nearest_to(at_x, at_y)[0]
        (near,) = (reach < lidar.range_max).nonzero()
        best, which = np.full(lidar.beams, math.inf), np.full(lidar.beams, NOBODY)
        if len(near) == 0:
            return Cast(best, which)
        here = World(world.starts[near], world.ends[near], world.radii[near]).seen_from(
            at_x, at_y, yaw_rad + lidar.yaw_rad
        )
        disc_beam, disc_m, disc = self._discs(here)
        side_beam, side_m, side = self._sides(here)
        beam = np.concatenate((disc_beam, side_beam))
        distance = np.concatenate((disc_m, side_m))
        np.minimum.at(best, beam, distance)
        first = distance <= best[beam]
        which[beam[first]] = near[np.concatenate((disc, side))[first]]
        return Cast(best, which)

    def _discs(self, here: World) -> tuple[Ints, Floats, Ints]:
        """Return beams, distances and objects for the round ends of all capsules."""
        long = (here.starts != here.ends).any(axis=1).nonzero()[0]
        owner = np.concatenate((np.arange(len(here)), long))
        centre = np.concatenate((here.starts, here.ends[long]))
        radius = here.radii[owner]
        away = np.hypot(centre[:, 0], centre[:, 1])
        half = np.arcsin(np.minimum(radius / np.maximum(away, 1e-9), 1.0))
        middle = np.arctan2(centre[:, 1], centre[:, 0])
        beam, disc = self._covered(middle - half, 2.0 * half)
        along = self._cos[beam] * centre[disc, 0] + self._sin[beam] * centre[disc, 1]
        reach = radius[disc] ** 2 - (away[disc] ** 2 - along**2)
        return beam, along - np.sqrt(np.maximum(reach, 0.0)), owner[disc]

    def _sides(self, here: World) -> tuple[Ints, Floats, Ints]:
        """Return beams, distances and objects for the straight sides, left and right of each capsule's centre line."""
        side = here.ends - here.starts
        length = np.hypot(side[:, 0], side[:, 1])
        (long,) = (length > 0.0).nonzero()
        if len(long) == 0:
            none = np.empty(0, dtype=np.int64)
            return none, np.empty(0), none
        side, length = side[long], length[long]
        left = np.stack((-side[:, 1], side[:, 0]), axis=1) * (here.radii[long] / length)[:, None]
        start = np.concatenate((here.starts[long] + left, here.starts[long] - left))
        side, owner = np.concatenate((side, side)), np.concatenate((long, long))
        end = start + side
        one, other = np.arctan2(start[:, 1], start[:, 0]), np.arctan2(end[:, 1], end[:, 0])
        turn = (other - one + math.pi) % (2 * math.pi) - math.pi
        beam, line = self._covered(np.where(turn < 0.0, other, one), np.abs(turn))
        across = self._cos[beam] * side[line, 1] - self._sin[beam] * side[line, 0]
        height = start[:, 0] * side[:, 1] - start[:, 1] * side[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = height[line] / across
        return beam, np.where(distance > 0.0, distance, math.inf), owner[line]

    def _covered(self, first_rad: Floats, width_rad: Floats) -> tuple[Ints, Ints]:
        """Return the beams within each sector, concatenated, and the sector of each beam."""
        lidar = self.lidar
        turn = 2 * math.pi
        begin = (first_rad - lidar.angle_min) % turn
        begin = np.concatenate((begin, begin - turn)) / lidar.angle_increment
        width = np.concatenate((width_rad, width_rad)) / lidar.angle_increment
        low = np.maximum(np.ceil(begin), 0.0).astype(np.int64)
        high = np.minimum(np.floor(begin + width), lidar.beams - 1).astype(np.int64)
        count = np.maximum(high - low + 1, 0)
        sector = np.repeat(np.arange(len(count)), count)
        beam = np.arange(len(sector)) - np.repeat(np.cumsum(count) - count - low, count)
        return beam, sector % len(first_rad)
