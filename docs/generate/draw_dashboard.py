"""Draws docs/images/dashboard.png: `python -m docs.generate.draw_dashboard`.

The picture is a real one: supervisor, simulator and teleop run, somebody presses the keys of a drive along the
aisle past a pillar, and the screen is taken as it is while the supervisor slows the robot down.
"""

import asyncio
import copy
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import matplotlib as mpl
import pyte
from PIL import Image, ImageDraw, ImageFont
from pyte.screens import Char

from bench.terminal import Terminal, end, teleop
from deploy.stack.launch import free_loopback_endpoint
from teleop.view import Odom
from wire import topics
from wire.messages import Odometry, Point, SafetyStatus
from wire.zenoh_bus import BusConfig, ZenohBus, open_bus

IMAGE = Path(__file__).parents[1] / "images" / "dashboard.png"
COLUMNS, ROWS = 112, 31
PATIENCE_S = 40.0
PILLAR_AHEAD_M, PILLAR_LEFT_M = 2.2, 0.5
KEYS = "wwwwww"
NEAR_M = 0.42
"""The screen is taken when the nearest obstacle is this near, and when it says so."""
WORDS = ("LIMITED", "COLLISION WARNING")

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


# --- the drive


def take_screen() -> pyte.Screen:
    """The screen of a teleop that drives past a pillar, at its nearest.

    Raises:
        TimeoutError: the robot did not get there.
    """
    endpoint = free_loopback_endpoint()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        for node in (topics.SUPERVISOR, topics.SIM):
            process = subprocess.Popen(
                [sys.executable, "-m", node, "--endpoint", endpoint],
                stderr=subprocess.DEVNULL,
                env=os.environ | {"LIFELINE_STATE_DIR": folder},
            )
            stack.callback(end, process)
        return asyncio.run(_drive(endpoint))


async def _drive(endpoint: str) -> pyte.Screen:
    async with asyncio.timeout(PATIENCE_S):
        bus = await open_bus(BusConfig(endpoint), "client")
        try:
            return await _pass_pillar(bus, endpoint)
        finally:
            await bus.close()


async def _pass_pillar(bus: ZenohBus, endpoint: str) -> pyte.Screen:
    wake = asyncio.Event()
    statuses, truths = bus.subscribe(topics.STATUS, wake=wake), bus.subscribe(topics.TRUTH)
    screen = pyte.Screen(COLUMNS, ROWS)
    terminal = Terminal(COLUMNS, ROWS, pyte.ByteStream(screen).feed)

    async def until(condition: Callable[[SafetyStatus], bool]) -> None:
        while True:
            await wake.wait()
            wake.clear()
            newest = statuses.latest()
            if newest is not None and newest.message is not None and condition(newest.message):
                return

    with teleop(terminal, "--endpoint", endpoint):
        await until(lambda status: status.mode == SafetyStatus.READY)
        truth = truths.latest()
        assert truth is not None, "the simulator of our own says where the robot is"
        assert truth.message is not None
        bus.publisher(topics.OBSTACLE).put(_beside_the_way(truth.message))
        terminal.type(" ")
        await until(lambda status: "ESTOP" in status.reasons)
        terminal.type("r")
        await until(lambda status: status.mode == SafetyStatus.READY)
        terminal.type(KEYS)
        await until(lambda status: status.mode == SafetyStatus.LIMITED and status.nearest_m < NEAR_M)
        while not all(any(word in row for row in screen.display) for word in WORDS):
            await until(lambda _: True)
        return copy.deepcopy(screen)


def _beside_the_way(truth: Odometry) -> Point:
    """Where the pillar stands, in the world."""
    pose = Odom.of(truth)
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x_m = pose.x_m + PILLAR_AHEAD_M * cos - PILLAR_LEFT_M * sin
    y_m = pose.y_m + PILLAR_AHEAD_M * sin + PILLAR_LEFT_M * cos
    return Point(x_m, y_m, 0.0)


# --- the picture


def draw(screen: pyte.Screen, path: Path) -> None:
    """The screen as a terminal shows it."""
    size = (SCALE * (2 * MARGIN + COLUMNS * CELL_W), SCALE * (2 * MARGIN + ROWS * CELL_H))
    image = Image.new("RGB", size, BACKGROUND)
    canvas = ImageDraw.Draw(image)
    canvas.rectangle((0, 0, size[0] - 1, size[1] - 1), outline=FRAME, width=SCALE)
    fonts = Path(mpl.get_data_path()) / "fonts" / "ttf"
    regular, bold = (
        ImageFont.truetype(fonts / name, SCALE * FONT_PX)
        for name in ("DejaVuSansMono.ttf", "DejaVuSansMono-Bold.ttf")
    )
    for row in range(ROWS):
        for column in range(COLUMNS):
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


if __name__ == "__main__":
    draw(take_screen(), IMAGE)
