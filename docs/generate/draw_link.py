"""Draws docs/images/link.svg from the stored run of `python -m bench.link --json`: `python -m docs.generate.draw_link`.

Panels: false stops an hour over loss, one for each round trip, a line for each link.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.link.results import MANY, TARGET_ROUND_TRIP_S, TARGETS, Link, Measured, read
from docs.generate.palette import DANGER, GREY, INK, LIGHT, RING, ROBOT

PICTURE = Path(__file__).parents[1] / "images/link.svg"
COLOURS = {Link.TCP: RING, Link.QUIC: ROBOT, Link.UDP: GREY}
LABELS = {Link.TCP: "TCP", Link.QUIC: "QUIC, mutual TLS, datagrams", Link.UDP: "UDP, without TLS"}
ORDER = {link: number for number, link in enumerate(Link)}
TARGETS_PERCENT = {100 * loss: target for loss, target in TARGETS.items()}
LINEAR_BELOW = 1.0
"""Stops an hour below which the axis is linear, so that it shows zero."""


def draw(measured: Sequence[Measured], path: Path) -> None:
    """Draw one panel for each round trip; red: the targets for QUIC.

    Args:
        measured: one for each condition.
        path: of the picture.
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
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=LIGHT, lw=0.6)
    panels[0].set_ylabel("false stops an hour")
    _legend(figure, lines, shortest_s)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


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
    # A fixed salt, so that the same run gives the same file.
    mpl.rcParams.update(
        {
            "font.size": 10,
            "axes.edgecolor": GREY,
            "text.color": INK,
            "axes.labelcolor": INK,
            "svg.hashsalt": "link",
        }
    )
    draw(list(read().together().values()), PICTURE)


if __name__ == "__main__":
    main()
