"""Links with certificates, over TLS and over QUIC: who connects, who is refused and is told why, and what an end of a certificate ends."""

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Callable, Generator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import pytest
import zenoh

from deploy.keys import certificates
from tests.system.authority import TestAuthority, secure_endpoint
from wire import tls, topics
from wire.bundle import read_bundle
from wire.bus import BusError
from wire.messages import planar_twist
from wire.roles import Role
from wire.zenoh.bus import BusConfig, ZenohBus, open_bus

WITHIN_S = 60.0
"""Time limit for expected events on a loaded machine: a refused client first tries twice, and waits 10 s after a vain attempt."""
LIFETIME_S = 4.0
"""Of a certificate that ends during a test; long enough to connect with it on a loaded machine."""
LIFELINE = str(Path(sys.executable).with_name("lifeline"))
PROTOCOLS = ["tls", "quic"]


@pytest.fixture
def ours(tmp_path: Path) -> TestAuthority:
    return TestAuthority(tmp_path)


@pytest.fixture
def theirs(tmp_path: Path) -> TestAuthority:
    (tmp_path / "theirs").mkdir()
    return TestAuthority(tmp_path / "theirs")


@asynccontextmanager
async def opened(config: BusConfig, role: str, said: list[str] | None = None) -> AsyncGenerator[ZenohBus]:
    said = [] if said is None else said
    bus = await asyncio.wait_for(
        open_bus(config, "hub" if role == "hub" else "client", say=said.append),
        WITHIN_S,
    )
    try:
        yield bus
    finally:
        await bus.close()


async def until(condition: Callable[[], object], what: str) -> None:
    deadline_s = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < deadline_s, f"not within {WITHIN_S:g} s: {what}"
        await asyncio.sleep(0.01)


async def refusal(config: BusConfig) -> str:
    """Return why a client is refused."""
    with pytest.raises(BusError) as caught:
        async with opened(config, "client"):
            pass
    assert "\n" not in str(caught.value)
    return str(caught.value)


@contextmanager
def supervisor(directory: Path, endpoint: str, keys: Path) -> Generator[Callable[[], str]]:
    """Run the supervisor until it listens; give its output so far."""
    output = directory / "supervisor.log"
    with output.open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "supervisor", "--endpoint", endpoint, "--keys", keys],
            stdout=log,
            stderr=log,
            env={**os.environ, "LIFELINE_STATE_DIR": str(directory / "state")},
        )
    try:
        deadline_s = time.monotonic() + WITHIN_S
        while "listening" not in output.read_text():
            assert time.monotonic() < deadline_s, output.read_text()
            assert process.poll() is None, output.read_text()
            time.sleep(0.02)
        yield output.read_text
    finally:
        process.terminate()
        process.wait(WITHIN_S)


