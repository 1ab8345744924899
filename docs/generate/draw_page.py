"""Draws docs/images/page.png: `python -m docs.generate.draw_page`.

The picture is a screenshot: supervisor, simulator and the page's server run, and a page in a browser drives the robot.
It needs Debian's package chromium.
"""

import asyncio
import base64
import io
import tempfile
from pathlib import Path

from PIL import Image

from tests.system.test_station_drive import drives, wheel

IMAGE = Path(__file__).parents[1] / "images" / "page.png"
WIDTH_PX, HEIGHT_PX = 1000, 640
"""A tablet in landscape."""
DISTANCE_M = 1.0
"""The robot drives this distance before the screenshot."""


async def _draw(directory: Path) -> None:
    async with wheel(directory) as (robot, _, _, tab):
        await tab.do(
            "Emulation.setDeviceMetricsOverride",
            width=WIDTH_PX,
            height=HEIGHT_PX,
            deviceScaleFactor=1,
            mobile=True,
        )
        await drives(robot, tab)
        began_m = robot.x_m
        await robot.until(lambda: abs(robot.x_m - began_m) > DISTANCE_M, "the distance")
        shot = await tab.do("Page.captureScreenshot", format="png")
        picture = Image.open(io.BytesIO(base64.b64decode(shot["data"])))
        picture.convert("RGB").save(IMAGE, optimize=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        asyncio.run(_draw(Path(name)))
