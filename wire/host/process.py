"""Guaranteed end of a process.

An interpreter that exits with an open Zenoh session can hang. After an uncaught exception, a process can stay alive
with its liveliness token, but publish nothing. Therefore a service runs under `run_process`, which ends the process on
a signal, when its main returns, and on any exception, including one in a task that is not awaited.
"""

import asyncio
import gc
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Coroutine
from contextlib import ExitStack, suppress
from typing import Any, NoReturn

from wire.host.installation import runnable
from wire.host.memory_keeper import MemoryKeeper
from wire.host.process_limits import limit_of
from wire.host.streams import open_closed_streams
from wire.inbox import BusError
from wire.text import printable_lines

_log = logging.getLogger(__name__)

STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
STOP_LIMIT_S = 3.0
"""Maximum time from the first request to stop to the end of the process, even if a call hangs."""

EXIT_FAILURE = 1

Main = Callable[[asyncio.Event], Coroutine[Any, Any, int]]


def run_process(name: str, main: Main, *, memory_keeper: bool = False) -> NoReturn:
    """Run `main(stop)` in a new event loop and end the process with the code that it returns.

    Args:
        name: the name of the process, for error messages.
        main: SIGTERM, SIGINT and SIGHUP set `stop`; main must then return within `STOP_LIMIT_S`.
        memory_keeper: whether to start a memory keeper (wire/host/memory_keeper.py), for a process whose death must stop the robot.
    """
    open_closed_streams()
    # A program that starts many times disables the collection of garbage during its imports, which takes up to 21 ms.
    gc.freeze()  # no later collection searches the modules, which would take 9 ms, longer than many steps of the law
    gc.enable()
    at_end = ExitStack()
    code = EXIT_FAILURE
    try:
        code = asyncio.run(_supervised(main, at_end, memory_keeper=memory_keeper))
    except BusError as error:
        print(f"{name}: {printable_lines(runnable(str(error)))}", file=sys.stderr)
    except Exception as error:  # noqa: BLE001 - the last handler before the process ends
        sentence = limit_of(error)
        if sentence is None:
            _log.exception("%s ended with an unexpected error", name)
        else:
            print(f"{name}: {printable_lines(sentence)}", file=sys.stderr)
    finally:
        with suppress(OSError):  # the terminal may be closed
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
        """End the process on an exception in a task that is not awaited, instead of only logging it."""
        error = context.get("exception")
        if not failed.done():
            failed.set_exception(error if isinstance(error, Exception) else RuntimeError(context["message"]))

    loop.set_exception_handler(on_unhandled)
    for number in STOP_SIGNALS:
        loop.add_signal_handler(number, on_signal)
    # After the signal handlers: without them, a signal would end the process and leave the keeper behind.
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
    """End the process after `STOP_LIMIT_S`, even if its main hangs."""
    timer = threading.Timer(STOP_LIMIT_S, os._exit, (EXIT_FAILURE,))
    timer.daemon = True
    timer.start()
