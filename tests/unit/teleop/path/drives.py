"""The real plant follows a course in virtual time, with a transport's delay between the two."""

import math
from typing import NamedTuple

import numpy as np

from sim.motion_sensors import PERFECT, Odometer
from sim.plant import Plant
from teleop.path.course import Path, Pose, Poses, TrackError, seen_from, wrap
from teleop.path.pursuit import Course
from teleop.pilots.pilot import NEUTRAL, Velocity

BEAT_STEPS = 25
"""Of 2 ms: the heartbeat's 20 Hz."""
DELAY_STEPS = 20
"""Odometry to command to wheels: 40 ms."""
ODOM_STEPS = 10
REST_STEPS = 300


class Driven(NamedTuple):
    """The result of a drive."""

    done: bool
    took_s: float
    by_odometry: TrackError
    by_truth: TrackError
    end_m: float
    end_rad: float
    times_s: "np.ndarray"
    odometry: Poses
    collisions: int

    def __str__(self) -> str:
        odometry, truth = self.by_odometry, self.by_truth
        return (
            f"{self.took_s:.1f} s; odometry: {odometry.rms_m * 1e3:.1f} mm rms, {odometry.max_m * 1e3:.1f} mm at most; "
            f"truth: {truth.rms_m * 1e3:.1f} and {truth.max_m * 1e3:.1f} mm; "
            f"end: {self.end_m * 1e3:.1f} mm, {math.degrees(self.end_rad):.1f} degrees"
        )


def drive(path: Path, speed_m_s: float, limit_s: float = 120.0) -> Driven:
    """Drive a path whose frame is that of the odometry; the robot stands at its origin."""
    plant = Plant()
    course = Course(path, speed_m_s)
    command, under_way = NEUTRAL, list[tuple[int, Velocity]]()
    by_odometry, by_truth = list[float](), list[float]()
    rows, times_s = list[tuple[float, float, float]](), list[float]()
    rest_at: int | None = None
    odometer, period_s = Odometer(plant.wheels, PERFECT), ODOM_STEPS * plant.timestep_s
    seen = odometer.read(*plant.wheel_angles_rad, period_s)
    for step in range(round(limit_s / plant.timestep_s)):
        if rest_at is None and step % BEAT_STEPS == 0:
            velocity = course.step(Pose(*seen[:3]), seen.linear_m_s)
            if velocity is None:
                rest_at = step + REST_STEPS
            under_way.append((step + DELAY_STEPS, NEUTRAL if velocity is None else velocity))
        if step == rest_at:
            break
        while under_way and under_way[0][0] <= step:
            command = under_way.pop(0)[1]
        plant.step(command)
        if step % ODOM_STEPS == 0:
            seen = odometer.read(*plant.wheel_angles_rad, period_s)
            rows.append(seen[:3])
            times_s.append(plant.time_s)
            by_odometry.append(course.station(Pose(*seen[:3])).off_m)
            (true,) = seen_from(np.array([plant.true_pose]), Pose(*plant.start_pose)).tolist()
            by_truth.append(course.station(Pose(*true)).off_m)
    odometry, truth = TrackError.of(by_odometry), TrackError.of(by_truth)
    assert odometry is not None
    assert truth is not None
    return Driven(
        done=rest_at is not None,
        took_s=times_s[-1],
        by_odometry=odometry,
        by_truth=truth,
        end_m=math.hypot(seen.x_m - path.end.x_m, seen.y_m - path.end.y_m),
        end_rad=abs(wrap(seen.yaw_rad - path.end.yaw_rad)),
        times_s=np.array(times_s),
        odometry=np.array(rows),
        collisions=plant.collisions,
    )
