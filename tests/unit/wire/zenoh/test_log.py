"""A client finds out in a separate process why it is refused."""

import asyncio
from asyncio.subprocess import Process
from contextlib import suppress
from signal import SIGKILL
from typing import Any

import pytest

from wire.zenoh.log import why_refused


async def test_a_cancelled_client_waits_for_the_end_of_its_attempt_to_connect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started = asyncio.Queue[Process]()
    start = asyncio.create_subprocess_exec

    async def noted(*words: str, **options: Any) -> Process:  # noqa: ANN401
        process = await start(*words, **options)
        started.put_nowait(process)
        return process

    monkeypatch.setattr(asyncio, "create_subprocess_exec", noted)
    asking = asyncio.create_task(why_refused("tls/127.0.0.1:1", "robot", "no-bundle"))
    process = await started.get()
    asking.cancel()
    with suppress(asyncio.CancelledError):
        await asking
    assert process.returncode == -SIGKILL
