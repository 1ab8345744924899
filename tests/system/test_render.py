"""`lifeline render` of a robot that runs, and of the recording of its drive."""

import asyncio
import json
import math
import signal
import subprocess
from pathlib import Path
from typing import Any

import av
import pytest

from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from recordings.recording import RecordingReader
from tests.gl import needs_gl
from tests.system.harness import Robot, free_endpoint, robot
from tests.system.test_record import ODOM, Recording, lifeline
from wire import topics
from wire.messages import Odometry

pytestmark = pytest.mark.timeout(240)
SMALL = ("--size", "64x48")


def rendered(*arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        lifeline("render", *arguments, *SMALL, "--json"),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


async def drive_away(subject: Robot, distance_m: float) -> None:
    """Drive ahead, and come to rest."""
    while subject.x_m < distance_m:
        await subject.drive()
        await subject.until(
            lambda: subject.x_m >= distance_m or subject.speed_m_s < 0.005, "the drive or its end"
        )
    subject.type("s")
    await subject.until(lambda: abs(subject.speed_m_s) < 0.005, "standstill")


@needs_gl
async def test_a_driven_robot_is_drawn_where_it_stands_and_its_recording_is_a_film_of_its_length(
    tmp_path: Path,
) -> None:
    recording = tmp_path / "drive.mcap"
    async with robot(tmp_path) as subject:
        assert subject.bus is not None
        truth = subject.bus.subscribe(topics.TRUTH, depth=1)
        poses: list[Odometry] = []

        def is_known() -> bool:
            poses.extend(one.message for one in truth.take() if one.message is not None)
            return bool(poses)

        await subject.until(is_known, "the true pose")
        start = poses[-1].pose.pose.position
        recorder = Recording(subject, recording)
        try:
            await recorder.flushed()
            await drive_away(subject, 0.4)
            recorder.process.send_signal(signal.SIGINT)
            code, _, errors = await recorder.ended()
            assert (code, errors) == (0, "")
        finally:
            recorder.close()
        StateDir(tmp_path).record.write_text(json.dumps(Launch.read(None, subject.endpoint).to_record()))
        now, live, new = [
            await asyncio.to_thread(
                rendered, "--out", str(tmp_path / name), *options, "--state-dir", str(tmp_path)
            )
            for name, *options in (
                ("now.png",),
                ("live.webp", "--seconds", "1", "--fps", "3"),
                ("new.png", "--fresh", "--seconds", "0.1"),
            )
        ]
        poses.clear()
        await subject.until(is_known, "the true pose")
        there = poses[-1].pose.pose.position
    for drawn in (now, live):
        assert drawn["robot"] == f"the running robot at {subject.endpoint}, by its true pose"
        assert (drawn["x_m"], drawn["y_m"]) == pytest.approx((there.x, there.y), abs=0.01)
    assert (now["frames"], live["frames"]) == (1, 3)
    assert new["robot"] == "a new robot"
    assert (new["x_m"], new["y_m"]) == pytest.approx((start.x, start.y), abs=0.01)
    assert math.dist((now["x_m"], now["y_m"]), (start.x, start.y)) > 0.4

    film = rendered(str(recording), "--out", str(tmp_path / "drive.mp4"), "--fps", "2")
    assert film["robot"] == f"{recording}, by its true pose"
    assert (film["x_m"], film["y_m"]) == pytest.approx((there.x, there.y), abs=0.3)
    times_s = [
        message.log_time_ns * 1e-9
        for message in RecordingReader(recording).messages()
        if message.topic == ODOM
    ]
    with av.open(str(tmp_path / "drive.mp4")) as container:
        assert container.duration is not None
        duration_s = container.duration / av.time_base
    assert duration_s == pytest.approx(times_s[-1] - times_s[0], abs=0.3)


def render(tmp_path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command where no robot runs."""
    where = ("--out", str(tmp_path / "a.png"), "--endpoint", free_endpoint(), "--state-dir", str(tmp_path))
    return subprocess.run(
        lifeline("render", *arguments, *where, *SMALL),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@needs_gl
def test_where_no_robot_runs_a_new_one_is_drawn_and_the_command_says_so(tmp_path: Path) -> None:
    done = render(tmp_path, "--seconds", "0.1")
    assert done.returncode == 0, done.stderr
    assert "rendering a new robot at its start" in done.stderr
    assert ": a new robot, at x" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("{tmp}/notes.mcap",),
            "is not an MCAP file: name a recording, such as a file that `lifeline record` wrote",
        ),
        (("{tmp}/notes.mcap", "--fresh"), "leave out the file, or --fresh and --drive"),
        (("last",), "has no incidents: see `lifeline incidents list`"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    (tmp_path / "notes.mcap").write_text("nothing")
    done = render(tmp_path, *(one.format(tmp=tmp_path) for one in arguments))
    assert done.returncode == 2, done.stderr
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "a.png").exists()