def bare_client(endpoint: str, keys: Path | None, **changes: object) -> zenoh.Session:
    """Open a bare session, with the settings of a client of ours and some changes."""
    values: dict[str, object] = {
        "mode": "client",
        "connect/endpoints": [tls.zenoh_endpoint(endpoint)],
        "connect/timeout_ms": 0,
        "scouting/multicast/enabled": False,
    }
    if keys is not None:
        values["transport/link/tls"] = {**tls.settings(read_bundle(keys, time.time())), **changes}
    settings = zenoh.Config()
    for key, value in values.items():
        settings.insert_json5(key, json.dumps(value))
    return zenoh.open(settings)


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_two_bundles_of_one_authority_connect(ours: TestAuthority, protocol: str) -> None:
    endpoint = secure_endpoint(protocol)
    hub_config = BusConfig(endpoint, keys=ours.bundle("robot7", Role.SUPERVISOR))
    client_config = BusConfig(endpoint, keys=ours.bundle("alice", Role.OPERATOR))
    async with opened(hub_config, "hub") as hub, opened(client_config, "client") as client:
        topic = topics.source_cmd_vel("teleop")
        commands, publisher = hub.subscribe(topic, depth=100), client.publisher(topic)

        def came() -> bool:
            publisher.put(planar_twist(0.25, 0.0))
            return any(arrival.message == planar_twist(0.25, 0.0) for arrival in commands.take())

        await until(came, "a command")


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_link_over_quic_has_datagrams_beside_its_streams(ours: TestAuthority, protocol: str) -> None:
    endpoint = secure_endpoint(protocol)
    async with opened(BusConfig(endpoint, keys=ours.bundle("robot7", Role.SUPERVISOR)), "hub"):
        with bare_client(endpoint, ours.bundle("alice", Role.OPERATOR)) as session:
            links = session.info.links()
            assert {link.auth_identifier for link in links} == {"supervisor@robot"}
            assert sorted(link.is_streamed for link in links) == (
                [False, True] if protocol == "quic" else [True]
            )


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_another_authority_is_refused_and_both_sides_say_so(
    ours: TestAuthority, theirs: TestAuthority, tmp_path: Path, protocol: str
) -> None:
    endpoint = secure_endpoint(protocol)
    with supervisor(tmp_path, endpoint, ours.bundle("robot7", Role.SUPERVISOR)) as log:
        sentence = await refusal(BusConfig(endpoint, keys=theirs.bundle("mallory", Role.OPERATOR)))
        assert sentence.startswith(f"cannot connect to {endpoint}: ")
        assert "the supervisor's certificate is from another authority" in sentence
        await until(lambda: "its bundle is from another authority" in log(), "the supervisor's sentence")
        async with opened(BusConfig(endpoint, keys=ours.bundle("alice", Role.OPERATOR)), "client"):
            await until(lambda: "operator@robot connected at" in log(), "the name of a client")


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_program_that_is_refused_ends_with_one_sentence(
    ours: TestAuthority, theirs: TestAuthority, tmp_path: Path, protocol: str
) -> None:
    endpoint, bundle = secure_endpoint(protocol), theirs.bundle("mallory", Role.BASE)
    with supervisor(tmp_path, endpoint, ours.bundle("robot7", Role.SUPERVISOR)):
        options = ["--no-viewer", "--endpoint", endpoint, "--keys", str(bundle)]
        ended = await asyncio.to_thread(
            subprocess.run,
            [sys.executable, "-m", "sim", *options],
            capture_output=True,
            text=True,
            timeout=WITHIN_S,
            check=False,
        )
    assert ended.returncode == 1
    assert ended.stderr.splitlines()[-1].startswith(
        f"sim: cannot connect to {endpoint}: the supervisor's certificate"
    )
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["estop"], 2),
        (["doctor", "--json"], 1),
        (["status"], 2),
        (["topic", "list"], 2),
        (["fleet", "list"], 2),
    ],
    ids=["estop", "doctor", "status", "topic", "fleet"],
)
def test_every_command_names_the_certificate_that_is_refused(
    ours: TestAuthority, theirs: TestAuthority, tmp_path: Path, protocol: str, words: list[str], code: int
) -> None:
    endpoint = secure_endpoint(protocol)
    bundle = theirs.bundle("mallory", Role.OPERATOR, robot="any")
    with supervisor(tmp_path, endpoint, ours.bundle("robot7", Role.SUPERVISOR)):
        ended = lifeline(*words, "--endpoint", endpoint, "--keys", bundle)
    if words[0] == "doctor":
        (problem,) = (one for one in json.loads(ended.stdout) if one["check"] == "supervisor")
        said = problem["what"]
    else:
        said = ended.stderr
        assert len(said.splitlines()) == 1, said
    assert ended.returncode == code
    assert (
        f"cannot connect to {endpoint}: the supervisor's certificate is from another authority: copy a "
        in said
    )
    assert f"this program used the certificate of mallory in {bundle}" in said


@pytest.mark.parametrize("words", [["status"], ["estop"]], ids=["status", "estop"])
def test_a_bundle_that_others_can_change_is_refused_with_its_repair(
    ours: TestAuthority, words: list[str]
) -> None:
    bundle = ours.bundle("anna", Role.OPERATOR, robot="any")
    bundle.chmod(0o777)
    ended = lifeline(*words, "--endpoint", secure_endpoint("tls"), "--keys", bundle)
    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    assert (
        f"{bundle} has mode 0777, so that other users can change it: run `chmod 755 {bundle}`" in ended.stderr
    )


