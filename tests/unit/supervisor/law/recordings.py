"""Real lidar recordings, each with a plausible robot, and the law run over them.

The recordings are not part of the repository: `LIFELINE_LIDAR_DATA` names their directory, else it is
`shared/data/lidar` beside the repository. Without it, their tests are skipped.
"""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from supervisor.config import FootprintSection, LidarSection, SupervisorSection
from supervisor.law.decision import Decision
from supervisor.law.model import Inputs, LawConfig, Odometry
from supervisor.law.near_memory import Remembered
from supervisor.law.reckoning import Velocity
from supervisor.law.safety import step
from supervisor.law.scan import LaserScan
from supervisor.law.state import State
from supervisor.messages import to_scan
from tests.unit.supervisor.law.law_harness import NEUTRAL, TICK_S, on_time, proven_state
from wire import messages as ros
from wire.bus import Arrival

DATA = Path(
    os.environ.get("LIFELINE_LIDAR_DATA") or Path(__file__).resolve().parents[5] / "shared" / "data" / "lidar"
)

START_S = 1000.0
SLOW = Velocity(0.1, 0.0)

Floats = npt.NDArray[np.float64]
Ranges = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Robot:
    """A robot that carries one of the recorded lidars, as its owner would configure it."""

    file: str
    section: SupervisorSection
    no_return: tuple[float, ...] = ()
    """The sensor's codes for "no return" in the data, in addition to NaN and +Inf."""
    codes_below_m: float = 0.0
    longest_s: float = math.inf
    """The part of the recording that is used."""


