"""Draws docs/images/view.png: `python -m docs.generate.draw_view`.

The picture is a real one: supervisor and simulator run, the robot drives a circle until it comes near a rack, and Rerun's
viewer shows the recording. The viewer needs no screen, but a Vulkan driver, such as Debian's mesa-vulkan-drivers.
"""

import asyncio
import io
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from bench.rig.terminal import end
from deploy.stack.launch import free_loopback_endpoint, free_port
from lifeline.view.rerun_log import TIMELINE, RerunLog
from lifeline.view.scene import read_source
from lifeline.view.window import LOOPBACK, Viewer
from supervisor.config import SupervisorSection
from wire import topics
from wire.zenoh.bus import BusConfig, open_bus

IMAGE = Path(__file__).parents[1] / "images" / "view.png"
SIZE = (940, 880)
"""Of the window [px]; small, so that its text is readable in a page."""
TITLE_PX = 36
"""The viewer's title bar, which is cut off."""
PATIENCE_S = 60.0
COVERED = "blocked 2.3 2.7"
"""Behind on the left [rad], where the drive does not go."""
DRIVE = ("path", "circle", "--radius", "1.0", "--speed", "0.5")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        recording, shown = Path(folder) / "drive.mcap", Path(folder) / "drive.rrd"
        record(recording)
        last_ns = write(recording, shown)
        picture = screenshot(shown, last_ns)
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image = image.crop((0, round(TITLE_PX * image.width / SIZE[0]), image.width, image.height))
    image.save(IMAGE, optimize=True)
    print(f"{IMAGE}: {IMAGE.stat().st_size / 1000:.0f} kB")


def record(file: Path) -> None:
    """Drive, and record the drive."""
    options = ["--endpoint", free_loopback_endpoint()]

    def start(module: str, *arguments: str) -> "subprocess.Popen[bytes]":
        return subprocess.Popen([sys.executable, "-m", module, *arguments, *options])

    robot = [start("supervisor"), start("sim")]
    try:
        until(
            lambda: (
                subprocess.run(
                    [sys.executable, "-m", "lifeline.cli.app", "watch", "--once", *options],
                    check=False,
                    capture_output=True,
                ).returncode
                == 0
            )
        )
        recorder = start("lifeline.cli.app", "record", str(file))
        until(file.exists)
        asyncio.run(cover(options[-1]))
        start("lifeline.cli.app", *DRIVE).wait(PATIENCE_S)
        recorder.send_signal(signal.SIGINT)
        recorder.wait(PATIENCE_S)
    finally:
        for process in robot:
            end(process)


async def cover(endpoint: str) -> None:
    """Cover a part of the lidar's view, so that the picture has hidden places."""
    bus = await open_bus(BusConfig(endpoint), "client")
    reply = await bus.call(topics.SIM_FAULTS, COVERED)
    await bus.close()
    assert reply.success, reply.message


def write(recording: Path, shown: Path) -> int:
    """Write the recording for Rerun in the layout of a running robot; return the time of its last message [ns]."""
    scene, recorded = read_source(recording, SupervisorSection(), "robot")
    log = RerunLog(recording.name, follows=True)
    log.save(shown)
    log.fixed(scene.fixed())
    messages = list(recorded)
    for message in messages:
        log.log(message.log_time_ns, scene.draw(message.topic, message.log_time_ns * 1e-9, message.payload))
    log.close()
    return messages[-1].log_time_ns


def screenshot(file: Path, time_ns: int) -> bytes:
    """Return a picture (PNG) of the viewer at a time of the recording."""
    port = free_port()
    size = "x".join(map(str, SIZE))
    viewer = Viewer(
        str(file), "--headless", "--port", str(port), "--window-size", size, "--hide-welcome-screen"
    )
    try:
        address = f"rerun+http://{LOOPBACK}:{port}/proxy"
        until(lambda: bool(ViewerClient.connect(address)))
        client = ViewerClient.connect(address)
        until(lambda: is_shown(client))
        client.set_time(TIMELINE, timestamp=np.datetime64(time_ns, "ns"), play_state="paused")
        time.sleep(3.0)  # the camera and the plots move to their place, and nothing reports it
        return client.take_screenshot()
    finally:
        viewer.close()


def is_shown(client: ViewerClient) -> bool:
    state = client.get_state()
    return state.active_recording is not None and bool(state.views) and not state.loading


def until(is_so: Callable[[], bool]) -> None:
    """Wait until something is so; an error counts as not yet."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        try:
            if is_so():
                return
        except (OSError, RuntimeError):
            pass
        time.sleep(0.2)
    raise TimeoutError


if __name__ == "__main__":
    main()
