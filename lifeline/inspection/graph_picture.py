"""The graph of nodes and keys as a PNG picture, drawn by Pillow like the SVG of wiring.py. Pure."""

import io
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from lifeline.inspection.wiring import Wire
from wire.text import printable

SCALE = 2
"""Pixels for each unit of the drawing, for sharp lines on dense screens."""
LANE, ROW, TOP, MARGIN = 150, 30, 70, 20
INK, LINE, WRONG, PAPER, BOX, RULE = "#1c2733", "#2f5d8c", "#b3261e", "#ffffff", "#e8eef6", "#b9c4d0"


def png_of(names: Sequence[str], wires: Sequence[Wire]) -> bytes:
    """Return the graph as a PNG file."""
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
    for number, wire in enumerate(wires):
        y = TOP + ROW * number
        source = MARGIN if wire.writer is None else lanes[wire.writer]
        colour = WRONG if wire.writer is None else LINE
        for reader in wire.readers:
            _arrow(draw, source, lanes[reader], y, colour)
        draw.circle((source * SCALE, y * SCALE), 4 * SCALE, colour)
        draw.text(((MARGIN + lane * len(names) + 10) * SCALE, y * SCALE), wire.label, INK, font, anchor="lm")
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()


def _arrow(draw: ImageDraw.ImageDraw, source: int, to: int, y: int, colour: str) -> None:
    sign = 1 if to > source else -1
    draw.line((source * SCALE, y * SCALE, to * SCALE, y * SCALE), colour, 2 * SCALE)
    head = ((to, y), (to - 9 * sign, y - 5), (to - 9 * sign, y + 5))
    draw.polygon([(x * SCALE, at * SCALE) for x, at in head], colour)
