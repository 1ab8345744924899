"""A program that plays the supervisor at its endpoint: another user's moves nothing, and is believed by nobody (decision 0060)."""

import asyncio
import os
import sys
import tempfile
import threading
import time
from collections.abc import AsyncGenerator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import zenoh

from tests.system.harness import PATIENCE_S, Robot, patiently, robot
from tests.system.operators import until
from tests.system.ports import free_endpoint
from wire import topics
from wire.access import LOCAL_ROLES
from wire.bus_config import BusConfig
from wire.zenoh import hub_proof, local_socket
from wire.zenoh.bus import open_bus
from wire.zenoh.connect import open_session
from wire.zenoh.hub_proof import HubProof
from wire.zenoh.session import ZenohSession

LIFELINE = Path(sys.executable).with_name("lifeline")
ROOT, STRANGER = 0, 65533
SPEED_M_S = 0.6
FOR_S = 2.0
needs_root = pytest.mark.skipif(os.getuid() != ROOT, reason="needs root, to become another user")


@dataclass
class FakeHub:
    """A hub as a process of a user."""

    process: asyncio.subprocess.Process

    async def heard(self) -> tuple[int, float]:
        """Return how many odometry messages it has heard since the last call, and the fastest speed in them."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(b"\n")
        count, fastest_m_s = (await asyncio.wait_for(self.process.stdout.readline(), PATIENCE_S)).split()
        return int(count), float(fastest_m_s)

    async def drives(self) -> None:
        """Wait until the base follows it."""
        await self._until(lambda heard, fastest_m_s: heard > 0 and fastest_m_s > 0.9 * SPEED_M_S)

    async def stands(self) -> None:
        """Wait until the base stands and is heard."""
        await self._until(lambda heard, fastest_m_s: heard > 0 and fastest_m_s < 0.02)

    async def _until(self, condition: Callable[[int, float], bool]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            heard = await self.heard()
            while not condition(*heard):
                await asyncio.sleep(0.05)
                heard = await self.heard()


@asynccontextmanager
async def fake_hub(endpoint: str, user: int, run_directory: Path) -> AsyncGenerator[FakeHub]:
    """A fake hub that listens at an endpoint; its socket, if it can make one, is in `run_directory`."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.system.fake_hub", endpoint, str(user), str(SPEED_M_S)),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=os.environ | {local_socket.ENVIRONMENT: str(run_directory)},
    )
    assert process.stdout is not None
    try:
        assert await asyncio.wait_for(process.stdout.readline(), PATIENCE_S) == b"listens\n"
        yield FakeHub(process)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A directory for the socket of a fake hub, which no client of this test looks into."""
    path = tmp_path / "elsewhere"
    path.mkdir(mode=0o700)
    return path


@pytest.fixture
def theirs() -> Iterator[Path]:
    """A directory of the other user, where that user can listen; pytest's own directories admit only root."""
    with tempfile.TemporaryDirectory() as name:
        os.chown(name, STRANGER, STRANGER)
        yield Path(name)


async def said(log: Path, words: str) -> None:
    await until(lambda: words in log.read_text(), PATIENCE_S)


def refusals(log: Path) -> int:
    return log.read_text().count("refused the hub at")


@needs_root
async def test_a_base_does_not_move_for_another_user_who_took_the_port_before_the_supervisor(
    tmp_path: Path, elsewhere: Path
) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    log = tmp_path / "sim.log"
    try:
        async with fake_hub(subject.endpoint, STRANGER, elsewhere) as fake:
            subject.start(topics.SIM)
            await said(log, f"it is a program of the user {STRANGER}")
            await asyncio.sleep(FOR_S)
            assert await fake.heard() == (0, 0.0), "it is not even heard"
        assert refusals(log) == 1
        subject.start(topics.SUPERVISOR)
        await subject.observe()
        subject.start_teleop()
        await subject.drive()
    finally:
        await subject.close()


async def test_a_base_follows_a_hub_of_its_own_user_at_the_tcp_endpoint(
    tmp_path: Path, elsewhere: Path
) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    try:
        async with fake_hub(subject.endpoint, os.getuid(), elsewhere) as fake:
            subject.start(topics.SIM)
            await fake.drives()
    finally:
        await subject.close()


@needs_root
async def test_a_base_that_reconnects_to_another_user_at_the_same_port_stays_braked_until_that_hub_is_gone(
    tmp_path: Path, elsewhere: Path
) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    log = tmp_path / "sim.log"
    try:
        async with fake_hub(subject.endpoint, ROOT, elsewhere) as first:
            subject.start(topics.SIM)
            await first.drives()
        for _ in range(2):
            async with fake_hub(subject.endpoint, STRANGER, elsewhere) as fake:
                await said(log, "refused the hub at")
                await fake.stands()
                await asyncio.sleep(FOR_S)
                heard, fastest_m_s = await fake.heard()
                assert (heard > 0, fastest_m_s) == (True, pytest.approx(0.0, abs=0.02))
        assert refusals(log) == 1
        async with fake_hub(subject.endpoint, ROOT, elsewhere) as last:
            await last.drives()
    finally:
        await subject.close()


@needs_root
async def test_the_user_of_the_configuration_may_run_the_hub(tmp_path: Path, elsewhere: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'[bus]\nhub_user = "{STRANGER}"\n')
    subject = Robot(free_endpoint(), tmp_path)
    try:
        async with fake_hub(subject.endpoint, STRANGER, elsewhere) as fake:
            subject.start(topics.SIM, "--config", str(config))
            await fake.drives()
    finally:
        await subject.close()


