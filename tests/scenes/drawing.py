"""Describes one run around its worst moment as text, and draws it as a picture."""

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib import patches
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from supervisor.law.clearance import Circle
from supervisor.law.reckoning import Pose
from tests.scenes.run import Moment, Outcome
from tests.scenes.scene import Lidar, Scene
from tests.scenes.sensing import Ranges
from tests.scenes.world import Floats, Measure

MARGIN_M = 1.0
"""Margin of the picture around the hull's path."""


def describe(scene: Scene, outcome: Outcome, moments: list[Moment], around_s: float) -> list[str]:
    """Describe the ticks around the worst moment: motion, decision, and place of the nearest object."""
    measure = Measure(scene.hull)
    lines = [
        "     t   clear  at base (x, y)   bearing  |  moves v, w     asked v, w     output v, w    scale  reasons, scans"
    ]
    for moment in moments:
        if abs(moment.now_s - outcome.closest_s) > around_s:
            continue
        clearances = measure.clearances_m(scene.world, *moment.pose)
        number = int(clearances.argmin())
        _, points = scene.world.seen_from(*moment.pose).nearest_to(0.0, 0.0)
        x_m, y_m = points[number].tolist()
        decision = moment.decision
        scans = " ".join(
            f"{lidar}:{at_s:.3f}{_beams_at(scene.lidars[lidar], ranges, x_m, y_m)}"
            for lidar, at_s, ranges in moment.scans
        )
        lines.append(
            f"{moment.now_s:6.2f}  {clearances[number]:6.4f}  #{number:<2} ({x_m:5.2f},{y_m:5.2f})"
            f"  {math.degrees(math.atan2(y_m, x_m)):6.1f}°"
            f"  | {moment.twist.linear_m_s:5.2f} {moment.twist.angular_rad_s:5.2f}"
            f"   {moment.asked.linear_m_s:5.2f} {moment.asked.angular_rad_s:5.2f}"
            f"   {decision.output.linear_m_s:6.3f} {decision.output.angular_rad_s:6.3f}"
            f"  {decision.scale:5.3f}  {','.join(decision.reasons)} {scans}"
        )
    return lines


def _beams_at(lidar: Lidar, ranges: Ranges, x_m: float, y_m: float) -> str:
    """Format the readings of the three beams around a point in the base frame."""
    bearing = math.atan2(y_m - lidar.y_m, x_m - lidar.x_m) - lidar.yaw_rad
    away_m = math.hypot(y_m - lidar.y_m, x_m - lidar.x_m)
    beam = round(((bearing - lidar.angle_min) % (2 * math.pi)) / lidar.angle_increment)
    if beam > lidar.beams:
        return f"[outside the fan, {away_m:.2f} m]"
    near = " ".join(f"{ranges[number % lidar.beams]:.3f}" for number in (beam - 1, beam, beam + 1))
    return f"[{near}; centre at {away_m:.3f}]"


def draw(scene: Scene, outcome: Outcome, moments: list[Moment], path: Path) -> None:
    """Draw the hull's path, the objects, the hull at its closest, and each lidar's last scan before that."""
    figure, axes = plt.subplots(figsize=(9, 9))
    world = scene.world
    for start, end, radius_m in zip(world.starts, world.ends, world.radii, strict=True):
        axes.plot([start[0], end[0]], [start[1], end[1]], color="0.4", linewidth=0.5)
        for centre in (start, end):
            axes.add_patch(patches.Circle(tuple(centre), radius_m, color="0.4"))
    ways = np.array([(moment.pose.x_m, moment.pose.y_m) for moment in moments])
    axes.plot(ways[:, 0], ways[:, 1], color="tab:blue", linewidth=0.7)
    closest = min(moments, key=lambda moment: abs(moment.now_s - outcome.closest_s))
    _draw_hull(axes, scene, closest.pose, "tab:red")
    for number, lidar in enumerate(scene.lidars):
        seen = [
            (moment.pose, ranges)
            for moment in moments
            if moment.now_s <= closest.now_s
            for which, _, ranges in moment.scans
            if which == number
        ]
        if seen:
            pose, ranges = seen[-1]
            points = _points(lidar, pose, ranges)
            axes.plot(points[:, 0], points[:, 1], ".", markersize=3, color="tab:green")
    low, high = ways.min(axis=0) - MARGIN_M, ways.max(axis=0) + MARGIN_M
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_title(f"seed {scene.seed}: {outcome.closest_m:.3f} m at {outcome.closest_s:.2f} s")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_hull(axes: Axes, scene: Scene, pose: Pose, colour: str) -> None:
    if isinstance(scene.hull, Circle):
        axes.add_patch(patches.Circle((pose.x_m, pose.y_m), scene.hull.radius_m, fill=False, color=colour))
    else:
        axes.add_patch(patches.Polygon(_placed(np.array(scene.hull.corners), pose), fill=False, color=colour))
    ahead = _placed(np.array(((0.0, 0.0), (0.15, 0.0))), pose)
    axes.plot(ahead[:, 0], ahead[:, 1], color=colour)


def _placed(points: Floats, pose: Pose) -> Floats:
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    placed: Floats = points @ np.array(((cos, sin), (-sin, cos))) + (pose.x_m, pose.y_m)
    return placed


def _points(lidar: Lidar, pose: Pose, ranges: Ranges) -> Floats:
    good = np.isfinite(ranges) & (ranges > 0.0) & (ranges <= lidar.range_max)
    angle = lidar.yaw_rad + lidar.angle_min + lidar.angle_increment * np.arange(lidar.beams)[good]
    reading = ranges[good].astype(np.float64)
    points = np.stack((lidar.x_m + reading * np.cos(angle), lidar.y_m + reading * np.sin(angle)), axis=1)
    return _placed(points, pose)
