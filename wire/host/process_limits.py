"""Limits of this process that the kernel enforces: open files, memory, and the time that a closing socket may block; what to do at a limit."""

import ctypes
import errno
import os
import resource
import socket
import struct
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

DATA_PAGES = 5
"""The place of the writable memory, in pages, in /proc/self/statm."""
LINGER_PERIOD_S = 0.1
NO_THREAD = "can't start new thread"
"""The message of Python's RuntimeError."""
REMEDIES = (
    dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "free some space, or choose another directory")
    | {errno.ENAMETOOLONG: "give a shorter path"}
    | dict.fromkeys((errno.EMFILE, errno.ENFILE), "raise the limit of open files (`ulimit -n`)")
    | dict.fromkeys(
        (errno.EAGAIN, errno.ENOMEM),
        "end other programs, or raise the limits of processes and memory (`ulimit -u`, `ulimit -v`)",
    )
    | dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS), "correct its permissions, or choose another directory"
    )
)
"""What to do if the machine refuses more."""
_NO_LINGER = struct.pack("ii", 0, 0)


def limit_of(error: Exception) -> str | None:
    """Return in one sentence which limit of the machine an error shows and what to do; None if it shows none."""
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and NO_THREAD in str(error)):
        number = errno.EAGAIN
    if number == errno.ENOENT and isinstance(error, OSError) and error.filename is None:
        return "the working directory no longer exists: change to another with `cd`"
    if number not in REMEDIES:
        return None
    name = getattr(error, "filename", None)
    return f"{'' if name is None else f'{name}: '}{os.strerror(number)}: {REMEDIES[number]}"


def raise_open_files(wanted: int) -> int:
    """Raise the soft limit of open files to `wanted`, at most to the hard limit; return how many of them are permitted.

    A shell and systemd start a process with 1,024 as its soft limit, although its hard limit is much higher.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return wanted
    raised = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (raised, hard))
    return raised


def bound_memory(limit_bytes: int) -> None:
    """End this process instead of letting its memory grow beyond a limit, and so take that of other processes.

    An allocation beyond the limit fails, and Zenoh then aborts. The kernel counts writable memory, with the stacks of
    the threads. The limit never rises above one that is already in force.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    bounds = [limit for limit in (limit_bytes, soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(bounds), hard))


@contextmanager
def bounded_growth(memory_bytes: int, file_bytes: int) -> Generator[None]:
    """Let allocations fail that make the memory of this process grow by more, and writes to longer files, until the context ends."""
    used = int(Path("/proc/self/statm").read_text().split()[DATA_PAGES]) * resource.getpagesize()
    before = {kind: resource.getrlimit(kind) for kind in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)}
    for (kind, limits), wanted in zip(before.items(), (used + memory_bytes, file_bytes), strict=True):
        bounds = [limit for limit in (wanted, *limits) if limit != resource.RLIM_INFINITY]
        resource.setrlimit(kind, (min(bounds), limits[1]))
    try:
        yield
    finally:
        for kind, limits in before.items():
            resource.setrlimit(kind, limits)


def never_linger() -> None:
    """Keep the option SO_LINGER off on all sockets of this process, from a thread; call it once or more.

    Zenoh sets it to 10 s on each TCP link: `close` then blocks one of Zenoh's few threads until the peer has acknowledged
    the end of the connection. A peer that delays its acknowledgements stops that thread for 40 ms, and a peer whose
    cable is cut for 10 s; meanwhile other links are not read, and their leases end. Without it, the kernel delivers what
    is left in the background.
    """
    with _lock:
        if not _started and sys.platform == "linux":
            _started.append(True)
            threading.Thread(target=_clear_repeatedly, name="no-linger", daemon=True).start()


_lock = threading.Lock()
_started: list[bool] = []


def _clear_repeatedly() -> None:
    while True:
        with suppress(OSError):  # there is no free file descriptor at the moment
            clear_linger()
        time.sleep(LINGER_PERIOD_S)


def clear_linger() -> None:
    """Switch SO_LINGER off on every socket that is open now; other files are left as they are."""
    # As PyDLL, which keeps the interpreter's lock: a call takes 4 us with its loop, and never waits.
    setsockopt = ctypes.PyDLL(None).setsockopt
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - ten times a second, and a Path for each costs more than the call
        setsockopt(int(name), socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER, len(_NO_LINGER))
