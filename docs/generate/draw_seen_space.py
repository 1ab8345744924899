"""Draw docs/images/seen-space.png and partial-view.png; `python -m docs.generate.draw_safety_law` calls this.

Every point is the law's own: `supervisor.law.scan`, `seen_space` and `near_memory` compute them from made-up scans.
"""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Circle, Patch, Polygon

from docs.generate.palette import GOOD, HIDDEN, INK, REMEMBERED, ROBOT, plain
from supervisor.config import SupervisorSection
from supervisor.law import clearance
from supervisor.law.clearance import Barrier, Floats, Hull, Kind, permitted_scale, survey
from supervisor.law.lidar import PROFILES
from supervisor.law.near_memory import Remembered, remember
from supervisor.law.reckoning import Pose
from supervisor.law.scan import LaserScan, Lidar, Moment, Mount, ScanReading, View, rays_of, read_scan
from supervisor.law.seen_space import hidden_places, hiding_distance_m, lookout
from wire.host.config import read_toml

DEFAULTS = SupervisorSection()
EXAMPLES = Path(__file__).parents[2] / "deploy" / "examples"
HERE = Pose(0.0, 0.0, 0.0)
REACH_M = 3.0
"""From the hull: farther than anything in the drawings."""

SMALLEST_M = 0.10
"""Larger than the default, so that the distances can be seen."""
BEAMS = 120
RANGE_M = 1.5
ROUND = clearance.Circle(0.25)
SPARSE = Lidar("lidar", Mount(), PROFILES["rep117"], timeout_s=0.24)


