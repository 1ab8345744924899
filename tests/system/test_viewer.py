"""The window: it shows the present state, does not slow the physics, and may be closed.

The tests use an X server without a screen, where the processor draws.
"""

import asyncio
import itertools
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sim.overlay import COLOURS, Mode
from tests.system.harness import PATIENCE_S, Robot, free_endpoint
from tests.system.xserver import XVFB, XServer, x_server
from wire import topics

pytestmark = [
    pytest.mark.skipif(XVFB is None, reason="there is no Xvfb: apt install xvfb"),
    pytest.mark.timeout(150),
]

RING_PIXELS = 150
"""Minimum number of pixels of a ring's colour; nothing else in the hall has as many."""


def start_sim(subject: Robot, server: XServer) -> None:
    with (subject.logs / "sim.log").open("ab") as log:
        subject.processes[topics.SIM] = subprocess.Popen(
            [sys.executable, "-m", "sim", "--endpoint", subject.endpoint, "--viewer", "--no-moving"],
            stdout=log,
            stderr=log,
            env=os.environ | {"DISPLAY": server.display},
        )


def pixels_of(mode: Mode, screen: NDArray[np.uint8]) -> int:
    """Return the number of bright, saturated pixels with the hue of the mode's ring."""
    colour = np.array(COLOURS[mode])
    shade = screen.astype(np.float64)
    brightest = shade.max(axis=2)
    match = np.abs(shade / np.maximum(brightest, 1.0)[:, :, None] - colour / colour.max()).max(axis=2)
    return int(np.count_nonzero((match < 0.12) & (brightest > 150)))


async def until_ring(server: XServer, mode: Mode, subject: Robot) -> None:
    seen = 0
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        subject.look()
        seen = pixels_of(mode, server.screen())
        if seen >= RING_PIXELS:
            return
        await asyncio.sleep(0.05)
    raise AssertionError(f"no ring of {mode}, only {seen} pixels; {subject.picture()}")


@pytest.mark.timed
async def test_the_window_shows_what_holds_keeps_the_pace_and_may_be_closed(tmp_path: Path) -> None:
    with x_server(tmp_path) as server:
        subject = Robot(free_endpoint(), tmp_path)
        try:
            subject.start(topics.SUPERVISOR)
            start_sim(subject, server)
            await subject.observe()
            await subject.until(lambda: "NO_COMMAND" in subject.status.reasons, "STOPPED")
            await until_ring(server, Mode.STOPPED, subject)

            subject.start_teleop()
            await subject.drive("ww", 0.2)
            await until_ring(server, Mode.DRIVING, subject)
            subject.type("s")

            subject.look()
            subject.travel.clear()
            await asyncio.sleep(3.0)  # the length of the measurement, by the arrivals
            subject.look()
            gaps_s = [b[0] - a[0] for a, b in itertools.pairwise(subject.travel)]
            print(
                f"\n    measured: odometry with a window, gaps median {statistics.median(gaps_s) * 1e3:.1f} ms, "
                f"99 % {sorted(gaps_s)[int(0.99 * len(gaps_s))] * 1e3:.1f} ms, longest {max(gaps_s) * 1e3:.1f} ms"
            )
            assert statistics.median(gaps_s) == pytest.approx(0.02, abs=0.004)

            server.close_windows()
            log = subject.logs / "sim.log"
            await subject.until(lambda: "the window was closed" in log.read_text(), "the window's end")
            seen = len(subject.travel)
            await subject.until(lambda: len(subject.travel) > seen + 50, "odometry after it")
        finally:
            await subject.close()


def test_a_window_that_was_asked_for_and_cannot_open_is_refused_in_one_sentence(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sim", "--viewer", "--endpoint", free_endpoint()],
        env=os.environ | {"DISPLAY": ":4999", "WAYLAND_DISPLAY": ""},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("sim: no window can be opened here (")
    assert done.stderr.endswith("leave out --viewer, or use --no-viewer\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.smoke
async def test_a_window_that_nobody_asked_for_and_cannot_open_holds_up_no_robot(tmp_path: Path) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    try:
        subject.start(topics.SUPERVISOR)
        with (tmp_path / "sim.log").open("ab") as log:
            subject.processes[topics.SIM] = subprocess.Popen(
                [sys.executable, "-m", "sim", "--endpoint", subject.endpoint],
                stdout=log,
                stderr=log,
                env=os.environ | {"DISPLAY": ":4999", "WAYLAND_DISPLAY": ""},
            )
        await subject.observe()
        await subject.until(lambda: bool(subject.travel), "odometry")
        assert "the simulation goes on without one" in (tmp_path / "sim.log").read_text()
    finally:
        await subject.close()
