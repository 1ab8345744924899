"""A router between hubs and operators, with certificates on every link: who reaches whom, and what others try in vain."""

import asyncio
import json
import os
import signal
import time
from collections.abc import AsyncGenerator, Callable, Generator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import zenoh

from tests.system.authority import TestAuthority, secure_endpoint
from tests.system.ports import free_endpoint
from tests.system.routers import end as end_router
from tests.system.routers import router, start_router
from tests.system.test_keys import bare_client
from wire import topics
from wire.access import Contract
from wire.bundle import read_bundle
from wire.bus import NoReplyError
from wire.messages import Bool, EstopLease, TriggerResponse, encode, planar_twist
from wire.roles import ANY, Role
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus
from wire.zenoh.router import RouterConfig, region_name, settings

WITHIN_S = 30.0
SETTLED_S = 0.5
"""How long nothing must arrive that is refused; what is allowed arrives within milliseconds."""
FALSE = b"false"
ROUTER_CONNECTS_S = 0.5
"""A hub connects to a router that runs within some milliseconds."""
ROBOTS = ("robot1", "robot2")
STATION = "door"
TELEOP = topics.source_cmd_vel(topics.TELEOP)


@dataclass
class Site:
    """One router, and the hubs of two robots that dial out to it."""

    ours: TestAuthority
    endpoint: str
    hubs: dict[str, ZenohBus]
    at_hubs: dict[str, str]
    """Endpoints for the programs of each robot's computer."""

    def bundle(self, role: Role, robot: str) -> Path:
        return self.ours.bundle(f"{role}-{robot}", role, robot=robot)


@asynccontextmanager
async def client(config: BusConfig) -> AsyncGenerator[ZenohBus]:
    bus = await asyncio.wait_for(open_bus(config, "client"), WITHIN_S)
    try:
        yield bus
    finally:
        await bus.close()


@asynccontextmanager
async def site(tmp_path: Path, protocol: str = "tls") -> AsyncGenerator[Site]:
    ours, endpoint = TestAuthority(tmp_path), secure_endpoint(protocol)
    made = Site(ours, endpoint, {}, {})
    with router(endpoint, ROBOTS, made.bundle(Role.ROUTER, ANY), stations=[STATION]):
        try:
            for robot in ROBOTS:
                made.at_hubs[robot] = free_endpoint()
                made.hubs[robot] = await open_hub(made, robot)
            yield made
        finally:
            for hub in made.hubs.values():
                await hub.close()


async def open_hub(made: Site, robot: str) -> ZenohBus:
    config = BusConfig(
        made.at_hubs[robot],
        robot,
        keys=made.bundle(Role.SUPERVISOR, robot),
        contract=Contract(stations=(STATION,)),
        routers=(made.endpoint,),
    )
    hub = await open_bus(config, "hub")
    hub.serve(topics.SUPERVISOR_RESET, _reset)
    for epoch in (b"", hub.run_id):
        hub.declare_alive(topics.SUPERVISOR, epoch)
    return hub


async def _reset(_: str) -> TriggerResponse:
    return TriggerResponse(success=True, message="by the hub")


async def until(condition: Callable[[], object], what: str, within_s: float = WITHIN_S) -> float:
    began_s = time.monotonic()
    while not condition():
        assert time.monotonic() < began_s + within_s, f"not within {within_s:g} s: {what}"
        await asyncio.sleep(0.002)
    return time.monotonic() - began_s


def heard_by(session: zenoh.Session, expression: str) -> list[tuple[str, bytes]]:
    heard: list[tuple[str, bytes]] = []

    def add(sample: zenoh.Sample) -> None:
        heard.append((str(sample.key_expr), sample.payload.to_bytes()))

    kept.append(session.declare_subscriber(expression, zenoh.handlers.Callback(add, indirect=False)))
    return heard


