"""Runs a program in the foreground of this terminal, so that neither of the two outlives the other.

The program is forked at once, while this process has no threads, but waits until `start`. The kernel kills it when this
process dies, however that happens. Its own end is seen through a pidfd, without a delay. A signal that another process sends to this
process is passed on; the terminal itself sends Ctrl-C to both.
"""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import NoReturn

PASSED_ON = frozenset(
    {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2}
)
IGNORED_BY_PYTHON = (signal.SIGPIPE, signal.SIGXFSZ)
"""A program that is started must not inherit this."""
_PR_SET_PDEATHSIG = 1
_CANNOT_RUN = 127


class BoundChild:
    """A program that waits for `start`.

    Create it in the main thread, before any other thread.

    Args:
        command: the program and its arguments.
    """

    def __init__(self, command: list[str]) -> None:
        before = {int(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, PASSED_ON)}
        libc = ctypes.CDLL(None)
        word_read, self._word = os.pipe()
        self._failure, failure_write = os.pipe()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._word)
            libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
            _run(command, before, parent, word_read, failure_write)
        os.close(word_read)
        os.close(failure_write)
        self.descriptor = os.pidfd_open(self.pid)
        """A pidfd: readable once the program has ended."""

    def start(self) -> OSError | None:
        """Let the program start; return why it cannot run."""
        os.write(self._word, b"1")
        number = os.read(self._failure, 16)  # empty: the program runs, and has closed it
        return OSError(int(number), os.strerror(int(number))) if number else None

    def send(self, number: int) -> None:
        signal.pidfd_send_signal(self.descriptor, number)

    def exit_code(self) -> int:
        """Reap the program, once it has ended; return its exit code, or 128 + N if signal N ended it."""
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return code if code >= 0 else 128 - code

    def abandon(self) -> None:
        """End the program, which has not started."""
        os.close(self._word)
        os.waitpid(self.pid, 0)


def _run(command: list[str], mask: set[int], parent: int, word: int, failure: int) -> NoReturn:
    """Wait for the word, then become the program; or end."""
    try:
        if os.read(word, 1) and os.getppid() == parent:
            for number in IGNORED_BY_PYTHON:
                signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            os.execvp(command[0], command)  # noqa: S606 - the user's own command
    except OSError as error:
        os.write(failure, str(error.errno).encode())
    finally:
        os._exit(_CANNOT_RUN)


def take_signals(on_signal: Callable[[int, bool], None]) -> None:
    """Call `on_signal` on a thread of its own with each signal of `PASSED_ON`, and whether the kernel itself sent it.

    These signals must be blocked in all threads, which `BoundChild` does.
    """

    def take() -> None:
        while True:
            taken = signal.sigwaitinfo(PASSED_ON)
            on_signal(taken.si_signo, taken.si_code > 0)

    threading.Thread(target=take, daemon=True, name="signals").start()


def end(code: int) -> NoReturn:
    """End this process at once; an open Zenoh session could delay a regular exit."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
