"""Who may do what on the wire: role × key × message, through a real hub, with plain Zenoh sessions on both sides.

The tables are written by hand, and not generated as the access control is.
"""

import asyncio
import fcntl
import os
import shutil
import sys
from collections.abc import AsyncGenerator, Iterable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import zenoh

from tests.system.harness import PATIENCE_S, patiently, robot
from tests.system.namespaces import needs_namespaces
from tests.system.ports import free_endpoint, participants
from tests.system.rogue import open_rogue
from wire import topics
from wire.access import LOCAL_ROLES, Contract
from wire.bus_config import BusConfig
from wire.roles import Role
from wire.zenoh import connect, local_socket
from wire.zenoh.connect import open_session
from wire.zenoh.hub_proof import HubProof

pytestmark = pytest.mark.smoke

LIFELINE = Path(sys.executable).with_name("lifeline")
ROLES = [Role.BASE, Role.SENSOR, Role.OPERATOR, Role.ESTOP, Role.VIEWER]
CONTRACT = Contract(
    sources=("teleop", "joy"), lidars=("scan", "rear/scan"), more_keys=("camera/**",), stations=("door",)
)

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
    Role.OPERATOR: {
        "teleop/cmd_vel",
        "joy/cmd_vel",
        "estop",
        "estop_station/door/presence",
        "sim/obstacle",
    },
    Role.ESTOP: {"estop", "estop_station/door/presence"},
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
        "alive/door-estop",
        "alive/door-estop/00ff",
    },
    Role.ESTOP: {"alive/door-estop", "alive/door-estop/00ff"},
}
NEVER = {
    "cmd_vel",
    "estop_station/door/challenge",
    "estop_station/ghost/presence",
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
    "estop_station/*/presence",
    "estop_station/**",
}
NAMES = {
    "alive/supervisor",
    "alive/supervisor/00ff",
    "alive/ghost",
    "alive/ghost.1",
    "alive/ghost-estop",
    "alive/*",
    "alive/**",
    "alive",
}


def keys_of(table: dict[Role, set[str]], *more: Iterable[str]) -> list[str]:
    return sorted(set[str]().union(*table.values(), *more))


@asynccontextmanager
async def hub_and(role: Role) -> AsyncGenerator[tuple[zenoh.Session, zenoh.Session]]:
    endpoint = free_endpoint()
    hub = await open_session(BusConfig(endpoint, contract=CONTRACT, unproven=(role,)), "hub")
    client = await asyncio.to_thread(open_rogue, endpoint)
    try:
        yield hub, client
    finally:
        client.close()  # pyright: ignore[reportUnknownMemberType]
        hub.close()  # pyright: ignore[reportUnknownMemberType]


def barrier(client: zenoh.Session) -> None:
    """Wait until the hub has processed everything that the client sent before: messages of a link stay in order.

    Only the hub's entry of the admin space is read: Zenoh answers for each declaration while it holds a lock, and a declaration
    that arrives meanwhile stops the hub (pull request 2619 of eclipse-zenoh/zenoh).
    """
    assert list(client.get("@/*/peer", timeout=10.0)), "the hub answers its admin space"


def is_answered(session: zenoh.Session, key: str, *, expected: bool) -> bool:
    """Query a key; wait long for an expected answer, which a busy machine may delay."""
    replies = session.get(
        f"robot/{key}", timeout=PATIENCE_S if expected else 0.5, target=zenoh.QueryTarget.ALL
    )
    return any(reply.ok for reply in replies)


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
        heard.clear()
        for key in keys:
            client.delete(f"robot/{key}")
        barrier(client)
        assert heard == set()


