"""How the page of a station is served, and with which certificates: the least powerful that are enough."""

import socket
import sys
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.listen import is_loopback
from deploy.stack.reach import check_may_drive, check_may_stop
from lifeline.page import wheel_of
from teleop.wheel import SourceWheel
from wire import tls
from wire.bundle import Bundle, BundleError, choose_bundle
from wire.bus_config import BusConfig
from wire.host.config import NAME
from wire.host.connections import is_here
from wire.roles import Role

LOOPBACK = ("127.0.0.1", "localhost")
PAGE_ROLES = (Role.ESTOP, Role.OPERATOR)
"""Whose certificates may serve the page: that of an operator only if the page drives, because it is the more powerful one."""
ELSEWHERE = "192.0.2.1"
"""An address for documentation (RFC 5737): the kernel chooses the interface of the default route for it."""


class Page(NamedTuple):
    """How the page of a station is served."""

    name: str
    """Of the station, in the supervisor's configuration."""
    port: int
    is_open: bool
    """Whether it is served to the local network."""
    may_open: bool
    """Whether it is served there without a question."""
    drives: bool
    """Whether a page may drive."""
    passport: Path | None
    """The file of the robot's passport, whose sentence the page shows."""
    authority: Path | None
    """The certificate of the authority that signed it; None: that of the robot's bundle."""


def joining(launch: Launch, page: Page) -> tuple[Launch, SourceWheel | None]:
    """Return the robot with the bundle with which this station reaches it, and the command source of a page that drives.

    Raises:
        DeployError: the name of the station or the certificate is refused, or the configuration lets no page drive.
    """
    if NAME.fullmatch(page.name) is None:
        raise DeployError(
            f"{page.name!r} is not a name: use small letters, digits and _ as in [[supervisor.estop_stations]]"
        )
    issue = _how_to_issue(launch, page)
    if launch.bus.keys is not None and tls.is_secure(launch.bus.endpoint):
        roles = (Role.OPERATOR,) if page.drives else PAGE_ROLES
        launch = launch.with_keys(_bundles(launch.bus.keys, roles, issue)[0].certificate.parent)
    if not page.drives:
        check_may_stop(launch.bus, issue)
        return launch, None
    check_may_drive(launch.bus, issue)
    return launch, wheel_of(launch)


def hosts_of(launch: Launch, page: Page) -> tuple[tuple[str, ...], Bundle | None]:
    """Return the names under which the page is served, and the bundle with the certificate for them; None: without TLS.

    Raises:
        DeployError: there is no such certificate, or the person does not confirm.
    """
    if not page.is_open:
        return LOOPBACK, None
    issue = _how_to_issue(launch, page)
    if launch.bus.keys is None:
        raise DeployError(
            f"--open needs TLS: issue a certificate with {issue}, and name its bundle with --keys"
        )
    roles = PAGE_ROLES if page.drives else PAGE_ROLES[:1]
    bundles = _bundles(launch.bus.keys, roles, issue)
    for bundle in bundles:
        hosts = tuple(host for host in bundle.hosts if _is_reachable(host))
        if bundle.role in roles and hosts:
            if not page.may_open:
                _ask(
                    f"everybody who can reach {hosts[0]} will see the page of the e-stop station {page.name}"
                )
            return hosts, bundle
    raise _unfit(bundles[-1], roles, issue)


def _unfit(bundle: Bundle, roles: Collection[Role], issue: str) -> DeployError:
    """Return why a bundle cannot serve the page."""
    who = f"the certificate of {bundle.name}"
    if bundle.role in roles:
        return DeployError(
            f"{who} names no address at which other computers reach this one: add it with "
            f"`lifeline keys issue {bundle.name} --host {_address()}`"
        )
    if bundle.role in PAGE_ROLES:
        return DeployError(
            f"{who} has the role {bundle.role}, which serves a page only with --drive: add --drive, or issue one with {issue}"
        )
    return DeployError(f"{who} has the role {bundle.role}, which serves no page: issue one with {issue}")


def _bundles(keys: Path, roles: Sequence[Role], issue: str) -> list[Bundle]:
    """Return the bundle of each of these roles in a directory of bundles; a directory that is a bundle may have any role.

    Raises:
        DeployError: there is none, or one is refused.
    """
    bundles: list[Bundle] = []
    refused: list[str] = []
    for role in roles:
        try:
            bundles.append(choose_bundle(keys, time.time(), part=role))
        except BundleError as error:
            # The command for a page also names the address and the robot.
            refused.append(str(error).replace(f"`lifeline keys issue NAME --role {role}`", issue))
    if not bundles:
        raise DeployError(refused[0])
    return bundles


def _how_to_issue(launch: Launch, page: Page) -> str:
    """Return the command that issues one certificate which is enough for this page."""
    needs_operator = page.drives and tls.is_secure(launch.bus.endpoint)
    role, bundle = (Role.OPERATOR, "driver") if needs_operator else (Role.ESTOP, "page")
    more = f" --robot {launch.bus.namespace}" if launch.bus.namespace != BusConfig().namespace else ""
    more += f" --host {_address()}" if page.is_open else ""
    return f"`lifeline keys issue {page.name}-{bundle} --role {role}{more}`"


def _address() -> str:
    """Return this computer's address in the local network; `ADDRESS` if none is known."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((ELSEWHERE, 9))  # sends nothing
            return str(probe.getsockname()[0])
        except OSError:
            return "ADDRESS"


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
