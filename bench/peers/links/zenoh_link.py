"""Bare Zenoh: the relay listens, as the supervisor does; the others are clients. Liveliness tokens show presence."""

import json
from collections.abc import Callable, Mapping

import zenoh

COMMAND, OUTPUT, TOKEN = "peers/command", "peers/output", "peers/alive"
LEASE_S = 0.4
_kept: list[object] = []
"""Zenoh ends what is no longer referenced."""


def open_session(
    address: str, *, listens: bool, lease_s: float = LEASE_S, more: Mapping[str, object] | None = None
) -> zenoh.Session:
    """Open a session with the supervisor's settings of lease and priority; `more` are further settings of Zenoh.

    Raises:
        zenoh.ZError: the session cannot be opened.
    """
    config = zenoh.Config()
    values: dict[str, object] = {
        "mode": "peer" if listens else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(lease_s * 1000),
        "listen/endpoints" if listens else "connect/endpoints": [address],
        **(more or {}),
    }
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    _kept.append(session)
    return session


def connect(address: str, role: str, heard: Callable[[bytes], None]) -> Callable[[bytes], None]:
    session = open_session(address, listens=role == "relay")
    hears, says = (COMMAND, OUTPUT) if role == "relay" else (OUTPUT, COMMAND)
    publisher = session.declare_publisher(
        says, priority=zenoh.Priority.REAL_TIME, congestion_control=zenoh.CongestionControl.DROP, express=True
    )
    _kept.append(session.declare_subscriber(hears, _direct(lambda sample: heard(sample.payload.to_bytes()))))

    def send(payload: bytes) -> None:
        publisher.put(payload)

    return send


def hold(address: str) -> None:
    liveliness = open_session(address, listens=False).liveliness()
    _kept.append(liveliness.declare_token(TOKEN))
    while not list(liveliness.get(TOKEN)):
        pass


def watch(address: str, lost: Callable[[], None]) -> None:
    def changed(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            lost()

    liveliness = open_session(address, listens=False).liveliness()
    _kept.append(liveliness.declare_subscriber(TOKEN, _direct(changed), history=True))


def _direct(callback: Callable[[zenoh.Sample], None]) -> "zenoh.handlers.Callback[zenoh.Sample]":
    """Have Zenoh call this on its own thread, as the supervisor does."""
    return zenoh.handlers.Callback(callback, indirect=False)