@pytest.mark.parametrize("unproven", [(Role.VIEWER,), LOCAL_ROLES], ids=["at the socket", "participants"])
async def test_a_local_program_may_put_what_any_role_may_and_an_unknown_source_is_heard(
    unproven: tuple[Role, ...],
) -> None:
    endpoint = free_endpoint()
    hub = await open_session(BusConfig(endpoint, contract=CONTRACT, unproven=unproven), "hub")
    there = endpoint if unproven == LOCAL_ROLES else participants(endpoint)
    clients = [await asyncio.to_thread(open_rogue, there) for _ in range(2)]
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
        permitted = MAY_SERVE.get(role, set[str]())
        assert {key for key in everything if is_answered(hub, key, expected=key in permitted)} == permitted
        assert len(queryables) == len(everything) + 4


@pytest.mark.parametrize("role", ROLES)
async def test_only_an_operator_may_call_services(role: Role) -> None:
    async with hub_and(role) as (hub, client):
        everything = keys_of(MAY_CALL, ["secret"])
        served = [hub.declare_queryable(f"robot/{key}", _answer) for key in everything]
        permitted = MAY_CALL.get(role, set[str]())
        assert {key for key in everything if is_answered(client, key, expected=key in permitted)} == permitted
        assert not is_answered(client, "**", expected=False)
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


async def test_only_at_the_socket_does_the_hub_report_declarations() -> None:
    """While it reports them, a declaration can block its routing (pull request 2619 of eclipse-zenoh/zenoh)."""
    for unproven in ((Role.VIEWER,), LOCAL_ROLES):
        endpoint = free_endpoint()
        hub = await open_session(BusConfig(endpoint, contract=CONTRACT, unproven=unproven), "hub")
        plain, local = [
            await asyncio.to_thread(open_rogue, there) for there in (endpoint, participants(endpoint))
        ]
        own = f"@/{hub.info.zid()}/peer"
        declared = f"{own}/subscriber/robot/scan"
        try:
            subscribers = [client.declare_subscriber("robot/scan") for client in (plain, local)]
            barrier(plain)
            barrier(local)

            def reported(client: zenoh.Session, asked: str, prefix: str = own) -> set[str]:
                replies = client.get(asked, timeout=10.0, consolidation=zenoh.ConsolidationMode.NONE)
                keys = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
                return {key for key in keys if key.startswith(prefix)}

            for asked in (
                "@/**",
                "@/*/peer/**",
                f"{own}/**",
                "@/*/peer/*/**",
                "@/*/peer/subscriber/**",
                declared,
            ):
                assert reported(plain, asked) == set(), asked
                assert declared in reported(local, asked), asked
            for client in (plain, local):
                assert reported(client, "@/*/peer") == reported(client, own) == {own}
            assert len(subscribers) == 2
        finally:
            for session in (plain, local, hub):
                session.close()  # pyright: ignore[reportUnknownMemberType]


def _answer(query: zenoh.Query) -> None:
    with query:
        query.reply(query.key_expr if "*" not in str(query.key_expr) else "robot/cmd_vel", b"answer")


STRANGER = """
import os, sys, threading  # all that is imported later may be unreadable for the other user
import zenoh
from tests.system.rogue import open_rogue
os.setgroups([]), os.setgid(65534), os.setuid(65534)
try:
    open_rogue(sys.argv[2])
    sys.exit("another user must not reach the socket")
except zenoh.ZError:
    pass
session = open_rogue(sys.argv[1])
heard = session.declare_subscriber("robot/cmd_vel", allowed_origin=zenoh.Locality.REMOTE)
for key in ("teleop/cmd_vel", "ghost/cmd_vel", "scan", "odom", "estop", "**"):
    session.put(f"robot/{key}", b"put")
token = session.liveliness().declare_token("robot/alive/teleop")
served = session.declare_queryable("robot/sim/reset", lambda query: None)
answers = [reply for reply in session.get("robot/supervisor/reset", timeout=0.5) if reply.ok]
assert not answers, answers
assert list(session.get("@/*/peer", timeout=10.0)), "the hub answers its admin space"
print("ready", flush=True)
print(str(heard.recv().key_expr), flush=True)
session.close()
"""
HUB = """
import asyncio, sys, time
from wire.bus_config import BusConfig
from wire.zenoh.connect import open_session
session = asyncio.run(open_session(BusConfig(sys.argv[1]), "hub"))
print("listens", flush=True)
time.sleep(60)
"""
LIMIT_S = 20.0


