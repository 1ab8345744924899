"""`lifeline graph`: which nodes communicate, measured from the sessions at the hub: each node is a lane, each key an arrow.

supervisor        sim
    │              │
    ├─────────────►│    cmd_vel     50.0 Hz
    │◄─────────────┤    scan        20.0 Hz
"""

import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import NoReturn

from deploy.stack.console import answer
from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.launch import Launch
from lifeline.inspection.listening import Robot, inspection
from lifeline.inspection.nodes import Node
from lifeline.inspection.traffic import Traffic
from wire.host.installation import require
from wire.text import printable

SUFFIXES = (".svg", ".png", ".dot")
GAP = 4
"""Columns of text between two lanes, besides their names."""
MIN_LANE = 12

LANE_PX, ROW_PX, TOP_PX, MARGIN_PX = 150, 30, 70, 20
"""Smallest width of a lane, height of a row, and the edges of a drawing."""
CHARACTER_PX = 7.5
"""Width of a character of the SVG's labels, at 13 px."""
SCALE = 2
"""Pixels of the PNG for each unit of the drawing, for sharp lines on dense screens."""
INK, LINE, WRONG, PAPER, BOX, RULE = "#1c2733", "#2f5d8c", "#b3261e", "#ffffff", "#e8eef6", "#b9c4d0"


def show_graph(launch: Launch, out: Path | None, seconds: float, *, as_json: bool) -> NoReturn:
    """Print the graph, or write it to a file.

    Raises:
        DeployError: the file's type is not supported.
    """
    if out is not None and out.suffix not in SUFFIXES:
        raise DeployError(f"cannot draw {out}: choose a file that ends with {', '.join(SUFFIXES)}")
    if out is not None and out.suffix == ".png":
        require("sim")  # Pillow
    _show(launch, out, seconds, as_json=as_json)


@inspection
async def _show(robot: Robot, out: Path | None, seconds: float, *, as_json: bool) -> int:
    traffic, nodes = await robot.traffic(seconds), await robot.nodes()
    names = [node.name for node in nodes]
    wires = wires_of(nodes, traffic, robot.namespace)
    if out is not None:
        _write(out, names, wires, f"{robot.namespace} at {robot.launch.bus.endpoint}")
    if out is None and not as_json:
        print(text_of(names, wires))
    else:
        answer(_to_json(names, wires), f"{out}: {len(names)} nodes, {len(wires)} topics", as_json=as_json)
    return 0


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
        cells[source] = "●" if wire.readers else "○"  # without readers
    for reader in wire.readers:
        at = middle[reader]
        if at in (first, last):
            cells[at] = "│"
        cells[at - 1 if at > source else at + 1] = "►" if at > source else "◄"
    return "".join(cells)


def _to_json(names: list[str], wires: list[Wire]) -> list[dict[str, object]]:
    return [
        {
            "key": wire.key,
            "writer": None if wire.writer is None else names[wire.writer],
            "readers": [names[n] for n in wire.readers],
            "rate_hz": number(wire.rate_hz),
        }
        for wire in wires
    ]


def _write(out: Path, names: list[str], wires: list[Wire], title: str) -> None:
    try:
        if out.suffix == ".png":
            out.write_bytes(png_of(names, wires))
        else:
            out.write_text(dot_of(names, wires) if out.suffix == ".dot" else svg_of(names, wires, title))
    except OSError as error:
        raise DeployError(f"cannot write {out} ({error.strerror}): choose another file") from error


