"""Who may do what on the wire: role × key × message, through a real hub, with plain Zenoh sessions on both sides.

The tables are written by hand, and not generated as the access control is.
"""

import asyncio
from collections.abc import AsyncGenerator, Iterable
from contextlib import asynccontextmanager

import pytest
import zenoh

from tests.system.ports import free_endpoint
from tests.system.rogue import open_rogue
from wire.access import LOCAL_ROLES, Contract
from wire.roles import Role
from wire.session import BusConfig, open_session

ROLES = [Role.BASE, Role.SENSOR, Role.OPERATOR, Role.ESTOP, Role.VIEWER]
CONTRACT = Contract(sources=("teleop", "joy"), lidars=("scan", "rear/scan"), more_keys=("camera/**",))

MAY_PUT = {
    Role.BASE: {
        "scan",
        "rear/scan",
        "odom",
        "imu",
        "diagnostics",
        "clock",
        "sim/truth",
        "estop",
        "camera/image",
    },
    Role.SENSOR: {"scan", "rear/scan", "imu", "diagnostics", "camera/image"},
    Role.OPERATOR: {"teleop/cmd_vel", "joy/cmd_vel", "estop", "sim/obstacle"},
    Role.ESTOP: {"estop"},
    Role.VIEWER: set[str](),
}
MAY_SERVE = {
    Role.BASE: {"sim/reset", "sim/faults", "sim/time"},
    Role.OPERATOR: {"teleop/holder", "joy/holder"},
}
MAY_CALL = {
    Role.OPERATOR: {"supervisor/reset", "sim/reset", "sim/faults", "sim/time", "teleop/holder", "joy/holder"}
}
MAY_BE_ALIVE = {
    Role.BASE: {"alive/sim", "alive/ros2", "alive/sim/00ff"},
    Role.OPERATOR: {
        "alive/teleop",
        "alive/joy",
        "alive/teleop/00ff",
        "alive/teleop.1a2b",
        "alive/teleop-exec",
    },
}
NEVER = {
    "cmd_vel",
    "supervisor/status",
    "ghost/cmd_vel",
    "lidar/scan",
    "secret",
    "a/b/cmd_vel",
    "alive/teleop",
}
WILD = {
    "**",
    "*",
    "*/cmd_vel",
    "cmd_$*",
    "$*vel",
    "*/**",
    "sim/*",
    "supervisor/*",
    "teleop/*",
    "*/scan",
    "**/scan",
}
NAMES = {
    "alive/supervisor",
    "alive/supervisor/00ff",
    "alive/ghost",
    "alive/ghost.1",
    "alive/*",
    "alive/**",
    "alive",
}


def keys_of(table: dict[Role, set[str]], *more: Iterable[str]) -> list[str]:
    return sorted(set[str]().union(*table.values(), *more))


@asynccontextmanager
async def hub_and(role: Role) -> AsyncGenerator[tuple[zenoh.Session, zenoh.Session]]:
    endpoint = free_endpoint()
    hub = await open_session(BusConfig(endpoint, contract=CONTRACT, local=(role,)), "hub")
    client = await asyncio.to_thread(open_rogue, endpoint)
    try:
        yield hub, client
    finally:
        client.close()  # pyright: ignore[reportUnknownMemberType]
        hub.close()  # pyright: ignore[reportUnknownMemberType]


def barrier(client: zenoh.Session) -> None:
    """Wait until the hub has processed everything that the client sent before: messages of a link stay in order."""
    assert list(client.get("@/**", timeout=10.0)), "the hub answers its admin space"


def collector() -> tuple[set[str], "zenoh.handlers.Callback[zenoh.Sample]"]:
    """Return a set, and a callback that adds the key of each sample to it."""
    heard: set[str] = set()

    def add(sample: zenoh.Sample) -> None:
        heard.add(str(sample.key_expr))

    return heard, zenoh.handlers.Callback(add, indirect=False)


def heard_by(session: zenoh.Session, expression: str) -> tuple[set[str], object]:
    heard, callback = collector()
    return heard, session.declare_subscriber(expression, callback)


def tokens_seen_by(session: zenoh.Session, expression: str) -> tuple[set[str], object]:
    seen, callback = collector()
    return seen, session.liveliness().declare_subscriber(expression, callback, history=True)


