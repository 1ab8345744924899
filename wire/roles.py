"""The roles of a robot's participants, and the common names of their certificates (pure).

The access control of Zenoh knows a participant by the common name of its certificate, and compares it exactly. The common
name therefore has the role and the namespace, and nothing else: `operator@robot7`, or `operator@any` for all robots.
"""

from enum import StrEnum

ANY = "any"
"""Stands for the namespaces of all robots of the same authority; no robot may have it as its namespace."""


class Role(StrEnum):
    """What a participant is for."""

    SUPERVISOR = "supervisor"
    """Decides, writes `cmd_vel`, and is the hub."""
    BASE = "base"
    """Moves the wheels, and publishes odometry; also the sensors of a robot that has no participants of their own."""
    SENSOR = "sensor"
    OPERATOR = "operator"
    """Drives, stops and resets."""
    ESTOP = "estop"
    """Stops only."""
    VIEWER = "viewer"
    """Reads only."""
    ROUTER = "router"
    """Passes messages between the hubs of robots and their operators, stations and viewers, and is a server as the hubs are."""


SERVERS = (Role.SUPERVISOR, Role.ROUTER)
"""Whose certificates other participants accept as a server's; all others only connect to these."""
LISTENERS = (*SERVERS, Role.ESTOP)
"""Whose certificates may name hosts: a station also serves a page to browsers."""


def common_name(role: Role, namespace: str) -> str:
    """Return the common name of a role's certificate for one robot's namespace, or for `ANY`."""
    return f"{role}@{namespace}"


def role_of(name: str) -> tuple[Role, str] | None:
    """Return the role and the namespace of a common name; None if it is not one of `common_name`."""
    role, _, namespace = name.partition("@")
    return (Role(role), namespace) if role in {*Role} and namespace else None
