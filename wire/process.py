"""A process that always ends.

An interpreter that ends with an open Zenoh session can hang, and an uncaught exception can leave a zombie:
running, its token alive, nothing published. So a service runs under `run_process`, which ends it for
certain: on a signal, on its own return, and on any exception, also one in a task that nobody awaits.
"""

import asyncio
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Coroutine
from contextlib import ExitStack, suppress
from typing import Any, NoReturn

from wire.bus import BusError
from wire.memory_keeper import MemoryKeeper

_log = logging.getLogger(__name__)

STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
STOP_LIMIT_S = 3.0
"""From the first request to stop to the end of the process, whatever hangs."""

EXIT_FAILURE = 1

Main = Callable[[asyncio.Event], Coroutine[Any, Any, int]]


def run_process(name: str, main: Main, *, memory_keeper: bool = True) -> NoReturn:
    """Run `main(stop)` in a new event loop and end the process with the code that it returns.

    Args:
        name: the process's, for its last words.
        main: `stop` is set by SIGTERM, SIGINT and SIGHUP; main then has `STOP_LIMIT_S` to come to its end.
        memory_keeper: whether the process gets one (wire/memory_keeper.py).
    """
    at_end = ExitStack()
    code = EXIT_FAILURE
    try:
        code = asyncio.run(_supervised(main, at_end, memory_keeper=memory_keeper))
    except BusError as error:
        print(f"{name}: {error}", file=sys.stderr)
    except Exception:  # noqa: BLE001 - the last stop before the process ends
        _log.exception("%s ended by an error of its own", name)
    finally:
        with suppress(OSError):  # a terminal that is gone takes no last words
            logging.shutdown()
            sys.stdout.flush()
            sys.stderr.flush()
        at_end.close()
        os._exit(code)


async def _supervised(main: Main, at_end: ExitStack, *, memory_keeper: bool) -> int:
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    failed: asyncio.Future[int] = loop.create_future()

    def on_signal() -> None:
        stop.set()
        end_for_certain()

    def on_unhandled(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Something raised where nobody awaits it: that is the end of the process, not a line in a log."""
        error = context.get("exception")
        if not failed.done():
            failed.set_exception(error if isinstance(error, Exception) else RuntimeError(context["message"]))

    loop.set_exception_handler(on_unhandled)
    for number in STOP_SIGNALS:
        loop.add_signal_handler(number, on_signal)
    # Not before the handlers: a signal that ends the process without them would leave the keeper behind.
    if memory_keeper:
        at_end.callback(MemoryKeeper().end)
    running = asyncio.ensure_future(main(stop))
    await asyncio.wait({running, failed}, return_when=asyncio.FIRST_COMPLETED)
    if not running.done():
        end_for_certain()
        running.cancel()
        await asyncio.wait({running})
        return await failed
    if not failed.done():
        failed.cancel()
    return running.result()


def end_for_certain() -> None:
    """From now on the process has `STOP_LIMIT_S` to live."""
    timer = threading.Timer(STOP_LIMIT_S, os._exit, (EXIT_FAILURE,))
    timer.daemon = True
    timer.start()