@pytest.mark.parametrize("role", ROLES)
async def test_a_put_passes_only_on_the_keys_of_its_role_and_a_wildcard_nowhere(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        heard, _subscriber = heard_by(hub, "**")
        keys = keys_of(MAY_PUT, NEVER, WILD)
        for key in keys:
            client.put(f"robot/{key}", b"put")
        for key in ("**", "*/scan", "other/scan", "robot2/cmd_vel", "scan"):
            client.put(key, b"put")
        barrier(client)
        assert heard == {f"robot/{key}" for key in MAY_PUT[role]}
        for key in keys:
            client.delete(f"robot/{key}")
        heard.clear()
        barrier(client)
        assert heard == set()


async def test_a_local_program_may_put_what_any_role_may_and_an_unknown_source_is_heard() -> None:
    endpoint = free_endpoint()
    hub = await open_session(BusConfig(endpoint, contract=CONTRACT, local=LOCAL_ROLES), "hub")
    clients = [await asyncio.to_thread(open_rogue, endpoint) for _ in range(2)]
    try:
        heard, _subscriber = heard_by(hub, "robot/**")
        bridges = [heard_by(clients[1], f"robot/{key}") for key in ("cmd_vel", "supervisor/status", "*")]
        barrier(clients[1])
        for key in keys_of(MAY_PUT, NEVER, WILD):
            clients[0].put(f"robot/{key}", b"put")
        barrier(clients[0])
        barrier(clients[1])
        sources = {"robot/*/cmd_vel", "robot/ghost/cmd_vel"}
        assert heard == {f"robot/{key}" for keys in MAY_PUT.values() for key in keys} | sources
        assert [keys - {f"robot/{key}" for key in MAY_PUT[Role.BASE]} for keys, _ in bridges] == [set()] * 3
    finally:
        for client in clients:
            client.close()  # pyright: ignore[reportUnknownMemberType]
        hub.close()  # pyright: ignore[reportUnknownMemberType]


@pytest.mark.parametrize("role", ROLES)
async def test_queries_are_answered_only_by_the_roles_that_serve_their_keys(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        everything = keys_of(MAY_SERVE, ["supervisor/reset", "cmd_vel"])
        queryables = [
            client.declare_queryable(f"robot/{key}", _answer, complete=True)
            for key in [*everything, "**", "*", "supervisor/*", "*/reset"]
        ]
        barrier(client)
        answered = {
            key
            for key in everything
            if any(r.ok for r in hub.get(f"robot/{key}", timeout=0.5, target=zenoh.QueryTarget.ALL))
        }
        assert answered == MAY_SERVE.get(role, set())
        assert len(queryables) == len(everything) + 4


@pytest.mark.parametrize("role", ROLES)
async def test_only_an_operator_may_call_services(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        everything = keys_of(MAY_CALL, ["secret"])
        served = [hub.declare_queryable(f"robot/{key}", _answer) for key in everything]
        answered = {key for key in everything if any(r.ok for r in client.get(f"robot/{key}", timeout=0.5))}
        assert answered == MAY_CALL.get(role, set())
        assert not any(r.ok for r in client.get("robot/**", timeout=0.5, target=zenoh.QueryTarget.ALL))
        assert len(served) == len(everything)


@pytest.mark.parametrize("role", ROLES)
async def test_a_token_is_seen_only_if_its_role_may_hold_it(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        seen, _watch = tokens_seen_by(hub, "robot/**")
        everything = keys_of(MAY_BE_ALIVE, NAMES)
        tokens = [client.liveliness().declare_token(f"robot/{key}") for key in everything]
        barrier(client)
        assert seen == {f"robot/{key}" for key in MAY_BE_ALIVE.get(role, set())}
        assert len(tokens) == len(everything)


@pytest.mark.parametrize("role", ROLES)
async def test_every_role_may_read_the_robots_keys_and_tokens_and_nothing_else(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        inside, _inside = heard_by(client, "robot/**")
        bridged, _bridge = heard_by(client, "robot/cmd_vel")
        outside, _outside = heard_by(client, "other/**")
        alive, _watch = tokens_seen_by(client, "robot/alive/*")
        barrier(client)
        _token = hub.liveliness().declare_token("robot/alive/supervisor")
        for key in ("robot/cmd_vel", "robot/supervisor/status", "other/cmd_vel"):
            hub.put(key, b"put")
        barrier(client)
        assert inside == {"robot/cmd_vel", "robot/supervisor/status"}
        assert (bridged, outside, alive) == ({"robot/cmd_vel"}, set(), {"robot/alive/supervisor"})


def _answer(query: zenoh.Query) -> None:
    with query:
        query.reply(query.key_expr if "*" not in str(query.key_expr) else "robot/cmd_vel", b"answer")
