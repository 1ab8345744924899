"""The graph of nodes and keys: each node is a lane, each key an arrow from its writer to its readers. Pure.

supervisor        sim
    │              │
    ├─────────────►│    cmd_vel     50.0 Hz
    │◄─────────────┤    scan        20.0 Hz
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape

from lifeline.inspection.nodes import Node
from lifeline.inspection.traffic import Traffic
from wire.text import printable

GAP = 4
"""Columns of text between two lanes, besides their names."""
MIN_LANE = 12
CHARACTER_PX = 7.5
"""Width of a character of the drawing's labels, at 13 px."""
ROW_PX, TOP_PX, MARGIN_PX = 30.0, 70.0, 20.0


@dataclass(frozen=True, slots=True)
class Wire:
    """A key with one of its writers. Nodes are numbers of lanes."""

    key: str
    """Relative to the robot's namespace, if it is in it."""
    writer: int | None
    """None: no node declares that it writes the key."""
    readers: tuple[int, ...]
    rate_hz: float
    """NaN if nothing was heard."""

    @property
    def label(self) -> str:
        """The key and its rate."""
        return self.key if math.isnan(self.rate_hz) else f"{self.key}  {self.rate_hz:.1f} Hz"


def wires_of(nodes: Sequence[Node], traffic: Traffic, namespace: str) -> list[Wire]:
    """Return the wires of all keys that a node writes or that were heard, by writer and key."""
    declared = {key for node in nodes for key in node.session.writes if "*" not in key}
    wires = [wire for key in declared | set(traffic.keys) for wire in _wires(key, nodes, traffic, namespace)]
    return sorted(wires, key=lambda wire: (math.inf if wire.writer is None else wire.writer, wire.key))


def _wires(key: str, nodes: Sequence[Node], traffic: Traffic, namespace: str) -> Iterator[Wire]:
    writers: list[int | None] = [n for n, node in enumerate(nodes) if key in node.session.writes]
    heard = traffic.keys.get(key)
    rate_hz = math.nan if heard is None else heard.rate_hz
    for writer in writers or [None]:
        readers = tuple(n for n, node in enumerate(nodes) if n != writer and node.reads(key))
        yield Wire(printable(key.removeprefix(f"{namespace}/")), writer, readers, rate_hz)


def text_of(names: Sequence[str], wires: Iterable[Wire]) -> str:
    """Return the graph as text."""
    names = [printable(name) for name in names]
    width = max(MIN_LANE, *(len(name) + GAP for name in names), 0) if names else MIN_LANE
    middle = [width // 2 + n * width for n in range(len(names))]
    lines = ["".join(name.center(width) for name in names).rstrip()]
    lines.append(_row(width * len(names), middle, None).rstrip())
    lines.extend(f"{_row(width * len(names), middle, wire)}  {wire.label}" for wire in wires)
    return "\n".join(lines)


def _row(length: int, middle: Sequence[int], wire: Wire | None) -> str:
    """Return the lanes of one row, with a wire's arrows."""
    cells = [" "] * length
    for at in middle:
        cells[at] = "│"
    if wire is None or (wire.writer is None and not wire.readers):
        return "".join(cells)
    ends = [middle[n] for n in (*wire.readers, *(() if wire.writer is None else (wire.writer,)))]
    first, last = (0, max(ends)) if wire.writer is None else (min(ends), max(ends))
    for at in range(first, last + 1):
        cells[at] = "┼" if at in middle and first < at < last else "─"
    source = first if wire.writer is None else middle[wire.writer]
    if wire.writer is not None:
        cells[source] = "●" if wire.readers else "○"  # nobody reads it
    for reader in wire.readers:
        at = middle[reader]
        if at in (first, last):
            cells[at] = "│"
        cells[at - 1 if at > source else at + 1] = "►" if at > source else "◄"
    return "".join(cells)


def svg_of(names: Sequence[str], wires: Sequence[Wire], title: str) -> str:
    """Return the graph as SVG."""
    lane_px = max(110.0, *(len(name) * CHARACTER_PX + 30.0 for name in names), 0.0)
    x_px = [MARGIN_PX + lane_px * (n + 0.5) for n in range(len(names))]
    label_px = MARGIN_PX + lane_px * len(names) + 10.0
    width_px = label_px + max((len(wire.label) for wire in wires), default=0) * CHARACTER_PX + MARGIN_PX
    height_px = TOP_PX + ROW_PX * (len(wires) + 1)
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width_px:.0f}" height="{height_px:.0f}" '
            f'viewBox="0 0 {width_px:.0f} {height_px:.0f}" font-family="sans-serif" font-size="13">'
        ),
        f"<title>{escape(title)}</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for name, at in zip(names, x_px, strict=True):
        half_px = lane_px / 2 - 8.0
        parts.append(
            f'<rect x="{at - half_px:.1f}" y="16" width="{2 * half_px:.1f}" height="30" rx="5" fill="#e8eef6" stroke="#2f5d8c"/>'
            f'<text x="{at:.1f}" y="36" text-anchor="middle" font-weight="bold" fill="#1c2733">{escape(printable(name))}</text>'
            f'<line x1="{at:.1f}" y1="46" x2="{at:.1f}" y2="{height_px - MARGIN_PX:.1f}" stroke="#b9c4d0" stroke-width="1.5"/>'
        )
    for number, wire in enumerate(wires):
        parts.extend(_svg_wire(wire, x_px, TOP_PX + ROW_PX * number, label_px))
    return "\n".join([*parts, "</svg>", ""])


def _svg_wire(wire: Wire, x_px: Sequence[float], y_px: float, label_px: float) -> Iterator[str]:
    source_px = MARGIN_PX if wire.writer is None else x_px[wire.writer]
    colour = "#b3261e" if wire.writer is None else "#2f5d8c"
    for reader in wire.readers:
        to_px = x_px[reader]
        sign = 1.0 if to_px > source_px else -1.0
        yield f'<line x1="{source_px:.1f}" y1="{y_px:.1f}" x2="{to_px:.1f}" y2="{y_px:.1f}" stroke="{colour}" stroke-width="1.8"/>'
        yield (f'<path d="M {to_px:.1f} {y_px:.1f} l {-9 * sign:.1f} -4.5 l 0 9 z" fill="{colour}"/>')
    yield f'<circle cx="{source_px:.1f}" cy="{y_px:.1f}" r="4" fill="{colour}"/>'
    yield f'<text x="{label_px:.1f}" y="{y_px + 4:.1f}" fill="#1c2733">{escape(wire.label)}</text>'


def dot_of(names: Sequence[str], wires: Iterable[Wire]) -> str:
    """Return the graph in Graphviz's language: nodes are boxes, keys are ellipses."""
    lines = ["digraph lifeline {", "  rankdir=LR;"]
    lines += [f"  n{n} [shape=box, label={json.dumps(printable(name))}];" for n, name in enumerate(names)]
    keys: dict[str, int] = {}
    for wire in wires:
        if wire.key not in keys:
            keys[wire.key] = len(keys)
            lines.append(f"  k{keys[wire.key]} [shape=ellipse, label={json.dumps(wire.label)}];")
            lines += [f"  k{keys[wire.key]} -> n{reader};" for reader in wire.readers]
        if wire.writer is not None:
            lines.append(f"  n{wire.writer} -> k{keys[wire.key]};")
    return "\n".join([*lines, "}", ""])
