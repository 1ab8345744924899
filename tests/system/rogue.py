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
