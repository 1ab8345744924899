"""Draw the pictures of docs/safety-law.md: `python -m docs.generate.draw_safety_law`.

The curves are the law's own: `supervisor.law.clearance` computes them, with the defaults of `[supervisor]`.
"""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from docs.generate.draw_seen_space import draw_partial_view, draw_seen_space
from docs.generate.palette import DANGER, GOOD, GREY, INK, RING, ROBOT, plain, style
from supervisor.config import SupervisorSection
from supervisor.law.clearance import Barrier, permitted_closing_speed, permitted_scale, survey

IMAGES = Path(__file__).parents[1] / "images"
DEFAULTS = SupervisorSection()
HULL_M = 0.25
STOP_M = DEFAULTS.stop_distance_m


def draw_barrier(path: Path) -> None:
    """One point near a robot: what the letters of the formula stand for."""
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    _letters(left)
    _directions(right)
    figure.savefig(path, dpi=150)


def _robot(axes: Axes) -> None:
    axes.add_patch(Circle((0, 0), HULL_M + STOP_M, color=RING, alpha=0.18, lw=0))
    axes.add_patch(Circle((0, 0), HULL_M + STOP_M, fill=False, color=RING, lw=1.2, ls=(0, (4, 3))))
    axes.add_patch(Circle((0, 0), HULL_M, color=ROBOT, alpha=0.85, lw=0))
    axes.set_aspect("equal")
    axes.axis("off")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str) -> None:
    axes.annotate(
        "",
        end,
        start,
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2.0, "shrinkA": 0, "shrinkB": 0},
    )


def _letters(axes: Axes) -> None:
    _robot(axes)
    point = np.array([0.72, 0.50])
    normal = point / np.hypot(*point)
    on_hull = HULL_M * normal
    axes.plot(*zip(on_hull, point, strict=True), color=INK, lw=1.0, ls=":")
    axes.plot(*point, "o", color=DANGER, ms=8)
    axes.text(0.75, 0.53, "$p$", color=DANGER, fontsize=13)
    middle = (on_hull + point) / 2
    axes.text(middle[0] - 0.01, middle[1] + 0.05, "$c$", color=INK, fontsize=13, ha="right")
    tip = on_hull + 0.17 * normal
    _arrow(axes, (on_hull[0], on_hull[1]), (tip[0], tip[1]), INK)
    axes.text(tip[0] + 0.03, tip[1] - 0.09, "$n$", color=INK, fontsize=13)
    _arrow(axes, (0, 0), (0.48, 0), "white")
    _arrow(axes, (HULL_M, 0), (0.48, 0), GOOD)
    axes.text(0.50, -0.03, "$v$", color=GOOD, fontsize=13, va="center")
    axes.annotate(
        "",
        (0.10, 0.13),
        (0.13, -0.11),
        arrowprops={"arrowstyle": "-|>", "color": "white", "lw": 1.6, "connectionstyle": "arc3,rad=0.5"},
    )
    axes.text(-0.04, 0.08, r"$\omega$", color="white", fontsize=13, ha="center")
    speed = 0.62
    closing = speed * normal[0]
    seen_end = point - 0.3 * closing / speed * normal / normal[0]
    _arrow(axes, (point[0], point[1]), (seen_end[0] + 0.04, seen_end[1] + 0.03), DANGER)
    axes.text(seen_end[0] + 0.09, seen_end[1] - 0.10, "$k$: how fast it closes", color=DANGER, fontsize=10)
    axes.text(
        0, -HULL_M - STOP_M - 0.08, f"{STOP_M:.2f} m around the hull", color=GREY, ha="center", va="top"
    )
    axes.text(0, -0.14, "hull", color="white", ha="center", fontsize=10)
    axes.set_xlim(-0.66, 1.12)
    axes.set_ylim(-0.78, 0.72)
    axes.set_title("one point of a scan", color=INK, fontsize=11)


def _directions(axes: Axes) -> None:
    """Which share of three motions the barrier permits near a wall."""
    _robot(axes)
    wall = np.stack([np.full(121, 0.70), np.linspace(-0.66, 0.66, 121)], axis=1)
    axes.plot(wall[:, 0], wall[:, 1], color=INK, lw=4, solid_capstyle="butt")
    axes.text(0.75, 0.0, "a wall at 0.45 m", rotation=270, va="center", color=INK, fontsize=10)
    hull = DEFAULTS.footprint.hull()
    around = survey(hull, wall)
    barrier = Barrier(STOP_M, DEFAULTS.deceleration_m_s2, 0.1, 0.0)
    for name, linear, angular, where in (
        ("forward", 1.0, 0.0, (0.39, 0.05)),
        ("back", -1.0, 0.0, (-0.39, 0.05)),
        ("turn on the spot", 0.0, 1.0, (0.0, -0.40)),
    ):
        scale, _ = permitted_scale(around, linear, angular, barrier)
        color = GOOD if scale == 1.0 else DANGER
        axes.text(*where, f"{name}\n{100 * scale:.0f} %", color=color, fontsize=10, ha="center")
    _arrow(axes, (HULL_M, 0), (0.52, 0), DANGER)
    _arrow(axes, (-HULL_M, 0), (-0.52, 0), GOOD)
    axes.add_patch(Wedge((0, 0), 0.16, 100, 350, width=0.018, color="white"))
    angle = math.radians(350)
    axes.plot(0.151 * math.cos(angle), 0.151 * math.sin(angle), marker=(3, 0, 10), color="white", ms=9)
    axes.set_xlim(-0.66, 1.12)
    axes.set_ylim(-0.78, 0.72)
    axes.set_title("the permitted share of 1 m/s and of 1 rad/s", color=INK, fontsize=11)


def draw_braking(path: Path) -> None:
    """κ(c) for several reaction times."""
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    axes = figure.subplots()
    clearance = np.linspace(0.0, 1.2, 601)
    reactions_s = (0.05, 0.1, 0.2, 0.4)
    colors = ("#86a5c8", ROBOT, "#274b73", "#13273f")
    for reaction_s, color in zip(reactions_s, colors, strict=True):
        barrier = Barrier(STOP_M, DEFAULTS.deceleration_m_s2, reaction_s, 0.0)
        speed = permitted_closing_speed(clearance, barrier)
        axes.plot(clearance, speed, color=color, lw=2.2)
        axes.text(1.21, speed[-1], f"$T$ = {reaction_s:g} s", color=color, va="center", fontsize=10)
    axes.axvspan(0.0, STOP_M, color=RING, alpha=0.18, lw=0)
    axes.text(
        STOP_M / 2, 1.05, f"nothing may close\nwithin {STOP_M:.2f} m", color=INK, ha="center", fontsize=10
    )
    axes.axhline(DEFAULTS.max_linear_m_s, color=GREY, lw=1.0, ls=(0, (4, 3)))
    axes.text(0.01, DEFAULTS.max_linear_m_s - 0.02, "limit of a command", color=GREY, va="top", fontsize=9)
    axes.set_xlim(0.0, 1.2)
    axes.set_ylim(0.0, 1.7)
    axes.set_xlabel("$c$: distance from the hull [m]")
    axes.set_ylabel(r"$\kappa(c)$: permitted closing speed [m/s]")
    plain(axes)
    figure.savefig(path, dpi=150)


def main() -> None:
    style()
    draw_barrier(IMAGES / "barrier.png")
    draw_braking(IMAGES / "braking.png")
    draw_seen_space(IMAGES / "seen-space.png")
    draw_partial_view(IMAGES / "partial-view.png")


if __name__ == "__main__":
    main()
