"""The server of a station's page as a real process: presses, losses, garbage, foreign pages, and codes."""

import asyncio
import http.client
import json
import signal
import socket
import sys
import time
from contextlib import AsyncExitStack, suppress
from itertools import product
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from deploy.stack.launch import DEFAULT_CONFIG
from station.relay import MAX_PAGES
from station.visitors import MAX_VISITORS, VISIT_S
from teleop.station.state import Word
from tests.system.authority import TestAuthority
from tests.system.harness import Robot
from tests.system.namespaces import needs_namespaces
from tests.system.operators import LIMIT_S, Operator, until
from tests.system.pages import URL, Code, Server, closing_code, served
from tests.system.test_estop_stations import ESTOP, LIFELINE, LOST, drive, heard, refusal_of, refused, state
from wire import topics
from wire.host.installation import runnable
from wire.lease import LEASE_S
from wire.roles import Role

pytestmark = pytest.mark.timeout(180)


async def lost(subject: Robot) -> None:
    await subject.until(
        lambda: LOST in subject.status.causes and state(subject, "phone") == "lost", "its loss"
    )


@pytest.mark.smoke
async def test_a_press_latches_the_estop_and_a_closed_connection_is_the_loss_of_the_station(
    tmp_path: Path,
) -> None:
    async with served(tmp_path) as (subject, server):
        async with server.heard_page(subject) as page:
            await until(lambda: page.word is not Word.NOT_HEARD and page.view["required"])
            await page.press()
            await subject.until(lambda: ESTOP in subject.status.causes, "its press")
            await until(lambda: page.word is Word.STOPPED and page.lease.is_confirmed)
        await lost(subject)
        await until(lambda: "the connection to a page has ended" in server.output)


@pytest.mark.timed
async def test_a_robot_that_drives_stops_when_the_connection_of_the_page_closes(tmp_path: Path) -> None:
    async with (
        served(tmp_path, "supervisor", "sim", teleop=True) as (subject, server),
        server.heard_page(subject) as page,
    ):
        await drive(subject, "phone")
        closed_s = time.monotonic()
        page.socket.transport.abort()
        to_zero_s = await subject.zero_after(closed_s)
        print(f"\n    measured: a page's connection is cut to zero on cmd_vel: {to_zero_s * 1e3:.1f} ms")
        assert to_zero_s < LEASE_S
        await lost(subject)
        await refused(subject, "station phone is not heard")


async def test_a_page_that_is_silent_on_an_open_connection_loses_its_lease_and_then_its_connection(
    tmp_path: Path,
) -> None:
    async with served(tmp_path) as (subject, server), server.heard_page(subject) as page:
        page.hangs = True
        await lost(subject)
        assert await closing_code(page.socket) == Code.SILENT


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP])
async def test_a_server_that_ends_or_stops_is_the_loss_of_the_station(
    tmp_path: Path, number: signal.Signals
) -> None:
    async with served(tmp_path) as (subject, server), server.heard_page(subject) as page:
        server.send(number)
        await lost(subject)
        await until(lambda: page.word is Word.NOT_HEARD)
        if number == signal.SIGTERM:
            assert await server.ended() == (0, "")


@pytest.mark.timed  # a late process may lose its presence
async def test_a_terminal_that_accepts_no_output_does_not_end_the_lease(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server), server.heard_page(subject) as page:
        server.look(at=False)
        for _ in range(60):  # each prints a picture of 2 kB, until the terminal's buffer is full
            server.type(b"\r")
            await asyncio.sleep(0.02)
        await subject.never(lambda: state(subject, "phone") != "heard", "stopped by its terminal", 1.0)
        await page.press()
        await subject.until(lambda: ESTOP in subject.status.causes, "its press")
        server.look(at=True)


GARBAGE: list[str | bytes] = [
    b"\x00\xff",
    "{",
    '{"challenge": "1", "response": "2"}',
    '{"challenge": "1", "response": "2", "stop": false, "linear": 1.0}',
    '{"token": "again"}',
    "[" * 500,
]