def _degrees(*pairs: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple((math.radians(start), math.radians(end)) for start, end in pairs)


_BOX = FootprintSection(corners_m=[(0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25), (0.4, -0.25)])

ROBOTS = {
    robot.file.split("_")[0] + "-" + robot.file.split("_")[1]: robot
    for robot in (
        Robot(
            "hokuyo726_front_obstacles_BSD",
            SupervisorSection(
                scan_timeout_s=0.3,
                footprint=FootprintSection(radius_m=0.25),
                lidar=LidarSection(profile="hokuyo_urg", x_m=0.15),
            ),
            codes_below_m=0.0195,
        ),
        Robot(  # at its left front corner, the lidar looks to the right: ahead is at the left of its view
            "hokuyo768_right_moving_BSD",
            SupervisorSection(
                scan_timeout_s=0.4,
                footprint=_BOX,
                blind_creep_m_s=0.1,  # one lidar at a corner does not see the other side
                lidar=LidarSection(
                    profile="hokuyo_urg",
                    x_m=0.35,
                    y_m=0.2,
                    yaw_rad=-math.pi / 2,
                    masked_rad=_degrees((-136.0, -126.0), (126.0, 136.0)),
                ),
            ),
            no_return=(0.0,),
            codes_below_m=0.0195,
        ),
        Robot(
            "hokuyo_urg04_people_BSD",
            SupervisorSection(
                scan_timeout_s=0.3,
                footprint=FootprintSection(radius_m=0.2),
                lidar=LidarSection(profile="hokuyo_urg"),
            ),
            longest_s=40.0,
        ),
        Robot(  # both ends of its view show the robot's own mount
            "sick_lms1xx_50hz_Apache2",
            SupervisorSection(
                scan_timeout_s=0.15,
                footprint=_BOX,
                blind_creep_m_s=0.1,  # it does not see beside the robot's front
                lidar=LidarSection(
                    profile="sick_lms", x_m=0.35, masked_rad=_degrees((-136.0, -48.0), (98.0, 136.0))
                ),
            ),
            no_return=(0.0,),
        ),
        Robot(
            "sick_intel_CCBY3",
            SupervisorSection(
                scan_timeout_s=1.2,
                footprint=FootprintSection(radius_m=0.27),
                lidar=LidarSection(profile="sick_lms"),
            ),
            no_return=(81.83,),
            longest_s=120.0,
        ),
        Robot(  # the lidar's zero direction points backwards
            "neato_lds_drive_square_MIT",
            SupervisorSection(
                scan_timeout_s=0.6,
                footprint=FootprintSection(radius_m=0.165),
                lidar=LidarSection(profile="neato_xv", yaw_rad=-math.pi),
            ),
            no_return=(0.0,),
        ),
    )
}


@dataclass(frozen=True)
class Recording:
    """A recording in the law's time: it begins at `START_S`."""

    robot: Robot
    config: LawConfig
    scans: tuple[Ranges, ...]
    header_s: Floats
    arrival_s: Floats
    odometry: tuple[Odometry, ...]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float

    @property
    def header_lag_s(self) -> float:
        """Usual time between a header's stamp and its arrival, by two clocks."""
        return float(np.median(self.arrival_s - self.header_s))

    @property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.arrival_s)))

    def base_angles(self, ranges: Ranges) -> Floats:
        """Each beam's direction against the robot's own x axis, within ±π."""
        angles: Floats = (
            self.config.lidars[0].mount.yaw_rad
            + self.angle_min
            + self.angle_increment * np.arange(len(ranges), dtype=np.float64)
        )
        turned: Floats = (angles + math.pi) % (2 * math.pi) - math.pi
        return turned

    def painted(self, ranges: Ranges, distance_m: float = 0.2, half_width_rad: float = 0.15) -> Ranges:
        """The same scan with an object straight ahead of the lidar, in the direction of travel."""
        there = np.abs(self.base_angles(ranges)) <= half_width_rad
        return np.where(there, np.float32(distance_m), ranges)

    def noisy(self, ranges: Ranges, number: int) -> Ranges:
        """The same scan with every other one 1 mm farther: no real scan repeats itself. Codes are unchanged."""
        return np.where(self.returns(ranges), ranges + np.float32(0.001 * (number % 2)), ranges)

    def returns(self, ranges: Ranges) -> npt.NDArray[np.bool_]:
        """Return which readings are distances, by the data and not by the law."""
        readings = ranges.astype(np.float64)
        no_return = ~(readings <= self.range_max) | ((readings > 0.0) & (readings < self.robot.codes_below_m))
        for code in self.robot.no_return:
            no_return |= np.isclose(readings, code, rtol=0.0, atol=1e-3)
        return ~no_return

    def scan(self, ranges: Ranges, arrival_s: float, header_s: float | None = None) -> LaserScan:
        """Return the scan as received; without `header_s`, its header has no stamp."""
        header = ros.header("laser", 0 if header_s is None else round(header_s * 1e9))
        zero = np.float32(0)
        message = ros.LaserScan(
            header=header,
            angle_min=self.angle_min,
            angle_max=self.angle_min + (len(ranges) - 1) * self.angle_increment,
            angle_increment=self.angle_increment,
            time_increment=float(zero),
            scan_time=0.0,
            range_min=self.range_min,
            range_max=self.range_max,
            ranges=ranges,
            intensities=np.empty(0, dtype=np.float32),
        )
        scan = to_scan(Arrival(message, arrival_s, None), self.config.lidars[0].timeout_s)
        assert scan is not None
        return scan

    def free_ahead_m(self, ranges: Ranges) -> float:
        """Return the free distance ahead of the front quarter of the robot's length [m]."""
        gap_m, x_m = self._readings_around(ranges)
        ahead_m = 0.0 if self.robot.section.footprint.radius_m is not None else 0.2
        return float(gap_m[x_m > ahead_m].min(initial=math.inf))

    def free_around_m(self, ranges: Ranges) -> float:
        """Return the distance between the hull and the nearest reading in any direction [m]."""
        return float(self._readings_around(ranges)[0].min(initial=math.inf))

    def _readings_around(self, ranges: Ranges) -> tuple[Floats, Floats]:
        """Each distance reading's gap to the hull and its x in the base frame [m]: plain geometry, without the law.

        A reading that is too close counts as a distance.
        """
        angles = self.base_angles(ranges)
        lidar = self.config.lidars[0].mount
        masked = np.zeros(len(ranges), dtype=np.bool_)
        for start, end in lidar.masked_rad:
            own = self.angle_min + self.angle_increment * np.arange(len(ranges), dtype=np.float64)
            masked |= (own >= start) & (own <= end)
        seen = self.returns(ranges) & ~masked
        distance = np.maximum(ranges[seen].astype(np.float64), self.range_min)
        x = lidar.x_m + distance * np.cos(angles[seen])
        y = lidar.y_m + distance * np.sin(angles[seen])
        radius_m = self.robot.section.footprint.radius_m
        if radius_m is not None:
            return np.hypot(x, y) - radius_m, x
        return np.hypot(np.maximum(np.abs(x) - 0.4, 0.0), np.maximum(np.abs(y) - 0.25, 0.0)), x


def load(robot: Robot) -> Recording:
    """Read a recording and set it to the law's time."""
    data = np.load(DATA / f"{robot.file}.npz")
    header_s: Floats = data["stamps"]
    # Where the arrival was not recorded, scans arrive in the order of the file, at the times of the stamps.
    arrival_s: Floats = data["recv_stamps"] if "recv_stamps" in data else np.sort(header_s)
    start_s = float(arrival_s[0])
    arrival_s = np.maximum.accumulate(arrival_s - start_s) + START_S + 1e-6 * np.arange(len(arrival_s))
    used = arrival_s - START_S <= robot.longest_s
    lengths = data["n_beams"] if "n_beams" in data else np.full(len(header_s), data["ranges"].shape[1])
    scans = [row[:length] for row, length, use in zip(data["ranges"], lengths, used, strict=True) if use]
    return Recording(
        robot,
        robot.section.law(),
        tuple(scans),
        header_s[used] - start_s + START_S,
        arrival_s[used],
        tuple(_odometry(data, start_s, float(arrival_s[used][-1]))),
        float(data["angle_min"]),
        float(data["angle_increment"]),
        float(data["range_min"]),
        float(data["range_max"]),
    )