def tokens_seen_by(session: zenoh.Session, expression: str) -> list[str]:
    seen: list[str] = []

    def add(sample: zenoh.Sample) -> None:
        seen.append(str(sample.key_expr))

    callback = zenoh.handlers.Callback(add, indirect=False)
    kept.append(session.liveliness().declare_subscriber(expression, callback, history=True))
    return seen


kept: list[object] = []


@pytest.fixture(autouse=True)
def _drop() -> Generator[None]:
    yield
    kept.clear()


@pytest.mark.smoke
@pytest.mark.parametrize("protocol", ["tls", "quic"])
async def test_an_operator_reaches_a_robot_that_dialled_out(tmp_path: Path, protocol: str) -> None:
    async with site(tmp_path, protocol) as made:
        hub, wake = made.hubs["robot1"], asyncio.Event()
        commands, _ = hub.subscribe_sources([topics.TELEOP], depth=32, wake=wake)
        alive = hub.watch_alive(wake, [topics.TELEOP])
        keys = made.bundle(Role.OPERATOR, ANY)
        async with client(BusConfig(made.endpoint, "robot1", keys=keys)) as operator:
            publisher, token = operator.publisher(TELEOP), operator.declare_alive(topics.TELEOP, b"run")

            def came() -> bool:
                publisher.put(planar_twist(0.25, 0.0))
                return bool(commands[topics.TELEOP].take())

            await until(came, "a command")
            await until(lambda: any(one.epoch == b"run" for one in alive.take()), "the token of the run")
            assert (await operator.call(topics.SUPERVISOR_RESET, timeout_s=5.0)).message == "by the hub"
            token.withdraw()
            await until(lambda: any(not one.alive for one in alive.take()), "the end of the token")


async def test_an_estop_station_behind_the_router_is_challenged_and_answers(tmp_path: Path) -> None:
    async with site(tmp_path) as made:
        hub = made.hubs["robot1"]
        wake, node = asyncio.Event(), topics.estop_node(STATION)
        answers = hub.subscribe(topics.estop_presence(STATION))
        alive = hub.watch_alive(wake, [node])
        challenge = hub.publisher(topics.estop_challenge(STATION))
        keys = made.bundle(Role.ESTOP, "robot1")
        async with client(BusConfig(made.endpoint, "robot1", keys=keys)) as station:
            station.declare_alive(node, b"run")
            challenges = station.subscribe(topics.estop_challenge(STATION))
            presence = station.publisher(topics.estop_presence(STATION))

            def answered() -> bool:
                challenge.put(EstopLease(challenge=7))
                for one in challenges.take():
                    assert one.message is not None
                    presence.put(one.message)
                return bool(answers.take())

            await until(answered, "an answer to a challenge")
            await until(lambda: any(one.alive for one in alive.take()), "the station's token")
        await until(lambda: any(not one.alive for one in alive.take()), "the end of the station's token")


@pytest.mark.timed
async def test_a_local_program_does_not_wait_for_a_router_that_is_gone(tmp_path: Path) -> None:
    ours, made_s = TestAuthority(tmp_path), time.monotonic()
    nowhere = Site(ours, secure_endpoint("tls"), {}, {"robot1": free_endpoint()})
    hub = await open_hub(nowhere, "robot1")
    try:
        async with client(BusConfig(nowhere.at_hubs["robot1"], "robot1")) as local:
            asked_s = time.monotonic()
            assert (await local.call(topics.SUPERVISOR_RESET)).success
            assert time.monotonic() - asked_s < 1.0
    finally:
        await hub.close()
    assert time.monotonic() - made_s < WITHIN_S


