"""Robots that cannot be measured without Lifeline, and the return of Lifeline's processes."""

import asyncio
from pathlib import Path
from typing import Any, cast

import pytest

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.processes import POLL_S, Process
from deploy.stack.statedir import StateDir
from passport import measure
from passport.cells import OF_LIFELINE, Fault
from passport.measure import Orders
from passport.without import Without
from wire import topics
from wire.bus_config import BusConfig

TCP, QUIC = "tcp/127.0.0.1:7447", "quic/127.0.0.1:7447"


@pytest.mark.parametrize(
    ("endpoint", "base", "why"),
    [
        (QUIC, topics.SIM, "a robot with certificates"),
        (QUIC, topics.ROS2, "a robot with certificates"),
        (TCP, topics.SIM, "the process supervisor is not one of this computer's `lifeline up`"),
        (TCP, topics.ROS2, "the process supervisor is not one of this computer's `lifeline up`"),
    ],
)
def test_a_robot_whose_supervisor_cannot_be_replaced_is_refused_with_the_reason(
    tmp_path: Path, endpoint: str, base: str, why: str
) -> None:
    launch = Launch(tmp_path / "robot.toml", BusConfig(endpoint), nodes=(topics.SUPERVISOR, base))
    refused = Without(launch, StateDir(tmp_path), ("teleop", "path")).refusal()
    assert refused is not None
    assert why in refused


def test_a_ros2_robot_whose_process_ros2_runs_elsewhere_or_without_an_interpreter_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[ros2]\npython = "nowhere"\n')
    launch = Launch(file, BusConfig(TCP), nodes=(topics.SUPERVISOR, topics.ROS2))
    here = {topics.SUPERVISOR}

    def elsewhere(_launch: Launch, _state: StateDir, name: str) -> str | None:
        return None if name in here else f"{name} runs elsewhere"

    monkeypatch.setattr("passport.without.not_supervised", elsewhere)
    without = Without(launch, StateDir(tmp_path), ("teleop", "path"))
    assert without.refusal() == "ros2 runs elsewhere"
    here.add(topics.ROS2)
    assert f"{tmp_path / 'nowhere'} is missing: run `make ros2`" in (without.refusal() or "")


@pytest.mark.parametrize("fault", sorted(OF_LIFELINE))
def test_a_fault_or_a_stop_of_lifeline_is_refused(tmp_path: Path, fault: Fault) -> None:
    orders = Orders("path", None, tmp_path / "out", 1, (0,), [Fault.ZERO, fault], with_lifeline=False)
    with pytest.raises(DeployError, match=f"^{fault}: not without Lifeline"):
        measure._without(cast("Any", None), StateDir(tmp_path), orders)  # pyright: ignore[reportPrivateUsage]


class SlowStack:
    """Stands for supervisord and its processes: each process ends only when the test lets it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.running = [topics.SUPERVISOR, topics.ROS2]
        self.stopping: list[str] = []
        self.are_asked = asyncio.Event()
        """Whether all are asked to stop."""
        self.started: list[str] = []
        monkeypatch.setattr("passport.without.supervisord.stop_program", self._stop)
        monkeypatch.setattr("passport.without.supervisord.start_program", self._start)
        monkeypatch.setattr("passport.without.processes.of", self._of)
        monkeypatch.setattr("passport.without.ros2_program.with_variables", self._command)

    def _stop(self, _state: StateDir, name: str) -> bool:
        self.stopping.append(name)
        return True

    def _start(self, _state: StateDir, name: str) -> bool:
        if name in self.running:
            return False
        self.started.append(name)
        return True

    def _of(self, _path: Path) -> list[Process]:
        if self.stopping == self.running:
            self.are_asked.set()
        return [Process(1, name) for name in self.running]

    def _command(self, *_: object) -> list[str]:
        return ["true"]


async def test_processes_that_are_still_ending_when_the_measurement_is_interrupted_are_started_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = SlowStack(monkeypatch)
    both = tuple(stack.running)
    launch = Launch(tmp_path / "robot.toml", BusConfig(TCP), nodes=both)
    without = Without(launch, StateDir(tmp_path), ("teleop", "path"))
    beginning = asyncio.create_task(without.begin())
    await stack.are_asked.wait()
    beginning.cancel()
    ending = asyncio.create_task(without.end())
    for name in both:
        await asyncio.wait([ending], timeout=2 * POLL_S)
        assert not ending.done()
        stack.running.remove(name)
    assert await ending
    assert tuple(stack.started) == both


async def test_an_end_without_a_beginning_starts_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = SlowStack(monkeypatch)
    launch = Launch(tmp_path / "robot.toml", BusConfig(TCP), nodes=tuple(stack.running))
    assert await Without(launch, StateDir(tmp_path), ("teleop", "path")).end()
    assert stack.started == []
