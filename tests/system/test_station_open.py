"""A page on another computer drives: over TLS, with the certificate of an operator, at an address of the local network."""

import asyncio
import json
import shlex
import socket
import ssl
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.typing import Origin

from bench.link.namespaces import entered
from deploy.stack import processes
from deploy.stack.launch import DEFAULT_CONFIG
from teleop.station.state import Word
from tests.system.authority import TestAuthority
from tests.system.harness import PATIENCE_S, POLL_S, patiently
from tests.system.namespaces import needs_namespaces
from tests.system.operators import Operator, until
from tests.system.pages import Server
from tests.system.test_estop_stations import LIFELINE
from tests.system.test_station import NETWORK
from tests.system.test_station_commands import SLOW_M_S, hands
from tests.unit.lifeline.test_own_passport import passport_of
from wire.bundle import AUTHORITY
from wire.roles import Role

pytestmark = [needs_namespaces, pytest.mark.timeout(180)]

HERE = "10.77.0.1"


class Opened(Server):
    """`lifeline up --station --open --drive` on another computer: in a network of its own.

    Args:
        state: its state directory.
        authority: the certificate that the browser trusts.
        options: of the command.
    """

    def __init__(self, state: Path, authority: Path, *options: str) -> None:
        self._trusting = ssl.create_default_context(cafile=authority)
        self.origin = f"https://{HERE}:8470"
        up = f"{LIFELINE} up --station --open --yes --drive --no-viewer --state-dir {state} "
        Operator.__init__(self, "unshare", "--net", "sh", "-c", NETWORK + up + shlex.join(options))

    def socket(self, origin: str | None = "", host: str = HERE, path: str = "lease") -> connect:
        """Open one of the page's websockets from that network, at its address."""
        with entered(Path(f"/proc/{self.process.pid}/ns/net")):
            connection = socket.create_connection((host, 8470), PATIENCE_S)
        connection.settimeout(0)
        return connect(
            f"wss://{host}:8470/{path}",
            origin=Origin(origin or self.origin),
            sock=connection,
            ssl=self._trusting,
        )


async def becomes(condition: Callable[[], object]) -> None:
    """Wait for a condition; a busy machine may end the connections of a page, and the next page is tried."""
    late_s = asyncio.get_running_loop().time() + PATIENCE_S / 2
    while not condition():
        assert asyncio.get_running_loop().time() < late_s
        await asyncio.sleep(POLL_S)


@pytest.mark.parametrize("protocol", ["tcp", "quic"])
async def test_one_certificate_of_an_operator_is_enough_for_a_page_on_another_computer_that_drives(
    tmp_path: Path, protocol: str
) -> None:
    ours, keys, config = TestAuthority(tmp_path), tmp_path / "on the robot", tmp_path / "robot.toml"
    keys.mkdir(mode=0o700)
    config.write_text(DEFAULT_CONFIG.read_text())
    for name, role, hosts in (
        ("robot7", Role.SUPERVISOR, (HERE,)),
        ("robot7-base", Role.BASE, None),
        ("phone-driver", Role.OPERATOR, (HERE,)),
    ):
        ours.bundle(name, role, hosts=hosts).rename(keys / name)
    driver = keys / "phone-driver"
    options = {
        "--config": config,
        "--endpoint": f"{protocol}/127.0.0.1:7447",
        "--keys": driver if protocol == "tcp" else keys,
        "--passport": passport_of(config, keys / "robot7"),
    }
    # pytest's own directory has too long a path for a socket on some machines.
    with tempfile.TemporaryDirectory(prefix="lifeline-test-") as directory:
        state = Path(directory)
        words = [str(word) for option in options.items() for word in option]
        server = Opened(state, driver / AUTHORITY, *words)
        try:
            assert (await server.address()).startswith(f"https://{HERE}:8470/#")

            async def attempt() -> None:
                async with server.page() as page, hands(server, page) as one:
                    await becomes(lambda: page.word is not Word.NOT_HEARD and one.drives and one.picture)
                    assert one.robot["passport"].startswith("After the one fault tested")
                    await one.rest()
                    await one.commands.send(json.dumps({"request": "reset"}))
                    await becomes(lambda: one.picture["mode"] == "READY")
                    one.linear = 0.4
                    await becomes(lambda: one.picture["velocity"]["measured"] > SLOW_M_S)
                    await page.press()
                    await becomes(lambda: one.picture["velocity"]["permitted"] == 0.0)

            await patiently(attempt)
            server.type(b"\x03")
            await until(lambda: server.process.poll() is not None)
            assert processes.of(state) == []
        finally:
            server.close()
            ended = await asyncio.create_subprocess_exec(LIFELINE, "down", "--state-dir", directory)
            await ended.wait()
