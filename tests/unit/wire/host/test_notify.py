"""The reports to systemd: when they are sent, and that no receiver can delay or end the loop that sends them."""

import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from wire.host.notify import RETRY_S, Notifier, take_notifier

READY = b"READY=1\nWATCHDOG=1"
RUNNING = b"WATCHDOG=1"
STOPPING = b"STOPPING=1"


class Systemd:
    """A socket that receives the reports."""

    def __init__(self, name: str) -> None:
        self.environment = {"NOTIFY_SOCKET": name}
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(name.replace("@", "\0"))

    def heard(self) -> list[bytes]:
        messages: list[bytes] = []
        while True:
            try:
                messages.append(self._socket.recv(4096))
            except BlockingIOError:
                return messages

    def close(self) -> None:
        self._socket.close()


Notifiers = Callable[..., Notifier]


@pytest.fixture
def notifiers() -> Iterator[Notifiers]:
    """Make notifiers from their variables, and end them."""
    made: list[Notifier] = []

    def make(environment: dict[str, str], **more: str) -> Notifier:
        made.append(take_notifier(environment | more))
        return made[-1]

    yield make
    for notifier in made:
        notifier.stopping()


@pytest.fixture(params=["path", "abstract"])
def systemd(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Systemd]:
    name = str(tmp_path / "notify") if request.param == "path" else f"@lifeline-test-{os.getpid()}"
    receiver = Systemd(name)
    yield receiver
    receiver.close()


def test_the_first_decision_reports_ready_and_each_later_one_at_most_a_quarter_of_the_limit(
    systemd: Systemd, notifiers: Notifiers
) -> None:
    notifier = notifiers(systemd.environment, WATCHDOG_USEC="1000000")
    assert systemd.heard() == []
    notifier.running(100.0)
    assert systemd.heard() == [READY]
    notifier.running(100.249)
    assert systemd.heard() == []
    notifier.running(100.25)
    assert systemd.heard() == [RUNNING]
    notifier.running(100.499)
    assert systemd.heard() == []
    notifier.running(107.0)
    assert systemd.heard() == [RUNNING]


def test_after_the_end_is_reported_nothing_more_is(systemd: Systemd, notifiers: Notifiers) -> None:
    notifier = notifiers(systemd.environment, WATCHDOG_USEC="1000000")
    notifier.running(0.0)
    notifier.stopping()
    notifier.running(10.0)
    assert systemd.heard() == [READY, STOPPING]


@pytest.mark.parametrize("watchdog", [{}, {"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "1"}])
def test_without_a_watchdog_for_this_process_only_start_and_end_are_reported(
    systemd: Systemd, notifiers: Notifiers, watchdog: dict[str, str]
) -> None:
    notifier = notifiers(systemd.environment, **watchdog)
    notifier.running(0.0)
    notifier.running(1e9)
    notifier.stopping()
    assert systemd.heard() == [READY, STOPPING]


def test_a_watchdog_for_this_very_process_is_served(systemd: Systemd, notifiers: Notifiers) -> None:
    watchdog = {"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getpid())}
    notifier = notifiers(systemd.environment, **watchdog)
    notifier.running(0.0)
    notifier.running(0.25)
    assert systemd.heard() == [READY, RUNNING]


def test_without_systemd_nothing_is_sent() -> None:
    notifier = take_notifier({})
    notifier.running(0.0)
    notifier.stopping()


def test_a_child_process_inherits_none_of_the_variables(systemd: Systemd) -> None:
    environment = systemd.environment | {"WATCHDOG_USEC": "1", "WATCHDOG_PID": "1", "HOME": "/root"}
    take_notifier(environment).stopping()
    assert environment == {"HOME": "/root"}


@pytest.mark.parametrize("address", ["vsock:2:1234", "notify", "/", "@"])
def test_an_address_of_another_kind_is_one_warning_and_nothing_is_sent(
    address: str, caplog: pytest.LogCaptureFixture
) -> None:
    notifier = take_notifier({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "1000000"})
    notifier.running(0.0)
    assert [record.message for record in caplog.records] == [
        f"NOTIFY_SOCKET={address} is neither a path nor an abstract name: nothing is reported"
    ]


@pytest.mark.parametrize("limit", ["", "0", "-1", "1.5", "soon"])
def test_a_limit_that_is_no_number_is_one_warning_and_readiness_is_still_reported(
    systemd: Systemd, notifiers: Notifiers, limit: str, caplog: pytest.LogCaptureFixture
) -> None:
    notifier = notifiers(systemd.environment, WATCHDOG_USEC=limit)
    notifier.running(0.0)
    notifier.running(1e9)
    assert systemd.heard() == [READY]
    assert [record.message for record in caplog.records] == [
        f"WATCHDOG_USEC={limit} is no number of microseconds: the watchdog is not served"
    ]


def test_a_receiver_that_does_not_read_neither_delays_the_loop_nor_ends_it(
    systemd: Systemd, notifiers: Notifiers
) -> None:
    notifier = notifiers(systemd.environment, WATCHDOG_USEC="4000000")
    for second in range(10_000):  # far more than the queue of a socket holds
        notifier.running(float(second))
    waiting = len(systemd.heard())
    assert 0 < waiting < 10_000
    notifier.running(10_000.0)
    assert systemd.heard() == [RUNNING]


def test_a_receiver_that_is_missing_at_first_hears_that_the_service_is_ready(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    notifier = Notifier(path, period_s=60.0)
    notifier.running(0.0)
    late = Systemd(path)
    notifier.running(RETRY_S / 2)
    assert late.heard() == []
    notifier.running(RETRY_S)
    assert late.heard() == [READY]
    notifier.stopping()
    late.close()


def test_a_receiver_that_was_replaced_hears_the_next_report(tmp_path: Path) -> None:
    path = tmp_path / "notify"
    first = Systemd(str(path))
    notifier = Notifier(str(path), period_s=1.0)
    notifier.running(0.0)
    first.close()
    notifier.running(1.0)
    path.unlink()
    second = Systemd(str(path))
    notifier.running(2.0)
    assert second.heard() == [RUNNING]
    notifier.stopping()
    second.close()


def test_an_address_that_is_too_long_for_a_socket_ends_nothing() -> None:
    notifier = Notifier("/" + "x" * 200, period_s=1.0)
    notifier.running(0.0)
    notifier.stopping()
