"""Close a killed process's sockets immediately by letting a helper process hold its memory.

When a process ends, the kernel frees its memory page by page before it closes its files. Its sockets close, and its
liveliness token disappears, only after all memory is freed. Memory that a second process shares is not freed at that
time. The supervisor and teleop, whose death must stop the robot, therefore have a keeper: a sleeping process that shares only its memory (clone(2) with CLONE_VM). A
thread of the service extends this sleep periodically. After the service has ended, the keeper wakes up, ends and frees
the memory, some seconds after the peers have noticed the end of the service.

The keeper runs no Python code and allocates no memory. It only calls C's `getc_unlocked` once on a timer. It blocks all
signals that can be blocked, and signals to its service's process group do not reach it.
"""

import ctypes
import gc
import os
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

NAME = "memory-keeper"
"""The keeper's name in /proc/PID/comm; its command line and environment are those of its service."""

KEEP_S = 3
"""How long the keeper continues to sleep after the last extension."""
RENEW_S = 1.0

_CLONE_VM = 0x100
_CLONE_FS = 0x200
_CLOSE_RANGE_UNSHARE = 2
_ALL_FILES = 0xFFFFFFFF
_PR_SET_NAME = 15
_WALL = 0x40000000
_IOFBF = 0
"""Fully buffered stream; with a given buffer, C allocates none."""
_BUFFER_BYTES = 64
_SIGINFO_BYTES = 128
_STACK_BYTES = 1 << 16
_STACK_ALIGNMENT = 16


_NEEDED = (
    *(
        "prctl",
        "close_range",
        "unshare",
        "timerfd_create",
        "timerfd_settime",
        "fdopen",
        "setvbuf",
        "__fpurge",
    ),
    *("getc_unlocked", "clone", "waitid", "waitpid"),
)


_Buffer = ctypes.Array[ctypes.c_char]


class _Timer(ctypes.Structure):
    """C's `struct itimerspec`, for a single expiration."""

    _fields_ = (
        ("period_s", ctypes.c_long),
        ("period_ns", ctypes.c_long),
        ("s", ctypes.c_long),
        ("ns", ctypes.c_long),
    )


class _Sleep(NamedTuple):
    """The timer that the keeper waits for, as file descriptor and C stream with its buffer."""

    descriptor: int
    stream: ctypes.c_void_p
    buffer: _Buffer


class MemoryKeeper:
    """The keeper of this process.

    Without a keeper (not Linux, or not permitted) everything works, but peers notice the death of this process some
    milliseconds later, depending on the size of its memory.
    """

    def __init__(self) -> None:
        self.pid: int | None = None
        self._over = False
        libc = ctypes.CDLL(None)
        try:
            sleep = _sleep(libc)
        except AttributeError:  # another system, or the C library lacks a function
            return
        if sleep is None:
            return
        # Allocate here, not on the thread: if there is no memory, the thread would end without setting `made`, and this one would wait forever.
        buffers = [ctypes.create_string_buffer(size) for size in (_STACK_BYTES, _SIGINFO_BYTES)]
        made = threading.Event()
        is_collecting = gc.isenabled()
        gc.disable()
        threading.Thread(
            target=self._keep, args=(libc, sleep, *buffers, made), name=NAME, daemon=True
        ).start()
        made.wait()
        if is_collecting:
            gc.enable()
        if self.pid is None:
            os.close(sleep.descriptor)
        else:
            threading.Thread(target=self._put_off, args=(libc, sleep), name=NAME, daemon=True).start()

    def end(self) -> None:
        """End the keeper; for a process that ends regularly and has announced its end to its peers."""
        self._over = True
        if self.pid is not None:
            with suppress(ProcessLookupError):
                expedite(self.pid)
                os.kill(self.pid, signal.SIGKILL)

    def _keep(
        self, libc: ctypes.CDLL, sleep: _Sleep, stack: _Buffer, ended: _Buffer, made: threading.Event
    ) -> None:
        """Start the keeper, and start another whenever it has ended, for example while this process was stopped.

        The keeper uses a stack of this thread and its thread-local storage, so this thread must not end while a keeper
        runs. This thread has its own file table. The cyclic garbage collector must not run here, because it would close
        files in the wrong table. While a keeper runs, this thread therefore only waits for its end, in C.
        """
        try:
            if _prepare(libc, sleep.descriptor):
                self.pid = _clone(libc, stack, sleep)
        finally:
            made.set()
        while self.pid is not None:
            libc.waitid(os.P_PID, self.pid, ended, os.WEXITED | os.WNOWAIT | _WALL)
            time.sleep(RENEW_S)  # limits the rate if keepers end one after another
            is_collecting = gc.isenabled()
            gc.disable()
            # Its pid may be reused once it is reaped, but not before.
            pid, self.pid = self.pid, None
            libc.waitpid(pid, None, _WALL)
            self.pid = None if self._over else _clone(libc, stack, sleep)
            if is_collecting:
                gc.enable()

    def _put_off(self, libc: ctypes.CDLL, sleep: _Sleep) -> None:
        """Extend the keeper's sleep periodically while this process runs."""
        while not self._over:
            _set(libc, sleep)
            time.sleep(RENEW_S)


