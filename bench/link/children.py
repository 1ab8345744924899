"""Forks a process for each flow: as in reality, operators and robots share no threads with each other.

The parent has imported all modules and opened no session, so that a fork is safe, and much cheaper than a new interpreter.
"""

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

_PR_SET_PDEATHSIG = 1
NICE = -10
Pipe: TypeAlias = "Connection[Any, Any]"


def fork_each(items: Sequence[T], work: Callable[[T, Pipe], None]) -> list[Pipe]:
    """Run `work` in a process for each item; return the parent's end of each pipe.

    The processes end with their work, or with this one.
    """
    forking = multiprocessing.get_context("fork")
    libc = ctypes.CDLL(None)
    pipes: list[Pipe] = []

    def child(item: T, pipe: Pipe) -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        work(item, pipe)
        pipe.close()
        os._exit(0)  # closing a session can take seconds, and nobody needs it

    # Each of them stands for a computer of its own: other work of this one must not delay it.
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    for item in items:
        ours, theirs = forking.Pipe()
        forking.Process(target=child, args=(item, theirs)).start()
        theirs.close()
        pipes.append(ours)
    return pipes
