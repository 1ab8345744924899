"""How a command ends early: errors that the operator can correct, reported in one sentence without a traceback, and signals.

`interrupts` raises one exception on the first SIGINT, SIGTERM or SIGHUP; further signals do not interrupt the cleanup.

    with interrupts():
        try:
            try:
                work()
            finally:
                ignore()
        finally:
            take_down()

`take_down` runs whenever the signal arrives, even just before `ignore`: the handler itself ignores all further
signals before it raises.
"""

import signal
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

EXIT_REFUSED = 2
EXIT_NOT_RUNNING = 3


class DeployError(Exception):
    """The command cannot be executed; the message gives the cause and the remedy."""

    exit_code = EXIT_REFUSED


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(KeyboardInterrupt):
    """A signal asked this command to end. A KeyboardInterrupt, because asyncio passes it on from callbacks."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.exit_code = 128 + number


def default_until_handled() -> None:
    """Let SIGINT end the process immediately and silently, until a command handles it; ignored, it stays ignored (nohup).

    Python's own handler raises KeyboardInterrupt wherever the program is, which prints a traceback from an import.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def ignore() -> None:
    """Ignore all further signals: the command is ending."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def interrupts() -> Generator[None]:
    """Raise `Interrupted` in the main thread on the first signal; signals already ignored stay ignored (nohup)."""

    def on_signal(number: int, _frame: object) -> None:
        ignore()
        raise Interrupted(number)

    with _handled_by(on_signal):
        yield


@contextmanager
def held_back() -> Generator[None]:
    """Postpone the handling of signals to the end of the context, and handle the first of them.

    While compiled modules are imported, `Interrupted` would become an ImportError. The signals are not blocked, because
    another thread of this process would then receive them.
    """
    received: list[int] = []
    try:
        with _handled_by(lambda number, _frame: received.append(number)):
            yield
    finally:
        if received:
            signal.raise_signal(received[0])


@contextmanager
def _handled_by(handler: Callable[[int, FrameType | None], None]) -> Generator[None]:
    """Handle all signals that are not ignored by `handler`, and restore the previous handlers on exit."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number, previous in before.items():
        if previous is not signal.SIG_IGN:
            signal.signal(number, handler)
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)
