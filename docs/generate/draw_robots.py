"""Draws docs/images/robots.svg and fleet.svg from the stored runs of the benches: `python -m docs.generate.draw_robots`.

The runs are those of `python -m bench.robots --json` and `python -m bench.fleet --json`. Panels: load, gaps of cmd_vel and stop times over the number of robots on one machine.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.fleet import CURVE
from bench.rig.sheet import percentile
from bench.robots.results import (
    STORED,
    TARGET_GAP_P99_MS,
    TARGET_ROBOTS,
    TARGET_STOP_P99_MS,
    Crowd,
    read,
)
from docs.generate.palette import DANGER, GREY, INK, LIGHT, RING, ROBOT

SATURATED_MS = 300.0
"""Longer gaps are drawn on a logarithmic scale."""
IMAGES = Path(__file__).parents[1] / "images"


def draw(crowds: Sequence[Crowd], cores: int, path: Path, *, has_targets: bool) -> None:
    """Draw three panels over the number of robots; red: the limit of the machine, and the targets."""
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    load, gaps, stops = figure.subplots(1, 3)
    robots = [one.robots for one in crowds]

    load.plot(robots, [cores * one.busy_percent for one in crowds], ".-", color=GREY, label="machine")
    load.plot(robots, [sum(one.cpu_percent) for one in crowds], ".-", color=ROBOT, label="supervisors")
    load.plot(robots, [one.feeder_percent for one in crowds], ".-", color=RING, label="sensors and operators")
    if any(one.router_percent for one in crowds):
        load.plot(robots, [one.router_percent for one in crowds], ".-", color=INK, label="router")
    load.axhline(100 * cores, color=DANGER, lw=1.6, label=f"limit: {cores} cores")
    load.set_title("CPU [% of one core]", fontsize=11)
    load.set_ylim(0, 110 * cores)
    load.legend(fontsize=8, frameon=False, loc="best")

    gaps.plot(robots, [one.gap_p50_ms for one in crowds], ".-", color=GREY, label="p50")
    gaps.plot(robots, [one.gap_p99_ms for one in crowds], ".-", color=ROBOT, label="p99")
    gaps.plot(robots, [one.gap_max_ms for one in crowds], ".:", color=RING, label="maximum")
    if has_targets:
        _target(gaps, TARGET_GAP_P99_MS)
    gaps.set_title("gaps of cmd_vel [ms]", fontsize=11)
    if max(one.gap_max_ms for one in crowds) > SATURATED_MS:
        gaps.set_yscale("log")
        gaps.set_ylim(0.5 * min(one.gap_p50_ms for one in crowds))
    else:
        gaps.set_ylim(0)

    for one in crowds:
        stops.plot([one.robots] * len(one.stop_ms), one.stop_ms, "_", color=ROBOT, alpha=0.35, ms=9)
    for percent, colour in ((50, GREY), (99, ROBOT)):
        stops.plot(
            robots,
            [percentile(one.stop_ms, percent) for one in crowds],
            ".-",
            color=colour,
            label=f"p{percent}",
        )
    if has_targets:
        _target(stops, TARGET_STOP_P99_MS)
    stops.set_title("SIGKILL to zero [ms]", fontsize=11)
    stops.set_yscale("log")
    stops.set_yticks((1, 3, 10, 30, 100, 300), ("1", "3", "10", "30", "100", "300"))

    for axes in (gaps, stops):
        axes.legend(fontsize=8, frameon=False)
    for axes in (load, gaps, stops):
        axes.set_xlabel("robots")
        axes.set_xlim(0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=LIGHT, lw=0.6)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def _target(axes: Axes, limit_ms: float) -> None:
    """Mark the target for the p99 by a line up to the target's number of robots."""
    axes.plot([0, TARGET_ROBOTS], [limit_ms, limit_ms], color=DANGER, lw=1.6)
    axes.plot([TARGET_ROBOTS], [limit_ms], "v", color=DANGER, ms=6, label="target of the p99")


def _cores(run: dict[str, str]) -> int:
    """Return the number of cores with which the description of the machine begins."""
    return int(run["machine"].split()[0])


def main() -> None:
    # A fixed salt, so that the same run gives the same file.
    mpl.rcParams.update(
        {
            "font.size": 10,
            "axes.edgecolor": GREY,
            "text.color": INK,
            "axes.labelcolor": INK,
            "svg.hashsalt": "robots",
        }
    )
    for name, file, has_targets in (("robots", STORED, True), ("fleet", CURVE, False)):
        stored = read(file)
        draw(stored.crowds, _cores(stored.run), IMAGES / f"{name}.svg", has_targets=has_targets)


if __name__ == "__main__":
    main()