def draw_seen_space(path: Path) -> None:
    """What a scan proves and what stays hidden; and what a hole costs in speed."""
    figure = Figure(figsize=(11, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    _scene(left)
    _speed_by_hole(right)
    figure.savefig(path, dpi=150)


WALL, DIRT, COVER = slice(78, 106), slice(51, 53), slice(4, 18)
"""Beams of the first drawing, counted from straight behind, counter-clockwise, 3° apart."""


def _read(ranges: Floats, taken_s: float, before: ScanReading | None) -> ScanReading:
    scan = LaserScan(
        ranges.astype(np.float32), -math.pi, 2 * math.pi / BEAMS, 0.05, RANGE_M, arrival_s=taken_s
    )
    moment = Moment(taken_s, SPARSE.timeout_s, HERE, 0.0, 0.0)
    return read_scan(
        before, scan, moment, SPARSE, ROUND, REACH_M, DEFAULTS.smallest_obstacle_m, in_the_open=False
    )


def _scene(axes: Axes) -> None:
    """A scan, one lidar timeout after another that still saw a pillar where there is dirt by now."""
    angle = -math.pi + 2 * math.pi / BEAMS * np.arange(BEAMS)
    ranges = np.full(BEAMS, np.inf)
    ranges[WALL] = 0.95 / np.sin(angle[WALL])
    ranges[ranges > RANGE_M] = np.inf
    earlier = ranges.copy()
    earlier[DIRT] = 0.44
    ranges[DIRT] = np.nan
    ranges[COVER] = np.nan
    first = _read(earlier, 0.0, None)
    last = _read(ranges, 2 * SPARSE.timeout_s, first)
    assert last.view is not None  # both scans are valid
    shown = first.around.points
    kept = remember(Remembered(shown, np.zeros(len(shown))), last.view, SPARSE.mount)
    hidden = hidden_places(last.view, SPARSE.mount, ROUND, SMALLEST_M, REACH_M)
    hidden = hidden[np.hypot(hidden[:, 0], hidden[:, 1]) < RANGE_M + 0.01]
    _rays(axes, last.view, SPARSE.mount, ROUND)
    axes.add_patch(Circle((0, 0), ROUND.radius_m, color=ROBOT, lw=0, zorder=3))
    axes.text(-0.05, 0.12, "hull", color="white", ha="center", va="center", zorder=4)
    _forward(axes, (0.02, 0.0))
    axes.plot(0, 0, "o", color="white", mec=INK, ms=6, zorder=6)
    seen = last.around.points
    axes.plot(seen[:, 0], seen[:, 1], "o", color=INK, ms=4)
    axes.plot(hidden[:, 0], hidden[:, 1], "o", color=HIDDEN, ms=4, zorder=5)
    axes.plot(kept.points[:, 0], kept.points[:, 1], "D", color=REMEMBERED, ms=6)
    _note(axes, "return: its ray is free up to it", (0.1, 0.97), (0.1, 1.22), INK)
    edge = 2 * math.pi / BEAMS * 3
    hides_m = float(hiding_distance_m(np.array(edge), SMALLEST_M))
    dirt = float(np.mean(angle[DIRT]))
    disc_m = hides_m + SMALLEST_M / 2
    centre = (disc_m * math.cos(dirt), disc_m * math.sin(dirt))
    axes.add_patch(Circle(centre, SMALLEST_M / 2, fill=False, color=HIDDEN, lw=1.2))
    axes.plot(
        [0, hides_m * math.cos(dirt)], [0, hides_m * math.sin(dirt)], "--", color=HIDDEN, lw=1.0, zorder=5
    )
    sides = (math.degrees(dirt - edge / 2), math.degrees(dirt + edge / 2))
    axes.add_patch(Arc((0, 0), 3.04, 3.04, theta1=sides[0], theta2=sides[1], color=HIDDEN, lw=1.2))
    axes.text(1.6 * math.cos(dirt), 1.6 * math.sin(dirt), "δ", color=HIDDEN, ha="center", va="center")
    _note(
        axes,
        f"narrow hole, δ = {math.degrees(edge):.0f}°: a disc of\n"
        f"w = {100 * SMALLEST_M:.0f} cm fits from r = {hides_m:.2f} m (dashed)",
        centre,
        (1.1, -1.72),
        HIDDEN,
    )
    point = kept.points[0]
    _note(axes, "remembered: no beam\nhas disproved it", (point[0], point[1]), (0.62, 0.42), REMEMBERED)
    _note(axes, "wide hole: hidden places\nat the hull and its edges", (-0.2, -0.17), (-1.25, -0.62), HIDDEN)
    _note(axes, "no return: free up to\nrange_max, then hidden", (0.0, -RANGE_M), (-1.1, -1.72), HIDDEN)
    axes.set_xlim(-1.75, 1.75)
    axes.set_ylim(-1.9, 1.4)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(
        f"what one scan proves (120 beams, short range, w = {100 * SMALLEST_M:.0f} cm)",
        color=INK,
        fontsize=11,
    )


def _forward(axes: Axes, start: tuple[float, float]) -> None:
    """An arrow on the hull: ahead is to the right."""
    x_m, y_m = start
    arrow = {"arrowstyle": "-|>", "color": "white", "lw": 2.0}
    axes.annotate("", (x_m + 0.24, y_m), start, zorder=5, arrowprops=arrow)


def _free_area(axes: Axes, view: View, mount: Mount, hull: Hull) -> None:
    """What a view without holes has seen free."""
    rays = rays_of(view.geometry, mount, hull)
    ends = (rays.direction * view.free_m + rays.origin_m).T
    axes.add_patch(Polygon(np.vstack([rays.origin_m.T, ends]), color=GOOD, alpha=0.13, lw=0))


def _rays(axes: Axes, view: View, mount: Mount, hull: Hull) -> None:
    """What a view has seen free, as an area from beam to beam, and each ray."""
    rays = rays_of(view.geometry, mount, hull)
    origin = rays.origin_m[:, 0]
    ends = (rays.direction * view.free_m + rays.origin_m).T
    known = view.free_m > 0.0
    for first in range(len(ends)):
        second = (first + 1) % len(ends)
        if second == 0 and view.geometry.beams * abs(view.geometry.increment) < 2 * math.pi - 1e-6:
            break
        if known[first] and known[second]:
            axes.add_patch(
                Polygon(np.stack([origin, ends[first], ends[second]]), color=GOOD, alpha=0.13, lw=0)
            )
    for end in ends[known]:
        axes.plot([origin[0], end[0]], [origin[1], end[1]], color=GOOD, lw=0.4, alpha=0.5)


def _note(axes: Axes, text: str, point: tuple[float, float], place: tuple[float, float], color: str) -> None:
    axes.annotate(
        text,
        point,
        place,
        color=color,
        fontsize=9,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": color, "lw": 0.8, "shrinkB": 3},
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.8},
    )


def permitted_ahead_m_s(hole_rad: float, smallest_m: float) -> float:
    """How fast the default robot may drive at a hole of its default lidar, far from everything [m/s].

    Args:
        hole_rad: angle between the last rays beside the hole, which is straight ahead.
        smallest_m: the diameter of the smallest obstacle.
    """
    beams = 3600
    increment = 2 * math.pi / beams
    angle = -math.pi + increment * (np.arange(beams) + 0.5)
    ranges = np.where(np.abs(angle) < hole_rad / 2 - 1e-9, np.nan, 5.0)
    lidar = Lidar("lidar", Mount(), PROFILES["rep117"], timeout_s=0.24)
    scan = LaserScan(ranges.astype(np.float32), float(angle[0]), increment, 0.05, 12.0, arrival_s=0.0)
    reading = read_scan(
        None, scan, Moment(0.0, 0.05, HERE, 0.0, 0.0), lidar, ROUND, REACH_M, smallest_m, in_the_open=False
    )
    assert reading.view is not None  # most beams see
    hidden = hidden_places(reading.view, lidar.mount, ROUND, smallest_m, REACH_M)
    barrier = Barrier(DEFAULTS.stop_distance_m, DEFAULTS.deceleration_m_s2, 0.1, 0.0)
    fastest_m_s = DEFAULTS.max_linear_m_s
    return fastest_m_s * permitted_scale(survey(ROUND, hidden, Kind.HIDDEN), fastest_m_s, 0.0, barrier)[0]


def _speed_by_hole(axes: Axes) -> None:
    increment = math.radians(0.1)
    holes_rad = increment * np.arange(1, 150, 2)
    for smallest_m, color in ((0.02, "#86a5c8"), (DEFAULTS.smallest_obstacle_m, ROBOT), (0.10, "#13273f")):
        speed = [permitted_ahead_m_s(float(hole), smallest_m) for hole in holes_rad]
        axes.plot(np.degrees(holes_rad), speed, color=color, lw=2.0, label=f"w = {100 * smallest_m:.0f} cm")
    axes.legend(title="smallest_obstacle_m", frameon=False)
    axes.set_xlabel("δ: width of a hole straight ahead [°]")
    axes.set_ylabel("permitted speed straight ahead [m/s]")
    axes.set_ylim(0.0, 1.05)
    axes.set_xlim(0.0, 15.0)
    plain(axes)
    axes.set_title("less seen, less speed (round hull, radius 0.25 m; T = 0.1 s)", color=INK, fontsize=11)


def draw_partial_view(path: Path) -> None:
    """The hidden places of the example with one front lidar, and what a second lidar leaves of them."""
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    _partial_view(
        left, EXAMPLES / "amr_one_lidar.toml", "one front lidar: hidden places at the sides and behind"
    )
    _partial_view(
        right,
        EXAMPLES / "amr_two_lidars.toml",
        "two lidars at opposite corners: only in front of walls",
    )
    figure.legend(
        handles=[
            Patch(color=GOOD, alpha=0.13, label="seen free by one lidar"),
            Patch(color=GOOD, alpha=0.25, label="by both"),
            Line2D([], [], marker="o", ls="", color=HIDDEN, ms=5, label="hidden place"),
            Line2D([], [], marker="o", ls="", color="white", mec=INK, ms=7, label="lidar"),
        ],
        loc="outside lower center",
        ncols=4,
        frameon=False,
    )
    figure.savefig(path, dpi=150)


ROOM: Floats = np.array([[1.3, 0.9], [-1.3, 0.9], [-1.3, -0.9], [1.3, -0.9]])
"""Corners [m] of the room in which the examples stand."""


def _to_walls(mount: Mount, angle_rad: Floats) -> Floats:
    """Distances (n,) [m] from a lidar to the walls of the room, for directions (n,) in the base frame."""
    across, along = np.abs(np.cos(angle_rad)), np.abs(np.sin(angle_rad))
    to_x = ROOM[0, 0] - np.sign(np.cos(angle_rad)) * mount.x_m
    to_y = ROOM[0, 1] - np.sign(np.sin(angle_rad)) * mount.y_m
    distance: Floats = np.minimum(to_x / np.maximum(across, 1e-9), to_y / np.maximum(along, 1e-9))
    return distance


def _partial_view(axes: Axes, file: Path, title: str) -> None:
    """An example's robot in a small room."""
    config = SupervisorSection.model_validate(read_toml(file)["supervisor"])
    hull, lidars = config.footprint.hull(), config.law().lidars
    assert isinstance(hull, clearance.ConvexPolygon)  # both examples are rectangles
    views: list[View] = []
    for section, lidar in zip(config.all_lidars(), lidars, strict=True):
        assert section.view_rad is not None  # the examples say what their lidars see
        assert section.beams is not None
        first, last = section.view_rad
        increment = (last - first) / (section.beams - 1)
        angle: Floats = lidar.mount.yaw_rad + first + increment * np.arange(section.beams, dtype=np.float64)
        ranges = _to_walls(lidar.mount, angle).astype(np.float32)
        scan = LaserScan(ranges, first, increment, 0.05, 25.0, arrival_s=0.0)
        moment = Moment(0.0, 0.07, HERE, 0.0, 0.0)
        reading = read_scan(
            None, scan, moment, lidar, hull, REACH_M, config.smallest_obstacle_m, in_the_open=False
        )
        assert reading.view is not None  # every beam returns
        views.append(reading.view)
        _free_area(axes, reading.view, lidar.mount, hull)
    lookouts = [lookout(v, lidar.mount, HERE, HERE) for v, lidar in zip(views, lidars, strict=True)]
    parts: list[Floats] = []
    for view, lidar, own in zip(views, lidars, lookouts, strict=True):
        others = tuple(one for one in lookouts if one is not own)
        smallest_m = config.smallest_obstacle_m
        parts.append(hidden_places(view, lidar.mount, hull, smallest_m, REACH_M, lambda given=others: given))
    hidden = np.concatenate(parts)
    hidden = hidden[(np.abs(hidden) < ROOM[0]).all(axis=1)]
    axes.add_patch(Polygon(np.array(hull.corners), color=ROBOT, lw=0, zorder=3))
    axes.plot(hidden[:, 0], hidden[:, 1], "o", color=HIDDEN, ms=5, zorder=5)
    for lidar in lidars:
        axes.plot(lidar.mount.x_m, lidar.mount.y_m, "o", color="white", mec=INK, ms=7, zorder=6)
    _forward(axes, (-0.05, 0.0))
    axes.add_patch(Polygon(ROOM, fill=False, color=INK, lw=3))
    axes.set_xlim(-1.45, 1.45)
    axes.set_ylim(-1.05, 1.05)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(title, color=INK, fontsize=11)
