"""Which hub is believed: the kernel's answers are given, and the session is a stand-in with links."""

import asyncio
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, cast

import pytest

from wire.bus_config import BusConfig
from wire.zenoh import hub_proof
from wire.zenoh.hub_proof import ATTEMPTS, HubProof

STRANGER = 4_000_000
TCP = "tcp/127.0.0.1:7447"


@dataclass(frozen=True)
class Link:
    dst: str = TCP
    src: str = "tcp/127.0.0.1:50000"


@dataclass
class Session:
    """The links of a session."""

    open: list[Link] = field(default_factory=lambda: [Link()])
    closed: bool = False

    @property
    def info(self) -> "Session":
        return self

    def links(self) -> list[Link]:
        return self.open

    def is_closed(self) -> bool:
        return self.closed


class Kernel:
    """Answers who has the other end."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.user: int | None = os.getuid()
        self.here = True
        self.asked = 0
        self.before: Callable[[], object] = lambda: None
        """Called before each answer."""
        monkeypatch.setattr(hub_proof, "ASK_AGAIN_S", 0.0)
        monkeypatch.setattr(hub_proof, "tcp_user", self._tcp_user)
        monkeypatch.setattr(hub_proof, "unix_users", self._unix_users)
        monkeypatch.setattr(hub_proof, "is_here", self._is_here)

    def _unix_users(self, _: str) -> list[int]:
        return [] if self.user is None else [self.user, self.user]

    def _is_here(self, _: str) -> bool:
        return self.here

    def _tcp_user(self, local: str, remote: str) -> int | None:
        assert (local, remote) == ("127.0.0.1:50000", "127.0.0.1:7447")
        self.asked += 1
        user = self.user
        self.before()
        return user


started: list[Session] = []


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[Kernel]:
    yield Kernel(monkeypatch)
    while started:  # their threads end
        started.pop().closed = True


def proof_of(config: BusConfig | None = None) -> tuple[HubProof, list[str]]:
    said: list[str] = []
    return HubProof(config or BusConfig(), said.append), said


def check(proof: HubProof, session: Session | None = None) -> bool:
    return proof.check(cast("Any", session or Session()))


def start(proof: HubProof, session: Session | None = None) -> Session:
    session = session or Session()
    started.append(session)
    proof.start(cast("Any", session))
    return session


@pytest.mark.parametrize("link", [Link(), Link("unixsock-stream//run/7447.sock", "unixsock-stream/x")])
async def test_the_own_user_root_and_the_user_of_the_configuration_are_believed(
    kernel: Kernel, link: Link
) -> None:
    for name, user in ((None, os.getuid()), (None, 0), (str(STRANGER), STRANGER), ("root", 0)):
        kernel.user = user
        proof, said = proof_of(BusConfig(hub_user=name))
        assert check(proof, Session([link]))
        await asyncio.sleep(0)
        assert said == []


@pytest.mark.parametrize("link", [Link(), Link("unixsock-stream//run/7447.sock", "unixsock-stream/x")])
async def test_the_hub_of_another_user_is_refused_in_one_sentence(kernel: Kernel, link: Link) -> None:
    kernel.user = STRANGER
    proof, said = proof_of()
    for _ in range(3):
        assert not check(proof, Session([link]))
    await asyncio.sleep(0)
    assert len(said) == 1
    assert all(words in said[0] for words in (TCP, str(STRANGER), "hub_user"))
    kernel.user = os.getuid()
    assert check(proof, Session([link]))
    kernel.user = STRANGER
    assert not check(proof, Session([link]))
    await asyncio.sleep(0)
    assert len(said) == 2


async def test_one_link_to_another_user_is_enough_to_refuse_the_hub(kernel: Kernel) -> None:
    kernel.user = STRANGER
    kernel.before = lambda: setattr(kernel, "user", 0)
    proof, _ = proof_of()
    assert not check(proof, Session([Link(), Link()]))


@pytest.mark.parametrize("link", [Link(), Link("unixsock-stream//run/7447.sock", "unixsock-stream/x")])
async def test_a_hub_whose_user_the_kernel_does_not_show_is_refused(kernel: Kernel, link: Link) -> None:
    kernel.user = None
    proof, said = proof_of()
    assert not check(proof, Session([link]))
    await asyncio.sleep(0)
    assert ["does not show" in one and "certificates" in one for one in said] == [True]


async def test_the_kernel_is_asked_again_about_a_connection_that_is_not_accepted_yet(kernel: Kernel) -> None:
    kernel.user = None
    kernel.before = lambda: kernel.asked == ATTEMPTS - 1 and setattr(kernel, "user", 0)
    proof, _ = proof_of()
    assert check(proof)
    assert kernel.asked == ATTEMPTS


async def test_a_session_that_does_not_show_its_new_link_yet_is_asked_again(kernel: Kernel) -> None:
    class Late(Session):
        def links(self) -> list[Link]:
            kernel.asked += 1
            return self.open if kernel.asked == ATTEMPTS else []

    proof, _ = proof_of()
    assert check(proof, Late())


async def test_a_connection_that_has_ended_is_not_proven_and_not_refused(kernel: Kernel) -> None:
    proof, said = proof_of()
    assert not check(proof, Session([]))
    await asyncio.sleep(0)
    assert (said, kernel.asked) == ([], 0)


async def test_tcp_to_another_machine_proves_nobody_and_stays_as_it_was(kernel: Kernel) -> None:
    kernel.user, kernel.here = None, False
    proof, _ = proof_of()
    assert check(proof)


async def test_with_certificates_the_kernel_is_not_asked(kernel: Kernel) -> None:
    kernel.user = STRANGER
    proof, _ = proof_of(BusConfig("quic/127.0.0.1:7447"))
    assert check(proof)
    assert proof.holds
    start(proof)
    proof.changed()
    assert proof.holds
    assert kernel.asked == 0


async def test_a_user_whom_this_machine_does_not_have_proves_nobody_and_stops_no_program(
    kernel: Kernel,
) -> None:
    proof, _ = proof_of(BusConfig(hub_user="nobody-here"))
    assert check(proof)
    kernel.user = STRANGER
    assert not check(proof)


async def test_after_a_reconnection_nothing_counts_until_the_new_hub_is_proven(kernel: Kernel) -> None:
    proof, said = proof_of()
    assert not proof.holds
    session = start(proof)
    assert proof.holds_within(1.0)
    session.open = []
    proof.changed()
    assert not proof.holds_within(0.01)
    kernel.user, session.open = STRANGER, [Link()]
    proof.changed()
    await until(lambda: said != [])
    assert not proof.holds
    kernel.user = os.getuid()
    proof.changed()
    assert proof.holds_within(1.0)


async def test_an_answer_about_an_older_connection_does_not_prove_the_present_one(kernel: Kernel) -> None:
    late, asked = threading.Event(), threading.Event()
    kernel.before = lambda: (asked.set(), late.wait(1.0))
    proof, said = proof_of()
    start(proof)
    assert asked.wait(1.0)
    kernel.user, kernel.before = STRANGER, lambda: None
    proof.changed()
    late.set()
    await until(lambda: said != [])
    assert not proof.holds_within(0.05)


async def test_a_proof_that_failed_is_repeated_although_no_transport_opens(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub_proof, "ASK_LATER_S", 0.01)
    proof, _ = proof_of()
    session = start(proof, Session([]))
    assert not proof.holds_within(0.05)
    session.open = [Link()]
    assert proof.holds_within(1.0)


async def test_the_end_of_an_old_connection_that_is_reported_late_does_not_make_the_program_deaf(
    kernel: Kernel,
) -> None:
    proof, _ = proof_of()
    start(proof)
    assert proof.holds_within(1.0)
    proof.changed()
    assert proof.holds_within(1.0)


async def test_an_error_while_the_kernel_is_asked_proves_nothing_and_the_next_answer_counts(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        kernel.before = lambda: None
        raise OSError("Too many open files")

    monkeypatch.setattr(hub_proof, "ASK_LATER_S", 0.01)
    kernel.before = fail
    proof, _ = proof_of()
    start(proof)
    assert proof.holds_within(1.0)
    assert kernel.asked > 1


async def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 2.0
    while not condition():
        assert time.monotonic() < deadline_s
        await asyncio.sleep(0.005)
