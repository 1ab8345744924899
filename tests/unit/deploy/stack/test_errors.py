"""A signal ends a command once, and never interrupts its clean-up."""

import os
import signal
from collections.abc import Iterator

import pytest

from deploy.stack import errors


@pytest.fixture(autouse=True)
def nothing_is_ignored() -> Iterator[None]:
    """The parent of these tests may ignore signals, like nohup, or a shell for background jobs."""
    before = {number: signal.signal(number, signal.default_int_handler) for number in errors.SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", errors.SIGNALS)
def test_the_first_signal_is_raised_and_the_next_ones_are_not(number: signal.Signals) -> None:
    with errors.interrupts():
        with pytest.raises(errors.Interrupted) as raised:
            os.kill(os.getpid(), number)
        assert raised.value.exit_code == 128 + number
        for further in errors.SIGNALS:
            os.kill(os.getpid(), further)


def test_nothing_disturbs_the_end_of_a_command() -> None:
    with errors.interrupts():
        errors.ignore()
        os.kill(os.getpid(), signal.SIGTERM)


def test_the_handlers_are_given_back() -> None:
    before = [signal.getsignal(number) for number in errors.SIGNALS]
    with errors.interrupts():
        errors.ignore()
    assert [signal.getsignal(number) for number in errors.SIGNALS] == before


def test_a_hangup_that_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with errors.interrupts():
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", errors.SIGNALS)
def test_a_signal_that_is_held_back_is_raised_after_the_context(number: signal.Signals) -> None:
    finished: list[bool] = []

    def work() -> None:
        with errors.held_back():
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), signal.SIGTERM)
            finished.append(True)

    with errors.interrupts():
        with pytest.raises(errors.Interrupted) as raised:
            work()
        assert raised.value.exit_code == 128 + number
    assert finished


def test_without_a_signal_nothing_is_raised_and_a_later_one_is_handled() -> None:
    with errors.interrupts():
        with errors.held_back():
            pass
        with pytest.raises(errors.Interrupted):
            os.kill(os.getpid(), signal.SIGINT)
