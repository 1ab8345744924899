"""Reads Zenoh's log, which Zenoh writes only to the standard output of its process.

Two programs read it. The supervisor reads its own, for sentences about refused clients. A client that cannot connect starts
a separate process that tries once and whose output it reads, because the standard output of teleop is the screen.
"""

import asyncio
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from wire.zenoh.link_trouble import Repeats, at_a_client, at_the_hub
from wire.zenoh.session import in_thread

PERIOD_S = 30.0
"""The supervisor logs each sentence at most once in this time."""
PROBE_LIMIT_S = 15.0
"""Longer than Zenoh's own limit of 10 s for one attempt."""
STANDARD_OUTPUT = 1
RAISED = "Unable to open listener"
"""In a line whose error `zenoh.open` raises too."""
COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def report_refusals(start_log: Callable[[], None], say: Callable[[str], None]) -> None:
    """Report each refused link of this process in a sentence; other output passes through, except errors that are raised too.

    Args:
        start_log: begins Zenoh's log.
        say: called on a thread.
    """
    sys.stdout.flush()
    output = os.fdopen(os.dup(STANDARD_OUTPUT), "w", buffering=1)
    reading, writing = os.pipe()
    # A full pipe must lose lines instead of blocking Zenoh's threads.
    os.set_blocking(writing, False)
    os.dup2(writing, STANDARD_OUTPUT)
    os.close(writing)
    sys.stdout = output

    def read() -> None:
        repeats = Repeats(PERIOD_S)
        with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                sentence = at_the_hub(line)
                if sentence is None:
                    output.write("" if RAISED in line else line)
                elif repeats.is_new(sentence, time.monotonic()):
                    say(sentence)

    threading.Thread(target=read, daemon=True, name="zenoh-log").start()
    start_log()


async def why_refused(endpoint: str, namespace: str, keys: str) -> str | None:
    """Try to connect in a separate process, and return why the link is refused; None if it is not."""
    process = subprocess.Popen(  # noqa: ASYNC220 - asyncio starts its processes in the loop too
        [sys.executable, "-P", "-m", "wire.zenoh.connect", endpoint, namespace, keys],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )
    try:
        async with asyncio.timeout(PROBE_LIMIT_S):
            # A process of asyncio prints warnings if it is killed when it ends, or ends after the event loop.
            output, _ = await in_thread(process.communicate)
    except TimeoutError:
        return None
    finally:
        process.kill()
    lines = COLOUR.sub("", output.decode(errors="replace")).splitlines()
    return next(filter(None, map(at_a_client, lines)), None)