@pytest.mark.parametrize("options", [[], ["--name", "door"]], ids=["once", "station"])
def test_an_estop_with_a_certificate_that_may_not_stop_says_so(
    ours: TestAuthority, options: list[str]
) -> None:
    vera = ours.bundle("vera", Role.VIEWER)
    done = lifeline("estop", "--endpoint", secure_endpoint("tls"), "--keys", vera, *options)
    assert done.returncode == 2
    assert "the certificate of vera has the role viewer, which may not stop: issue one with " in done.stderr
    assert ("lifeline: NOT stopped: " in done.stderr) is not bool(options)
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.smoke
@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_client_without_a_certificate_or_with_a_foreign_one_is_refused(
    ours: TestAuthority, theirs: TestAuthority, tmp_path: Path, protocol: str
) -> None:
    """The bundles of our programs are checked before they connect; others send what they like."""
    endpoint = secure_endpoint(protocol)
    alice, mallory = ours.bundle("alice", Role.OPERATOR), theirs.bundle("mallory", Role.OPERATOR)
    with supervisor(tmp_path, endpoint, ours.bundle("robot7", Role.SUPERVISOR)) as log:
        with pytest.raises(zenoh.ZError):
            bare_client(endpoint, alice, enable_mtls=False)
        await until(lambda: "a client was refused: it has no certificate" in log(), "a sentence")
        with pytest.raises(zenoh.ZError):
            bare_client(endpoint, mallory, root_ca_certificate=str(alice / "authority.pem"))
        await until(
            lambda: "a client was refused: its certificate is from another authority" in log(), "a sentence"
        )
        with pytest.raises(zenoh.ZError):
            bare_client(endpoint.replace(protocol, "tcp"), None)
        assert "connected at" not in log()


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_supervisor_under_another_name_is_refused(
    ours: TestAuthority, tmp_path: Path, protocol: str
) -> None:
    endpoint = secure_endpoint(protocol)
    everywhere = endpoint.replace("127.0.0.1", "0.0.0.0")
    with supervisor(tmp_path, everywhere, ours.bundle("robot7", Role.SUPERVISOR)) as log:
        config = BusConfig(
            endpoint.replace("127.0.0.1", "127.0.0.2"), keys=ours.bundle("alice", Role.OPERATOR)
        )
        assert "is not for this host" in await refusal(config)
        await until(lambda: "it is not for the host to which the client connects" in log(), "a sentence")


@pytest.mark.parametrize("server", ["web", "page", "driver"])
@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_server_of_another_role_is_refused_at_once_and_after_a_reconnect(
    ours: TestAuthority, monkeypatch: pytest.MonkeyPatch, protocol: str, server: str
) -> None:
    """Zenoh also trusts the public authorities of the web, which certify any host of their customers.

    An e-stop station and an operator may serve a page at a host, but are no hubs.
    """
    endpoint, alice = secure_endpoint(protocol), ours.bundle("alice", Role.OPERATOR)
    robot7 = BusConfig(endpoint, keys=ours.bundle("robot7", Role.SUPERVISOR))

    def on_the_web(_role: Role, _robot: str) -> str:
        return "www.example.org"

    with monkeypatch.context() as patch:
        if server == "web":
            patch.setattr(certificates, "common_name", on_the_web)
        role = {"web": Role.SUPERVISOR, "page": Role.ESTOP, "driver": Role.OPERATOR}[server]
        bundle = ours.bundle(server, role, hosts=("robot7",))
    own = tls.settings(read_bundle(robot7.keys or Path(), time.time()))
    own |= {
        "listen_certificate": str(bundle / f"{server}.pem"),
        "listen_private_key": str(bundle / f"{server}.key"),
    }
    values: dict[str, object] = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "listen/endpoints": [tls.zenoh_endpoint(endpoint)],
        "transport/link/tls": own,
    }
    settings = zenoh.Config()
    for key, value in values.items():
        settings.insert_json5(key, json.dumps(value))
    with await asyncio.to_thread(zenoh.open, settings):
        assert tls.NOT_A_HUB in await refusal(BusConfig(endpoint, keys=alice))
    said: list[str] = []
    hub = await _as_soon_as_the_port_is_free(robot7)
    async with opened(BusConfig(endpoint, keys=alice), "client", said):
        await hub.close()
        with await _open_as_soon_as_the_port_is_free(settings) as impostor:
            await until(lambda: said, "that the client notices the impostor")
            assert tls.NOT_A_HUB in said[0]
            await until(lambda: not impostor.info.links(), "that the client closes the link")


