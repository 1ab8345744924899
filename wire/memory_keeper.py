"""Sockets that close at once when their process is killed: what it held in memory is freed by another.

The kernel frees the memory of a process that ends, page by page, before it closes its files: its sockets close, and
its liveliness token goes, only when all is freed. Memory that a second process shares is not freed then. So each
process has a keeper: a process that shares its memory and nothing else (clone(2) with CLONE_VM), and waits in one
read for the end of the first. Then it ends too, and the memory is freed when nobody waits for that.

The keeper runs no Python and allocates nothing. All that it ever does is one call of C's `getc_unlocked` on a
pipe whose other end only the first process has; signals that can be blocked do not reach it.
"""

import ctypes
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

NAME = "memory-keeper"
"""The keeper's in /proc/PID/comm; its command line and environment are those of the process that it keeps."""

_CLONE_VM = 0x100
_CLONE_FILES = 0x400
_PR_SET_NAME = 15
_IOFBF = 0
"""A stream with a buffer that is given: C allocates none then."""
_BUFFER_BYTES = 64
_STACK_BYTES = 1 << 16
_STACK_ALIGNMENT = 16


def keep_memory() -> int | None:
    """Give this process a keeper, which ends with it.

    Returns:
        The keeper's pid; None where there is none (not Linux, or it is forbidden): all works without, but the
        death of this process is noticed some milliseconds later, by the size of its memory.
    """
    if sys.platform != "linux":
        return None
    reading, writing = os.pipe()
    made: SimpleQueue[int | None] = SimpleQueue()
    threading.Thread(target=_keep, args=(reading, made), name=NAME, daemon=True).start()
    pid = made.get()
    os.close(reading)
    if pid is None:
        os.close(writing)
    else:
        with suppress(OSError):
            # Freeing yields to whoever has something to do.
            os.sched_setscheduler(pid, os.SCHED_IDLE, os.sched_param(0))
    return pid


def _keep(reading: int, made: "SimpleQueue[int | None]") -> None:
    """Make the keeper, and stay: it runs on this thread's stack variables and thread-local storage."""
    stack, buffer = ctypes.create_string_buffer(_STACK_BYTES), ctypes.create_string_buffer(_BUFFER_BYTES)
    pid = _clone(reading, stack, buffer)
    made.put(pid)
    if pid is not None:
        threading.Event().wait()


def _clone(
    reading: int, stack: "ctypes.Array[ctypes.c_char]", buffer: "ctypes.Array[ctypes.c_char]"
) -> int | None:
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_NAME, NAME.encode())
    if libc.unshare(_CLONE_FILES) != 0:
        return None
    # This thread has a table of files of its own now, and the keeper gets a copy: it must hold no socket open,
    # nor the end of the pipe that tells it of the end.
    for entry in list(Path("/proc/thread-self/fd").iterdir()):
        if int(entry.name) != reading:
            with suppress(OSError):  # the listing's own is closed already
                os.close(int(entry.name))
    libc.fdopen.restype = ctypes.c_void_p
    stream = ctypes.c_void_p(libc.fdopen(reading, b"r"))
    if not stream or libc.setvbuf(stream, buffer, _IOFBF, ctypes.c_size_t(_BUFFER_BYTES)) != 0:
        return None
    top = ctypes.addressof(stack) + _STACK_BYTES
    pid: int = libc.clone(
        ctypes.cast(libc.getc_unlocked, ctypes.c_void_p),
        ctypes.c_void_p(top - top % _STACK_ALIGNMENT),
        _CLONE_VM,
        stream,
    )
    return pid if pid > 0 else None
