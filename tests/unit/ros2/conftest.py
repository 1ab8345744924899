"""Fixtures of the tests with real processes."""

import subprocess
import sys
from collections.abc import Generator

import pytest

from ros2 import guard
from tests.unit.ros2.processes import Child


@pytest.fixture(autouse=True)
def every_process_uses_dds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fast DDS is not installed here; the C library stands for it."""
    monkeypatch.setattr(guard, "DDS_LIBRARIES", (b"libc.so",))


@pytest.fixture
def child() -> Generator[Child]:
    """A process that waits until it is killed."""
    command = [sys.executable, "-c", "print('ready', flush=True); input()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        try:
            yield process
        finally:
            process.kill()