async def _as_soon_as_the_port_is_free(config: BusConfig) -> ZenohBus:
    """Open a hub; Zenoh closes the socket of QUIC some time after its session."""
    deadline_s = time.monotonic() + WITHIN_S
    while True:
        try:
            return await open_bus(config, "hub")
        except BusError:
            assert time.monotonic() < deadline_s
            await asyncio.sleep(0.05)


async def _open_as_soon_as_the_port_is_free(settings: zenoh.Config) -> zenoh.Session:
    """Open a bare hub, likewise."""
    deadline_s = time.monotonic() + WITHIN_S
    while True:
        try:
            return await asyncio.to_thread(zenoh.open, settings)
        except zenoh.ZError:
            assert time.monotonic() < deadline_s
            await asyncio.sleep(0.05)


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_a_certificate_that_expires_closes_its_link_and_a_new_one_opens_it_again(
    ours: TestAuthority, tmp_path: Path, protocol: str
) -> None:
    endpoint = secure_endpoint(protocol)
    said: list[str] = []
    with supervisor(tmp_path, endpoint, ours.bundle("robot7", Role.SUPERVISOR)) as log:
        alice = ours.bundle("alice", Role.OPERATOR, LIFETIME_S)
        ends_s = read_bundle(alice, time.time()).ends_s
        async with opened(BusConfig(endpoint, keys=alice), "client", said):
            assert "the certificate of alice ends in 0.0 hours" in said[0]
            await until(lambda: "operator@robot connected" in log(), "the link")
            await until(lambda: len(said) == 2, "that the client notices the end")
            assert ends_s <= time.time() < ends_s + WITHIN_S
            assert "the link is closed, because the certificate of alice has expired" in said[1]
            await until(lambda: "operator@robot disconnected" in log(), "that the link is closed")
            await until(
                lambda: "a client was refused: its certificate has expired" in log(), "that it stays closed"
            )
            # Before, within the second of the end, links are accepted and closed at once.
            before = log().count("operator@robot connected")
            assert ours.bundle("alice", Role.OPERATOR) == alice
            await until(
                lambda: log().count("operator@robot connected") > before, "the link with the new certificate"
            )


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_when_the_supervisors_certificate_expires_all_links_close(
    ours: TestAuthority, protocol: str
) -> None:
    endpoint = secure_endpoint(protocol)
    alice = ours.bundle("alice", Role.OPERATOR)
    hub_said: list[str] = []
    robot7 = BusConfig(endpoint, keys=ours.bundle("robot7", Role.SUPERVISOR, LIFETIME_S))
    ends_s = read_bundle(robot7.keys or Path(), time.time()).ends_s
    async with opened(robot7, "hub", hub_said) as hub:
        changes = hub.watch_alive()
        async with opened(BusConfig(endpoint, keys=alice), "client") as client:
            client.declare_alive("teleop")
            states: list[bool] = []

            def is_lost() -> bool:
                states.extend(change.alive for change in changes.take())
                return False in states

            # TLS compares whole seconds: within this one, the client may connect again, and Zenoh leaves that link open.
            await until(is_lost, "that the token of the client was gone")
            assert states[0]
        await until(lambda: len(hub_said) == 2, "that the supervisor says why")
        assert "robot7 has expired" in hub_said[1]
        assert "restart the supervisor" in hub_said[1]
        await until(lambda: time.time() > ends_s + 1.0, "the second after the end")
        assert "the supervisor's certificate has expired" in await refusal(BusConfig(endpoint, keys=alice))