async def test_an_operator_of_one_robot_cannot_touch_another_through_the_router(tmp_path: Path) -> None:
    """With a plain Zenoh program: puts, wildcards, tokens, queries and replies; the operator of all robots still can."""
    async with site(tmp_path) as made:
        victim = await asyncio.to_thread(bare_local, made.at_hubs["robot2"])
        foreign = await asyncio.to_thread(bare_client, made.endpoint, made.bundle(Role.OPERATOR, "robot1"))
        witness = await asyncio.to_thread(bare_client, made.endpoint, made.bundle(Role.VIEWER, ANY))
        try:
            at_victim, at_witness = heard_by(victim, "robot2/**"), heard_by(witness, "*/**")
            spies = [heard_by(foreign, "**"), heard_by(foreign, "robot2/**")]
            changes = tokens_seen_by(victim, "robot2/alive/**")
            async with client(
                BusConfig(made.endpoint, "robot2", keys=made.bundle(Role.OPERATOR, ANY))
            ) as own:
                estop = own.publisher(topics.ESTOP)

                def passes() -> bool:
                    estop.put(Bool(data=False))
                    return bool(at_victim) and bool(at_witness)

                await until(passes, "what is allowed arrives at both")
                estop.put(Bool(data=True))  # arrives after the others
                last = ("robot2/estop", encode(Bool(data=True)))
                await until(lambda: last in at_victim and last in at_witness, "the last e-stop at both")
                at_victim.clear()
                at_witness.clear()
                changes.clear()
                keys = [
                    f"robot2/{key}"
                    for key in ("teleop/cmd_vel", "estop", "cmd_vel", "scan", "**", "*/cmd_vel")
                ]
                keys += ["**", "*/estop", "*/teleop/cmd_vel", "*/**", "robot$*/estop"]
                for key in keys:
                    foreign.put(key, b"foreign")
                    foreign.delete(key)
                kept.extend(
                    foreign.liveliness().declare_token(f"robot2/alive/{name}")
                    for name in ("teleop", "supervisor", "teleop/00ff", "sim")
                )
                kept.extend(
                    foreign.declare_queryable(key, _false_reply, complete=True)
                    for key in ("robot2/**", "robot2/supervisor/reset", "**", "robot2/teleop/holder")
                )
                made.hubs["robot2"].publisher(topics.CMD_VEL).put(planar_twist(0.0, 0.0))
                await until(lambda: at_victim, "a command of the hub")
                await asyncio.sleep(SETTLED_S)  # it is the duration in which nothing may arrive
                assert {key for key, _ in at_victim} == {"robot2/cmd_vel"}
                assert {key for key, _ in at_witness} <= {"robot2/cmd_vel"}
                spied = {payload for heard in spies for _, payload in heard} - {
                    b"foreign",
                    b"",
                }  # a session hears itself
                assert (spied, changes) == (set(), [])
                assert await asyncio.to_thread(replies, foreign, "robot2/supervisor/reset") == []
                assert (await own.call(topics.SUPERVISOR_RESET, timeout_s=5.0)).message == "by the hub"
                with pytest.raises(NoReplyError):
                    await own.call(topics.source_holder(topics.TELEOP), timeout_s=1.0)
        finally:
            for session in (victim, foreign, witness):
                session.close()  # pyright: ignore[reportUnknownMemberType]


def bare_local(endpoint: str) -> zenoh.Session:
    return bare_client(endpoint, None)


def replies(session: zenoh.Session, key: str) -> list[bytes]:
    """Return the replies of others: a session also answers itself."""
    answers = [reply.ok.payload.to_bytes() for reply in session.get(key, timeout=1.0) if reply.ok is not None]
    return [answer for answer in answers if answer != FALSE]


def _false_reply(query: zenoh.Query) -> None:
    with query:
        query.reply("robot2/supervisor/reset", FALSE)


