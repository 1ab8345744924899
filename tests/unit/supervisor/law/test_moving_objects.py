"""Moving objects are not covered: a person who walks at the robot is touched, and how fast the robot still is then.

docs/safety-law.md ("What is not covered") has these figures. Robot and person approach each other on one line; the person
does not stop. `python -m tests.unit.supervisor.law.test_moving_objects` prints the table.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from supervisor.law.clearance import Circle
from supervisor.law.model import Command, Inputs, LawConfig, Odometry
from supervisor.law.reckoning import STANDSTILL, Pose, Velocity
from supervisor.law.safety import initial_state, step
from supervisor.law.scan import LaserScan
from tests.unit.supervisor.law.closed_loop import BEAMS, Base, World, advance
from tests.unit.supervisor.law.law_harness import CONFIG, TICK_S

HULL = Circle(0.25)
PERSON_M = 0.15
"""Radius of a person's legs at the height of the lidar."""
WALL_M = 9.0
SCAN_S = 0.05
PHASES_S = tuple(number * SCAN_S / 5 for number in range(5))
STARTS_M = tuple(np.linspace(4.0, 5.0, 10).tolist())
CORNERS = WALL_M * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def world_at(person_m: float) -> World:
    return World(np.array([[person_m, 0.0]]), np.array([PERSON_M]), CORNERS, np.roll(CORNERS, -1, axis=0))


def touch_m_s(
    robot_m_s: float, person_m_s: float, *, start_m: float, phase_s: float, config: LawConfig
) -> float:
    """Return the speed of the robot [m/s] when it touches a person who begins at `start_m`."""
    base, pose, now_s, person_m = Base(), Pose(0.0, 0.0, 0.0), 0.0, start_m
    state, decision = step(initial_state(config), now_s, Inputs())
    command, next_scan_s = STANDSTILL, phase_s
    while world_at(person_m).clearance_m(*pose, HULL) > 0.0:
        now_s += TICK_S
        assert now_s < 20.0, "they never meet"
        pose = advance(pose, base.step(command, TICK_S), TICK_S)
        person_m -= person_m_s * TICK_S
        scans: tuple[LaserScan, ...] = ()
        if now_s >= next_scan_s:
            next_scan_s += SCAN_S
            ranges = world_at(person_m).ranges(*pose)
            scans = (LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.02, 12.0, now_s),)
        asked = STANDSTILL if decision.reasons or now_s < 0.3 else Velocity(robot_m_s, 0.0)
        command = decision.output
        odometry = Odometry(base.twist, now_s)
        inputs = Inputs((Command("teleop", asked, now_s),), scans=scans, odometry=odometry)
        state, decision = step(state, now_s, inputs)
    return abs(base.twist.linear_m_s)


def fastest_touch_m_s(robot_m_s: float, person_m_s: float) -> tuple[float, int]:
    """Return the greatest speed of the robot at touch [m/s], and the number of drives."""
    config = replace(CONFIG, hull=HULL)
    speeds = [
        touch_m_s(robot_m_s, person_m_s, start_m=start_m, phase_s=phase_s, config=config)
        for start_m, phase_s in itertools.product(STARTS_M, PHASES_S)
    ]
    return max(speeds), len(speeds)


TOUCHES = (
    (0.3, 1.2, 0.0),
    (0.5, 1.2, 0.05),
    (0.8, 1.2, 0.24),
    (1.0, 1.2, 0.33),
    (1.0, 0.5, 0.0),
    (1.0, 2.0, 0.6),
)
"""Speeds of robot, of person, and of the robot at touch [m/s]: the greatest of 50 drives each."""


@pytest.mark.proof
@pytest.mark.parametrize(("robot_m_s", "person_m_s", "documented_m_s"), TOUCHES)
def test_a_person_who_walks_at_the_robot_is_touched_at_no_more_than_the_documented_speed(
    robot_m_s: float, person_m_s: float, documented_m_s: float
) -> None:
    assert fastest_touch_m_s(robot_m_s, person_m_s)[0] <= documented_m_s + 0.01


if __name__ == "__main__":
    for robot, person, _ in TOUCHES:
        speed_m_s, drives = fastest_touch_m_s(robot, person)
        print(f"robot {robot} m/s, person {person} m/s: {speed_m_s:.2f} m/s at touch, n = {drives}")