async def test_garbage_ends_its_own_connection_only(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server):
        for message in GARBAGE:
            async with server.page() as page:
                await until(lambda page=page: page.token)
                await page.socket.send(message)
                assert await closing_code(page.socket) == Code.BAD_MESSAGE
            async with server.socket() as unpaired:
                await unpaired.send(message)
                assert await closing_code(unpaired) in {Code.BAD_MESSAGE, Code.NOT_PAIRED}
        async with server.page() as page:
            await until(lambda: page.token)
            await page.socket.send("x" * 513)
            assert await closing_code(page.socket) == 1009
        async with server.page() as page:
            await until(lambda: page.token)
            for _ in range(1000):
                await page.send()
            assert await closing_code(page.socket) in {Code.BAD_MESSAGE, 1006}  # 1006: it sent on
        with socket.create_connection(("127.0.0.1", int(server.port))) as stream:
            stream.sendall(b"\x16\x03\x01\x02\x00garbage\r\n\r\n")
            assert stream.recv(1000).startswith(b"HTTP/1.1 400")
        async with server.heard_page(subject):
            server.send(signal.SIGTERM)
        _, errors = await server.ended()
        assert "Traceback" not in errors


def upgrade(server: Server) -> bytes:
    """The request that opens the page's websocket."""
    return (
        f"GET /lease HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nOrigin: {server.origin}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OTAxMjM0NQ==\r\n\r\n"
    ).encode()


async def test_strangers_keep_no_new_page_away_and_their_connections_end(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server):
        request = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n".encode()
        kinds = [b"", request, request + b"\r\n", request + b"Content-Length: 9\r\n\r\n", upgrade(server)]
        strangers: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = []
        for number in range(2 * MAX_VISITORS):
            strangers.append(await asyncio.open_connection("127.0.0.1", int(server.port)))
            strangers[-1][1].write(kinds[number % len(kinds)])
        page = http.client.HTTPConnection("127.0.0.1", int(server.port), timeout=LIMIT_S)
        page.request("GET", "/")
        assert page.getresponse().status == 200
        page.close()
        async with server.heard_page(subject):
            for reader, writer in strangers:
                with suppress(ConnectionResetError):
                    await asyncio.wait_for(reader.read(), VISIT_S + LIMIT_S)
                writer.close()
            await heard(subject, "phone")


@pytest.mark.timed  # a late process may lose its presence
@pytest.mark.parametrize("kind", ["pings", "texts", "requests"])
async def test_a_stranger_that_sends_much_is_cut_off_and_the_page_that_is_open_is_heard(
    tmp_path: Path, kind: str
) -> None:
    async with served(tmp_path) as (subject, server), server.heard_page(subject):
        reader, writer = await asyncio.open_connection("127.0.0.1", int(server.port))
        begin, repeated = {
            "pings": (upgrade(server), b"\x89\x80mask"),
            "texts": (upgrade(server), b"\x81\x81maskx"),
            "requests": (b"", f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode()),
        }[kind]
        writer.write(begin)

        async def flood() -> None:
            with suppress(ConnectionError):
                while True:
                    writer.write(repeated * 1000)
                    await writer.drain()

        flooding = asyncio.ensure_future(flood())
        with suppress(ConnectionError):
            await asyncio.wait_for(reader.read(), LIMIT_S)
        await flooding
        writer.close()
        await subject.never(lambda: LOST in subject.status.causes, "lost beside a stranger", 0.5)


