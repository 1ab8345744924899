"""Measures the time of `step()` beside plain numpy on the same arrays, with scans of 360 to 16,384 beams."""

import itertools
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from bench.rig import scenery
from bench.rig.sheet import Column, Sheet, Verdict
from supervisor.config import SupervisorSection
from supervisor.law.decision import Decision, Mode
from supervisor.law.model import Command, Inputs, Odometry
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from supervisor.law.state import State
from wire.freshness import Sent

BEAMS = (360, 1080, 4096, 16384)
TICK_S = 0.02
SCANS = 32
WARM_UP_ROUNDS, ROUNDS = 25, 100
BLOCK = 8
CONFIG = SupervisorSection().law()

TARGET_BEAMS = 360
TARGET_TO_NUMPY = 20.0
"""Limit of a step with a new scan, odometry and a command, relative to plain numpy on the same scan."""


class Driver:
    """Runs the law in virtual time, with inputs prepared in advance so that only `step()` is measured."""

    def __init__(self, beams: int) -> None:
        self._ranges = scenery.scans(beams, SCANS)
        self._increment = scenery.angle_increment(beams)
        self.state: State = initial_state(CONFIG)
        self.now_s = 1000.0
        self._ticks = 0
        self.mode = Mode.STOPPED
        # Only neutral commands end the first stop.
        for _ in range(2 * round(CONFIG.command_timeout_s / TICK_S)):
            self.step(self.inputs(Velocity(0.0, 0.0), scan=True))

    def inputs(self, velocity: Velocity | None = None, *, scan: bool) -> Inputs:
        """Return the inputs of the next tick: a stamped command, odometry and optionally a stamped scan."""
        self._ticks += 1
        self.now_s += TICK_S
        sent = Sent(b"bench", self._ticks, self.now_s)
        velocity = velocity or Velocity(scenery.FORWARD_M_S, scenery.TURN_RAD_S)
        reading = LaserScan(
            self._ranges[self._ticks % SCANS],
            scenery.ANGLE_MIN,
            self._increment,
            scenery.RANGE_MIN_M,
            scenery.RANGE_MAX_M,
            self.now_s,
            sent,
        )
        return Inputs(
            commands=(Command("teleop", velocity, self.now_s, sent),),
            scans=(reading,) if scan else (),
            odometry=Odometry(Velocity(scenery.ODOMETRY_M_S, scenery.TURN_RAD_S), self.now_s),
        )

    def step(self, inputs: Inputs) -> Decision:
        self.state, decision = step(self.state, self.now_s, inputs)
        self.mode = decision.mode
        return decision


class PlainNumpy:
    """The minimum computation of any law: ranges -> points -> distances from the hull -> the smallest."""

    def __init__(self, beams: int) -> None:
        self._ranges = scenery.scans(beams, SCANS)
        angle = scenery.ANGLE_MIN + scenery.angle_increment(beams) * np.arange(beams)
        self._cos, self._sin = np.cos(angle), np.sin(angle)
        self._turn = 0
        self.nearest_m = np.inf

    def run(self) -> None:
        self._turn += 1
        ranges = self._ranges[self._turn % SCANS].astype(np.float64)
        self.nearest_m = float(
            (np.hypot(ranges * self._cos, ranges * self._sin) - CONFIG.hull.radius_m).min()
        )


KINDS = ("scan", "tick", "numpy")
"""The timed operations: a step with and without a scan, and the plain numpy code."""


@dataclass(frozen=True)
class Timing:
    """Times for one number of beams [µs], by their kind."""

    beams: int
    median_us: dict[str, float]
    p99_us: dict[str, float]
    scan_to_numpy: float
    """The median of the ratios of each round: a slow machine slows both."""
    per_beam_to_360: float
    """Time for each beam relative to that of the smallest scan: 1 is linear, less is better."""


