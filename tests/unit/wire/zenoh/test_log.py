"""A client finds out in a separate process why it is refused."""

import asyncio
import subprocess
import threading
from collections.abc import Callable
from signal import SIGKILL
from typing import Any, cast

import pytest

from wire.zenoh.log import why_refused

STEPS = pytest.mark.parametrize("steps", range(1, 9))
"""Steps of the event loop that pass first."""


class Client:
    """A client that asks why it is refused; a command takes the place of its attempt to connect."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *command: str) -> None:
        self.process: subprocess.Popen[bytes]
        start = cast("Callable[..., subprocess.Popen[bytes]]", subprocess.Popen)

        def started(_: list[str], **options: Any) -> "subprocess.Popen[bytes]":  # noqa: ANN401
            self.process = start(command, **options)
            return self.process

        monkeypatch.setattr(subprocess, "Popen", started)
        self.task = asyncio.create_task(why_refused("tls/127.0.0.1:1", "robot", "keys"))

    async def step(self, steps: int) -> None:
        for _ in range(steps):
            await asyncio.sleep(0)


@STEPS
def test_a_program_that_ends_after_it_cancelled_its_client_kills_the_attempt_and_prints_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, steps: int
) -> None:
    async def program() -> Client:
        client = Client(monkeypatch, "sleep", "infinity")
        await client.step(8)
        client.task.cancel()
        await client.step(steps)
        return client

    client = asyncio.run(program())  # cancels the client again, if it has not ended
    assert client.task.cancelled()
    assert client.process.wait() == -SIGKILL
    assert not caplog.messages


@STEPS
async def test_a_client_is_cancelled_although_its_attempt_has_just_ended(
    monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    client = Client(monkeypatch, "true")
    await client.step(2)
    for thread in threading.enumerate():
        if thread.name == "zenoh-work":
            thread.join()
    await client.step(steps)
    if client.task.cancel():
        with pytest.raises(asyncio.CancelledError):
            await client.task