async def test_pages_of_other_servers_and_names_are_refused(tmp_path: Path) -> None:
    async with served(tmp_path, drives=True) as (_, server):
        foreign = (None, "null", "http://evil.example", f"https://127.0.0.1:{server.port}")
        for origin, path in product(foreign, ("lease", "picture", "drive")):
            with pytest.raises(InvalidStatus, match="403"):
                async with server.socket(origin, path=path):
                    pytest.fail(f"{origin} was served at {path}")
        with pytest.raises(InvalidStatus, match="403"):
            async with server.socket(host="evil.example"):
                pytest.fail("a changed name was served")
        page = http.client.HTTPConnection("127.0.0.1", int(server.port))
        for path, headers, wanted in (
            ("/", {}, 200),
            ("/station.js", {}, 200),
            ("/", {"Host": f"evil.example:{server.port}"}, 403),
            ("/", {"Origin": "http://evil.example"}, 403),
            ("/../server.py", {}, 404),
        ):
            page.request("GET", path, headers=headers)
            response = page.getresponse()
            response.read()
            assert (path, response.status) == (path, wanted)
            assert str(response.getheader("content-security-policy")).startswith("default-src 'none'; ")
        page.close()


@pytest.mark.smoke
async def test_a_code_counts_once_whatever_others_guess(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server):
        code = (await server.new_address()).partition("#")[2]
        for _ in range(10):
            async with server.page(code="wrong") as guess:
                assert await closing_code(guess.socket) == Code.NOT_PAIRED
        async with server.page(code=code):
            await heard(subject, "phone")
            async with server.page(code=code) as second:
                assert await closing_code(second.socket) == Code.NOT_PAIRED


async def test_a_session_connects_again_in_the_place_of_its_old_connection(tmp_path: Path) -> None:
    async with served(tmp_path) as (subject, server), server.page() as page:
        await until(lambda: page.token)
        async with server.page(token=page.token) as again:
            await until(lambda: again.token)
            await page.send()
            assert await closing_code(page.socket) == Code.REPLACED
            await until(lambda: again.word is not Word.NOT_HEARD)
            await heard(subject, "phone")
        async with server.page(token="x" * 43) as stranger:
            assert await closing_code(stranger.socket) == Code.NOT_PAIRED


async def test_a_page_with_several_connections_has_one_place_in_the_queue_and_only_with_a_name(
    tmp_path: Path,
) -> None:
    zero = json.dumps({"linear": 0.0, "angular": 0.0, "time_s": 0.0, "picture": 0})
    async with served(tmp_path, drives=True) as (subject, server), server.heard_page(subject) as page:

        async def refused(hello: str) -> int:
            async with server.socket(path="drive") as socket:
                await socket.send(hello)
                return await closing_code(socket)

        hello = json.dumps({"token": page.token})
        for name in ("", " \t ", "\n"):
            await page.socket.send(json.dumps({"name": name}))
            assert await refused(hello) == Code.NO_NAME
        await page.socket.send(json.dumps({"name": "Anna"}))
        async with server.socket(path="drive") as driving:

            async def drive() -> None:
                await driving.send(hello)
                while True:
                    await driving.send(zero)
                    await asyncio.sleep(0.1)

            sending = asyncio.ensure_future(drive())
            try:
                await until(lambda: page.view["driver"] == "Anna")
                for _ in range(3):
                    assert await refused(hello) == Code.HAS_PLACE
                assert page.view["driver"] == "Anna"
                assert subject.bus is not None
                for _ in range(50):
                    await driving.send(json.dumps({"request": "reset"}))
                report = ""
                while "requested a reset" not in report:
                    report = (await subject.bus.call(topics.source_holder("teleop"))).message
                assert "Anna began to drive" in report, "a flood of requests is one request"
            finally:
                sending.cancel()


async def test_a_page_too_many_is_refused(tmp_path: Path) -> None:
    async with served(tmp_path) as (_, server), AsyncExitStack() as opened:
        for _ in range(MAX_PAGES):
            page = await opened.enter_async_context(server.page())
            await until(lambda page=page: page.token)
        async with server.page() as late:
            assert await closing_code(late.socket) == Code.TOO_MANY


