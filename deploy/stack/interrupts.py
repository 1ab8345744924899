"""SIGINT, SIGTERM and SIGHUP as one exception, once; after it, nothing disturbs the taking down.

    with interrupts():
        try:
            try:
                work()
            finally:
                ignore()
        finally:
            take_down()

A signal at any moment reaches `take_down`, also one that arrives just before `ignore`: the handler itself
ignores all further ones before it raises.
"""

import signal
from collections.abc import Generator
from contextlib import contextmanager

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(KeyboardInterrupt):
    """A signal asked this command to end. A KeyboardInterrupt: asyncio lets nothing else through its callbacks."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.exit_code = 128 + number


def ignore() -> None:
    """From now on the command is coming to its end, and asking again does not hurry it."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def interrupts() -> Generator[None]:
    """Raise `Interrupted` in the main thread on the first signal; one that was ignored before stays so (nohup)."""

    def on_signal(number: int, _frame: object) -> None:
        ignore()
        raise Interrupted(number)

    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, on_signal)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
