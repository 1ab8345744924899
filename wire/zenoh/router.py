"""Zenoh's configuration of a router between the hubs of robots and their operators, stations and viewers (pure).

Robots behind NAT dial out: each hub connects to a router, and so does everybody else. A router decides nothing. It passes
messages on, and its allow-list knows each participant by the common name of its certificate:

* a hub (`supervisor@robot7`) sends and receives within its own namespace;
* a station or operator writes what the table of topics has for its role, for its robot (`operator@robot7`) or for all
  robots of the router (`operator@any`). A wildcard passes nowhere;
* a viewer reads.

The robot's hub checks everything again: it takes from its router only what operators and stations may write.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wire import tls
from wire.access import UNPROVEN_LINK, AllowList, Contract, Grant, Message, written_by
from wire.bundle import Bundle
from wire.roles import ANY, Role, common_name
from wire.zenoh import limits

STATIONS = (Role.OPERATOR, Role.ESTOP, Role.VIEWER)
"""Who connects to a router beside the hubs; bases and sensors are on the robot."""
ALL_ROBOTS = "*/**"
UNSIGNED = b"without certificates"
RECONNECT_MS = (50, 1000)
"""Shortest and longest period of a hub's attempts to connect to a router, and of a router's to another."""
_READ: tuple[Message, ...] = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_SERVED: tuple[Message, ...] = ("put", "query", "reply", "declare_queryable", "liveliness_token")
_ALL = (*_READ, *_SERVED)


@dataclass(frozen=True, slots=True)
class RouterConfig:
    """What a router needs to know."""

    listen: tuple[str, ...]
    robots: tuple[str, ...]
    """Namespaces of the robots."""
    keys: Path | None = None
    """Its bundle, of the role router; unused with tcp."""
    connect: tuple[str, ...] = ()
    """Other routers to which it connects."""
    sources: tuple[str, ...] = Contract().sources
    """Names of the command sources of all robots."""
    stations: tuple[str, ...] = ()
    """Names of the e-stop stations of all robots."""

    @property
    def lease_s(self) -> float:
        """How long a silent link counts as alive."""
        return tls.lease_s((*self.listen, *self.connect))


def region_name(authority: bytes | None) -> str:
    """Return the name by which a hub recognizes its own routers; it is derived from the certificate of the authority.

    Args:
        authority: the certificate of the authority in PEM; None: without certificates, on one machine.
    """
    return f"lifeline-{hashlib.sha256(UNSIGNED if authority is None else authority).hexdigest()[:16]}"


def dial(endpoints: Sequence[str]) -> dict[str, object]:
    """Return the settings by which a hub or a router connects to routers, in the background, until it ends."""
    shortest_ms, longest_ms = RECONNECT_MS
    return {
        "connect/endpoints": [tls.zenoh_endpoint(one) for one in endpoints],
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {
            "period_init_ms": shortest_ms,
            "period_max_ms": longest_ms,
            "period_increase_factor": 2,
        },
        # A robot starts without its router, and without waiting for it.
        "open/return_conditions": {"connect_scouted": False, "declares": False},
    }


def settings(
    config: RouterConfig, bundle: Bundle | None, region: str, open_files: int = limits.WANTED_FILES
) -> dict[str, object]:
    """Return the configuration, by Zenoh's paths; `nested` makes a file for `zenohd` of it.

    Args:
        config: the router.
        bundle: its bundle; None: without certificates, on one machine.
        region: the name by which hubs know it (`region_name`).
        open_files: the maximum number of open files of its process.
    """
    has_local = any(not tls.is_secure(one) for one in (*config.listen, *config.connect))
    values: dict[str, object] = {
        "mode": "router",
        "listen/endpoints": [tls.zenoh_endpoint(one) for one in config.listen],
        "region_name": region,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": round(config.lease_s * 1000),
        "access_control": access_control(config, has_local=has_local),
        "adminspace": {"enabled": False},
        # A router of somebody else is in a region of its own, without the rights of one that is known.
        "gateway": {
            "south": [
                {"filters": [{"modes": ["peer", "client"]}]},
                {"filters": [{"region_names": [region], "negated": True}]},
            ]
        },
        **limits.hub_settings("*", open_files),
        **dial(config.connect),
    }
    if bundle is not None:
        values["transport/link/tls"] = tls.settings(bundle)
    return values


def nested(values: dict[str, object]) -> dict[str, Any]:
    """Return the same settings as one document, as `zenohd --config` reads it."""
    document: dict[str, Any] = {}
    for path, value in values.items():
        place = document
        *folders, last = path.split("/")
        for folder in folders:
            place = place.setdefault(folder, {})
        place[last] = value
    return document


def access_control(config: RouterConfig, *, has_local: bool) -> dict[str, object]:
    """Return the router's allow-list.

    Args:
        config: the robots, their command sources and their e-stop stations.
        has_local: whether programs of this machine connect without a certificate; they then count as hub, operator and
            station of every robot.
    """
    robots, contract = config.robots, Contract(config.sources, lidars=(), stations=config.stations)
    allowed = AllowList()
    for robot in robots:
        allowed.add(_named(Role.SUPERVISOR, robot), hub_grants([robot]))
        for role in STATIONS:
            allowed.add(_named(role, robot), station_grants(role, [robot], f"{robot}/**", contract))
    for role in STATIONS:
        allowed.add(_named(role, ANY), station_grants(role, robots, ALL_ROBOTS, contract))
    everything = Grant(_ALL, "ingress", (ALL_ROBOTS,)), Grant(_ALL, "egress", (ALL_ROBOTS,))
    allowed.add(_named(Role.ROUTER, ANY), everything)
    if has_local:
        local = [grant for role in STATIONS for grant in station_grants(role, robots, ALL_ROBOTS, contract)]
        local += hub_grants(robots)
        allowed.add({"id": "local", "link_protocols": [UNPROVEN_LINK]}, dict.fromkeys(local))
    return allowed.settings()


def hub_grants(robots: Sequence[str]) -> Iterator[Grant]:
    """Yield what is allowed to the hub of a robot, or to hubs without certificates: everything in its namespace."""
    own = tuple(f"{robot}/**" for robot in robots)
    yield Grant(_ALL, "ingress", own)
    yield Grant(_SERVED, "egress", own)
    # Subscriptions of all robots, such as that of `lifeline fleet` to each status.
    yield Grant(_READ, "egress", ("**",))


def station_grants(role: Role, robots: Sequence[str], readable: str, contract: Contract) -> Iterator[Grant]:
    """Yield what is allowed to one role: to read what `readable` names, and what the table of topics has for it."""
    yield Grant(_READ, "ingress", (readable,))
    yield Grant(_ALL, "egress", (readable,))
    for robot in robots:
        yield from written_by(role, robot, contract)


def _named(role: Role, namespace: str) -> dict[str, object]:
    name = common_name(role, namespace)
    return {"id": name, "cert_common_names": [name]}
