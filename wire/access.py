"""What the hub accepts from each participant and sends to it: an allow-list, generated from the table of topics (pure).

Everything that is not listed is refused. A list of what is refused would not do: a put on `robot/**` matches every
subscriber, but no rule for `robot/cmd_vel`. Zenoh allows a message if an allowed key expression includes the message's key
expression, so a wildcard passes only where the list has the same wildcard or a wider one.

Participants with a certificate have the role in its common name (`wire.roles`). The programs of the hub's own user use its
socket (local_socket.py), and have all roles. Everyone else has the roles that the configuration gives: by default that of a viewer.

The hub checks what comes in (ingress) and what goes out to each participant (egress). Everything may go out within the
robot's namespace: every participant may read. `delete` is never allowed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from wire import topics
from wire.roles import ANY, Role, common_name

LOCAL_ROLES = (Role.BASE, Role.SENSOR, Role.OPERATOR, Role.ESTOP, Role.VIEWER)
"""The roles of a program of the hub's user."""
BEHIND_A_ROUTER = (Role.OPERATOR, Role.ESTOP)
"""Whose messages a router passes to the hub of a robot, beside those of viewers, who only read."""
LOCAL_LINK = "unixsock-stream"
UNPROVEN_LINK = "tcp"
ADMIN_SPACE = "@/**"
"""Zenoh's own report of sessions and declarations, for the inspection tools; it is read-only.

The hub replies for each declaration while it holds the read lock of its routing tables. A declaration that arrives
meanwhile blocks its routing permanently (pull request 2619 of eclipse-zenoh/zenoh), and the robot stops.
"""
HUB_ENTRY = "@/*/peer"
"""The hub's entry in the admin space: its sessions and their links. It is read without that lock."""
NODE_TOKENS = "@ros2_lv/*/*/*/*/NN/*/*/*"
"""The key expression of the tokens of ROS 2 nodes with rmw_zenoh (docs/design.md of github.com/ros2/rmw_zenoh):

    @ros2_lv/<domain>/<session>/<node id>/<node id>/NN/<enclave>/<namespace>/<name>

where `%` replaces each slash.
"""
ROS2_TOKENS = f"{NODE_TOKENS.partition('/')[0]}/**"

Message = Literal[
    "put",
    "delete",
    "query",
    "reply",
    "declare_subscriber",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
]
Flow = Literal["ingress", "egress"]


@dataclass(frozen=True, slots=True)
class Contract:
    """The robot's own keys, beside those that every robot has."""

    sources: tuple[str, ...] = ("teleop", "joy", "path")
    lidars: tuple[str, ...] = (topics.SCAN.key,)
    """The scan topics of its lidars."""
    more_keys: tuple[str, ...] = ()
    """Keys of its other topics, which sensors, bases and local programs may write."""
    stations: tuple[str, ...] = ()
    """The names of its e-stop stations."""


@dataclass(frozen=True, slots=True)
class Grant:
    """Messages on key expressions, in one direction, that the hub allows."""

    messages: tuple[Message, ...]
    flow: Flow
    keys: tuple[str, ...]
    """Full key expressions, including the namespace."""


INSPECTION = (Grant(("query",), "ingress", (ADMIN_SPACE,)), Grant(("reply",), "egress", (ADMIN_SPACE,)))
"""To read all of the admin space: for programs at the hub's socket, and for certificates other than a viewer's or a router's.

A viewer must not be able to stop the robot.
"""


def access_control(
    namespace: str, contract: Contract, unproven: Iterable[Role] = (Role.VIEWER,)
) -> dict[str, object]:
    """Return Zenoh's configuration of the access control.

    Args:
        namespace: of the robot.
        contract: its own keys.
        unproven: the roles of programs that have no certificate and do not use the hub's socket.
    """
    allowed = AllowList()
    for role in Role:
        if role is not Role.SUPERVISOR:
            names = [common_name(role, namespace), common_name(role, ANY)]
            of_certificate = list(grants_of(role, namespace, contract))
            if role not in {Role.VIEWER, Role.ROUTER}:
                of_certificate.extend(INSPECTION)
            allowed.add({"id": role.value, "cert_common_names": names}, of_certificate)
    for name, link, roles in (
        ("local", LOCAL_LINK, LOCAL_ROLES),
        ("unproven", UNPROVEN_LINK, tuple(unproven)),
    ):
        every = [grant for role in roles for grant in grants_of(role, namespace, contract)]
        if {*roles} >= {*LOCAL_ROLES}:
            every.append(_unknown_sources(namespace))
        if link == LOCAL_LINK:
            every.extend(INSPECTION)
        allowed.add({"id": name, "link_protocols": [link]}, dict.fromkeys(every))
    return allowed.settings()


