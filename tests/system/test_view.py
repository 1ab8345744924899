"""`lifeline view` beside a real robot: what it writes, where it listens, and how it ends."""

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun.chunk

from recordings.recording import RecordingReader
from tests.system.harness import PATIENCE_S, Robot, free_endpoint, robot
from tests.system.process_state import listening

pytestmark = pytest.mark.timeout(180)
SHAPES = {
    "/odom/base_link/rings/stop",
    "/odom/base_link/rings/warning",
    "/odom/base_link/outline",
    "/odom/base_link/hull",
    "/odom/base_link",
    "/odom/path",
    "/odom/lidar_scan",
    "/odom/lidar_scan/points",
    "/odom/lidar_scan/free",
    "/odom/lidar_scan/hidden",
    "/mode",
    "/reasons/now",
    "/reasons/over",
    "/log",
}
VELOCITIES = {
    f"/velocity/{axis}/{name}"
    for axis in ("linear", "angular")
    for name in ("requested", "permitted", "measured")
}
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}
"""127.0.0.1 and ::1, as the kernel writes them."""


def say(text: str) -> None:
    print(f"\n    measured: {text}")


class Read:
    """A file for Rerun, read with its own reader."""

    def __init__(self, file: Path) -> None:
        self.chunks: dict[str, list[Any]] = {}
        for chunk in rerun.chunk.RrdReader(file).stream():
            self.chunks.setdefault(chunk.entity_path, []).append(chunk)

    def times_s(self, path: str) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
        """Return the times (n,) [s] at which something was logged there, in order."""
        times = [
            chunk.to_record_batch().column("time").to_numpy(zero_copy_only=False).astype(np.int64) * 1e-9
            for chunk in self.chunks[path]
            if not chunk.is_static
        ]
        return np.sort(np.concatenate(times))

    def values(self, path: str) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
        """Return the numbers (n,) that were logged there."""
        found: list[float] = []
        for chunk in self.chunks[path]:
            if not chunk.is_static:
                found += [value for (value,) in chunk.to_record_batch().column("Scalars:scalars").to_pylist()]
        return np.array(found)

    def texts(self, path: str) -> list[str]:
        texts: list[str] = []
        for chunk in self.chunks[path]:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name in {"StateChange:state", "TextLog:text"}:
                    texts += [
                        text for row in batch.column(name).to_pylist() for text in row if text is not None
                    ]
        return texts


@contextmanager
def viewing(subject: Robot, *arguments: str) -> "Generator[View]":
    view = View(subject, *arguments)
    try:
        yield view
    finally:
        view.close()


class View:
    """`lifeline view` as a process with a home of its own."""

    def __init__(self, subject: Robot, *arguments: str) -> None:
        self.home = subject.logs / "home"
        self.home.mkdir(exist_ok=True)
        self.output = subject.logs / f"view-{time.monotonic_ns()}.txt"
        environment = subject.environment | {"HOME": str(self.home)}
        for name in ("DISPLAY", "WAYLAND_DISPLAY", "XDG_CONFIG_HOME", "XDG_DATA_HOME"):
            environment.pop(name, None)
        with self.output.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "lifeline.cli.app", "view", *arguments],
                stdout=output,
                stderr=output,
                env=environment,
            )

    def text(self) -> str:
        return self.output.read_text()

    def interrupt(self) -> float:
        """Press Ctrl-C; return how long the process takes to end [s]."""
        began_s = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(PATIENCE_S) == 0, self.text()
        return time.monotonic() - began_s

    def close(self) -> None:
        self.process.kill()
        self.process.wait()

    def finish(self) -> str:
        """Wait for the end; return what was printed."""
        assert self.process.wait(PATIENCE_S) == 0, self.text()
        return self.text()


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "lifeline.cli.app", *arguments]


def speed_of(file: Read) -> float:
    return float(file.values("/velocity/linear/measured").max())