def time_steps() -> list[Timing]:
    """Time every variant `BLOCK` times in each round, so that load on the machine affects all variants.

    The first time of a block is not counted: it depends on how much of the cache the previous variant used, which
    may have 16,384 beams.
    """
    drivers = {beams: Driver(beams) for beams in BEAMS}
    bounds = {beams: PlainNumpy(beams) for beams in BEAMS}
    taken: dict[tuple[int, str], list[float]] = {(beams, kind): [] for beams in BEAMS for kind in KINDS}
    for number in range(-WARM_UP_ROUNDS, ROUNDS):
        for (beams, driver), place in itertools.product(drivers.items(), range(BLOCK)):
            with_scan = driver.inputs(scan=True)
            scan_us = _microseconds(lambda driver=driver, inputs=with_scan: driver.step(inputs))
            _assert_limited(driver)
            plain = driver.inputs(scan=False)
            tick_us = _microseconds(lambda driver=driver, inputs=plain: driver.step(inputs))
            _assert_limited(driver)
            numpy_us = _microseconds(bounds[beams].run)
            if number >= 0 and place > 0:
                taken[beams, "scan"].append(scan_us)
                taken[beams, "tick"].append(tick_us)
                taken[beams, "numpy"].append(numpy_us)
    first = float(np.median(taken[BEAMS[0], "scan"])) / BEAMS[0]
    return [
        Timing(
            beams,
            median_us={kind: float(np.median(taken[beams, kind])) for kind in KINDS},
            p99_us={kind: float(np.percentile(taken[beams, kind], 99)) for kind in KINDS},
            scan_to_numpy=float(np.median(np.divide(taken[beams, "scan"], taken[beams, "numpy"]))),
            per_beam_to_360=float(np.median(taken[beams, "scan"])) / beams / first,
        )
        for beams in BEAMS
    ]


def _microseconds(work: Callable[[], object]) -> float:
    """Return the processor time of this thread: another program that gets the core meanwhile does not count."""
    started_ns = time.thread_time_ns()
    work()
    return (time.thread_time_ns() - started_ns) / 1000


def _assert_limited(driver: Driver) -> None:
    assert driver.mode is Mode.LIMITED, f"the barrier must be active, the mode is {driver.mode.name}"


TIMING: tuple[Column[Timing], ...] = (
    ("beams", lambda one: f"{one.beams:,}"),
    ("scan p50", lambda one: f"{one.median_us['scan']:.0f}"),
    ("scan p99", lambda one: f"{one.p99_us['scan']:.0f}"),
    ("tick p50", lambda one: f"{one.median_us['tick']:.0f}"),
    ("tick p99", lambda one: f"{one.p99_us['tick']:.0f}"),
    ("numpy p50", lambda one: f"{one.median_us['numpy']:.0f}"),
    ("scan / numpy", lambda one: f"{one.scan_to_numpy:.1f}"),
    ("per beam", lambda one: f"{one.per_beam_to_360:.2f}"),
)


def timing_sheet(timings: Iterable[Timing]) -> Sheet:
    return Sheet.of(
        "step() in µs of processor time, driving at a wall with the barrier active",
        TIMING,
        timings,
        (
            "scan: a step with a new scan, odometry and a command. tick: a step with odometry and a command, "
            "the points moved by odometry."
        ),
        (
            "numpy: ranges → points → distances from the hull → the smallest, in plain numpy on the same arrays, "
            "alternating with the steps. scan / numpy is the median of the ratios of each round, since a slow machine "
            "slows both."
        ),
        (
            "Scans of all sizes alternate, as other work does between two real ticks; "
            "one size alone in a tight loop is faster by about a tenth."
        ),
        "per beam: the time of a scan step for each beam, relative to that at 360; 1 is linear.",
    )


def verdicts(timings: Iterable[Timing]) -> list[Verdict]:
    found: list[Verdict] = []
    for timing in timings:
        if timing.beams == TARGET_BEAMS:
            what = f"a step with a new scan of {timing.beams} beams, median,"
            found.append(Verdict(what, timing.scan_to_numpy, TARGET_TO_NUMPY, "× plain numpy"))
        else:
            what = f"time for each beam at {timing.beams:,} beams"
            found.append(Verdict(what, timing.per_beam_to_360, 1.0, f"× that at {TARGET_BEAMS}"))
    return found
