"""Measures how many times faster than real time the simulated robot runs on one core, unpaced and without a window.

The reference is the minimum for the same model and lidar: `mj_step` and `mj_multiRay` in a loop. Both run
alternately, so that load on the machine slows both.
"""

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bench.rig.sheet import Column, Sheet, Verdict
from sim import mj
from sim.config import Build, SimSection
from sim.lidar import SOLID_GROUP
from sim.plant import Plant

SCENES = (("warehouse", False), ("warehouse", True), ("aisle", True), ("empty", True))
LEG_S = 10
LEGS = ((0.3, 0.6), (-0.3, 0.6), (0.3, -0.6), (-0.3, -0.6))
"""v [m/s] and ω [rad/s], each for `LEG_S`, then again from the start; there is no contact in any scene."""
WARM_UP_ROUNDS, ROUNDS = 3, 80
CONFIG = SimSection()

TARGET_MS = 10.0
"""Limit for a simulated second: a hundred times real time."""
TARGET_TO_BARE = 1.25
"""Limit relative to the bare loop: 80 % of its rate."""


@dataclass(frozen=True)
class Pace:
    """Speed of one scene; times are CPU time of the single thread for a simulated second."""

    scene: str
    moving: bool
    geoms: int
    plant_ms: float
    plant_p90_ms: float
    bare_ms: float

    @property
    def what(self) -> str:
        return f"{self.scene}, people and forklifts moving" if self.moving else f"{self.scene}, all still"

    @property
    def real_time_factor(self) -> float:
        return 1000.0 / self.plant_ms

    @property
    def bare_factor(self) -> float:
        return 1000.0 / self.bare_ms

    @property
    def plant_to_bare(self) -> float:
        """The ratio of the medians."""
        return self.plant_ms / self.bare_ms


class Bare:
    """The same model in a loop of only MuJoCo's step and ray casting."""

    def __init__(self, scene: str, *, moving: bool) -> None:
        plant = Plant(scene, options=Build(moving=moving))
        self._model, self._data = plant.model, plant.data
        self._data.ctrl[:] = plant.wheels.wheel_speeds(plant.wheels.twist(2.0, 3.0))
        angles_rad = plant.lidars[0].angles_rad
        self._directions = np.stack(
            (np.cos(angles_rad), np.sin(angles_rad), 0.0 * angles_rad), axis=1
        ).ravel()
        self._origin = np.array((*plant.start_pose[:2], plant.lidars[0].height_m))
        self._groups = np.zeros(6, np.uint8)
        self._groups[SOLID_GROUP] = 1
        self._geoms, self._distances = np.zeros(angles_rad.size, np.int32), np.zeros(angles_rad.size)
        self._range_m = plant.lidars[0].range_max_m

    def run(self, scans: int, steps: int) -> None:
        for _ in range(scans):
            for _ in range(steps):
                mj.step(self._model, self._data)
            mj.multi_ray(
                self._model,
                self._data,
                self._origin,
                self._directions,
                self._groups,
                True,  # noqa: FBT003 - static geoms too, as the lidar does
                -1,
                self._geoms,
                self._distances,
                None,
                self._distances.size,
                self._range_m,
            )


def measure_pace() -> list[Pace]:
    """Measure every scene; each round is a simulated second of the plant and one of the bare loop."""
    plants = {
        key: Plant(key[0], CONFIG.limits(), CONFIG.lidar_configs(), CONFIG.seed, Build(moving=key[1]))
        for key in SCENES
    }
    bares = {key: Bare(key[0], moving=key[1]) for key in SCENES}
    plant_ms: dict[tuple[str, bool], list[float]] = {key: [] for key in SCENES}
    bare_ms: dict[tuple[str, bool], list[float]] = {key: [] for key in SCENES}
    for number in range(-WARM_UP_ROUNDS, ROUNDS):
        for key, plant in plants.items():
            leg, second = divmod(number + WARM_UP_ROUNDS, LEG_S)
            if leg % len(LEGS) == 0 and second == 0:
                plant.reset()
            scans = round(CONFIG.scan_hz)
            steps = round(1.0 / (CONFIG.scan_hz * plant.timestep_s))
            started_ns = time.thread_time_ns()
            for _ in range(scans):
                plant.step(LEGS[leg % len(LEGS)], steps)
                plant.scan()
            plant_ns = time.thread_time_ns()
            bares[key].run(scans, steps)
            bare_ns = time.thread_time_ns()
            assert plant.collisions == 0, "the path must be free: contacts take additional time"
            if number >= 0:
                plant_ms[key].append((plant_ns - started_ns) / 1e6)
                bare_ms[key].append((bare_ns - plant_ns) / 1e6)
    return [
        Pace(
            *key,
            plants[key].model.ngeom,
            plant_ms=float(np.median(plant_ms[key])),
            plant_p90_ms=float(np.percentile(plant_ms[key], 90)),
            bare_ms=float(np.median(bare_ms[key])),
        )
        for key in SCENES
    ]


COLUMNS: tuple[Column[Pace], ...] = (
    ("scene", lambda one: one.what),
    ("geoms", lambda one: f"{one.geoms}"),
    ("× real time", lambda one: f"{one.real_time_factor:.0f}"),
    ("ms", lambda one: f"{one.plant_ms:.2f}"),
    ("ms p90", lambda one: f"{one.plant_p90_ms:.2f}"),
    ("MuJoCo alone ×", lambda one: f"{one.bare_factor:.0f}"),
    ("ms", lambda one: f"{one.bare_ms:.2f}"),
    ("rate / MuJoCo's", lambda one: f"{1.0 / one.plant_to_bare:.2f}"),
)


def pace_sheet(paces: Iterable[Pace]) -> Sheet:
    return Sheet.of(
        "The simulated robot, unpaced, with a scan of 360 beams 20 times a simulated second, on one core",
        COLUMNS,
        paces,
        (
            "ms: CPU time of the thread for a simulated second of 500 steps and 20 scans, median of the rounds. "
            "The robot drives; the target of 10 ms is a hundred times real time."
        ),
        (
            "MuJoCo alone: mj_step and mj_multiRay in a loop on the same model, alternating with the robot; the target "
            "is 80 % of its rate, which is 1.25 times its time."
        ),
    )


def verdicts(paces: Iterable[Pace]) -> list[Verdict]:
    found: list[Verdict] = []
    for pace in paces:
        what = f"a simulated second of {pace.what}"
        found += [
            Verdict(f"{what}, processor time,", pace.plant_ms, TARGET_MS, "ms"),
            Verdict(f"{what}, times MuJoCo alone,", pace.plant_to_bare, TARGET_TO_BARE, "×"),
        ]
    return found
