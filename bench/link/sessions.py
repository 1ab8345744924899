"""Zenoh sessions of both sides, with the settings of the product and mutual TLS for QUIC."""

import json
import os
from typing import Literal

import zenoh

from bench.link.conditions import Link
from wire import tls, topics
from wire.bus_config import BusConfig
from wire.zenoh.connect import RECONNECT_MS, TX_QUEUE

Security = dict[str, str | bool]
"""Zenoh's settings for mutual TLS (`wire.tls.settings`)."""
RUNTIME = "(rx: (worker_threads: 1))"
"""Zenoh's threads of a process: a second receiving thread costs wake-ups, and no flow has more than 200 packets a second."""
PORT = 7447
"""Of the first flow of a condition; the others have the next ones."""
COMMAND_KEY = f"{BusConfig().namespace}/{topics.source_cmd_vel(topics.TELEOP).key}"
TOKEN_KEY = f"{BusConfig().namespace}/{topics.alive(topics.TELEOP)}"


def endpoint(link: Link, address: str, port: int) -> str:
    return tls.zenoh_endpoint(f"{link}/{address}:{port}")


def open_at(at: str, role: Literal["hub", "client"], lease_s: float, security: Security) -> zenoh.Session:
    """Open a session that listens or connects at an endpoint.

    Raises:
        zenoh.ZError: it cannot.
    """
    os.environ.setdefault("ZENOH_RUNTIME", RUNTIME)  # read once, when the first session is opened
    values: dict[str, object] = {
        "mode": "peer" if role == "hub" else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(lease_s * 1000),
        "transport/link/tx/queue/size/real_time": TX_QUEUE,
        "transport/link/tls": security,
    }
    if role == "hub":
        values["listen/endpoints"] = [at]
    else:
        values["connect/endpoints"] = [at]
        values["connect/timeout_ms"] = 20_000
        values["connect/retry"] = {
            "period_init_ms": RECONNECT_MS,
            "period_max_ms": RECONNECT_MS,
            "period_increase_factor": 1,
        }
    settings = zenoh.Config()
    for key, value in values.items():
        settings.insert_json5(key, json.dumps(value))
    return zenoh.open(settings)
