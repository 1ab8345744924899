"""What every caller of Zenoh needs: ways between its threads and the event loop, and its errors in one line."""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import zenoh


async def in_thread(work: Callable[[], Any]) -> Any:  # noqa: ANN401 - any result of the work
    """Run blocking work on a daemon thread, which does not delay the end of the process, unlike an executor's."""
    future: Future[Any] = Future()
    future.set_running_or_notify_cancel()  # the waiting task may be cancelled; the work still runs to its end

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:  # noqa: BLE001 - passed to the waiting task
            future.set_exception(error)

    threading.Thread(target=run, daemon=True, name="zenoh-work").start()
    return await asyncio.wrap_future(future)


def direct(callback: Callable[[Any], None]) -> "zenoh.handlers.Callback[Any]":
    """Return a callback that Zenoh calls on its own thread, without a queue between."""
    return zenoh.handlers.Callback(callback, indirect=False)


def call_in(loop: asyncio.AbstractEventLoop, callback: Callable[[], None]) -> None:
    """Call it in the event loop; do nothing if the loop has closed, so that no reply is possible."""
    try:
        loop.call_soon_threadsafe(callback)
    except RuntimeError:
        return


def first_line(error: object) -> str:
    """Return the first line of a Zenoh error without the source location at its end."""
    return str(error).split(" at ")[0].splitlines()[0]