@needs_root
async def test_a_socket_in_a_directory_of_another_user_leads_to_no_hub(
    monkeypatch: pytest.MonkeyPatch, theirs: Path
) -> None:
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(theirs))
    endpoint, sentences = free_endpoint(), list[str]()
    config = BusConfig(endpoint)
    async with fake_hub(endpoint, STRANGER, theirs):
        path = local_socket.socket_of(endpoint)
        assert path is not None
        assert local_socket.answers(path)
        opening = asyncio.ensure_future(open_bus(config, "client", proof=HubProof(config, sentences.append)))
        await until(lambda: sentences, PATIENCE_S)
        _, waiting = await asyncio.wait({opening}, timeout=FOR_S)
        opening.cancel()
        assert waiting
        assert [f"the user {STRANGER}" in one for one in sentences] == [True]


@needs_root
async def test_teleop_shows_whose_hub_it_refuses_and_drives_as_soon_as_the_supervisor_is_there(
    tmp_path: Path, elsewhere: Path
) -> None:
    subject = Robot(free_endpoint(), tmp_path)
    try:
        async with fake_hub(subject.endpoint, STRANGER, elsewhere):
            subject.start_teleop()
            terminal = subject.terminal
            assert terminal is not None
            await until(lambda: "refused the hub" in terminal.picture, PATIENCE_S)
            assert not terminal.shows_status
        subject.start(topics.SUPERVISOR)
        subject.start(topics.SIM)
        await subject.observe()
        await subject.drive()
    finally:
        await subject.close()


@needs_root
async def test_an_emergency_stop_is_sent_to_any_hub_but_a_confirmation_of_another_user_does_not_count(
    elsewhere: Path,
) -> None:
    endpoint = free_endpoint()
    for user, code in ((STRANGER, 1), (ROOT, 0)):
        async with fake_hub(endpoint, user, elsewhere):

            async def attempt(code: int = code) -> str:
                """It is confirmed within a second, or not at all."""
                press = await asyncio.create_subprocess_exec(
                    *(LIFELINE, "estop", "--endpoint", endpoint), stderr=asyncio.subprocess.PIPE
                )
                _, errors = await asyncio.wait_for(press.communicate(), PATIENCE_S)
                assert press.returncode == code
                return errors.decode()

            errors = await patiently(attempt)
            if code:
                assert f"it is a program of the user {user}" in errors
                assert "NOT confirmed" in errors


@needs_root
async def test_a_program_that_only_reads_may_read_the_hub_of_another_user(elsewhere: Path) -> None:
    endpoint = free_endpoint()
    async with fake_hub(endpoint, STRANGER, elsewhere):
        bus = await asyncio.wait_for(open_bus(BusConfig(endpoint), "client"), PATIENCE_S)
        try:
            statuses = bus.subscribe(topics.STATUS)
            await until(lambda: statuses.latest() is not None, PATIENCE_S)
        finally:
            await bus.close()


@pytest.mark.parametrize("kind", ["unix", "tcp"])
async def test_no_sample_of_a_new_hub_counts_before_the_kernel_has_said_whose_it_is(
    monkeypatch: pytest.MonkeyPatch, elsewhere: Path, kind: str
) -> None:
    endpoint, heard = free_endpoint(), list[bytes]()
    config = BusConfig(endpoint, unproven=LOCAL_ROLES)
    with monkeypatch.context() as patch:
        if kind == "tcp":  # the client finds no socket
            patch.setenv(local_socket.ENVIRONMENT, str(elsewhere))
        hub = await open_session(config, "hub")
    proof = HubProof(config, print)
    client = ZenohSession(await open_session(config, "client", proof=proof), "robot", proof=proof)
    try:
        client.subscribe_raw("cmd_vel", lambda payload, _stamp, _arrival_s: heard.append(payload))
        await until(lambda: proof.holds)
        await put_until(hub, b"first", lambda: b"first" in heard)
        answer = threading.Event()

        def late(*_: str) -> int:
            answer.wait(PATIENCE_S)
            return os.getuid()

        monkeypatch.setattr(hub_proof, "tcp_user", late)
        monkeypatch.setattr(hub_proof, "unix_users", lambda path: [late(path)])  # pyright: ignore[reportUnknownLambdaType, reportUnknownArgumentType]
        hub.close()  # pyright: ignore[reportUnknownMemberType]
        await until(lambda: not proof.holds)
        with monkeypatch.context() as patch:
            if kind == "tcp":
                patch.setenv(local_socket.ENVIRONMENT, str(elsewhere))
            hub = await open_session(config, "hub")
        began_s = time.monotonic()
        await put_until(hub, b"second", lambda: time.monotonic() > began_s + 1.0)
        assert b"second" not in heard
        answer.set()
        await put_until(hub, b"third", lambda: b"third" in heard)
    finally:
        await client.close()
        hub.close()  # pyright: ignore[reportUnknownMemberType]


async def put_until(hub: zenoh.Session, payload: bytes, condition: Callable[[], bool]) -> None:
    """Put a payload on `cmd_vel` every millisecond until the condition holds."""
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            hub.put("robot/cmd_vel", payload)
            await asyncio.sleep(0.001)


@pytest.mark.smoke
async def test_a_restarted_supervisor_is_proven_again(tmp_path: Path) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        subject.kill(topics.SUPERVISOR)
        subject.start(topics.SUPERVISOR)
        await subject.drive()
        assert refusals(tmp_path / "sim.log") == 0