def test_a_refused_start_is_one_sentence(ours: TestAuthority, tmp_path: Path) -> None:
    endpoint = secure_endpoint("quic")
    expired = ours.bundle("old", Role.SUPERVISOR, -1.0)
    hub, viewer = ours.bundle("robot7", Role.SUPERVISOR), ours.bundle("vera", Role.VIEWER)
    r8 = ours.bundle("robot8", Role.SUPERVISOR, robot="r8")
    readable = ours.bundle("open", Role.SUPERVISOR)
    (readable / "open.key").chmod(0o644)
    for options, code, sentence in (
        ([], 2, "needs certificates: make them with `lifeline keys`"),
        (["--keys", tmp_path / "none"], 1, "there is no bundle of keys at"),
        (["--keys", expired], 1, "the certificate of old .* expired on"),
        (["--keys", viewer], 1, "has the role viewer: the supervisor needs"),
        (["--keys", r8], 1, "is for the robot r8, not for robot"),
        (["--keys", readable], 1, "has mode 0644, so that other users can read it: run `chmod 600"),
    ):
        ended = subprocess.run(
            [sys.executable, "-m", "supervisor", "--endpoint", endpoint, *options],
            capture_output=True,
            text=True,
            timeout=WITHIN_S,
            check=False,
            env={**os.environ, "LIFELINE_STATE_DIR": str(tmp_path / "state")},
        )
        assert ended.returncode == code, ended.stderr
        assert ended.stdout == ""
        assert re.search(sentence, ended.stderr), ended.stderr
        assert len(ended.stderr.splitlines()) == (2 if code == 2 else 1), ended.stderr
    assert hub.is_dir()


def lifeline(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [LIFELINE, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=WITHIN_S,
        check=False,
    )


@pytest.mark.smoke
def test_the_commands_make_list_and_revoke_certificates(tmp_path: Path) -> None:
    keys = ["--keys", tmp_path / "keys"]
    early = lifeline("keys", "issue", "alice", "--role", "operator", *keys)
    assert (early.returncode, early.stdout) == (2, "")
    assert early.stderr.count("\n") == 1
    assert "run `lifeline keys init` first" in early.stderr
    assert lifeline("keys", "init", *keys).returncode == 0
    again = lifeline("keys", "init", *keys)
    assert again.returncode == 2
    assert "--replace" in again.stderr
    hub = lifeline(
        "keys",
        "issue",
        "robot7",
        "--role",
        "supervisor",
        "--host",
        "robot7",
        "--host",
        "10.0.0.7",
        "--json",
        *keys,
    )
    assert json.loads(hub.stdout)["hosts"] == ["robot7", "10.0.0.7", "localhost", "127.0.0.1", "::1"]
    alice = lifeline("keys", "issue", "alice", "--role", "operator", "--robot", "any", "--days", "2", *keys)
    assert "operator@any until" in alice.stdout
    assert read_bundle(tmp_path / "keys" / "bundles" / "alice", time.time()).namespace == "any"
    listed = lifeline("keys", "list", *keys)
    assert listed.returncode == 0
    assert "warning: alice ends on" in listed.stdout
    assert [row["name"] for row in json.loads(lifeline("keys", "list", "--json", *keys).stdout)] == [
        "alice",
        "robot7",
    ]
    revoked = lifeline("keys", "revoke", "alice", *keys)
    assert "connects until" in revoked.stdout
    assert "keys init --replace" in revoked.stdout
    renewed = lifeline("keys", "issue", "alice", *keys)
    assert (renewed.returncode, renewed.stderr.count("\n")) == (2, 1)
    assert lifeline("keys", "issue", "robot7", *keys).returncode == 0


def test_the_help_teaches_the_first_steps() -> None:
    text = " ".join(lifeline("keys", "--help").stdout.split())
    for step in (
        "keys init",
        "keys issue robot7 --role supervisor",
        "keys issue alice --role operator",
        "--keys",
    ):
        assert step in text
    roles = " ".join(lifeline("keys", "issue", "--help").stdout.split())
    assert all(role in roles for role in Role)
