"""`lifeline incidents` after a stop of the real robot: its figures against those of an observer, and the export."""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from recordings.incidents.incident import messages
from tests.system.harness import Robot, patiently, robot
from wire import topics
from wire.messages import SafetyStatus, decode

pytestmark = pytest.mark.timeout(120)
STATUS = "/robot/supervisor/status"
FILES = "*Z-SOURCE_LOST*.jsonl.gz"
WRITTEN_S = 10.0
"""Time limit for a black box: 2 s of its tail, and some seconds of writing."""


def say(text: str) -> None:
    print(f"\n    measured: {text}")


class Measured(NamedTuple):
    """A stop as an observer of odometry saw it."""

    speed_m_s: float
    standstill_s: float
    distance_m: float


def incidents(state: Path, *arguments: str, columns: int = 100) -> str:
    """Return the output of `lifeline incidents` in a separate process."""
    done = subprocess.run(
        [sys.executable, "-m", "lifeline.cli.app", "incidents", *arguments, "--state-dir", str(state)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"COLUMNS": str(columns), "LIFELINE_STATE_DIR": str(state)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


async def killed_at_speed(subject: Robot, folder: Path) -> Measured:
    """Drive at 0.5 m/s, kill teleop, and measure the stop from outside.

    On a busy machine the robot may have stopped before the kill, for another reason; then there is another attempt.
    """
    await subject.until(lambda: subject.status.owner == topics.TELEOP, "teleop's heartbeat")

    async def attempt() -> Measured:
        if subject.terminal is None:
            subject.start_teleop()
        await subject.drive()
        killed_s = subject.kill(topics.TELEOP)
        before_s = await subject.zero_after(killed_s) + killed_s
        await subject.until(lambda: "SOURCE_LOST" in subject.status.reasons, "the reason")
        standstill_s, distance_m = await subject.standstill_after(before_s)
        await subject.until(lambda: any(folder.glob(FILES)), "a black box", WRITTEN_S)
        # Before the kill counts, a robot that has just reached its speed gains some more.
        speed_m_s = next(speed for at_s, _, speed in reversed(subject.travel) if at_s <= before_s)
        return Measured(speed_m_s, standstill_s, distance_m)

    return await patiently(attempt)


@pytest.mark.timed
async def test_the_incident_of_a_killed_teleop_has_the_figures_of_an_observer_and_can_be_exported(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "blackbox"
    async with robot(tmp_path) as subject:
        seen = await killed_at_speed(subject, folder)
    path = max(folder.glob(FILES))
    listed: dict[str, Any] = json.loads(incidents(tmp_path, "list", "--json"))[-1]
    assert listed["file"] == str(path)
    assert listed["reasons"][0] == "SOURCE_LOST"
    assert listed["owner"] == topics.TELEOP
    assert listed["problem"] is None
    assert listed["speed_m_s"] == pytest.approx(seen.speed_m_s, rel=0.05)
    assert listed["to_standstill_s"] == pytest.approx(seen.standstill_s, abs=0.06)
    assert listed["distance_m"] == pytest.approx(seen.distance_m, abs=0.02)
    say(
        f"speed {listed['speed_m_s']:.3f} m/s, observed {seen.speed_m_s:.3f}; "
        f"braking {listed['distance_m']:.3f} m in {listed['to_standstill_s']:.2f} s, observed {seen.distance_m:.3f} m "
        f"in {seen.standstill_s:.2f} s"
    )

    rows = incidents(tmp_path, "list")
    assert f"{path.name[:20]}  SOURCE_LOST" in rows
    assert f"{listed['speed_m_s']:.2f} m/s" in rows
    for columns in (80, 160):
        shown = incidents(tmp_path, "show", listed["id"], columns=columns)
        assert "SOURCE_LOST: command source lost" in shown
        assert f"{listed['speed_m_s']:.2f} m/s, by odometry" in shown
        assert "● measured" in shown
        assert columns // 2 < max(map(len, shown.splitlines())) <= columns

    file = tmp_path / "incident.mcap"
    incidents(tmp_path, "export", "last", str(file))
    assert_readers_agree(path, file, listed)
    assert_every_rule_was_kept(path)


def assert_every_rule_was_kept(path: Path) -> None:
    """The black box has the times that the law read, so no load of the machine breaks a rule."""
    command = [sys.executable, "-m", "lifeline.cli.app", "judge", str(path), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rules = {rule["rule"]: rule for rule in json.loads(done.stdout)["rules"]}
    for name in ("motion ⇒ a fresh command", "a stop reason ⇒ zero in the same step"):
        assert (rules[name]["why_not"], rules[name]["broken"]) == ("", 0)


def assert_readers_agree(path: Path, file: Path, listed: dict[str, Any]) -> None:
    """Three independent readers find the same messages, and the same status at the stop."""
    expected = Counter(message.topic for message in messages(path))
    assert set(expected) == {
        "/robot/teleop/cmd_vel",
        "/robot/cmd_vel",
        "/robot/scan",
        "/robot/odom",
        STATUS,
    }
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {
            summary.channels[number].topic: count
            for number, count in summary.statistics.channel_message_counts.items()
        }
        assert counts == expected
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        by_mcap = [
            (message.log_time, decoded)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=[STATUS])
        ]
    with AnyReader([file]) as bag:
        assert {topic: info.msgcount for topic, info in bag.topics.items()} == expected
        connections = [connection for connection in bag.connections if connection.topic == STATUS]
        by_rosbags: list[tuple[int, Any]] = [
            (time_ns, bag.deserialize(payload, connection.msgtype))
            for connection, time_ns, payload in bag.messages(connections)
        ]
    ours = [
        (message.log_time_ns, decode(message.payload, SafetyStatus))
        for message in messages(path)
        if message.topic == STATUS
    ]
    for others in (by_mcap, by_rosbags):
        assert len(others) == len(ours)
        for (time_ns, status), (other_ns, other) in zip(ours, others, strict=True):
            assert (other_ns, other.mode, list(other.reasons)) == (time_ns, status.mode, status.reasons)
            assert other.permitted.linear.x == status.permitted.linear.x
    stopped = next(other for _, other in by_rosbags if list(other.reasons) == ["SOURCE_LOST"])
    assert stopped.nearest_m == pytest.approx(listed["nearest_m"], abs=1e-3)
    assert stopped.owner == listed["owner"]
