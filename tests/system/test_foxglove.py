"""`lifeline foxglove` beside a real robot, as an independent WebSocket client sees it."""

import asyncio
import json
import math
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deploy.stack.errors import EXIT_REFUSED
from tests.protobuf import Fields, protobuf_fields
from tests.system.foxglove_client import (
    CLIENT_MESSAGE,
    SERVICE_CALL,
    FoxgloveClient,
    foxglove_client,
)
from tests.system.harness import PATIENCE_S, Robot, free_endpoint, is_zero, robot
from tests.system.process_state import listening
from tests.system.test_record import lifeline
from wire import topics
from wire.messages import definition, encode, planar_twist

pytestmark = pytest.mark.timeout(120)
CMD_VEL, ODOM, SCAN, STATUS = "/robot/cmd_vel", "/robot/odom", "/robot/scan", "/robot/supervisor/status"
TF, SCENE = "/tf", "/scene"
SOURCES = tuple(f"/robot/{source}/cmd_vel" for source in ("teleop", "joy", "path"))
ALL = (*(f"/robot/{topic.key}" for topic in topics.TOPICS if "<" not in topic.key), *SOURCES, TF, SCENE)


def say(text: str) -> None:
    print(f"\n    measured: {text}")


@dataclass
class Served:
    """A running `lifeline foxglove`."""

    process: asyncio.subprocess.Process
    address: str

    @property
    def port(self) -> int:
        return int(self.address.rpartition(":")[2])

    async def interrupted(self) -> tuple[float, int | None, bytes]:
        """Send SIGINT; return the time to the end of the process [s], its exit code and its errors."""
        loop = asyncio.get_running_loop()
        sent_s = loop.time()
        self.process.send_signal(signal.SIGINT)
        _, errors = await asyncio.wait_for(self.process.communicate(), PATIENCE_S)
        return loop.time() - sent_s, self.process.returncode, errors


@asynccontextmanager
async def served(endpoint: str, *options: str) -> AsyncGenerator[Served]:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "lifeline.cli.app",
        "foxglove",
        "--endpoint",
        endpoint,
        *(options or ("--listen", "127.0.0.1:0")),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        assert process.stdout is not None
        line = (await asyncio.wait_for(process.stdout.readline(), PATIENCE_S)).decode()
        match = re.search(r"serving (ws://127\.0\.0\.1:\d+) to Foxglove", line)
        assert match is not None, line
        yield Served(process, match[1])
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


@asynccontextmanager
async def standing(tmp_path: Path) -> AsyncGenerator[tuple[Robot, Served]]:
    """A robot without an operator, whose sim publishes, and its server."""
    async with robot(tmp_path, teleop=False) as subject:
        await subject.until(
            lambda: "SCAN_STALE" not in subject.status.reasons and bool(subject.travel), "scans"
        )
        async with served(subject.endpoint) as server:
            yield subject, server


@asynccontextmanager
async def subscribed(server: Served, *names: str) -> AsyncGenerator[FoxgloveClient]:
    async with foxglove_client(server.address) as client:
        async with asyncio.timeout(PATIENCE_S):
            await client.until_advertised(*names)
            await client.subscribe(*names)
            for name in names:
                await client.next_of(name)
        yield client


async def test_each_topic_has_its_ros_type_and_encoding(tmp_path: Path) -> None:
    async with standing(tmp_path) as (_, server), foxglove_client(server.address) as client:
        async with asyncio.timeout(PATIENCE_S):
            await client.until_advertised(*ALL)
        assert set(client.channels) == set(ALL)
        assert client.server_info["name"] == "lifeline robot"
        assert client.server_info["capabilities"] == []
        for topic in topics.TOPICS:
            if "<" not in topic.key:
                channel = client.channels[f"/robot/{topic.key}"]
                type_name = topic.type.__msgtype__
                assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
                assert channel["schemaName"] == type_name
                assert channel["schema"] == definition(type_name).text
        drawing = {topic: client.channels[topic] for topic in (TF, SCENE)}
        assert [(one["encoding"], one["schemaName"]) for one in drawing.values()] == [
            ("protobuf", "foxglove.FrameTransforms"),
            ("protobuf", "foxglove.SceneUpdate"),
        ]
        assert listening(server.process.pid) == {("0100007F", server.port)}