@pytest.mark.timed
async def test_a_drive_is_the_same_live_in_its_recording_and_in_its_black_box(tmp_path: Path) -> None:
    live, again, incident = (tmp_path / f"{name}.rrd" for name in ("live", "again", "incident"))
    recording = tmp_path / "drive.mcap"
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(
            lambda: "SCAN_STALE" not in subject.status.reasons and bool(subject.travel), "scans"
        )
        where = ("--endpoint", subject.endpoint)
        recorder = subprocess.Popen(command("record", str(recording), *where))
        with viewing(subject, "--out", str(live), *where) as view:
            await subject.until(lambda: live.exists() and recording.exists(), "both files")
            seen_s = time.monotonic()
            drive = subprocess.Popen(command("path", "circle", "--radius", "1", "--speed", "0.5", *where))
            await subject.until(lambda: drive.poll() is not None, "the end of the drive", 60.0)
            boxes: list[Path] = []

            def written() -> bool:
                boxes[:] = (tmp_path / "blackbox").glob("*.jsonl.gz")
                return bool(boxes)

            await subject.until(written, "a black box")
            end_s = view.interrupt()
            fastest_m_s = max(speed_m_s for at_s, _, speed_m_s in subject.travel if at_s >= seen_s)
        recorder.send_signal(signal.SIGINT)
        assert await asyncio.to_thread(recorder.wait, PATIENCE_S) == 0
        with viewing(subject, str(recording), "--out", str(again), *where) as view:
            assert "messages" in view.finish()
        (box,) = boxes
        options = ("--state-dir", str(tmp_path), "--out", str(incident))
        with viewing(subject, box.name[:19], *options) as view:
            view.finish()
    say(f"--out: Ctrl-C ends it after {1000 * end_s:.0f} ms")

    shown = Read(live)
    assert set(shown.chunks) >= SHAPES | VELOCITIES
    times_s = shown.times_s("/odom/lidar_scan/points")
    rate_hz = (len(times_s) - 1) / (times_s[-1] - times_s[0])
    say(f"live: {len(times_s)} scans, {rate_hz:.2f} Hz; {speed_of(shown):.3f} of {fastest_m_s:.3f} m/s")
    assert rate_hz == pytest.approx(20.0, rel=0.1)
    assert speed_of(shown) == pytest.approx(fastest_m_s, abs=1e-9)
    assert shown.values("/velocity/linear/requested").max() == pytest.approx(0.5, abs=0.05)
    assert {"STOPPED", "DRIVING"} <= set(shown.texts("/mode"))

    shown = Read(again)
    scans = sum(message.topic == "/robot/scan" for message in RecordingReader(recording).messages())
    assert len(shown.times_s("/odom/lidar_scan/points")) == scans
    assert speed_of(shown) == pytest.approx(fastest_m_s, abs=1e-9)

    shown = Read(incident)
    match = re.search(r"Z-([A-Z_]+)", box.name)
    assert match is not None
    assert any(match[1] in text for text in shown.texts("/reasons/now"))
    assert any(match[1] in text for text in shown.texts("/log"))
    assert speed_of(shown) == pytest.approx(fastest_m_s, abs=1e-6)
    assert set(shown.chunks) >= SHAPES | VELOCITIES


def free_ports() -> int:
    """Return the first of two free ports that follow each other."""
    first = port_of(free_endpoint())
    while (second := port_of(free_endpoint())) != first + 1:
        first = second
    return first


def port_of(endpoint: str) -> int:
    return int(endpoint.rpartition(":")[2])


@pytest.mark.smoke
async def test_the_web_viewer_listens_on_loopback_alone_and_its_page_may_connect_nowhere_else(
    tmp_path: Path,
) -> None:
    port = free_ports()
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: bool(subject.travel), "odometry")
        with viewing(subject, "--web", "--port", str(port), "--endpoint", subject.endpoint) as view:
            sockets: set[tuple[str, int]] = set()

            def served() -> bool:
                sockets.update(listening(view.process.pid))
                return "in a browser" in view.text()

            await subject.until(served, "the page", 60.0)
            sockets |= listening(view.process.pid)
            replies: dict[str, tuple[int, str, str]] = {}
            for path in ("/", "/?url=x", "/re_viewer.js", "/../etc/passwd"):
                with closing(HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)) as connection:
                    connection.request("GET", path)
                    reply = connection.getresponse()
                    content = reply.read().decode()
                    header = reply.headers.get("Content-Security-Policy", "")
                    replies[path] = (reply.status, header or reply.headers.get("Location", ""), content)
            end_s = view.interrupt()
    say(f"--web: Ctrl-C ends it after {1000 * end_s:.0f} ms")
    assert {address for address, _ in sockets} <= LOOPBACK
    assert {port, port + 1} <= {number for _, number in sockets}
    status, location, _ = replies["/"]
    assert (status, location) == (302, f"/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{port + 1}%2Fproxy")
    status, policy, content = replies["/?url=x"]
    assert status == 200
    assert "<canvas" in content
    assert f"connect-src 'self' http://127.0.0.1:{port + 1} http://localhost:{port + 1}" in policy
    assert policy.startswith("default-src 'none'")
    assert replies["/re_viewer.js"][0] == 200
    assert replies["/../etc/passwd"][0] == 404
    assert not [file for file in view.home.rglob("*") if "rerun" in file.name]  # nothing enabled analytics


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        ((), 2, "there is no display here: use --web and a browser, or --out FILE.rrd"),
        (("--out", "{tmp}/new.rrd"), 3, "no supervisor answers at tcp/127.0.0.1:"),
        (("--out", "{tmp}/old.rrd"), 2, "already exists: choose another file"),
        (("--out", "{tmp}/no/such/folder.rrd", "{tmp}/cut.mcap"), 2, "cannot write"),
        (("{tmp}/none.mcap", "--out", "{tmp}/new.rrd"), 2, "No such file or directory"),
        (("{tmp}/old.rrd", "--out", "{tmp}/new.rrd"), 2, "is not an MCAP file"),
        (("{tmp}/none.jsonl.gz", "--out", "{tmp}/new.rrd"), 2, "none.jsonl.gz"),
        (("20260101", "--out", "{tmp}/new.rrd"), 2, "has no incidents: see `lifeline incidents list`"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_sentence(
    tmp_path: Path, arguments: tuple[str, ...], code: int, sentence: str
) -> None:
    (tmp_path / "old.rrd").write_bytes(b"RRF2")
    (tmp_path / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    where = ("--endpoint", free_endpoint(), "--state-dir", str(tmp_path))
    environment = {
        key: value for key, value in os.environ.items() if key not in {"DISPLAY", "WAYLAND_DISPLAY"}
    }
    done = subprocess.run(
        command("view", *(one.format(tmp=tmp_path) for one in arguments), *where),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=environment,
    )
    assert done.returncode == code, done.stderr
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "new.rrd").exists()
