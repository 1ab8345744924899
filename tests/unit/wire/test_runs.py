"""Which runs end with a session: `wire.runs`, and the hub's report of its sessions."""

import json

import pytest

from wire.runs import SESSION_BYTES, Runs
from wire.stamp import GID_BYTES, Stamper
from wire.zenoh.hub_report import sessions_in

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
