"""`lifeline graph`: which nodes communicate, measured from the sessions at the hub."""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from deploy.stack.errors import DeployError
from deploy.stack.formatting import number
from deploy.stack.launch import Launch
from lifeline.inspection.listening import Robot, inspect
from lifeline.inspection.wiring import Wire, dot_of, svg_of, text_of, wires_of
from wire.host.extras import require
from wire.text import printable

SUFFIXES = (".svg", ".png", ".dot")


def show_graph(launch: Launch, out: Path | None, seconds: float, *, as_json: bool) -> NoReturn:
    """Print the graph, or write it to a file.

    Raises:
        DeployError: the file's type is not supported.
    """
    if out is not None and out.suffix not in SUFFIXES:
        raise DeployError(f"cannot draw {out}: choose a file that ends with {', '.join(SUFFIXES)}")
    if out is not None and out.suffix == ".png":
        require("sim")  # Pillow

    async def body(robot: Robot) -> int:
        traffic, nodes = await robot.traffic(seconds), await robot.nodes()
        names = [node.name for node in nodes]
        wires = wires_of(nodes, traffic, robot.namespace)
        if out is not None:
            _write(out, names, wires, f"{robot.namespace} at {launch.bus.endpoint}")
        if as_json:
            print(json.dumps(_to_json(names, wires), indent=2))
        elif out is None:
            print(text_of(names, wires))
        else:
            print(f"lifeline: {out}: {len(names)} nodes, {len(wires)} topics")
        return 0

    inspect(launch, body)


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


SCALE = 2
"""Pixels for each unit of the drawing, for sharp lines on dense screens."""
LANE, ROW, TOP, MARGIN = 150, 30, 70, 20
INK, LINE, WRONG, PAPER, BOX, RULE = "#1c2733", "#2f5d8c", "#b3261e", "#ffffff", "#e8eef6", "#b9c4d0"


def png_of(names: Sequence[str], wires: Sequence[Wire]) -> bytes:
    """Return the graph as a PNG file, drawn like the SVG of wiring.py."""
    from PIL import Image, ImageDraw, ImageFont  # noqa: PLC0415 - Pillow is in an extra

    font = ImageFont.load_default(13 * SCALE)
    label_width = max((font.getlength(wire.label) for wire in wires), default=0.0) / SCALE
    lane = max(LANE, *(int(font.getlength(name) / SCALE) + 30 for name in names)) if names else LANE
    width, height = int(2 * MARGIN + lane * len(names) + label_width + 10), TOP + ROW * (len(wires) + 1)
    image = Image.new("RGB", (width * SCALE, height * SCALE), PAPER)
    draw = ImageDraw.Draw(image)
    lanes = [MARGIN + lane * n + lane // 2 for n in range(len(names))]
    for name, x in zip(names, lanes, strict=True):
        box = (x - lane // 2 + 8, 16, x + lane // 2 - 8, 46)
        draw.rounded_rectangle([SCALE * one for one in box], 5 * SCALE, BOX, LINE, SCALE)
        draw.text((x * SCALE, 31 * SCALE), printable(name), INK, font, anchor="mm")
        draw.line((x * SCALE, 46 * SCALE, x * SCALE, (height - MARGIN) * SCALE), RULE, SCALE)
    for row, wire in enumerate(wires):
        y = TOP + ROW * row
        source = MARGIN if wire.writer is None else lanes[wire.writer]
        colour = WRONG if wire.writer is None else LINE
        for reader in wire.readers:
            to = lanes[reader]
            back = 9 if to < source else -9
            draw.line((source * SCALE, y * SCALE, to * SCALE, y * SCALE), colour, 2 * SCALE)
            head = ((to, y), (to + back, y - 5), (to + back, y + 5))
            draw.polygon([(x * SCALE, at * SCALE) for x, at in head], colour)
        draw.circle((source * SCALE, y * SCALE), 4 * SCALE, colour)
        draw.text(((MARGIN + lane * len(names) + 10) * SCALE, y * SCALE), wire.label, INK, font, anchor="lm")
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()
