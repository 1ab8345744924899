"""Component tests run one service on the memory bus and a virtual clock: time jumps, nothing sleeps."""

import asyncio
import math
from collections.abc import Callable, Mapping
from contextvars import Context

import async_solipsism
import pytest

MICROSECOND_S = 1e-6


class VirtualLoop(async_solipsism.EventLoop):
    """A loop whose clock jumps to its next timer.

    Its clock counts whole microseconds. A timer in between would fire a hair too early, and a service that
    then waits for the rest would do so for ever: timers are moved up to the next whole one.
    """

    def call_at(
        self,
        when: float,
        callback: Callable[..., object],
        *args: object,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        whole = (math.floor(when / MICROSECOND_S) + 1) * MICROSECOND_S
        return super().call_at(whole, callback, *args, context=context)  # pyright: ignore[reportUnknownVariableType]


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Give every test here a virtual clock."""
    return {"virtual": VirtualLoop}
