"""The lines that a peer exchanges with the test: JSON objects on stdout, and commands on stdin."""

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

READY = "ready"


def say(**fields: Any) -> None:  # noqa: ANN401 - any values of JSON
    """Print a line; `at_ns` is the time by CLOCK_MONOTONIC unless it is given."""
    # One write for each line, so that the lines of several threads are not mixed.
    sys.stdout.write(json.dumps({"at_ns": time.monotonic_ns(), **fields}) + "\n")
    sys.stdout.flush()


def listen(obey: Callable[[dict[str, Any]], None], at_end: Callable[[], object]) -> None:
    """Call `obey` on another thread for each line of stdin, and `at_end` when stdin is closed.

    A test that dies closes the stdin of its peers, so that they end too.
    """

    def read() -> None:
        for line in sys.stdin:
            obey(json.loads(line))
        at_end()

    threading.Thread(target=read, daemon=True, name="stdin").start()
