"""A client that ignores the protocol: a bare Zenoh session."""

import json

import zenoh


def open_rogue(endpoint: str) -> zenoh.Session:
    settings = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
    }.items():
        settings.insert_json5(key, json.dumps(value))
    return zenoh.open(settings)


def answer(session: zenoh.Session, key: str, payload: bytes) -> zenoh.Queryable[None]:
    """Answer all queries that match a key with a payload."""

    def reply(query: zenoh.Query) -> None:
        query.reply(key, payload)

    return session.declare_queryable(key, reply)