def test_what_cannot_be_served_is_refused_in_one_sentence(tmp_path: Path) -> None:
    sentence = refusal_of(LIFELINE, "station", "--name", "front door")
    assert sentence.startswith("lifeline: 'front door' is not a name")
    with socket.create_server(("127.0.0.1", 0)) as busy:
        port = str(busy.getsockname()[1])
        sentence = refusal_of(LIFELINE, "station", "--port", port)
    assert f"port {port} on 127.0.0.1 is in use by another program" in sentence


NETWORK = "ip link set lo up && ip address add 10.77.0.1/32 dev lo && ip route add default dev lo src 10.77.0.1 && exec "
TO_STOP = "`lifeline keys issue phone-page --role estop --host 10.77.0.1`"
TO_DRIVE = "`lifeline keys issue phone-driver --role operator --host 10.77.0.1`"


@needs_namespaces
@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("", f"--open needs TLS: issue a certificate with {TO_STOP}, and name its bundle with --keys"),
        (
            "--keys {keys}/page",
            (
                "the certificate of page names no address at which other computers reach this one: add it with "
                "`lifeline keys issue page --host 10.77.0.1`"
            ),
        ),
        (
            "--keys {keys}/viewer",
            f"the certificate of viewer has the role viewer, which serves no page: issue one with {TO_STOP}",
        ),
        (
            "--keys {keys}/driver",
            "the certificate of driver has the role operator, which serves a page only with --drive: add --drive, or issue one with "
            + TO_STOP,
        ),
        (
            "--drive --keys {keys}/page --endpoint quic/127.0.0.1:7447",
            f"the certificate of page has the role estop, which may not drive: issue one with {TO_DRIVE}",
        ),
        (
            "--drive --keys {keys} --endpoint quic/127.0.0.1:7447",
            (
                "{keys} must have one bundle of the role operator for this process, but has page (estop), viewer (viewer): name one "
                f"with --keys, or issue it with {TO_DRIVE}"
            ),
        ),
        (
            "--keys {others} --endpoint quic/127.0.0.1:7447",
            (
                "{others} must have one bundle of the role estop for this process, but has base (base), other (viewer): name one with "
                f"--keys, or issue it with {TO_STOP}"
            ),
        ),
    ],
)
def test_a_certificate_that_cannot_serve_the_page_is_refused_with_the_command_that_issues_one(
    tmp_path: Path, options: str, sentence: str
) -> None:
    places = {"keys": tmp_path / "few", "others": tmp_path / "others"}
    ours = TestAuthority(tmp_path)
    for name, role, place in (
        ("page", Role.ESTOP, "keys"),
        ("viewer", Role.VIEWER, "keys"),
        ("base", Role.BASE, "others"),
        ("other", Role.VIEWER, "others"),
    ):
        places[place].mkdir(mode=0o700, exist_ok=True)
        ours.bundle(name, role).rename(places[place] / name)
    if "driver" in options:
        ours.bundle("driver", Role.OPERATOR, hosts=("10.77.0.1",)).rename(places["keys"] / "driver")
    station = f"{LIFELINE} station --open --config {DEFAULT_CONFIG} {options.format(**places)}"
    refusal = refusal_of("unshare", "--net", "sh", "-c", NETWORK + station)
    assert refusal == runnable(f"lifeline: {sentence.format(**places)}")


@needs_namespaces
def test_without_a_network_the_command_leaves_the_address_to_the_person_and_names_the_robot(
    tmp_path: Path,
) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[bus]\nnamespace = "r7"\n')
    refusal = refusal_of("unshare", "--net", LIFELINE, "station", "--open", "--config", str(config))
    assert "issue phone-page --role estop --robot r7 --host ADDRESS`" in refusal


