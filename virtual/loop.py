"""An event loop with a virtual clock: time jumps to the next timer, and stands still while a callback runs.

Several processes share one loop and its clock. Each runs in a context with its name, and everything that it schedules
belongs to it. A process can therefore be held (no callback of it runs) or killed (no callback of it ever runs again,
not even a `finally`).

The order of callbacks is deterministic: callbacks that are due at the same time run in the order of scheduling.
"""

import asyncio
import contextvars
import math
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from heapq import heappop, heappush
from typing import Any, TypeVar

T = TypeVar("T")

STANDSTILL_LIMIT = 200_000
"""Number of callbacks at the same time after which the loop counts as stuck."""

_process: contextvars.ContextVar["VirtualProcess | None"] = contextvars.ContextVar("process", default=None)


class VirtualTimeError(RuntimeError):
    """Time cannot advance: no timer is left, or callbacks reschedule themselves without end."""


class VirtualProcess:
    """A simulated process: its callbacks run, wait and end together.

    Args:
        name: name in messages.
        slack_s: its timers are delayed to multiples of this time, which saves wake-ups; 0: no delay.
    """

    def __init__(self, name: str, slack_s: float = 0.0) -> None:
        self.name = name
        self.slack_s = slack_s
        self.context = contextvars.copy_context()
        self.context.run(_process.set, self)
        self._held: list[asyncio.Handle] | None = None
        self.is_dead = False

    @property
    def is_held(self) -> bool:
        return self._held is not None

    def hold(self) -> None:
        """Queue its callbacks from now on instead of running them."""
        if self._held is None:
            self._held = []

    def let_go(self) -> list[asyncio.Handle]:
        """Run its callbacks again from now on; return the queued ones, oldest first."""
        held, self._held = self._held or [], None
        return held

    def keep(self, handle: asyncio.Handle) -> bool:
        """Return whether a callback must not run now; queue it if the process is held."""
        if self.is_dead:
            return True
        if self._held is None:
            return False
        self._held.append(handle)
        return True