def svg_of(names: Sequence[str], wires: Sequence[Wire], title: str) -> str:
    """Return the graph as SVG."""
    lane_px = max(LANE_PX, *(len(name) * CHARACTER_PX + 30.0 for name in names), 0.0)
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
        f'<rect width="100%" height="100%" fill="{PAPER}"/>',
    ]
    for name, at in zip(names, x_px, strict=True):
        half_px = lane_px / 2 - 8.0
        parts.append(
            f'<rect x="{at - half_px:.1f}" y="16" width="{2 * half_px:.1f}" height="30" rx="5" fill="{BOX}" stroke="{LINE}"/>'
            f'<text x="{at:.1f}" y="36" text-anchor="middle" font-weight="bold" fill="{INK}">{escape(printable(name))}</text>'
            f'<line x1="{at:.1f}" y1="46" x2="{at:.1f}" y2="{height_px - MARGIN_PX:.1f}" stroke="{RULE}" stroke-width="1.5"/>'
        )
    for row, wire in enumerate(wires):
        parts.extend(_svg_wire(wire, x_px, TOP_PX + ROW_PX * row, label_px))
    return "\n".join([*parts, "</svg>", ""])


def _svg_wire(wire: Wire, x_px: Sequence[float], y_px: float, label_px: float) -> Iterator[str]:
    source_px = MARGIN_PX if wire.writer is None else x_px[wire.writer]
    colour = WRONG if wire.writer is None else LINE
    for reader in wire.readers:
        to_px = x_px[reader]
        sign = 1.0 if to_px > source_px else -1.0
        yield f'<line x1="{source_px:.1f}" y1="{y_px:.1f}" x2="{to_px:.1f}" y2="{y_px:.1f}" stroke="{colour}" stroke-width="1.8"/>'
        yield (f'<path d="M {to_px:.1f} {y_px:.1f} l {-9 * sign:.1f} -4.5 l 0 9 z" fill="{colour}"/>')
    yield f'<circle cx="{source_px:.1f}" cy="{y_px:.1f}" r="4" fill="{colour}"/>'
    yield f'<text x="{label_px:.1f}" y="{y_px + 4:.1f}" fill="{INK}">{escape(wire.label)}</text>'


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


def png_of(names: Sequence[str], wires: Sequence[Wire]) -> bytes:
    """Return the graph as a PNG file, drawn like the SVG."""
    from PIL import Image, ImageDraw, ImageFont  # noqa: PLC0415 - Pillow is in an extra

    font = ImageFont.load_default(13 * SCALE)
    label_width = max((font.getlength(wire.label) for wire in wires), default=0.0) / SCALE
    lane = max(LANE_PX, *(int(font.getlength(name) / SCALE) + 30 for name in names)) if names else LANE_PX
    label = MARGIN_PX + lane * len(names) + 10
    width, height = int(label + label_width + MARGIN_PX), TOP_PX + ROW_PX * (len(wires) + 1)
    image = Image.new("RGB", (width * SCALE, height * SCALE), PAPER)
    draw = ImageDraw.Draw(image)
    lanes = [MARGIN_PX + lane * n + lane // 2 for n in range(len(names))]
    for name, x in zip(names, lanes, strict=True):
        box = (x - lane // 2 + 8, 16, x + lane // 2 - 8, 46)
        draw.rounded_rectangle([SCALE * one for one in box], 5 * SCALE, BOX, LINE, SCALE)
        draw.text((x * SCALE, 31 * SCALE), printable(name), INK, font, anchor="mm")
        draw.line((x * SCALE, 46 * SCALE, x * SCALE, (height - MARGIN_PX) * SCALE), RULE, SCALE)
    for row, wire in enumerate(wires):
        y = TOP_PX + ROW_PX * row
        source = MARGIN_PX if wire.writer is None else lanes[wire.writer]
        colour = WRONG if wire.writer is None else LINE
        for reader in wire.readers:
            to = lanes[reader]
            back = 9 if to < source else -9
            draw.line((source * SCALE, y * SCALE, to * SCALE, y * SCALE), colour, 2 * SCALE)
            head = ((to, y), (to + back, y - 5), (to + back, y + 5))
            draw.polygon([(x * SCALE, at * SCALE) for x, at in head], colour)
        draw.circle((source * SCALE, y * SCALE), 4 * SCALE, colour)
        draw.text((label * SCALE, y * SCALE), wire.label, INK, font, anchor="lm")
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()
