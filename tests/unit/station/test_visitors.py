"""A stranger's connection ends by itself, and neither many strangers nor much that they send keeps a page away."""

import math
import socket
from collections.abc import Callable, Generator
from contextlib import ExitStack

import pytest

from station.visitors import MAX_BYTES, MAX_VISITORS, VISIT_S, Visitor, Visitors

Connect = Callable[[], tuple[socket.socket, socket.socket]]


@pytest.fixture
def connect() -> Generator[Connect]:
    """Makes connections, each with both ends."""
    with ExitStack() as opened:

        def make() -> tuple[socket.socket, socket.socket]:
            ends = socket.socketpair()
            for end in ends:
                opened.enter_context(end).settimeout(0)
            return ends

        yield make


def has_ended(peer: socket.socket) -> bool:
    try:
        return peer.recv(1) == b""
    except BlockingIOError:
        return False


def test_a_connection_ends_after_the_time_of_a_visit(connect: Connect) -> None:
    (here, there), visitors = connect(), Visitors()
    visitors.enter(here, "10.0.0.1", 1.0)
    visitors.expire(math.nextafter(1.0 + VISIT_S, 0.0))
    assert not has_ended(there)
    visitors.expire(1.0 + VISIT_S)
    assert has_ended(there)
    visitors.expire(1.0 + VISIT_S)


def test_a_paired_page_stays_until_it_leaves(connect: Connect) -> None:
    (here, there), visitors = connect(), Visitors()
    page = visitors.enter(here, "10.0.0.1", 0.0)
    page.stay()
    visitors.expire(1e6)
    assert not has_ended(there)
    page.leave(1e6)
    visitors.expire(1e6 + VISIT_S)
    assert has_ended(there)


def test_a_visitor_too_many_ends_the_oldest_of_the_address_with_the_most(connect: Connect) -> None:
    visitors = Visitors()
    paired, guest = connect(), connect()
    visitors.enter(paired[0], "10.0.0.1", 0.0).stay()
    visitors.enter(guest[0], "10.0.0.2", 0.0)
    crowd = [connect() for _ in range(MAX_VISITORS + 2)]
    for here, _ in crowd:
        visitors.enter(here, "10.0.0.1", 0.0)
    assert not has_ended(paired[1])
    assert not has_ended(guest[1])
    assert [has_ended(there) for _, there in crowd] == [True] * 3 + [False] * (MAX_VISITORS - 1)


def test_a_connection_that_has_ended_counts_no_more(connect: Connect) -> None:
    visitors, guest = Visitors(), connect()
    visitors.enter(guest[0], "10.0.0.1", 0.0)
    for _ in range(2 * MAX_VISITORS):
        here, _ = connect()
        visitors.enter(here, "10.0.0.1", 0.0)
        here.close()
    assert not has_ended(guest[1])


def test_a_stranger_may_send_a_limited_number_of_bytes_and_a_paired_page_any(connect: Connect) -> None:
    stranger = Visitor(connect()[0], "10.0.0.1", VISIT_S)
    assert stranger.may_send(MAX_BYTES)
    assert not stranger.may_send(1)
    page = Visitor(connect()[0], "10.0.0.1", VISIT_S)
    page.stay()
    assert page.may_send(10 * MAX_BYTES)