class VirtualLoop(asyncio.AbstractEventLoop):
    """The parts of an event loop that services use: tasks, futures and timers; no files, sockets or threads."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._ready: deque[asyncio.Handle] = deque()
        self._timers: list[tuple[float, int, asyncio.TimerHandle]] = []
        self._scheduled = 0
        self._stopping = False
        self._closed = False
        self.on_error: Callable[[str, BaseException | None], None] | None = None
        """Called for each error that is not awaited: the process's name, or "" for none, and the error."""

    # --- time

    def time(self) -> float:
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Let time pass within the running callback, as if it blocked the whole loop."""
        self._now_s += seconds

    def call_soon(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        callback: Callable[..., object],
        *args: Any,  # noqa: ANN401
        context: contextvars.Context | None = None,
    ) -> asyncio.Handle:
        handle = asyncio.Handle(callback, args, self, context)
        self._ready.append(handle)
        return handle

    call_soon_threadsafe = call_soon  # pyright: ignore[reportAssignmentType] - there is one thread

    def call_later(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        delay: float,
        callback: Callable[..., object],
        *args: Any,  # noqa: ANN401
        context: contextvars.Context | None = None,
    ) -> asyncio.TimerHandle:
        return self.call_at(self._now_s + delay, callback, *args, context=context)

    def call_at(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        when: float,
        callback: Callable[..., object],
        *args: Any,  # noqa: ANN401
        context: contextvars.Context | None = None,
    ) -> asyncio.TimerHandle:
        process = _process.get() if context is None else context.get(_process)
        due_s = max(when, self._now_s)
        if process is not None and process.slack_s:
            due_s = max(due_s, math.ceil(due_s / process.slack_s - 1e-6) * process.slack_s)
        handle = asyncio.TimerHandle(due_s, callback, args, self, context)
        self._scheduled += 1
        heappush(self._timers, (due_s, self._scheduled, handle))
        return handle

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        """Do nothing: a cancelled timer is skipped when it is due."""

    # --- running

    def run_until_complete(self, future: Awaitable[T]) -> T:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Run until a future is done; all other callbacks wait for the next call.

        Raises:
            VirtualTimeError: the future can never be done.
        """
        previous = asyncio._get_running_loop()  # noqa: SLF001 - of loops for loops
        asyncio._set_running_loop(self)  # noqa: SLF001
        try:
            done = asyncio.ensure_future(future, loop=self)
            done.add_done_callback(lambda _: self.stop())
            self._run()
            return done.result()
        finally:
            asyncio._set_running_loop(previous)  # noqa: SLF001

    def _run(self) -> None:
        self._stopping = False
        ready, timers, at_once = self._ready, self._timers, 0
        while not self._stopping:
            if not ready:
                if not timers:
                    raise VirtualTimeError("all processes wait, and no timer is left")
                due_s, _, handle = heappop(timers)
                if due_s > self._now_s:
                    self._now_s, at_once = due_s, 0
            else:
                handle = ready.popleft()
            if handle._cancelled:  # noqa: SLF001  # pyright: ignore[reportPrivateUsage]
                continue
            process = handle._context.get(_process)  # noqa: SLF001  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType, reportUnknownVariableType]
            if process is not None and process.keep(handle):
                continue
            at_once += 1
            if at_once > STANDSTILL_LIMIT:
                raise VirtualTimeError(f"time stands still at {self._now_s:g} s: {handle!r}")
            handle._run()  # noqa: SLF001  # pyright: ignore[reportPrivateUsage]

    def resume(self, process: VirtualProcess) -> None:
        """Let a held process run again; its queued callbacks run first."""
        self._ready.extend(process.let_go())

    def stop(self) -> None:
        self._stopping = True

    def is_running(self) -> bool:
        return asyncio._get_running_loop() is self  # noqa: SLF001

    def is_closed(self) -> bool:
        return self._closed

    def close(self) -> None:
        """Close the loop and all coroutines. The `finally` blocks of killed processes run here, without any effect."""
        self._closed = True
        asyncio._set_running_loop(self)  # noqa: SLF001
        try:
            for task in asyncio.all_tasks(self):
                coroutine = task.get_coro()
                if isinstance(coroutine, Coroutine):
                    with suppress(BaseException):
                        coroutine.close()
        finally:
            asyncio._set_running_loop(None)  # noqa: SLF001
        self._ready.clear()
        self._timers.clear()

    async def shutdown_asyncgens(self) -> None:
        """Do nothing: generators end with their tasks."""

    async def shutdown_default_executor(self) -> None:
        """Do nothing: there is no executor."""

    # --- tasks

    def create_future(self) -> asyncio.Future[Any]:
        return asyncio.Future(loop=self)

    def create_task(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        coro: Coroutine[Any, Any, T],
        *,
        name: str | None = None,
        context: contextvars.Context | None = None,
    ) -> asyncio.Task[T]:
        return asyncio.Task(coro, loop=self, name=name, context=context)

    def get_debug(self) -> bool:
        return False

    def set_debug(self, enabled: bool) -> None:  # noqa: FBT001 - asyncio's own
        """Do nothing: there is no debug mode."""

    def set_exception_handler(self, handler: object) -> None:
        """Do nothing: `on_error` is called instead."""

    def default_exception_handler(self, context: dict[str, Any]) -> None:
        self.call_exception_handler(context)

    def call_exception_handler(self, context: dict[str, Any]) -> None:
        if self._closed or self.on_error is None:
            return
        handle = context.get("handle")
        process = None
        if isinstance(handle, asyncio.Handle):
            process = handle._context.get(_process)  # noqa: SLF001  # pyright: ignore[reportPrivateUsage, reportUnknownMemberType, reportUnknownVariableType]
        self.on_error("" if process is None else process.name, context.get("exception"))
