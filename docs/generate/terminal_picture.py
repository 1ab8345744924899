"""Draws the screen of a terminal emulator as a picture."""

from pathlib import Path

import matplotlib as mpl
import pyte
from PIL import Image, ImageDraw, ImageFont
from pyte.screens import Char

CELL_W, CELL_H, FONT_PX, BASELINE_PX, SCALE = 11, 22, 18, 17, 2
MARGIN = 22
BACKGROUND, FRAME = "#12161c", "#2b323c"
COLOURS = {
    "default": "#d7dde5",
    "black": "#0c0f13",
    "red": "#ff5a52",
    "green": "#7fd48a",
    "brown": "#f2c14e",
    "brightblack": "#6d7886",
    "brightwhite": "#ffffff",
}
FILLS = {"red": "#c62f2a", "green": "#5fb56c", "brown": "#f2c14e"}
"""Behind text: white must stay readable on it."""

BRAILLE_FIRST = 0x2800
DOTS = (
    (0, 0, 0x01),
    (0, 1, 0x02),
    (0, 2, 0x04),
    (1, 0, 0x08),
    (1, 1, 0x10),
    (1, 2, 0x20),
    (0, 3, 0x40),
    (1, 3, 0x80),
)
"""Right, down, and the bit of each dot of a braille character."""
DOT_PX = 1.8
LIGHT_PX, HEAVY_PX = 1, 3
BARS = {
    "─": ((0.0, 1.0, LIGHT_PX),),
    "━": ((0.0, 1.0, HEAVY_PX),),
    "╾": ((0.0, 0.5, HEAVY_PX), (0.5, 1.0, LIGHT_PX)),
    "╼": ((0.0, 0.5, LIGHT_PX), (0.5, 1.0, HEAVY_PX)),
}
"""From, to, and how thick."""
POSTS = {"┃": HEAVY_PX, "┼": LIGHT_PX}


def draw(screen: pyte.Screen, path: Path) -> None:
    """Draw a screen as a terminal shows it, down to its last line of text."""
    lines = max((number for number, line in enumerate(screen.display, 1) if line.strip()), default=1)
    size = (SCALE * (2 * MARGIN + screen.columns * CELL_W), SCALE * (2 * MARGIN + lines * CELL_H))
    image = Image.new("RGB", size, BACKGROUND)
    canvas = ImageDraw.Draw(image)
    canvas.rectangle((0, 0, size[0] - 1, size[1] - 1), outline=FRAME, width=SCALE)
    fonts = Path(mpl.get_data_path()) / "fonts" / "ttf"
    regular, bold = (
        ImageFont.truetype(fonts / name, SCALE * FONT_PX)
        for name in ("DejaVuSansMono.ttf", "DejaVuSansMono-Bold.ttf")
    )
    for row in range(lines):
        for column in range(screen.columns):
            cell = screen.buffer[row][column]
            place = (SCALE * (MARGIN + column * CELL_W), SCALE * (MARGIN + row * CELL_H))
            _draw_cell(canvas, cell, place, bold if cell.bold else regular)
    image.quantize(256).save(path, optimize=True)


def _draw_cell(
    canvas: ImageDraw.ImageDraw, cell: Char, place: tuple[int, int], font: ImageFont.FreeTypeFont
) -> None:
    left, top = place
    width, height = SCALE * CELL_W, SCALE * CELL_H
    if cell.bg != "default":
        canvas.rectangle((left, top, left + width - 1, top + height - 1), fill=FILLS[cell.bg])
    ink, char = COLOURS[cell.fg], cell.data
    middle = top + height // 2
    if BRAILLE_FIRST <= ord(char) < BRAILLE_FIRST + 256:
        for right, down, bit in DOTS:
            if (ord(char) - BRAILLE_FIRST) & bit:
                x, y = left + (2 * right + 1) * width // 4, top + (2 * down + 1) * height // 8
                radius = SCALE * DOT_PX
                canvas.ellipse((x - radius, y - radius, x + radius, y + radius), fill=ink)
    elif char in BARS:  # drawn, so that neighbours join
        for begin, stop, thickness in BARS[char]:
            half = SCALE * thickness / 2
            canvas.rectangle(
                (left + width * begin, middle - half, left + width * stop - 1, middle + half - 1), fill=ink
            )
    elif char in POSTS:
        half = SCALE * POSTS[char] / 2
        canvas.rectangle(
            (left + width / 2 - half, top + 2 * SCALE, left + width / 2 + half - 1, top + height - 2 * SCALE),
            fill=ink,
        )
        if char == "┼":
            canvas.rectangle((left, middle - SCALE / 2, left + width - 1, middle + SCALE / 2 - 1), fill=ink)
    elif char != " ":
        canvas.text((left, top + SCALE * BASELINE_PX), char, fill=ink, font=font, anchor="ls")