def _odometry(data: "np.lib.npyio.NpzFile", start_s: float, end_s: float) -> Iterator[Odometry]:
    """Recorded velocities; if only poses were recorded, the velocity between two of them, including spikes."""
    if "odom" not in data:
        return
    rows: Floats = data["odom"]
    names = str(data["odom_cols"]).split(",")
    last_s = START_S
    for before, row in pairwise(rows):
        values = dict(zip(names, row.tolist(), strict=True))
        if "vx" in values:
            arrival_s, velocity = values["recv"], Velocity(values["vx"], values["wz"])
        else:
            arrival_s, dt_s = values["ipc_stamp"], float(row[0] - before[0])
            way_m = math.hypot(row[2] - before[2], row[3] - before[3])
            turn_rad = math.remainder(row[4] - before[4], 2 * math.pi)
            if dt_s == 0.0:
                continue
            velocity = Velocity(way_m / dt_s, turn_rad / dt_s)
        arrival_s = arrival_s - start_s + START_S
        if arrival_s > end_s:
            return
        last_s = max(last_s, arrival_s)
        yield Odometry(velocity, last_s)


@dataclass
class Replay:
    """The law over a recording: steps at 50 Hz and at each scan; the operator requests motion."""

    recording: Recording
    motion: Velocity = SLOW
    state: State = field(init=False)
    decision: Decision = field(init=False)
    driven: int = 0

    def __post_init__(self) -> None:
        self.state = proven_state(self.recording.config, now_s=START_S)
        self.state, self.decision = step(self.state, START_S - TICK_S, Inputs())

    def step(self, now_s: float, scan: LaserScan | None = None, odometry: Odometry | None = None) -> Decision:
        """Whenever the robot stops, the operator sends neutral, then requests motion again."""
        wanted = NEUTRAL if self.decision.reasons else self.motion
        command = on_time("teleop", wanted, now_s)
        inputs = Inputs(commands=(command,), scans=() if scan is None else (scan,), odometry=odometry)
        self.state, self.decision = step(self.state, now_s, inputs)
        self.driven += self.decision.output != NEUTRAL
        return self.decision

    def run(self, *, painted: bool = False) -> Iterator[tuple[int | None, Decision]]:
        """Yield each step's decision, with the number of its scan."""
        recording = self.recording
        times = sorted(
            [(float(t), n) for n, t in enumerate(recording.arrival_s)]
            + [(START_S + k * TICK_S, -1) for k in range(round((recording.arrival_s[-1] - START_S) / TICK_S))]
        )
        waiting = list(reversed(recording.odometry))
        for now_s, number in times:
            odometry = None
            while waiting and waiting[-1].arrival_s <= now_s:
                odometry = waiting.pop()
            scan = None
            if number >= 0:
                ranges = recording.scans[number]
                ranges = recording.painted(ranges) if painted else ranges
                scan = recording.scan(ranges, now_s, float(recording.header_s[number]))
            yield (None if scan is None else number), self.step(now_s, scan, odometry)

    def recovery_s(self, good: Ranges, limit_s: float) -> float:
        """Return the time until it drives again, with valid scans, a standing base and an operator."""
        assert self.state.clock.now_s is not None
        # The scene changes here, so the memory of the previous one is not valid.
        start_s = self.state.clock.now_s
        sight = self.state.sight._replace(memory=Remembered(), places=())
        self.state = self.state._replace(sight=sight)
        lag_s, period_s = self.recording.header_lag_s, self.recording.period_s
        next_scan_s, flip = start_s + period_s, 0
        accepted = self.decision.scan_counts.accepted
        # First each beam has a return, because some profiles trust no silence before that.
        proof = np.where(self.recording.returns(good), good, np.float32(5.0))
        now_s = start_s
        while now_s - start_s < limit_s:
            now_s += TICK_S
            scan = None
            if now_s >= next_scan_s:
                flip = 1 - flip
                shown = self.decision.scan_counts.accepted > accepted
                seen = self.recording.noisy(good, flip) if shown else proof
                scan = self.recording.scan(seen, now_s, now_s - lag_s)
                next_scan_s += period_s
            self.step(now_s, scan, Odometry(NEUTRAL, now_s))
            if self.decision.output != NEUTRAL:
                return now_s - start_s
        return math.inf