def expedite(pid: int) -> None:
    """Give a keeper normal scheduling priority, so that it ends immediately even on a busy processor."""
    with suppress(OSError):
        os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))


def is_keeper(pid: int) -> bool:
    """Return whether a process is a keeper; its command line and environment are those of its service."""
    try:
        return Path(f"/proc/{pid}/comm").read_text().rstrip() == NAME
    except OSError:
        return False


def _sleep(libc: ctypes.CDLL) -> _Sleep | None:
    """Create the timer that a keeper waits for; None if this system has no such timer.

    Raises:
        AttributeError: the C library lacks something that a keeper needs.
    """
    for name in _NEEDED:
        getattr(libc, name)
    libc.fdopen.restype = ctypes.c_void_p
    descriptor = libc.timerfd_create(time.CLOCK_MONOTONIC, os.O_CLOEXEC)
    if descriptor < 0:
        return None
    stream = ctypes.c_void_p(libc.fdopen(descriptor, b"r"))
    buffer = ctypes.create_string_buffer(_BUFFER_BYTES)
    if not stream or libc.setvbuf(stream, buffer, _IOFBF, ctypes.c_size_t(_BUFFER_BYTES)) != 0:
        os.close(descriptor)
        return None
    return _Sleep(descriptor, stream, buffer)


def _set(libc: ctypes.CDLL, sleep: _Sleep) -> None:
    """Set the keeper's timer to `KEEP_S` from now."""
    timer = _Timer(s=KEEP_S)
    libc.timerfd_settime(sleep.descriptor, 0, ctypes.byref(timer), None)


def _prepare(libc: ctypes.CDLL, descriptor: int) -> bool:
    """Prepare this thread for being copied as the keeper: block all signals and close all files but the timer.

    The keeper must not hold a socket open or keep a file system busy.

    Returns:
        False if Linux is older than 5.9 or refuses.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    libc.prctl(_PR_SET_NAME, NAME.encode())
    # unshare(2) would do the same, but a container may forbid it.
    if libc.close_range(descriptor + 1, ctypes.c_uint(_ALL_FILES), _CLOSE_RANGE_UNSHARE) != 0:
        return False
    if descriptor > 0 and libc.close_range(0, descriptor - 1, 0) != 0:
        return False
    if libc.unshare(_CLONE_FS) == 0:
        os.chdir("/")
    return True


def _clone(libc: ctypes.CDLL, stack: _Buffer, sleep: _Sleep) -> int | None:
    _set(libc, sleep)
    libc.__fpurge(sleep.stream)  # noqa: SLF001 - its name in C; an earlier keeper may have left data in the buffer
    top = ctypes.addressof(stack) + len(stack)
    pid: int = libc.clone(
        ctypes.cast(libc.getc_unlocked, ctypes.c_void_p),
        ctypes.c_void_p(top - top % _STACK_ALIGNMENT),
        _CLONE_VM,
        sleep.stream,
    )
    if pid <= 0:
        return None
    with suppress(OSError):
        # If the service's process group is stopped and the service then killed, no stopped keeper remains.
        os.setpgid(pid, pid)
    with suppress(OSError):
        # Freeing the memory yields to all other processes.
        os.sched_setscheduler(pid, os.SCHED_IDLE, os.sched_param(0))
    return pid