@pytest.mark.skipif(os.getuid() != 0, reason="needs root, to become another user")
async def test_another_user_of_this_machine_reads_and_nothing_else() -> None:
    endpoint = free_endpoint()
    hub = await open_session(BusConfig(endpoint, contract=CONTRACT), "hub")
    try:
        heard, _subscriber = heard_by(hub, "**")
        seen, _watch = tokens_seen_by(hub, "robot/**")
        _served = hub.declare_queryable("robot/supervisor/reset", _answer)
        stranger = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", STRANGER, endpoint, participants(endpoint)),
            stdout=asyncio.subprocess.PIPE,
        )
        assert stranger.stdout is not None
        assert await asyncio.wait_for(stranger.stdout.readline(), LIMIT_S) == b"ready\n"
        assert (heard, seen) == (set(), set())
        assert not any(reply.ok for reply in hub.get("robot/sim/reset", timeout=0.5))
        hub.put("robot/cmd_vel", b"put")
        assert await asyncio.wait_for(stranger.stdout.readline(), LIMIT_S) == b"robot/cmd_vel\n"
        assert await asyncio.wait_for(stranger.wait(), LIMIT_S) == 0
    finally:
        hub.close()  # pyright: ignore[reportUnknownMemberType]


async def test_a_program_of_the_hubs_user_takes_part_without_an_option_and_a_plain_client_only_reads() -> (
    None
):
    endpoint, said = free_endpoint(), list[str]()
    config = BusConfig(endpoint, contract=CONTRACT)
    hub = await open_session(config, "hub")
    ours = await open_session(config, "client", proof=HubProof(config, said.append))
    plain = await asyncio.to_thread(open_rogue, endpoint)
    try:
        heard, _subscriber = heard_by(hub, "robot/**")
        seen, _watch = tokens_seen_by(hub, "robot/**")
        tokens = [
            client.liveliness().declare_token(f"robot/alive/{source}")
            for client, source in ((ours, "teleop"), (plain, "joy"))
        ]
        ours.put("robot/teleop/cmd_vel", b"put")
        plain.put("robot/joy/cmd_vel", b"put")
        barrier(ours)
        barrier(plain)
        assert (heard, seen, said) == ({"robot/teleop/cmd_vel"}, {"robot/alive/teleop"}, [])
        assert len(tokens) == 2
    finally:
        for session in (ours, plain, hub):
            session.close()  # pyright: ignore[reportUnknownMemberType]


async def test_a_client_that_does_not_reach_the_socket_is_shown_that_it_only_reads(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    endpoint, said = free_endpoint(), list[str]()
    hub = await open_session(BusConfig(endpoint), "hub")
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(tmp_path))
    proof = HubProof(BusConfig(endpoint), said.append)
    client = await open_session(BusConfig(endpoint), "client", proof=proof)
    try:
        assert [endpoint in one and "without_certificate" in one for one in said] == [True]
    finally:
        for session in (client, hub):
            session.close()  # pyright: ignore[reportUnknownMemberType]


async def test_a_hub_starts_although_another_one_examines_the_lock_of_its_socket() -> None:
    endpoint = free_endpoint()
    path = local_socket.socket_of(endpoint)
    assert path is not None
    lock = os.open(f"{path}{local_socket.LOCK}", os.O_CREAT | os.O_RDWR)
    fcntl.flock(lock, fcntl.LOCK_EX)
    asyncio.get_running_loop().call_later(connect.LOCK_RETRY_S, os.close, lock)
    hub = await open_session(BusConfig(endpoint), "hub")
    hub.close()  # pyright: ignore[reportUnknownMemberType]


