"""`lifeline station`: serve the page of an e-stop station to the browser of a phone."""

import asyncio
import os
import secrets
import signal
import socket
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import NoReturn

import segno

from deploy.stack.bringup import NEW_CODE
from deploy.stack.console import say
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.listen import bracketed, cannot_listen, is_loopback
from deploy.stack.reach import check_may_stop, run_command
from lifeline.page import painter_of, wheel_of
from station.admission import Address
from station.driving import Driving
from station.pairing import CODE_LIFETIME_S, Pairing
from station.relay import Relay
from station.server import serve
from station.visitors import MAX_VISITORS
from station.web import Application
from teleop.wheel import SourceWheel
from wire.bundle import Bundle, BundleError, choose_bundle
from wire.host.config import NAME
from wire.host.connections import is_here
from wire.roles import Role
from wire.zenoh.bus import ZenohBus, open_bus
from wire.zenoh.hub_proof import HubProof

LOOPBACK = ("127.0.0.1", "localhost")
CODE_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Without those that look alike, because a code may be typed."""
CODE_LENGTH = 12


def run(
    launch: Launch,
    name: str,
    port: int,
    *,
    is_open: bool,
    may_open: bool,
    drives: bool = False,
    passport: str = "",
) -> NoReturn:
    """Serve the page until Ctrl-C.

    Args:
        launch: the robot.
        name: of the station, in the supervisor's configuration.
        port: of the page.
        is_open: whether to serve it to the local network.
        may_open: whether to do so without asking.
        drives: whether a page may drive.
        passport: the sentence of the robot's passport, for the page; empty: none.

    Raises:
        DeployError: the name, the certificate or the port is refused, or the person does not confirm.
    """
    wheel = wheel_of(launch) if drives else None
    hosts, bundle = _hosts(launch, name, is_open=is_open, may_open=may_open)
    family = socket.AF_INET6 if ":" in hosts[0] else socket.AF_INET
    try:
        listening = socket.create_server((hosts[0], port), family=family, backlog=MAX_VISITORS)
    except OSError as error:
        text = f"{bracketed(hosts[0])}:{port}"
        raise cannot_listen(text, error.errno, error.strerror or str(error), "--port N") from error
    address = Address("http" if bundle is None else "https", tuple(map(bracketed, hosts)), port)
    run_command(lambda stop: _serve(stop, launch, name, address, listening, bundle, wheel, passport))


def beside(
    launch: Launch, name: str, port: int, *, is_open: bool, may_open: bool, drives: bool = False
) -> Launch:
    """Return the same robot with the page of the station among its programs; the arguments are those of `run`.

    Raises:
        DeployError: as for `run`, except for the port, which the program itself opens.
    """
    if drives:
        wheel_of(launch)
    _hosts(launch, name, is_open=is_open, may_open=may_open)
    opening = ("--open", "--yes") if is_open else ()
    module, *options = launch.command("lifeline.cli.app")[2:]
    command = (
        sys.executable,
        "-m",
        module,
        "station",
        "--name",
        name,
        "--port",
        str(port),
        *opening,
        *(["--drive"] if drives else []),
        *options,
    )
    return replace(launch, station=command, station_name=name, drives_on_page=drives)


def _hosts(
    launch: Launch, name: str, *, is_open: bool, may_open: bool
) -> tuple[tuple[str, ...], Bundle | None]:
    """Return the names under which the page is served, and the bundle with the certificate for them; None: without TLS."""
    if NAME.fullmatch(name) is None:
        raise DeployError(
            f"{name!r} is not a name: use small letters, digits and _ as in [[supervisor.estop_stations]]"
        )
    check_may_stop(launch.bus)
    return _open_hosts(launch, name, may_open=may_open) if is_open else (LOOPBACK, None)


def _open_hosts(launch: Launch, name: str, *, may_open: bool) -> tuple[tuple[str, ...], Bundle]:
    """Return the names of this computer in the local network, and the bundle with the certificate for them.

    Raises:
        DeployError: there is no such certificate, or the person does not confirm.
    """
    issue = f"`lifeline keys issue {name}-page --role estop --host ADDRESS`"
    if launch.bus.keys is None:
        raise DeployError(
            f"--open needs TLS: make a certificate with {issue}, and name its bundle with --keys"
        )
    try:
        bundle = choose_bundle(launch.bus.keys, time.time(), part=Role.ESTOP)
    except BundleError as error:
        raise DeployError(str(error)) from error
    hosts = tuple(host for host in bundle.hosts if bundle.role is Role.ESTOP and _is_reachable(host))
    if not hosts:
        raise DeployError(
            f"the certificate of {bundle.name} is not one of the role estop for an address of this computer in the local "
            f"network: issue one with {issue}"
        )
    if not may_open:
        _ask(f"everybody who can reach {hosts[0]} will see the page of the e-stop station {name}")
    return hosts, bundle


def _is_reachable(host: str) -> bool:
    """Return whether other computers can reach this one under a name or address."""
    try:
        address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0][4][0]
        return not is_loopback(str(address)) and is_here(host)
    except (OSError, UnicodeError):
        return False


def _ask(sentence: str) -> None:
    if not sys.stdin.isatty():
        raise DeployError("there is no terminal to confirm --open: add --yes")
    print(f"lifeline: {sentence}. Type yes to open it: ", end="", flush=True)
    if sys.stdin.readline().strip().lower() != "yes":
        raise DeployError("not confirmed: the page was not opened")


async def _serve(
    stop: asyncio.Event,
    launch: Launch,
    name: str,
    address: Address,
    listening: socket.socket,
    bundle: Bundle | None,
    wheel: SourceWheel | None,
    passport: str,
) -> int:
    loop = asyncio.get_running_loop()
    printer = ThreadPoolExecutor(1)  # a terminal that accepts no output must not delay the lease

    def report(sentence: str) -> None:
        printer.submit(say, sentence)

    pairing, relay, painter = Pairing(), Relay(name, launch.bus.endpoint), painter_of(launch, passport)
    driving = None if wheel is None else Driving(wheel)
    application = Application(name, address, relay, pairing, report, painter, driving)

    def offer() -> None:
        code = "".join(secrets.choice(CODE_LETTERS) for _ in range(CODE_LENGTH))
        pairing.offer(code, loop.time())
        printer.submit(print_code, address.url(code))

    def on_line() -> None:
        with suppress(OSError):  # in the background
            if os.read(0, 1024):
                offer()
                return
        loop.remove_reader(0)

    bus: ZenohBus | None = None
    proof = HubProof(launch.bus, report)
    opening = asyncio.ensure_future(open_bus(launch.bus, "client", say=report, proof=proof))
    working = [
        asyncio.ensure_future(relay.run(stop)),
        asyncio.ensure_future(serve(application, listening, bundle, stop)),
    ]
    loop.add_signal_handler(NEW_CODE, offer)
    offer()
    if sys.stdin.isatty():
        signal.signal(
            signal.SIGTTIN, signal.SIG_IGN
        )  # a read in the background fails, and does not stop the process
        loop.add_reader(0, on_line)
        report("Enter: a new code; Ctrl-C: end")
    try:
        await asyncio.wait({opening, *working}, return_when=asyncio.FIRST_COMPLETED)
        if opening.done():
            bus = opening.result()
            relay.join(bus)
            for part in (painter, wheel):
                if part is not None:
                    part.join(bus)
        await asyncio.gather(*working)
    finally:
        opening.cancel()
        if bus is not None:
            await bus.close()
    return 0


def print_code(url: str) -> None:
    """Print the address of the page with a new code, on a terminal also as a QR code."""
    if sys.stdout.isatty() and "utf" in sys.stdout.encoding.lower():
        segno.make(url, micro=False).terminal(compact=True)
    say(f"open {url} within {CODE_LIFETIME_S:.0f} s, in one browser")
