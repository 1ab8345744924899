"""Zenoh sessions of both sides, with the settings of the product and mutual TLS for QUIC."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import zenoh

from bench.link.conditions import Link
from wire import topics
from wire.session import RECONNECT_MS, TX_QUEUE, BusConfig

PORT = 7447
"""Of the first flow of a condition; the others have the next ones."""
COMMAND_KEY = f"{BusConfig().namespace}/{topics.source_cmd_vel(topics.TELEOP).key}"
TOKEN_KEY = f"{BusConfig().namespace}/{topics.alive(topics.TELEOP)}"


@dataclass(frozen=True)
class Keys:
    """A certificate with its key, and the certificate of the authority."""

    folder: Path

    def settings(self) -> dict[str, object]:
        authority, certificate, key = (
            str(self.folder / name) for name in ("authority.pem", "certificate.pem", "key.pem")
        )
        return {
            "root_ca_certificate": authority,
            "enable_mtls": True,
            "listen_private_key": key,
            "listen_certificate": certificate,
            "connect_private_key": key,
            "connect_certificate": certificate,
        }


def endpoint(link: Link, address: str, port: int) -> str:
    options = "?mixed_rel=1" if link is Link.QUIC else ""
    return f"{link}/{address}:{port}{options}"


def open_at(at: str, role: Literal["hub", "client"], lease_s: float, keys: Keys) -> zenoh.Session:
    """Open a session that listens or connects at an endpoint.

    Raises:
        zenoh.ZError: it cannot.
    """
    values: dict[str, object] = {
        "mode": "peer" if role == "hub" else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(lease_s * 1000),
        "transport/link/tx/queue/size/real_time": TX_QUEUE,
        "transport/link/tls": keys.settings(),
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