async def test_a_restarted_hub_replaces_the_socket_of_a_killed_one() -> None:
    endpoint = free_endpoint()
    path = local_socket.socket_of(endpoint)
    assert path is not None
    clients: list[zenoh.Session] = []
    for _ in range(2):
        hub = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", HUB, endpoint), stdout=asyncio.subprocess.PIPE
        )
        assert hub.stdout is not None
        assert await asyncio.wait_for(hub.stdout.readline(), LIMIT_S) == b"listens\n"
        clients.append(await asyncio.wait_for(open_session(BusConfig(endpoint), "client"), LIMIT_S))
        hub.kill()
        await hub.wait()
        assert path.exists()
        assert not local_socket.answers(path)
    waiting = asyncio.ensure_future(open_session(BusConfig(endpoint), "client"))
    last = await open_session(BusConfig(endpoint), "hub")
    try:
        clients.append(await asyncio.wait_for(waiting, LIMIT_S))
        await asyncio.wait_for(_all_at(clients, local_socket.zenoh_endpoint(path)), LIMIT_S)
    finally:
        for session in (*clients, last):
            session.close()  # pyright: ignore[reportUnknownMemberType]
    assert not path.exists()


async def test_hubs_that_are_started_and_killed_leave_no_more_files_than_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(run))
    for _ in range(3):
        hub = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", HUB, free_endpoint()), stdout=asyncio.subprocess.PIPE
        )
        assert hub.stdout is not None
        assert await asyncio.wait_for(hub.stdout.readline(), LIMIT_S) == b"listens\n"
        hub.kill()
        await hub.wait()
        assert len(list(run.iterdir())) == len(("socket", "lock"))


async def test_a_supervisor_whose_socket_was_removed_ends_since_nobody_could_stop_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(tmp_path / "run"))
    async with robot(tmp_path) as subject:
        await subject.drive()
        shutil.rmtree(tmp_path / "run")
        ended = asyncio.to_thread(subject.processes[topics.SUPERVISOR].wait, PATIENCE_S)
        assert await ended == 1
        assert "was removed, so no program can stop the robot" in (tmp_path / "supervisor.log").read_text()
        subject.start(topics.SUPERVISOR)
        await subject.drive()

        async def attempt() -> None:
            """A press is confirmed within a second, or not at all."""
            press = await asyncio.create_subprocess_exec(LIFELINE, "estop", "--endpoint", subject.endpoint)
            assert await asyncio.wait_for(press.wait(), PATIENCE_S) == 0

        await patiently(attempt)


@needs_namespaces
async def test_hubs_in_two_network_namespaces_with_one_home_and_port_have_sockets_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(run))
    hubs: list[asyncio.subprocess.Process] = []
    try:
        for number in (1, 2):
            start = 'ip link set lo up; exec "$@"'
            hub = await asyncio.create_subprocess_exec(
                *(
                    "unshare",
                    "--net",
                    "sh",
                    "-c",
                    start,
                    "sh",
                    sys.executable,
                    "-c",
                    HUB,
                    "tcp/127.0.0.1:7447",
                ),
                stdout=asyncio.subprocess.PIPE,
            )
            hubs.append(hub)
            assert hub.stdout is not None
            assert await asyncio.wait_for(hub.stdout.readline(), LIMIT_S) == b"listens\n"
            assert len(_answering(run)) == number
        first, second = _answering(run)
        hubs[1].kill()
        await hubs[1].wait()
        assert len(_answering(run)) == 1
        local_socket.prepare(run / "1-7447.sock")
        assert list(run.glob("*.sock")) == _answering(run), f"of {first} and {second}, only that of the hub"
    finally:
        for hub in hubs:
            if hub.returncode is None:
                hub.kill()
                await hub.wait()


def _answering(run: Path) -> list[Path]:
    return [path for path in run.glob("*.sock") if local_socket.answers(path)]


async def _all_at(clients: list[zenoh.Session], endpoint: str) -> None:
    """Wait until each client has one link, to this endpoint."""
    wanted = [[endpoint]] * len(clients)
    while [[str(link.dst) for link in client.info.links()] for client in clients] != wanted:  # noqa: ASYNC110 - no event
        await asyncio.sleep(0.02)