def decoded(channel: dict[str, Any], payload: bytes) -> Any:  # noqa: ANN401 - a generated type
    """Decode a message by the definition in its channel alone, as Foxglove does."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    return store.deserialize_cdr(payload, channel["schemaName"])


async def test_messages_arrive_as_the_robot_sent_them(tmp_path: Path) -> None:
    async with standing(tmp_path) as (subject, server):
        assert subject.bus is not None
        own = subject.bus.subscribe(topics.ODOM, depth=5000)
        async with subscribed(server, CMD_VEL, ODOM, SCAN, STATUS) as client:
            heard = await client.heard_for(1.0)
        sent = {arrival.payload for arrival in own.take_raw()}
        last = {topic: decoded(client.channels[topic], heard[topic][-1][1]) for topic in heard}
    assert len(heard[ODOM]) > 20
    assert {payload for _, payload in heard[ODOM]} <= sent
    assert (last[CMD_VEL].linear.x, last[CMD_VEL].angular.z) == (0.0, 0.0)
    assert (last[ODOM].header.frame_id, last[ODOM].child_frame_id) == ("odom", "base_link")
    assert (last[SCAN].header.frame_id, len(last[SCAN].ranges)) == ("lidar", 360)
    assert "NO_COMMAND" in last[STATUS].reasons
    for times_ns in ([time_ns for time_ns, _ in messages] for messages in heard.values()):
        assert times_ns == sorted(times_ns)


def text(fields: Fields, number: int) -> str:
    return fields[number][0].decode()


def radii_of(scene: bytes) -> dict[str, float]:
    """Return the radius of each round line [m]; checks that all lines are fixed to the base."""
    radii: dict[str, float] = {}
    for entity in map(protobuf_fields, protobuf_fields(scene)[2]):
        assert text(entity, 2) == "base_link"
        (line,) = entity[11]
        points = [protobuf_fields(point) for point in protobuf_fields(line)[5]]
        distances = [math.hypot(*(point.get(axis, [0.0])[0] for axis in (1, 2))) for point in points]
        assert max(distances) - min(distances) < 1e-9
        radii[text(entity, 3)] = distances[0]
    return radii


async def test_the_drawing_connects_the_frames_of_the_messages_and_has_the_configured_rings(
    tmp_path: Path,
) -> None:
    async with standing(tmp_path) as (_, server), subscribed(server, TF, SCENE) as client:
        heard = await client.heard_for(2.5)
    transforms = [
        protobuf_fields(transform)
        for _, payload in heard[TF]
        for transform in protobuf_fields(payload).get(1, [])
    ]
    assert {(text(one, 2), text(one, 3)) for one in transforms} == {
        ("odom", "base_link"),
        ("base_link", "lidar"),
    }
    assert radii_of(heard[SCENE][-1][1]) == pytest.approx({"hull": 0.25, "stop": 0.55, "warning": 0.75})


async def test_messages_parameters_and_calls_of_a_client_are_refused_and_reach_no_topic(
    tmp_path: Path,
) -> None:
    motion = encode(planar_twist(0.5, 0.0))
    advertisement = {"id": 1, "topic": "/robot/teleop/cmd_vel", "encoding": "cdr", "schemaName": "x"}
    async with standing(tmp_path) as (subject, server), subscribed(server, STATUS) as client:
        assert subject.bus is not None
        commands = subject.bus.subscribe(topics.source_cmd_vel(topics.TELEOP), depth=100)
        subject.outputs.clear()
        for request, answer in (
            (json.dumps({"op": "advertise", "channels": [advertisement]}), "does not support clientPublish"),
            (struct.pack("<BI", CLIENT_MESSAGE, 1) + motion, "Unknown channel"),
            (json.dumps({"op": "getParameters", "parameterNames": []}), "does not support parameters"),
            (
                json.dumps({"op": "setParameters", "parameters": [{"name": "x", "value": 1}]}),
                "does not support parameters",
            ),
            (struct.pack("<BIII", SERVICE_CALL, 1, 1, 3) + b"cdr", "does not support services"),
        ):
            assert answer in (await client.answer_to(request))["message"]
        await subject.until(lambda: len(subject.outputs) >= 25, "25 commands of the supervisor")
        assert commands.take() == []
        assert all(is_zero(twist) for _, twist in subject.outputs)
        await client.next_of(STATUS)
        _, code, errors = await server.interrupted()
    assert (code, errors) == (0, b"")


@pytest.mark.timed
async def test_a_client_that_never_reads_slows_nobody_and_the_scans_keep_their_rate(tmp_path: Path) -> None:
    async with standing(tmp_path) as (_, server):
        async with socket_that_never_reads(server) as (transport, names), subscribed(server, SCAN) as client:
            await client.heard_for(2.0)  # the other client's buffers are full by then
            heard = (await client.heard_for(10.0))[SCAN]
            late_s = (time.time_ns() - heard[-1][0]) * 1e-9
            rate_hz = len(heard) / 10.0
            pending = unsent(server.port)
            assert not transport.is_closing()
        took_s, code, errors = await server.interrupted()
    say(
        f"{rate_hz:.2f} scans/s, the last one {1000 * late_s:.0f} ms ago, while {pending:,} bytes on {names} topics "
        f"wait for a client; ended {took_s:.3f} s after SIGINT"
    )
    assert pending > 10_000
    assert rate_hz == pytest.approx(20.0, rel=0.05)
    assert late_s < 0.5
    assert took_s < 0.2
    assert (code, errors) == (0, b"")


def unsent(port: int) -> int:
    """Return the largest number of bytes that wait in the kernel to be sent by a connection of a server."""
    rows = [row.split() for row in Path("/proc/self/net/tcp").read_text().splitlines()[1:]]
    return max(int(row[4].partition(":")[0], 16) for row in rows if row[1] == f"0100007F:{port:04X}")


@asynccontextmanager
async def socket_that_never_reads(server: Served) -> AsyncGenerator[tuple[asyncio.Transport, int]]:
    """A client that subscribes to all topics and reads nothing after that; and the number of its topics."""
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    small.setblocking(False)  # noqa: FBT003
    await asyncio.get_running_loop().sock_connect(small, ("127.0.0.1", server.port))
    async with asyncio.timeout(PATIENCE_S), foxglove_client(server.address, sock=small) as client:
        await client.until_advertised(*ALL)
        await client.subscribe(*client.channels)
        client.connection.transport.pause_reading()
        yield client.connection.transport, len(client.channels)
        client.connection.transport.abort()


async def test_after_a_restart_of_the_supervisor_its_new_configuration_is_drawn(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("[supervisor]\nstop_distance_m = 0.30\n")
    options = ("--config", str(file))
    async with robot(tmp_path, topics.SUPERVISOR, teleop=False, config=file) as subject:
        await subject.until(lambda: subject.status.reasons != [], "a status")
        async with (
            served(subject.endpoint, *options, "--listen", "127.0.0.1:0") as server,
            subscribed(server, STATUS, SCENE) as client,
        ):
            assert radii_of((await client.next_of(SCENE))[1])["stop"] == pytest.approx(0.55)
            subject.kill(topics.SUPERVISOR)
            file.write_text("[supervisor]\nstop_distance_m = 0.40\n")
            subject.start(topics.SUPERVISOR, *options)
            while radii_of((await client.next_of(SCENE))[1])["stop"] != pytest.approx(0.65):
                pass
            await client.next_of(STATUS)
            _, code, errors = await server.interrupted()
    assert (code, errors) == (0, b"")


async def test_a_server_that_starts_first_serves_as_soon_as_the_supervisor_runs(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    async with served(endpoint) as server:
        async with foxglove_client(server.address):
            pass  # the next client must not depend on this one
        subject = Robot(endpoint, tmp_path)
        try:
            subject.start(topics.SUPERVISOR)
            async with subscribed(server, STATUS, CMD_VEL):
                pass
        finally:
            subject.kill(topics.SUPERVISOR)


async def test_a_server_without_a_supervisor_ends_at_once(tmp_path: Path) -> None:
    async with served(free_endpoint()) as server:
        took_s, code, errors = await server.interrupted()
    say(f"ended {took_s:.3f} s after SIGINT")
    assert (code, errors) == (0, b"")


@pytest.mark.parametrize(
    ("listen", "sentence"),
    [
        ("127.0.0.1:{taken}", "port {taken} on 127.0.0.1 is in use by another program: choose another port"),
        ("192.0.2.1:0", "cannot listen on 192.0.2.1:0 (Cannot assign requested address): choose an address"),
        ("8765", "--listen '8765' is not an address: use HOST:PORT"),
    ],
)
def test_an_address_on_which_it_cannot_serve_is_refused_in_one_sentence(listen: str, sentence: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        ended = subprocess.run(
            lifeline("foxglove", "--listen", listen.format(taken=port)),
            capture_output=True,
            check=False,
            text=True,
            timeout=PATIENCE_S,
        )
    assert ended.returncode == EXIT_REFUSED
    assert ended.stderr.startswith(f"lifeline: {sentence.format(taken=port)}")
    assert ended.stderr.count("\n") == 1
