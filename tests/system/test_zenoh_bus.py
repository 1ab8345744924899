"""The Bus over real Zenoh: refused messages, the death of a process, and closing."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import zenoh

from deploy.stack.launch import DEFAULT_CONFIG
from tests.system.harness import free_endpoint
from tests.system.ports import participants
from tests.system.rogue import open_rogue
from wire import topics
from wire.bus import Arrival, BusError, NoReplyError
from wire.messages import TriggerResponse, Twist, decode, encode, planar_twist
from wire.stamp import Stamper
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus
from wire.zenoh.session import MAX_REPLIES, MAX_SOURCE_NAME, SETTLE_S

pytestmark = pytest.mark.smoke

WITHIN_S = 20.0
"""Time limit for expected events on a loaded machine."""
NAMED_KEYS = Path(__file__).with_name("named_keys.py")
STUBBORN = Path(__file__).with_name("stubborn_source.py")


@asynccontextmanager
async def hub_and_client() -> AsyncGenerator[tuple[ZenohBus, ZenohBus, BusConfig]]:
    config = BusConfig(free_endpoint())
    hub = await open_bus(config, "hub")
    client = await open_bus(config, "client")
    try:
        yield hub, client, config
    finally:
        await client.close()
        await hub.close()


async def until(condition: Callable[[], object], what: str) -> None:
    deadline_s = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < deadline_s, f"not within {WITHIN_S:g} s: {what}"
        await asyncio.sleep(0.01)


async def test_a_message_crosses_with_its_stamp_and_is_stamped_on_arrival() -> None:
    async with hub_and_client() as (hub, client, _):
        commands = hub.subscribe(topics.source_cmd_vel("teleop"), depth=100)
        publisher = client.publisher(topics.source_cmd_vel("teleop"))
        arrivals: list[Arrival[Twist]] = []

        def came(twist: Twist) -> bool:
            arrivals[:] = [arrival for arrival in commands.take() if arrival.message == twist]
            return bool(arrivals)

        await until(
            lambda: publisher.put(planar_twist(0.0, 0.0)) or came(planar_twist(0.0, 0.0)), "the first one"
        )
        sent_s = time.monotonic()
        publisher.put(planar_twist(0.5, 0.1))
        await until(lambda: came(planar_twist(0.5, 0.1)), "the message")
        (arrival,) = arrivals
        assert arrival.stamp is not None
        assert sent_s <= arrival.stamp.source_time_ns * 1e-9 <= arrival.arrival_s <= time.monotonic()


async def test_a_flood_of_ever_new_writers_does_not_displace_a_known_writers_newest_sample() -> None:
    async with hub_and_client() as (hub, client, _):
        topic = topics.source_cmd_vel("teleop")
        kept, everything = hub.subscribe(topic, per_writer=True), hub.subscribe(topic, depth=10_000)
        writer = client.publisher(topic)
        seen: list[float] = []

        def arrived(speed_m_s: float) -> bool:
            seen.extend(a.message.linear.x for a in everything.take() if a.message)
            return speed_m_s in seen

        def flood(speed_m_s: float) -> None:
            for _ in range(100):
                client.put_raw(
                    f"robot/{topic.key}", encode(planar_twist(speed_m_s, 0.0)), Stamper().next().pack()
                )

        async def writes(speed_m_s: float) -> None:
            """Publish repeatedly until it arrives, because a flooded link drops messages."""
            deadline_s = time.monotonic() + WITHIN_S
            while not arrived(speed_m_s):
                assert time.monotonic() < deadline_s
                writer.put(planar_twist(speed_m_s, 0.0))
                await asyncio.sleep(0.01)

        await writes(0.1)
        newest: list[Arrival[Twist]] = []
        await until(lambda: newest.extend(kept.take()) or newest, "the other subscription's sample")
        (first,) = newest
        flood(0.2)
        await until(lambda: arrived(0.2), "the flood")
        await writes(0.3)
        flood(0.4)
        await until(lambda: arrived(0.4), "the flood after it")
        assert first.stamp is not None
        newest[:] = [a for a in kept.take() if a.stamp and a.stamp.gid == first.stamp.gid]
        assert [a.message for a in newest] == [planar_twist(0.3, 0.0)]


@pytest.mark.parametrize("key", ["cmd_vel", "*", "**", "supervisor/status", "supervisor/*"])
async def test_the_hub_and_the_bus_refuse_a_stranger_on_the_supervisors_keys(key: str) -> None:
    async with hub_and_client() as (hub, robot, config):
        rogue = open_rogue(participants(config.endpoint))
        cmd_vel = robot.subscribe(topics.CMD_VEL, depth=100)
        status = robot.subscribe(topics.STATUS, depth=100)
        scans = robot.subscribe(topics.ODOM, depth=100)  # a key that any client may write, for comparison
        try:
            arrived = False
            while not arrived:
                rogue.put(f"robot/{key}", encode(planar_twist(1.0, 0.0)))
                rogue.put("robot/odom", b"junk")
                await asyncio.sleep(0.02)
                arrived = bool(scans.take())
            assert cmd_vel.take() == []
            assert status.take() == []
            deadline_s = time.monotonic() + WITHIN_S
            genuine = hub.publisher(topics.CMD_VEL)
            while not (arrivals := cmd_vel.take()) and time.monotonic() < deadline_s:
                genuine.put(planar_twist(0.1, 0.0))
                await asyncio.sleep(0.02)
            assert arrivals[-1].message == planar_twist(0.1, 0.0)
        finally:
            rogue.close()


async def test_the_name_of_an_unknown_source_is_cut() -> None:
    async with hub_and_client() as (hub, client, _):
        _, strangers = hub.subscribe_sources(["teleop"], depth=1, wake=asyncio.Event())
        names: list[str] = []

        def came() -> bool:
            client.put_raw(f"robot/{'x' * 40_000}/cmd_vel", encode(planar_twist(0.0, 0.0)))
            names.extend(strangers.take())
            return bool(names)

        await until(came, "the name")
        assert set(names) == {"x" * MAX_SOURCE_NAME}


async def test_a_stranger_cannot_pose_as_the_supervisor() -> None:
    async with hub_and_client() as (_, client, config):
        watcher = await open_bus(config, "client")
        changes = watcher.watch_alive()
        client.declare_alive(topics.SUPERVISOR)
        client.declare_alive(topics.TELEOP)
        seen: list[str] = []
        try:
            await until(
                lambda: seen.extend(c.node for c in changes.take()) or topics.TELEOP in seen, "a token"
            )
            assert topics.SUPERVISOR not in seen
        finally:
            await watcher.close()


@pytest.mark.timed
async def test_a_killed_process_loses_its_token_within_milliseconds() -> None:
    async with hub_and_client() as (hub, _, config):
        changes = hub.watch_alive()
        source = subprocess.Popen([sys.executable, STUBBORN, config.endpoint], stdin=subprocess.PIPE)
        try:
            await until(lambda: any(c.alive for c in changes.take()), "its token")
            killed_s = time.monotonic()
            os.kill(source.pid, signal.SIGKILL)
            gone: list[float] = []
            await until(
                lambda: gone.extend(c.arrival_s for c in changes.take() if not c.alive) or gone, "its end"
            )
            print(f"\n    measured: SIGKILL to token gone: {(gone[0] - killed_s) * 1e3:.1f} ms")
            assert gone[0] - killed_s < 0.1
        finally:
            source.kill()
            source.communicate()


async def test_a_stopped_process_loses_its_token_with_its_lease() -> None:
    async with hub_and_client() as (hub, _, config):
        changes = hub.watch_alive()
        source = subprocess.Popen([sys.executable, STUBBORN, config.endpoint], stdin=subprocess.PIPE)
        try:
            await until(lambda: any(c.alive for c in changes.take()), "its token")
            os.kill(source.pid, signal.SIGSTOP)
            await until(lambda: any(not c.alive for c in changes.take()), "the lapse of its lease")
        finally:
            source.kill()
            source.communicate()


async def test_clients_see_the_hub_die_and_come_back() -> None:
    config = BusConfig(free_endpoint())
    hub = await open_bus(config, "hub")
    client = await open_bus(config, "client")
    changes = client.watch_alive()
    try:
        hub.declare_alive(topics.SUPERVISOR)
        await until(lambda: any(c.alive for c in changes.take()), "the hub's token")
        await hub.close()
        await until(lambda: any(not c.alive for c in changes.take()), "its end")
        hub = await open_bus(config, "hub")
        hub.declare_alive(topics.SUPERVISOR)
        await until(lambda: any(c.alive for c in changes.take()), "its return")
    finally:
        await client.close()
        await hub.close()


async def test_a_withdrawn_token_is_forgotten_and_others_are_kept() -> None:
    async with hub_and_client() as (_, client, _):
        kept = client._declared  # pyright: ignore[reportPrivateUsage] - nothing else shows what it keeps
        before = list(kept)
        for number in range(100):
            client.declare_alive(f"x{number}").withdraw()
        assert kept == before
        client.declare_alive("x")
        assert len(kept) == len(before) + 1


async def test_after_a_stopped_hub_goes_on_samples_count_only_once_the_link_has_settled() -> None:
    config = BusConfig(free_endpoint(), lease_s=0.2)
    keys = ["cmd_vel", "teleop/cmd_vel", "joy/cmd_vel", "supervisor/status"]
    hub = subprocess.Popen(
        [sys.executable, NAMED_KEYS, config.endpoint, *(f"robot/{key}" for key in keys)],
        stdin=subprocess.PIPE,
    )
    clients = [await open_bus(config, "client") for _ in range(4)]
    heard: list[tuple[int, str, str, float]] = []

    def hear(client: int, key: str) -> Callable[[bytes, bytes | None, float], None]:
        return lambda payload, _, arrival_s: heard.append(
            (client, f"robot/{key}", payload.decode(), arrival_s)
        )

    def all_hear() -> bool:
        return len({(client, key) for client, key, *_ in heard}) == len(clients) * len(keys)

    try:
        for number, client in enumerate(clients):
            for key in keys:
                client.subscribe_raw(key, hear(number, key))
        await until(all_hear, "samples of all keys")
        for _ in range(5):
            os.kill(hub.pid, signal.SIGSTOP)
            await asyncio.sleep(2.0 * config.lease_s)  # the fault itself: longer than the lease
            heard.clear()
            continued_s = time.monotonic()
            os.kill(hub.pid, signal.SIGCONT)
            await until(all_hear, "samples after the stop")
            assert not [one for one in heard if one[1] != one[2]]
            assert min(arrival_s for *_, arrival_s in heard) >= continued_s + SETTLE_S
    finally:
        hub.kill()
        hub.communicate()
        for client in clients:
            await client.close()


async def test_a_query_is_answered_and_nobody_s_silence_is_an_error() -> None:
    async with hub_and_client() as (hub, client, _):

        async def answer(text: str) -> TriggerResponse:
            return TriggerResponse(success=True, message=f"done {text}".strip())

        hub.declare_alive(topics.SUPERVISOR, hub.run_id)
        hub.serve(topics.SUPERVISOR_RESET, answer)
        assert (await client.call(topics.SUPERVISOR_RESET, timeout_s=WITHIN_S)).message == "done"
        assert (
            await client.call(topics.SUPERVISOR_RESET, "at once", timeout_s=WITHIN_S)
        ).message == "done at once"
        with pytest.raises(NoReplyError, match="robot/sim/reset"):
            await client.call(topics.SIM_RESET, timeout_s=0.2)


@pytest.mark.parametrize(
    ("request_bytes", "reply"),
    [(b"\0\1\0\0\0", "done"), (b"reset", "the request is not a std_msgs/msg/String")],
)
async def test_the_empty_trigger_request_of_a_ros_2_bridge_is_served(
    request_bytes: bytes, reply: str
) -> None:
    async with hub_and_client() as (hub, client, _):

        async def answer(text: str) -> TriggerResponse:
            return TriggerResponse(success=True, message=f"done {text}".strip())

        hub.declare_alive(topics.SUPERVISOR, hub.run_id)
        hub.serve(topics.SUPERVISOR_RESET, answer)
        response = await client.call_raw(
            topics.SUPERVISOR_RESET.key,
            request_bytes,
            lambda reply: decode(reply, TriggerResponse),
            timeout_s=WITHIN_S,
        )
        assert response.message == reply


async def test_a_program_that_answers_one_query_again_and_again_with_garbage_is_not_read_to_the_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = BusConfig(free_endpoint())
    hub = await open_bus(config, "hub")
    rogue = open_rogue(participants(config.endpoint))
    key = topics.source_holder("teleop").key

    def flood(query: zenoh.Query) -> None:
        with query:
            for _ in range(1000):
                query.reply(f"robot/{key}", b"\xff" * 64)

    try:
        with rogue.declare_queryable(f"robot/{key}", flood):
            deadline_s = time.monotonic() + WITHIN_S
            while not (ignored := [one for one in caplog.messages if "not a Trigger response" in one]):
                assert time.monotonic() < deadline_s
                with pytest.raises(NoReplyError):
                    await hub.call(topics.source_holder("teleop"), timeout_s=WITHIN_S)
        assert len(ignored) <= MAX_REPLIES
    finally:
        rogue.close()
        await hub.close()


async def test_a_port_in_use_is_one_sentence_that_says_what_to_do() -> None:
    async with hub_and_client() as (_, _, config):
        with pytest.raises(BusError, match=r"already in use.*lifeline down.*--endpoint"):
            await open_bus(config, "hub")


async def test_a_client_waits_for_its_hub_and_says_so_once() -> None:
    config = BusConfig(free_endpoint())
    said: list[str] = []
    opening = asyncio.create_task(open_bus(config, "client", on_wait=lambda: said.append("waiting")))
    await until(lambda: said, "that it waits")
    hub = await open_bus(config, "hub")
    client = await opening
    assert said == ["waiting"]
    await client.close()
    await hub.close()


@pytest.mark.timed
async def test_closing_ends_although_the_peer_is_stopped() -> None:
    config = BusConfig(free_endpoint(), lease_s=60.0)
    hub = await open_bus(config, "hub")
    source = subprocess.Popen([sys.executable, STUBBORN, config.endpoint], stdin=subprocess.PIPE)
    try:
        changes = hub.watch_alive()
        await until(lambda: any(c.alive for c in changes.take()), "its token")
        os.kill(source.pid, signal.SIGSTOP)
        started_s = time.monotonic()
        await hub.close()
        assert time.monotonic() - started_s < 3.0
    finally:
        source.kill()
        source.communicate()


async def test_what_one_turn_of_a_loop_says_arrives_whole() -> None:
    """With Zenoh's default of two places every third sample of a burst could be dropped."""
    async with hub_and_client() as (hub, client, _):
        topic = topics.source_cmd_vel("teleop")
        heard = hub.subscribe(topic, depth=1000)
        publisher = client.publisher(topic)
        arrived: list[float] = []

        def came() -> bool:
            arrived.extend(a.message.linear.x for a in heard.take() if a.message is not None)
            if not arrived:  # the subscription has not reached the client yet
                publisher.put(planar_twist(-1.0, 0.0))
            return bool(arrived)

        await until(came, "the first sample")
        for burst in range(50):
            for place in range(12):
                publisher.put(planar_twist(burst * 12.0 + place, 0.0))
            await until(
                lambda last=burst * 12.0 + 11: came() and arrived[-1] == last, "a burst's last sample"
            )
        assert [x for x in arrived if x >= 0.0] == [float(n) for n in range(600)]


@pytest.mark.parametrize(
    "path", sorted((DEFAULT_CONFIG.parent / "examples").glob("zenoh-bridge-*.json5")), ids=str
)
async def test_a_bridge_with_our_example_waits_for_the_hub_and_reaches_it(path: Path) -> None:
    """The session of the bridge, without its plugin."""
    config = BusConfig(free_endpoint())
    settings = zenoh.Config.from_file(str(path))
    settings.insert_json5("connect/endpoints", json.dumps([participants(config.endpoint)]))
    opening = asyncio.create_task(asyncio.to_thread(zenoh.open, settings))
    await asyncio.sleep(0.3)  # the bridge has tried in vain
    assert not opening.done()
    hub = await open_bus(config, "hub")
    try:
        scans = hub.subscribe(topics.SCAN, depth=100)
        with await asyncio.wait_for(opening, WITHIN_S) as session:

            def arrived() -> bool:
                session.put("robot/scan", b"\0")
                return bool(scans.take())

            await until(arrived, "a sample")
    finally:
        await hub.close()
