"""A LaserScan of a ROS 2 driver whose header stamps do not run like real time: over a bridge, and over the process `ros2`."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros2.host import PATIENCE_S, ROOT, Host
from tests.ros2.stack import SUPERVISOR, MakeStack, Watch
from tests.scan_stamps import PROBLEMS
from tests.system.ports import free_endpoint

STALE = "SCAN_STALE"
MOMENTS = 10
"""Stamps in whole seconds are fresh at the beginning of each second. This many samples cannot all fall there."""
SETTLED, COUNTED = 40, 20
"""Numbers of statuses, ten a second: stamps at 0.9 of real time fall behind by the timeout of a scan in 2.4 s."""


def doctor(config: Path) -> str:
    """Return what doctor prints, as one line."""
    lifeline = Path(sys.executable).with_name("lifeline")
    done = subprocess.run(
        [lifeline, "doctor", "--config", config],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return " ".join(done.stdout.split())


@pytest.mark.parametrize("stamps", PROBLEMS)
def test_over_a_bridge_such_stamps_are_named_as_the_cause_of_stale_scans(
    host: Host, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stamps: str
) -> None:
    monkeypatch.setenv("LIFELINE_STATE_DIR", str(tmp_path / "state"))
    config, endpoint, problem = tmp_path / "robot.toml", free_endpoint(), PROBLEMS[stamps]
    config.write_text(SUPERVISOR.format(endpoint=endpoint, folder=tmp_path))
    host.start("diff_drive", "--scan-stamps", stamps).ready()
    host.run("supervisor", [sys.executable, "-m", "supervisor", "--config", str(config)], host.variables)
    host.start("bridge", "--endpoint", endpoint).ready()
    watch = Watch(endpoint)
    try:
        watch.until(
            lambda w: w.status is not None and STALE in w.status.causes and problem in w.status.detail,
            problem,
        )
        said = doctor(config)
        for _ in range(MOMENTS):
            if STALE in said:
                break
            said = doctor(config)
    finally:
        watch.close()
    assert f"{STALE}: there is no fresh scan: the stamps of the lidar's scans {problem}" in said
    assert "wait for the lidar" not in said


@pytest.mark.parametrize("stamps", PROBLEMS)
def test_over_the_process_ros2_a_scan_is_as_old_as_its_publication_and_such_stamps_stop_nothing(
    host: Host, make_stack: MakeStack, stamps: str
) -> None:
    host.start("diff_drive", "--scan-stamps", stamps).ready()
    stack = make_stack()
    stack.drive(stack.source())
    first, stale = stack.watch.statuses + SETTLED, dict[int, bool]()

    def counted(watch: Watch) -> bool:
        if watch.status is not None and watch.statuses > first:
            stale[watch.statuses] = STALE in watch.status.causes
        return len(stale) >= COUNTED

    stack.watch.until(counted, "statuses")
    assert sum(stale.values()) < COUNTED / 2, "a busy machine delays some scans"