class AllowList:
    """Collects what is allowed to each subject, as Zenoh's configuration."""

    def __init__(self) -> None:
        self._rules: list[dict[str, object]] = []
        self._subjects: list[dict[str, object]] = []
        self._policies: list[dict[str, object]] = []

    def add(self, subject: dict[str, object], grants: Iterable[Grant]) -> None:
        """Allow a subject, with its `id` and what Zenoh knows it by, what the grants list."""
        name = str(subject["id"])
        own: list[str] = []
        for number, grant in enumerate(grants):
            own.append(f"{name} {number}")
            self._rules.append(
                {
                    "id": own[-1],
                    "messages": list(grant.messages),
                    "flows": [grant.flow],
                    "permission": "allow",
                    "key_exprs": list(grant.keys),
                }
            )
        self._subjects.append(subject)
        self._policies.append({"rules": own, "subjects": [name]})

    def settings(self) -> dict[str, object]:
        """Return Zenoh's `access_control`, which refuses everything else."""
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": self._subjects,
            "policies": self._policies,
        }


def grants_of(role: Role, namespace: str, contract: Contract) -> Iterator[Grant]:
    """Yield what the hub allows to one role: to read everything, and what the table of topics has for it.

    The link to a router brings what its operators and e-stop stations send, and may not ask the admin space.
    """
    everything = f"{namespace}/**"
    alive = f"{namespace}/{topics.alive('**')}"
    # A subscription may be wider, as that of `lifeline topic list`; what it receives is limited by the next rule.
    yield Grant(("declare_subscriber",), "ingress", ("**",))
    yield Grant(("declare_subscriber", "declare_queryable"), "egress", ("**",))
    if role is Role.ROUTER:
        yield Grant(("put", "query", "reply", "liveliness_token"), "egress", (everything,))
        yield Grant(("liveliness_query", "declare_liveliness_subscriber"), "egress", (alive,))
        yield Grant(("liveliness_query", "declare_liveliness_subscriber"), "ingress", ("**",))
        for behind in BEHIND_A_ROUTER:
            yield from written_by(behind, namespace, contract)
        return
    yield Grant(("put", "query", "reply"), "egress", (everything, HUB_ENTRY))
    yield Grant(
        ("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
        "egress",
        ("**", ROS2_TOKENS),
    )
    yield Grant(("liveliness_query", "declare_liveliness_subscriber"), "ingress", (alive, ROS2_TOKENS))
    yield Grant(("query",), "ingress", (HUB_ENTRY,))
    yield from written_by(role, namespace, contract)


def written_by(role: Role, namespace: str, contract: Contract) -> Iterator[Grant]:
    """Yield what one role may write, serve, call and be alive as."""
    written = [topic.key for topic in topics.TOPICS if role in topic.roles]
    served = [service.key for service in topics.SERVICES if role in service.roles]
    called = [service.key for service in topics.SERVICES if role is Role.OPERATOR]
    more = contract.more_keys if role in topics.SENSORS else ()
    kinds: tuple[tuple[tuple[Message, ...], Iterable[str]], ...] = (
        (("put",), (*_named(written, contract), *more)),
        (("declare_queryable", "reply"), _named(served, contract)),
        (("query",), _named(called, contract)),
        (("liveliness_token",), _alive_as(role, contract)),
    )
    for messages, keys in kinds:
        full = tuple(f"{namespace}/{key}" for key in keys)
        if full:
            yield Grant(messages, "ingress", full)
    if Role.BASE is role:
        yield Grant(("liveliness_token",), "ingress", (ROS2_TOKENS,))


def _unknown_sources(namespace: str) -> Grant:
    """Let the supervisor hear a local program that commands under an unknown name, so that the status can say so."""
    return Grant(("put",), "ingress", (f"{namespace}/{topics.source_cmd_vel('*').key}",))


def _alive_as(role: Role, contract: Contract) -> Iterator[str]:
    """Yield the keys of the tokens that a role may hold: for each node, also those of its runs."""
    if role is Role.BASE:
        yield from (f"{topics.alive(node)}/**" for node in (topics.SIM, topics.ROS2))
    if role is Role.OPERATOR:
        for source in contract.sources:
            # The source, the candidates for its name (teleop/holder.py), and its wrapper in ROS 2.
            nodes = (source, f"{source}.$*", f"{source}{topics.EXEC_SUFFIX}")
            yield from (f"{topics.alive(node)}/**" for node in nodes)
    if role in {Role.OPERATOR, Role.ESTOP}:
        yield from (f"{topics.alive(topics.estop_node(station))}/**" for station in contract.stations)


def _named(keys: Iterable[str], contract: Contract) -> Iterator[str]:
    """Yield the literal keys for keys of the table, which may have a placeholder."""
    for key in keys:
        if key == topics.LIDAR_PLACEHOLDER:
            yield from contract.lidars
        elif topics.SOURCE_PLACEHOLDER in key:
            yield from (key.replace(topics.SOURCE_PLACEHOLDER, source) for source in contract.sources)
        elif topics.STATION_PLACEHOLDER in key:
            yield from (key.replace(topics.STATION_PLACEHOLDER, station) for station in contract.stations)
        else:
            yield key
