"""`lifeline keys`: make an authority, issue certificates, list them, and revoke a name."""

import shlex
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from deploy.keys.certificates import Subject, UnusableAuthorityError, make_authority, sign
from deploy.keys.folder import Folder, locked
from deploy.keys.register import (
    Issued,
    RefusedError,
    Register,
    Request,
    Row,
    minute,
    rows,
    subject_of,
    warnings,
)
from deploy.stack.errors import DeployError
from deploy.stack.table import Column, Table
from wire.bundle import AUTHORITY
from wire.host.installation import runnable
from wire.roles import SERVERS, Role
from wire.text import printable


def init(directory: Path | None, *, replace: bool) -> dict[str, Any]:
    """Make an authority, and return what was made as JSON values.

    Raises:
        DeployError: there is one already and `replace` is False, or the folder cannot be used.
    """
    with locked(directory, create=True) as folder:
        if folder.has_authority and not replace:
            raise DeployError(
                f"there is an authority in {folder.path}: keep it, or make a new one with --replace, which ends all "
                "certificates of the old one"
            )
        signed = make_authority(time.time())
        revoked = _revoked_before(folder)
        # In this order, a crash leaves no certificate of the new authority that the register does not know.
        folder.remove_bundles()
        folder.put_authority(signed.certificate, signed.key)
        folder.put_register(revoked)
        return {"keys": str(folder.path), "ends": minute(signed.ends_s)}


def _revoked_before(folder: Folder) -> Register:
    """Return a register without certificates that refuses the same names; a damaged one refuses none."""
    try:
        return Register((), folder.register().revoked)
    except DeployError:
        return Register()


def issue(directory: Path | None, request: Request, lifetime_s: float) -> dict[str, Any]:
    """Issue a certificate, write its bundle, and return both as JSON values.

    Raises:
        DeployError: the request is refused, or the folder cannot be used.
    """
    with locked(directory) as folder:
        authority = folder.authority()
        register, now_s = folder.register(), time.time()
        try:
            name, role, robot, hosts = subject_of(register, request)
            signed = sign(*authority, Subject(name, role, robot, hosts), now_s, lifetime_s)
        except RefusedError as error:
            raise DeployError(str(error)) from error
        except UnusableAuthorityError as error:
            raise DeployError(
                f"the authority in {folder.path} cannot sign, because {error}: make a new one with "
                "`lifeline keys init --replace`"
            ) from error
        issued = Issued(name, role, robot, hosts, f"{signed.serial:x}", signed.ends_s)
        folder.put_register(register.without_ended(now_s).with_issued(issued))
        bundle = folder.put_bundle(name, signed.certificate, signed.key)
    return {
        "name": name,
        "common_name": issued.common_name,
        "hosts": list(hosts),
        "ends": minute(issued.ends_s),
        "bundle": str(bundle),
    }


def issued_sentences(issued: dict[str, Any]) -> list[str]:
    """Return what to do with a new bundle."""
    bundle, name = issued["bundle"], issued["name"]
    hosts = f" for the hosts {', '.join(issued['hosts'])}" if issued["hosts"] else ""
    role = issued["common_name"].partition("@")[0]
    is_until = f"{name} is {issued['common_name']} until {issued['ends']}{hosts}"
    if hosts and role not in SERVERS:
        drive, quoted = " --drive" if role == Role.OPERATOR else "", shlex.quote(bundle)
        return [
            is_until,
            f"on this computer, serve a page with `lifeline station --open{drive} --keys {quoted}`",
            f"on another computer, first copy the bundle: scp -r {quoted} HOST:",
            f"install {AUTHORITY} of the bundle on the phone as a certificate authority",
        ]
    if role == Role.ROUTER:
        start = f"start `lifeline router --listen tls/0.0.0.0:7448 --keys {name} --robot NAMESPACE`"
    else:
        endpoint = "quic/0.0.0.0:7447" if role == Role.SUPERVISOR else "quic/ROBOT:7447"
        start = f"start programs with --endpoint {endpoint} --keys {name}, or write both into robot.toml, section [bus]"
    return [
        is_until,
        f"copy the bundle to the computer of {name}: scp -r {shlex.quote(bundle)} HOST:",
        f"there, {start}",
    ]


def table(directory: Path | None) -> list[Row]:
    """Return one row for each name.

    Raises:
        DeployError: the folder cannot be used.
    """
    with locked(directory) as folder:
        return rows(folder.register(), time.time())


def show(table: list[Row]) -> None:
    """Print the rows, and a sentence for each certificate that ends soon."""
    if not table:
        print(runnable("no certificate was issued yet: `lifeline keys issue NAME --role ROLE`"))
        return
    console = Console()
    console.print(_to_table(table))
    for sentence in warnings(table):
        console.print(Text(printable(runnable(f"warning: {sentence}")), style="yellow"), soft_wrap=True)


def _to_table(table: list[Row]) -> Table:
    shown = Table("name", "role", "robot", Column("days left", right=True), "ends", "revoked")
    for row in table:
        days = "ended" if row.days_left < 0 else f"{row.days_left:.1f}"
        style = "dim" if row.revoked else "yellow" if row.ends_soon else ""
        shown.add_row(row.name, row.role, row.robot, days, row.ends, row.revoked, style=style)
    return shown


def to_json(table: list[Row]) -> list[dict[str, Any]]:
    """Return the rows as JSON values."""
    return [row._asdict() | {"days_left": round(row.days_left, 2)} for row in table]


def revoke(directory: Path | None, name: str) -> dict[str, Any]:
    """Revoke a name, and return until when its certificate still connects.

    Raises:
        DeployError: the name has no certificate, is revoked already, or the folder cannot be used.
    """
    with locked(directory) as folder:
        register, now_s = folder.register(), time.time()
        try:
            folder.put_register(register.with_revoked(name, now_s))
        except RefusedError as error:
            raise DeployError(str(error)) from error
        folder.remove_bundle(name)
        ends_s = register.ends_s(name)
    return {"name": name, "connects_until": minute(ends_s) if ends_s > now_s else None}


def revoked_sentence(revoked: dict[str, Any]) -> str:
    """Return what the revocation does, and what it does not."""
    name, until = revoked["name"], revoked["connects_until"]
    if until is None:
        return f"{name} is revoked and gets no new certificate; the one that it has no longer connects"
    return (
        f"{name} is revoked and gets no new certificate; the one that it has connects until {until}, unless you end it at "
        "once: `lifeline keys init --replace`, a new bundle for every other name, and a restart of the supervisor"
    )
