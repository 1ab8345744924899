"""Draws docs/images/robots.svg, fleet.svg and link.svg from the stored runs of the benches: `python -m docs.generate.draw_benches`."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.link.results import MANY, TARGET_ROUND_TRIP_S, TARGETS, Link, Measured
from bench.link.results import read as read_link
from bench.rig.sheet import percentile
from bench.robots.results import ROUTER, STORED, Robots, read
from docs.generate.palette import DANGER, GREY, INK, RING, ROBOT, UNDATED, plain, style

IMAGES = Path(__file__).parents[1] / "images"
SATURATED_MS = 300.0
"""Longer gaps are drawn on a logarithmic scale."""
COLOURS = {Link.TCP: RING, Link.QUIC: ROBOT, Link.UDP: GREY}
LABELS = {Link.TCP: "TCP", Link.QUIC: "QUIC, mutual TLS, datagrams", Link.UDP: "UDP, without TLS"}
ORDER = {link: number for number, link in enumerate(Link)}
TARGETS_PERCENT = {100 * loss: target for loss, target in TARGETS.items()}
LINEAR_BELOW = 1.0
"""Stops an hour below which the axis is linear, so that it shows zero."""


def draw_robots(path: Path, stored: Robots) -> None:
    """Draw load, gaps of cmd_vel and stop times over the number of robots on one machine; red: the limit of the machine."""
    crowds, cores = stored.crowds, int(stored.run["machine"].split()[0])
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
    stops.set_title("SIGKILL to zero [ms]", fontsize=11)
    stops.set_yscale("log")
    stops.set_yticks((1, 3, 10, 30, 100, 300), ("1", "3", "10", "30", "100", "300"))

    for axes in (gaps, stops):
        axes.legend(fontsize=8, frameon=False)
    for axes in (load, gaps, stops):
        axes.set_xlabel("robots")
        axes.set_xlim(0)
        plain(axes)
    figure.savefig(path, metadata=UNDATED)


def draw_link(path: Path, measured: Sequence[Measured]) -> None:
    """Draw false stops an hour over loss: a panel for each round trip, a line for each link; red: the targets for QUIC.

    Args:
        path: of the picture.
        measured: one for each condition.
    """
    round_trips_s = sorted({one.round_trip_s for one in measured})
    lines = sorted({(one.link, one.lease_s) for one in measured}, key=lambda line: (ORDER[line[0]], line[1]))
    shortest_s = min(lease_s for _, lease_s in lines)
    figure = Figure(figsize=(2.9 * len(round_trips_s), 3.7), layout="constrained")
    panels = figure.subplots(1, len(round_trips_s), sharey=True, squeeze=False)[0]
    for round_trip_s, axes in zip(round_trips_s, panels, strict=True):
        for link, lease_s in lines:
            found = [
                one
                for one in measured
                if (one.link, one.lease_s, one.round_trip_s) == (link, lease_s, round_trip_s)
            ]
            _line(axes, sorted(found, key=lambda one: one.loss), "-" if lease_s == shortest_s else "--")
        if round_trip_s == TARGET_ROUND_TRIP_S:
            axes.plot(list(TARGETS_PERCENT), list(TARGETS_PERCENT.values()), "v", color=DANGER, ms=6)
        axes.set_title(f"round trip {1000 * round_trip_s:g} ms", fontsize=11)
        axes.set_xlabel("packets lost, each way [%]")
        axes.set_yscale("symlog", linthresh=LINEAR_BELOW)
        axes.set_yticks((0, 1, 10, 100, 1000, 10000), ("0", "1", "10", "100", "1,000", "10,000"))
        axes.minorticks_off()
        axes.set_ylim(-0.15, 20_000)
        plain(axes)
    panels[0].set_ylabel("false stops an hour")
    _legend(figure, lines, shortest_s)
    figure.savefig(path, metadata=UNDATED)


def _line(axes: Axes, found: Sequence[Measured], style: str) -> None:
    """Draw the rates of a link; thin lines end at the upper bounds of rates with few stops."""
    losses = [100 * one.loss for one in found]
    if found:
        axes.plot(losses, [one.per_hour for one in found], f".{style}", color=COLOURS[found[0].link])
    for one in found:
        if one.stops < MANY:
            bounds = [one.per_hour, one.upper_per_hour]
            axes.plot([100 * one.loss] * 2, bounds, color=COLOURS[one.link], lw=0.7)


def _legend(figure: Figure, lines: Sequence[tuple[Link, float]], shortest_s: float) -> None:
    handles = [
        Line2D(
            [],
            [],
            color=COLOURS[link],
            ls="-" if lease_s == shortest_s else "--",
            marker=".",
            label=f"{LABELS[link]}, lease {lease_s:g} s",
        )
        for link, lease_s in lines
    ]
    handles.append(Line2D([], [], color=DANGER, ls="", marker="v", label="target for QUIC"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=9, frameon=False)


def main() -> None:
    style("robots")
    draw_robots(IMAGES / "robots.svg", read(STORED))
    draw_robots(IMAGES / "fleet.svg", read(ROUTER))
    style("link")
    draw_link(IMAGES / "link.svg", list(read_link().together().values()))


if __name__ == "__main__":
    main()