CLIENT = """
import asyncio, json, socket, ssl, sys, urllib.request
from websockets.asyncio.client import connect
authority, code = sys.argv[1:]
trusting = ssl.create_default_context(cafile=authority)
async def main():
    async with connect("wss://10.77.0.1:8470/lease", ssl=trusting, origin="https://10.77.0.1:8470") as page:
        await page.send(json.dumps({"code": code}))
        print(json.loads(await page.recv())["kind"])
asyncio.run(main())
print(urllib.request.urlopen("https://10.77.0.1:8470/", context=trusting).status)
try:
    urllib.request.urlopen("http://10.77.0.1:8470/")
except OSError:
    print("no TLS, no page")
with socket.create_connection(("10.77.0.1", 8470)) as silent:
    print("no handshake:", silent.recv(1))
"""


@needs_namespaces
async def test_the_page_opens_to_the_network_only_after_a_yes_and_over_tls(tmp_path: Path) -> None:
    bundle = TestAuthority(tmp_path).bundle("phone-page", Role.ESTOP, hosts=("10.77.0.1",))
    station = f"{LIFELINE} station --open --keys {bundle} --endpoint tcp/127.0.0.1:7447"
    for answer in ("no", "yes"):
        server = Operator("unshare", "--net", "sh", "-c", NETWORK + station)
        try:
            await until(lambda server=server: "Type yes to open it:" in server.output)
            assert "everybody who can reach 10.77.0.1" in server.picture
            assert URL.search(server.output) is None
            server.type(f"{answer}\r".encode())
            if answer == "no":
                code, errors = await server.ended()
                assert (code, errors) == (2, "lifeline: not confirmed: the page was not opened\n")
                continue
            await until(lambda server=server: URL.search(server.output))
            found = URL.search(server.output)
            assert found is not None
            where, _, code = found[0].partition("#")
            assert where == "https://10.77.0.1:8470/"
            client = await asyncio.create_subprocess_exec(
                *("nsenter", f"--target={server.process.pid}", "--net", sys.executable, "-c", CLIENT),
                *(str(bundle / "authority.pem"), code),
                stdout=asyncio.subprocess.PIPE,
            )
            output, _ = await client.communicate()
            assert output.decode().split("\n") == [
                "welcome",
                "200",
                "no TLS, no page",
                "no handshake: b''",
                "",
            ]
        finally:
            server.close()


@needs_namespaces
@pytest.mark.parametrize(
    "options",
    [
        "--keys {page}",
        "--keys {page} --drive",
        "--keys {driver} --drive",
        "--keys {all} --endpoint quic/127.0.0.1:7447 --config {config}",
        "--keys {all} --endpoint quic/127.0.0.1:7447 --config {config} --drive",
    ],
    ids=["stops", "drives here", "drives as an operator", "stops with one of several", "drives with two"],
)
async def test_without_a_terminal_a_page_whose_certificates_are_enough_needs_only_yes_as_an_option(
    tmp_path: Path, options: str
) -> None:
    ours = TestAuthority(tmp_path)
    page = ours.bundle("page", Role.ESTOP, hosts=("10.77.0.1",))
    ours.bundle("alice", Role.OPERATOR)
    ours.bundle("robot7", Role.SUPERVISOR)
    places = {"page": page, "all": page.parent, "config": DEFAULT_CONFIG}
    if "driver" in options:
        places["driver"] = ours.bundle("driver", Role.OPERATOR, hosts=("10.77.0.1",))
    station = f"{LIFELINE} station --open {options.format(**places)}"
    process = await asyncio.create_subprocess_exec(
        *("unshare", "--net", "sh", "-c", NETWORK + station),
        stdin=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    _, errors = await process.communicate()
    assert errors.decode() == "lifeline: there is no terminal to confirm --open: add --yes\n"


def test_without_its_packages_the_command_says_how_to_install_them() -> None:
    code = (
        "import sys; sys.modules['uvicorn'] = None; sys.argv = ['lifeline', 'station'];"
        "from lifeline.cli.app import main; main()"
    )
    refusal = refusal_of(sys.executable, "-c", code)
    assert refusal == "lifeline: this needs an extra: install lifeline[station], with `make setup`"
