"""Plug-in of supervisord: start programs, and restart a dead one, immediately and not a second later.

supervisord's loop sleeps for a second unless a file becomes ready. The death of a child does not end this sleep, because
Python resumes it after a signal. When the child is reaped, the loop sleeps once more before it restarts the program. This
plug-in makes a pipe ready at both moments, and when the loop begins. It runs in supervisord's interpreter and environment, not in Lifeline's.
"""

import importlib
import os
import signal
from contextlib import suppress
from typing import Any


class Wakeup:
    """A pipe in supervisord's loop, with the methods that the loop calls on each of its files."""

    def __init__(self) -> None:
        self.descriptor, self._end = os.pipe()
        for descriptor in (self.descriptor, self._end):
            os.set_blocking(descriptor, False)
        signal.set_wakeup_fd(self._end, warn_on_full_buffer=False)

    def wake(self, _event: object) -> None:
        """End the sleep of the loop; called at each change of a program's state."""
        with suppress(BlockingIOError):
            os.write(self._end, b"\0")

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return False

    def handle_read_event(self) -> None:
        with suppress(BlockingIOError):
            os.read(self.descriptor, 4096)

    def handle_error(self) -> None:
        pass


def make_wakeup(supervisord: Any) -> object:  # noqa: ANN401 - supervisord has no types
    """Add the pipe to the loop; called once, before supervisord becomes a daemon."""
    os.environ.pop(
        "PYTHONPATH", None
    )  # it was set for the import of this file; the programs must not inherit it
    wakeup = Wakeup()
    supervisord.options.get_socket_map()[wakeup.descriptor] = wakeup
    wakeup.wake(None)  # the first turn of the loop starts the programs
    events: Any = importlib.import_module("supervisor.events")
    events.subscribe(events.ProcessStateEvent, wakeup.wake)
    return wakeup
