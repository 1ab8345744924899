"""Forks a process for each flow, or for some flows together.

By default, operators and robots share no threads with each other, as in reality. Flows in one process share its wake-ups, which cost
most of the processor time: several times as many flows then fit on a machine.

The parent has imported all modules and opened no session, so that a fork is safe, and much cheaper than a new interpreter.
"""

import ctypes
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

_PR_SET_PDEATHSIG = 1
NICE = -10
Pipe: TypeAlias = "Connection[Any, Any]"


def fork_each(items: Sequence[T], work: Callable[[T, Pipe], None], together: int) -> list[Pipe]:
    """Run `work` for each item, in a process for so many of them together; return the parent's end of each pipe.

    The processes end with their work, or with this one.
    """
    forking = multiprocessing.get_context("fork")
    libc = ctypes.CDLL(None)
    pipes: list[Pipe] = []

    def child(group: Sequence[T], ends: Sequence[Pipe]) -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        threads = [threading.Thread(target=work, args=one) for one in zip(group, ends, strict=True)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for end in ends:
            end.close()
        os._exit(0)  # closing a session can take seconds, and nobody needs it

    # Each of them stands for a computer of its own: other work of this one must not delay it.
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    for first in range(0, len(items), together):
        group = items[first : first + together]
        ours, theirs = zip(*(forking.Pipe() for _ in group), strict=True)
        forking.Process(target=child, args=(group, theirs)).start()
        for end in theirs:
            end.close()
        pipes += ours
    return pipes