async def test_the_hub_takes_no_sensor_of_its_robot_from_the_router(tmp_path: Path) -> None:
    """A router that is compromised passes what it likes: here, one without an allow-list, with a bundle of ours."""
    ours, endpoint = TestAuthority(tmp_path), secure_endpoint("tls")
    made = Site(ours, endpoint, {}, {"robot1": free_endpoint()})
    lawless = await asyncio.to_thread(lawless_router, endpoint, made.bundle(Role.ROUTER, ANY))
    hub = await open_hub(made, "robot1")
    local = await asyncio.to_thread(bare_local, made.at_hubs["robot1"])
    try:
        heard = heard_by(local, "robot1/**")

        def passes() -> bool:
            lawless.put("robot1/teleop/cmd_vel", b"operator's")
            return bool(heard)

        await until(passes, "a command of an operator")
        for key in ("scan", "odom", "cmd_vel", "supervisor/status", "**", "*/cmd_vel", "sim/truth"):
            lawless.put(f"robot1/{key}", b"false")
        lawless.put("robot1/estop", b"last")
        await until(
            lambda: any(payload == b"last" for _, payload in heard), "an e-stop, in order behind the others"
        )
        assert {key for key, _ in heard} == {"robot1/teleop/cmd_vel", "robot1/estop"}
    finally:
        for session in (local, lawless):
            session.close()  # pyright: ignore[reportUnknownMemberType]
        await hub.close()


def lawless_router(endpoint: str, keys: Path) -> zenoh.Session:
    """Open a router of our authority that passes everything."""
    bundle = read_bundle(keys, time.time())
    region = region_name(bundle.authority.read_bytes())
    values = settings(RouterConfig((endpoint,), ("robot1",), keys), bundle, region)
    del values["access_control"], values["low_pass_filter"]
    configuration = zenoh.Config()
    for key, value in values.items():
        configuration.insert_json5(key, json.dumps(value))
    return zenoh.open(configuration)


@pytest.mark.parametrize("role", [role for role in Role if role is not Role.ROUTER])
async def test_nobody_else_plays_the_router(tmp_path: Path, role: Role) -> None:
    """All but supervisors have no certificate for servers, and a supervisor's passes nothing to another hub."""
    made = Site(TestAuthority(tmp_path), secure_endpoint("tls"), {}, {"robot1": free_endpoint()})
    false = await asyncio.to_thread(lawless_router, made.endpoint, made.bundle(role, "robot2"))
    hub = await open_hub(made, "robot1")
    try:
        estops, statuses = hub.subscribe(topics.ESTOP), heard_by(false, "robot1/cmd_vel")
        deadline_s = time.monotonic() + SETTLED_S + ROUTER_CONNECTS_S
        while time.monotonic() < deadline_s:
            false.put("robot1/estop", b"false")
            hub.publisher(topics.CMD_VEL).put(planar_twist(0.0, 0.0))
            await asyncio.sleep(0.01)
        assert (estops.take(), statuses) == ([], [])
    finally:
        false.close()  # pyright: ignore[reportUnknownMemberType]
        await hub.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
async def test_no_token_outlives_the_router_that_its_operator_used(
    tmp_path: Path, number: signal.Signals
) -> None:
    """Zenoh issue 2602: routers kept the tokens of a router that they had lost. The operator is three hops away."""
    made = Site(TestAuthority(tmp_path), secure_endpoint("tls"), {}, {"robot1": free_endpoint()})
    far, keys = secure_endpoint("tls"), made.bundle(Role.ROUTER, ANY)
    with router(made.endpoint, ROBOTS, keys):
        away = start_router(far, ROBOTS, keys, connect=[made.endpoint])
        hub = await open_hub(made, "robot1")
        try:
            wake = asyncio.Event()
            alive = hub.watch_alive(wake, [topics.TELEOP])
            operator = BusConfig(far, "robot1", keys=made.bundle(Role.OPERATOR, ANY))
            async with client(operator) as bus:
                bus.declare_alive(topics.TELEOP, b"run")
                await until(lambda: any(one.alive for one in alive.take()), "the token")
                os.kill(away.pid, number)
                took_s = await until(
                    lambda: any(not one.alive for one in alive.take()), "the end of the token"
                )
                print(
                    f"\n    measured: {number.name} of the far router to the end of the token {took_s * 1e3:.1f} ms"
                )
                end_router(away)
                away = start_router(far, ROBOTS, keys, connect=[made.endpoint])
                await until(lambda: any(one.alive for one in alive.take()), "the token again")
            await until(lambda: any(not one.alive for one in alive.take()), "the end of the session")
        finally:
            end_router(away)
            await hub.close()
