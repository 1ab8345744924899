"""Which runs end with a session, the hub's report of its sessions, and which samples count after a reconnection."""

import json
import math

import pytest

from wire.runs import SESSION_BYTES, Reconnection, Runs, sessions_in
from wire.stamp import GID_BYTES, Stamper

SESSION, OTHER = bytes(range(16)), bytes(range(1, 17))
EPOCH = SESSION[:SESSION_BYTES] + b"new run!"


def test_a_run_belongs_to_the_session_with_whose_id_its_epoch_begins() -> None:
    runs = Runs()
    runs.token("teleop", EPOCH, exists=True)
    runs.token("joy", OTHER, exists=True)
    assert runs.of(SESSION) == [("teleop", EPOCH)]


def test_a_run_without_a_token_is_forgotten() -> None:
    runs = Runs()
    second = SESSION[:SESSION_BYTES] + b"later!!!"
    for epoch in (EPOCH, second):
        runs.token("teleop", epoch, exists=True)
    runs.token("teleop", EPOCH, exists=False)
    assert runs.of(SESSION) == [("teleop", second)]
    runs.token("teleop", second, exists=False)
    assert runs.of(SESSION) == []


def test_the_end_of_an_unknown_token_changes_nothing() -> None:
    runs = Runs()
    runs.token("teleop", EPOCH, exists=False)
    assert runs.of(SESSION) == []


def test_a_stamper_completes_the_beginning_of_an_epoch() -> None:
    gids = {Stamper(SESSION[:SESSION_BYTES]).gid for _ in range(2)}
    assert len(gids) == 2
    assert {(gid[:SESSION_BYTES], len(gid)) for gid in gids} == {(SESSION[:SESSION_BYTES], GID_BYTES)}


def report(*sessions: object) -> bytes:
    return json.dumps({"sessions": list(sessions)}).encode()


def test_the_hubs_report_names_its_sessions_without_leading_zeros() -> None:
    named = report({"peer": "102", "whatami": "client"}, {"peer": OTHER.hex(), "whatami": "client"})
    assert sessions_in(named) == {bytes(14) + b"\x01\x02", OTHER}


@pytest.mark.parametrize(
    "payload",
    [
        report({"peer": "102", "whatami": "router"}),
        report({"peer": "no id", "whatami": "client"}),
        report({"peer": "102"}),
        report("client"),
        b"[]",
        b"{}",
        b"\xff",
        b"[" * 100_000,
    ],
)
def test_a_report_that_names_a_router_or_is_unreadable_proves_nothing(payload: bytes) -> None:
    assert sessions_in(payload) is None


def test_samples_count_before_and_after_the_first_connection() -> None:
    connection = Reconnection(0.4)
    assert connection.is_settled(5.0)
    connection.opened("a", 5.0)
    assert connection.is_settled(5.0)


def test_samples_after_a_reconnection_to_the_same_hub_count_once_it_has_settled() -> None:
    connection = Reconnection(0.5)
    connection.opened("a", 1.0)
    connection.opened("a", 5.0)
    assert not connection.is_settled(5.0)
    assert not connection.is_settled(math.nextafter(5.5, 0.0))
    assert connection.is_settled(5.5)


def test_each_further_reconnection_begins_anew() -> None:
    connection = Reconnection(0.5)
    for at_s in (1.0, 5.0, 5.25):
        connection.opened("a", at_s)
    assert not connection.is_settled(5.5)
    assert connection.is_settled(5.75)


def test_samples_of_a_restarted_hub_count_at_once() -> None:
    connection = Reconnection(0.5)
    connection.opened("a", 1.0)
    connection.opened("b", 5.0)
    assert connection.is_settled(5.0)
