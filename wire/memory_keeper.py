"""Sockets that close at once when their process is killed: its memory is freed later, by another.

The kernel frees the memory of a process that ends, page by page, before it closes its files: its sockets close, and
its liveliness token goes, only when all is freed. Memory that a second process shares is not freed then. So each
service has a keeper: a process that shares its memory and nothing else (clone(2) with CLONE_VM), and sleeps. A thread
of the service puts off the end of that sleep, again and again. Once nobody does, the keeper ends and frees the memory,
some seconds after all that had to be noticed was.

The keeper runs no Python and allocates nothing. All that it ever does is one call of C's `getc_unlocked` on a
timer; signals that can be blocked do not reach it, nor does what is sent to its service's process group.
"""

import ctypes
import gc
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

NAME = "memory-keeper"
"""The keeper's in /proc/PID/comm; its command line and environment are those of the process that it keeps."""

KEEP_S = 3
"""How long the keeper sleeps on when nobody puts that off any more."""
RENEW_S = 1.0

_CLONE_VM = 0x100
_CLONE_FS = 0x200
_CLOSE_RANGE_UNSHARE = 2
_ALL_FILES = 0xFFFFFFFF
_PR_SET_NAME = 15
_WALL = 0x40000000
_IOFBF = 0
"""A stream with a buffer that is given: C allocates none then."""
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


class _Timer(ctypes.Structure):
    """C's `struct itimerspec`, with a time to the end and no period."""

    _fields_ = (
        ("period_s", ctypes.c_long),
        ("period_ns", ctypes.c_long),
        ("s", ctypes.c_long),
        ("ns", ctypes.c_long),
    )


class _Sleep(NamedTuple):
    """What the keeper sleeps on."""

    descriptor: int
    stream: ctypes.c_void_p
    buffer: "ctypes.Array[ctypes.c_char]"


class MemoryKeeper:
    """The keeper of this process.

    Where there is none (not Linux, or it is forbidden) all works as well, but the death of this process is noticed
    some milliseconds later, by the size of its memory.
    """

    def __init__(self) -> None:
        self._pid: int | None = None
        self._over = False
        if sys.platform != "linux":
            return
        libc = ctypes.CDLL(None)
        try:
            sleep = _sleep(libc)
        except AttributeError:  # a C library that has not got all of these
            return
        if sleep is None:
            return
        made = threading.Event()
        is_collecting = gc.isenabled()
        gc.disable()
        threading.Thread(target=self._keep, args=(libc, sleep, made), name=NAME, daemon=True).start()
        made.wait()
        if is_collecting:
            gc.enable()
        if self._pid is None:
            os.close(sleep.descriptor)
        else:
            threading.Thread(target=self._put_off, args=(libc, sleep), name=NAME, daemon=True).start()

    @property
    def pid(self) -> int | None:
        return self._pid

    def end(self) -> None:
        """For a process that ends by itself and has said so: nothing has to be noticed any more."""
        self._over = True
        if self._pid is not None:
            with suppress(ProcessLookupError):
                expedite(self._pid)
                os.kill(self._pid, signal.SIGKILL)

    def _keep(self, libc: ctypes.CDLL, sleep: _Sleep, made: threading.Event) -> None:
        """Make the keeper, and another one whenever it has ended, as while this process was stopped.

        The keeper runs on the stack here, and on this thread's thread-local storage: nothing may end this thread while
        there is one. And this thread has files of its own: the cyclic collector must not run here, or it would close
        what it frees in the wrong table. So all that it does while there is a keeper is to wait for its end, in C.
        """
        stack = ctypes.create_string_buffer(_STACK_BYTES)
        ended = ctypes.create_string_buffer(_SIGINFO_BYTES)
        try:
            if _prepare(libc, sleep.descriptor):
                self._pid = _clone(libc, stack, sleep)
        finally:
            made.set()
        while self._pid is not None:
            libc.waitid(os.P_PID, self._pid, ended, os.WEXITED | os.WNOWAIT | _WALL)
            time.sleep(RENEW_S)  # whatever ends them one after another
            is_collecting = gc.isenabled()
            gc.disable()
            # Once it is reaped, its pid may be anybody's: until then nobody else has it.
            pid, self._pid = self._pid, None
            libc.waitpid(pid, None, _WALL)
            self._pid = None if self._over else _clone(libc, stack, sleep)
            if is_collecting:
                gc.enable()

    def _put_off(self, libc: ctypes.CDLL, sleep: _Sleep) -> None:
        """Put the keeper's end off for as long as this process runs."""
        while not self._over:
            _set(libc, sleep)
            time.sleep(RENEW_S)


def expedite(pid: int) -> None:
    """Let a keeper run like any other process, so that it ends at once also where the processor is busy."""
    with suppress(OSError):
        os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))


def is_keeper(pid: int) -> bool:
    """Whether this is another process's keeper, which has that one's command line and environment."""
    try:
        return Path(f"/proc/{pid}/comm").read_text().rstrip() == NAME
    except OSError:
        return False


def _sleep(libc: ctypes.CDLL) -> _Sleep | None:
    """What a keeper is to sleep on; None: this system has no such timer.

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
    """From now on it sleeps for `KEEP_S`."""
    timer = _Timer(s=KEEP_S)
    libc.timerfd_settime(sleep.descriptor, 0, ctypes.byref(timer), None)


def _prepare(libc: ctypes.CDLL, descriptor: int) -> bool:
    """Make this thread what the keeper is to be a copy of: deaf to signals, and without a directory or another file.

    It must hold no socket open, and be in no file system's way. False: Linux is older than 5.9, or forbids it.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    libc.prctl(_PR_SET_NAME, NAME.encode())
    # Not unshare(2), which a container may forbid.
    if libc.close_range(descriptor + 1, ctypes.c_uint(_ALL_FILES), _CLOSE_RANGE_UNSHARE) != 0:
        return False
    if descriptor > 0 and libc.close_range(0, descriptor - 1, 0) != 0:
        return False
    if libc.unshare(_CLONE_FS) == 0:
        os.chdir("/")
    return True


def _clone(libc: ctypes.CDLL, stack: "ctypes.Array[ctypes.c_char]", sleep: _Sleep) -> int | None:
    _set(libc, sleep)
    libc.__fpurge(sleep.stream)  # noqa: SLF001 - so it is called in C; an earlier keeper read more than it took
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
        # Whoever stops the service's whole group, and kills the service then, does not leave a stopped keeper behind.
        os.setpgid(pid, pid)
    with suppress(OSError):
        # Freeing yields to whoever has something to do.
        os.sched_setscheduler(pid, os.SCHED_IDLE, os.sched_param(0))
    return pid
