"""Compares one drive with its plan, and reports what is unexpected. Pure."""

import math

from commission.mounting import MOVED_M, MOVED_RAD, turn_between
from commission.plan import Base, Drive
from commission.trace import Odom, ahead_m
from commission.wall import Wall
from teleop.path.course import Pose, wrap

START_S = 1.5
"""A robot that has not moved this long after its first command does not move."""
WRONG_WAY_M = 0.08
WRONG_WAY_RAD = 0.15
NEARER_M = 0.1
"""How much nearer to the wall than planned a drive may come."""
NEAREST_M = 0.35
OVERTIME_SHARE, OVERTIME_S = 2.0, 3.0


class Watch:
    """Compares one drive with its plan."""

    def __init__(
        self,
        drive: Drive,
        base: Base,
        start: Pose,
        before: Wall,
        gap_m: float,
        started_s: float,
        *,
        is_first: bool,
    ) -> None:
        self._drive, self._start, self._before, self._gap_m = drive, start, before, gap_m
        self._started_s, self._is_first = started_s, is_first
        planned_m = max(0.0, drive.way_m) + (base.stop_m(drive.speed) if drive.way_m > 0.0 else 0.0)
        self._least_m = max(NEAREST_M, gap_m - planned_m - NEARER_M)
        self._latest_s = started_s + OVERTIME_SHARE * drive.lasts_s + OVERTIME_S

    def _done(self, odom: Odom) -> float:
        """Return the distance or the turn in the commanded direction, by odometry."""
        if self._drive.turn_rad:
            return wrap(odom.pose.yaw_rad - self._start.yaw_rad) * math.copysign(1.0, self._drive.turn_rad)
        return ahead_m(self._start, odom.pose) * math.copysign(1.0, self._drive.way_m)

    def is_done(self, odom: Odom, wall: Wall | None) -> bool:
        goal = abs(self._drive.turn_rad or self._drive.way_m)
        if self._is_first and wall is not None:
            by_wall = (
                turn_between(self._before, wall)
                if self._drive.turn_rad
                else wall.distance_m - self._before.distance_m
            )
            return max(abs(self._done(odom)), abs(by_wall)) >= goal
        return self._done(odom) >= goal

    def progress(self, odom: Odom) -> str:
        done = abs(self._done(odom))
        return f"{math.degrees(done):.0f}°" if self._drive.turn_rad else f"{done:.2f} m"

    def too_near(self, gap_m: float) -> str | None:
        """Return a text if the robot is closer to the wall than planned; else None."""
        if gap_m >= self._least_m:
            return None
        return f"it comes closer to the wall than planned: {gap_m:.2f} m from the hull"

    def surprise(self, now_s: float, odom: Odom, wall: Wall, gap_m: float) -> str | None:
        """Return what is unexpected; None if nothing is."""
        if (near := self.too_near(gap_m)) is not None:
            return near
        if now_s > self._latest_s:
            return f"it takes longer than planned: {self.progress(odom)} in {now_s - self._started_s:.0f} s"
        done, is_turn = self._done(odom), bool(self._drive.turn_rad)
        nearer_m = self._before.distance_m - wall.distance_m
        if not self._is_first:
            if done < -(WRONG_WAY_RAD if is_turn else WRONG_WAY_M):
                return "odometry shows a motion in the other direction"
            if not is_turn and nearer_m * math.copysign(1.0, self._drive.way_m) < -WRONG_WAY_M:
                return "the wall shows a motion in the other direction"
        if now_s - self._started_s > START_S:
            by_odometry = abs(done) >= (MOVED_RAD if is_turn else MOVED_M)
            moved = abs(turn_between(self._before, wall)) if is_turn else abs(nearer_m)
            by_wall = moved >= (MOVED_RAD if is_turn else MOVED_M)
            if not by_odometry:
                return (
                    "the wall shows a motion, and odometry does not"
                    if by_wall
                    else "the robot does not move: check its e-stop and its drives"
                )
            if not by_wall:
                return "odometry shows a motion, and the wall does not: the wheels slip, or the lidar is frozen or looks elsewhere"
        return None
