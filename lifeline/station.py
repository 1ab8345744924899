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
from deploy.stack.launch import Launch
from deploy.stack.listen import bracketed, cannot_listen
from deploy.stack.reach import run_command
from lifeline.page import painter_of
from lifeline.page_certificate import Page, hosts_of, joining
from station.admission import Address
from station.driving import Driving
from station.pairing import CODE_LIFETIME_S, Pairing
from station.relay import Relay
from station.server import serve
from station.visitors import MAX_VISITORS
from station.web import Application
from teleop.wheel import SourceWheel
from wire.bundle import Bundle
from wire.zenoh.bus import ZenohBus, open_bus
from wire.zenoh.hub_proof import HubProof

CODE_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Without those that look alike, because a code may be typed."""
CODE_LENGTH = 12


def run(launch: Launch, page: Page) -> NoReturn:
    """Serve the page until Ctrl-C.

    Raises:
        DeployError: the name, the passport, the certificate or the port is refused, or the person does not confirm.
    """
    robot, wheel = joining(launch, page)
    passport = _passport(robot, page)
    hosts, bundle = hosts_of(launch, page)
    family = socket.AF_INET6 if ":" in hosts[0] else socket.AF_INET
    try:
        listening = socket.create_server((hosts[0], page.port), family=family, backlog=MAX_VISITORS)
    except OSError as error:
        text = f"{bracketed(hosts[0])}:{page.port}"
        raise cannot_listen(text, error.errno, error.strerror or str(error), "--port N") from error
    address = Address("http" if bundle is None else "https", tuple(map(bracketed, hosts)), page.port)
    run_command(lambda stop: _serve(stop, robot, page.name, address, listening, bundle, wheel, passport))


def beside(launch: Launch, page: Page) -> Launch:
    """Return the same robot with the page of the station among its programs.

    Raises:
        DeployError: as for `run`, except for the port, which the program itself opens.
    """
    robot, _ = joining(launch, page)
    _passport(robot, page)
    hosts_of(launch, page)
    python, _, module, *options = launch.command("lifeline.cli.app")
    files = {"--passport": page.passport, "--authority": page.authority}
    chosen = ["--open", "--yes"] * page.is_open + ["--drive"] * page.drives
    command = (
        *(python, "-m", module, "station", "--name", page.name, "--port", str(page.port), *chosen),
        # The program may begin in another directory.
        *(
            word
            for option, file in files.items()
            if file is not None
            for word in (option, str(file.absolute()))
        ),
        *options,
    )
    return replace(launch, station=command, station_name=page.name, drives_on_page=page.drives)


def _passport(launch: Launch, page: Page) -> str:
    """Return the sentence of the robot's passport; empty without one.

    Raises:
        DeployError: the passport is refused.
    """
    if page.passport is None:
        return ""
    from lifeline.own_passport import sentence_of  # noqa: PLC0415 - cryptography takes 0.1 s to import

    return sentence_of(launch, page.passport, page.authority)


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
    application = Application(name, address, relay, pairing, since_boot_s, report, painter, driving)

    def offer() -> None:
        code = "".join(secrets.choice(CODE_LETTERS) for _ in range(CODE_LENGTH))
        pairing.offer(code, since_boot_s())
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
    relaying = asyncio.ensure_future(relay.run(stop))
    serving = asyncio.ensure_future(serve(application, listening, bundle, stop))
    loop.add_signal_handler(NEW_CODE, offer)
    offer()
    if sys.stdin.isatty():
        # A read in the background then fails, and does not stop the process.
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)
        loop.add_reader(0, on_line)
        report("Enter: a new code; Ctrl-C: end")
    try:
        await asyncio.wait({opening, relaying, serving}, return_when=asyncio.FIRST_COMPLETED)
        if opening.done():
            bus = opening.result()
            relay.join(bus)
            for part in (painter, wheel):
                if part is not None:
                    part.join(bus)
        await asyncio.gather(relaying, serving)
    finally:
        opening.cancel()
        if bus is not None:
            await bus.close()
    return 0


def since_boot_s() -> float:
    """Return a time [s] that goes on while the machine is suspended: a code must not outlive its minute."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def print_code(url: str) -> None:
    """Print the address of the page with a new code, on a terminal also as a QR code."""
    if sys.stdout.isatty() and "utf" in sys.stdout.encoding.lower():
        segno.make(url, micro=False).terminal(compact=True)
    say(f"open {url} within {CODE_LIFETIME_S:.0f} s, in one browser")
