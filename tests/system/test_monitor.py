"""`lifeline watch` and `lifeline metrics` beside a real robot."""

import asyncio
import json
import re
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from prometheus_client.parser import text_string_to_metric_families

from tests.system.harness import PATIENCE_S, Robot, free_endpoint, robot
from tests.system.test_record import lifeline, say
from wire import topics
from wire.messages import Bool, SafetyStatus

pytestmark = pytest.mark.timeout(120)

Samples = dict[tuple[str, str], float]
"""(name, value of the only label or empty) → value."""


def started(*arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(lifeline(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


async def line_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    async with asyncio.timeout(PATIENCE_S):
        return await asyncio.to_thread(process.stdout.readline)


async def row_where(
    process: "subprocess.Popen[str]", holds: Callable[[dict[str, Any]], bool]
) -> dict[str, Any]:
    """Read lines until a row fulfils a condition."""
    async with asyncio.timeout(PATIENCE_S):
        while not holds(row := json.loads(await line_of(process))):
            pass
    return row


async def interrupted(process: "subprocess.Popen[str]") -> tuple[float, str]:
    """Send SIGINT; return the time to the end of the process [s] and its errors."""
    sent_s = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, errors = await asyncio.to_thread(process.communicate, timeout=PATIENCE_S)
    assert process.returncode == 0
    return time.monotonic() - sent_s, errors


def scraped(address: str) -> Samples:
    with urlopen(address, timeout=PATIENCE_S) as response:
        text = response.read().decode()
    return {
        (sample.name, "".join(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


async def until_scraped(subject: Robot, address: str, holds: Callable[[Samples], bool]) -> Samples:
    """Scrape until a condition holds."""
    samples: Samples = {}

    def look() -> bool:
        samples.clear()
        samples.update(scraped(address))
        return holds(samples)

    await subject.until(look, "a scrape")
    return samples


async def test_watch_prints_a_row_of_a_robot_whatever_another_does(tmp_path: Path) -> None:
    nobody = free_endpoint()
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: bool(subject.travel) and subject.status.nearest_m > 0, "a scan")
        process = started("watch", "--json", "--endpoint", nobody, "--endpoint", subject.endpoint)
        try:
            row = await row_where(
                process,
                lambda row: row["up"] and row["nearest_m"] is not None and row["linear_m_s"] is not None,
            )
            assert (row["namespace"], row["endpoint"]) == ("robot", subject.endpoint)
            assert row["mode"] == "STOPPED"
            assert "NO_COMMAND" in row["causes"]
            assert 0.0 < row["nearest_m"] < 12.0
            assert abs(row["linear_m_s"]) < 0.05
            down = await row_where(process, lambda row: row["endpoint"] == nobody)
            assert (down["up"], down["mode"]) == (False, None)
            await row_where(process, lambda row: row["link"] == "no supervisor")
            assert subject.bus is not None
            subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
            await row_where(process, lambda row: row["up"] and "ESTOP" in row["reasons"])
            subject.kill(topics.SUPERVISOR)
            gone = await row_where(process, lambda row: row["endpoint"] == subject.endpoint and not row["up"])
            assert gone["link"].startswith("no supervisor for ")
            subject.start(topics.SUPERVISOR)
            await row_where(process, lambda row: row["up"])
            took_s, errors = await interrupted(process)
        finally:
            process.kill()
            process.communicate()
    say(f"watch ended {took_s:.2f} s after SIGINT")
    assert errors == ""


async def test_metrics_count_a_stop_and_never_go_backwards_when_the_supervisor_restarts(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(lambda: bool(subject.travel), "odometry")
        process = started("metrics", "--listen", "127.0.0.1:0", "--endpoint", subject.endpoint)
        try:
            found = re.search(r"http://127\.0\.0\.1:\d+/metrics", await line_of(process))
            assert found is not None
            address = found[0]
            stopped = ("lifeline_mode_seconds_total", "STOPPED")
            estops = ("lifeline_stops_total", "ESTOP")
            before = await until_scraped(
                subject, address, lambda now: now.get(stopped, 0.0) > 0.0 and now["lifeline_up", ""] == 1.0
            )
            assert before[estops] == 0.0
            assert subject.bus is not None
            subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
            after = await until_scraped(
                subject,
                address,
                lambda now: (
                    now[estops] == 1.0
                    and now[stopped] > before[stopped] + 0.5
                    and now["lifeline_message_gap_seconds_count", "odom"] > 10
                    and now["lifeline_message_age_seconds_count", "cmd_vel"] > 10
                    and now["lifeline_up", ""] == 1.0
                ),
            )
            assert after["lifeline_alarm", ""] == 0.0
            subject.kill(topics.SUPERVISOR)
            await until_scraped(subject, address, lambda now: now["lifeline_up", ""] == 0.0)
            subject.start(topics.SUPERVISOR)
            again = await until_scraped(subject, address, lambda now: now["lifeline_up", ""] == 1.0)
            assert again[estops] == 1.0
            assert again[stopped] >= after[stopped]
            took_s, errors = await interrupted(process)
        finally:
            process.kill()
            process.communicate()
        await subject.until(lambda: subject.status.mode == SafetyStatus.STOPPED, "a status")
    say(f"metrics ended {took_s:.2f} s after SIGINT")
    assert errors == ""


@pytest.mark.smoke
def test_metrics_on_a_port_in_use_say_so_in_one_sentence() -> None:
    endpoint = free_endpoint()
    with subprocess.Popen(
        lifeline("metrics", "--listen", "127.0.0.1:0", "--endpoint", endpoint),
        stdout=subprocess.PIPE,
        text=True,
    ) as first:
        try:
            assert first.stdout is not None
            found = re.search(r"http://(\S+)/metrics", first.stdout.readline())
            assert found is not None
            second = subprocess.run(
                lifeline("metrics", "--listen", found[1], "--endpoint", endpoint),
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
                check=False,
            )
        finally:
            first.kill()
    assert second.returncode == 2
    assert second.stderr.count("\n") == 1
    assert "is in use by another program" in second.stderr
