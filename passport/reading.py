"""`lifeline passport report`, `verify` and `diff`: files of passports are made, checked and compared."""

import time
from pathlib import Path
from typing import NamedTuple

from commission.commission import replace_file
from deploy.keys.signatures import Envelope, SignatureError, Signer, envelope_of, payload_of, signed, verify
from deploy.stack.console import answer, show
from deploy.stack.errors import DeployError
from deploy.stack.table import Column, Table
from passport.compare import changes
from passport.page import inside_of, page
from passport.record import MAX_BYTES, Passport, from_json
from passport.statement import digest, record_in, statement_of
from passport.summary import sentence
from wire.bundle import AUTHORITY, BundleError, choose_bundle
from wire.foreign import ForeignError, read_text
from wire.roles import Role

SPEED, LOAD, OLD, NEW = (Column(name, right=True) for name in ("speed", "load", "old", "new"))
MAX_FILE_BYTES = 3 * MAX_BYTES
"""Of a page: the record in base64, and its pictures."""
WORSE = 1
"""Exit code if a limit became worse."""


class Written(NamedTuple):
    """A page that was written, or checked."""

    page: str
    signer: str | None
    sha256: str
    """Of the record."""
    shows: str
    """What the measurement shows, in one sentence."""
    configuration_sha256: str
    """Of the configuration with which the robot was measured."""


def report(file: Path, out: Path, keys: Path | None) -> Written:
    """Write the page of a record, signed if there are keys.

    Args:
        file: the record of `lifeline passport measure`.
        out: the page.
        keys: the bundle of the robot's computer (role supervisor), or a directory with it; None: the page is not signed.

    Raises:
        DeployError: a file cannot be read or written, or the bundle cannot sign.
    """
    passport, _ = _read(file)
    inside, signer = passport.to_json(), None
    if keys is not None:
        envelope, who = _sign(passport, keys)
        inside, signer = envelope.model_dump_json(), _named(who)
    try:
        replace_file(out, page(passport, inside, signer))
    except OSError as error:
        raise DeployError(f"cannot write {out}: {error.strerror}") from error
    return Written(str(out), signer, digest(passport), sentence(passport), passport.configuration_sha256)


def check(file: Path, keys: Path) -> Written:
    """Return who signed a page that shows what was signed.

    Args:
        file: the page, or only its envelope.
        keys: a bundle, or any directory with the certificate of the authority that is trusted.

    Raises:
        DeployError: a file cannot be read, or is no passport.
        SignatureError: it is not signed, not by the computer of a robot of this authority, or was changed.
    """
    text = _text(file, MAX_FILE_BYTES)
    passport, envelope = _parsed(file, text)
    authority = _text(keys / AUTHORITY if keys.is_dir() else keys, None)
    who = _verified(passport, envelope, text, authority.encode())
    return Written(str(file), who, digest(passport), sentence(passport), passport.configuration_sha256)


def _verified(passport: Passport, envelope: Envelope | None, text: str, authority: bytes) -> str:
    if envelope is None:
        raise SignatureError("is not signed")
    signer = verify(envelope, authority)
    who = _named(signer)
    if signer.common_name.partition("@")[0] != Role.SUPERVISOR:
        raise SignatureError(f"is signed by {who}: only the computer of a robot signs its passport")
    if inside_of(text) is not None and text != page(passport, envelope.model_dump_json(), who):
        raise SignatureError(
            "has text that was not signed, or is of another version of Lifeline. The record inside is as it was signed by "
            f"{who}, SHA-256 {digest(passport)}: make the page again"
        )
    return who


def compare(old: Path, new: Path, *, as_json: bool) -> int:
    """Print the limits of two passports that differ; return `WORSE` if one became worse.

    Raises:
        DeployError: a file cannot be read, or they have no cell in common.
    """
    (before, _), (after, _) = _read(old), _read(new)
    found = changes(before, after)
    if not any(one.is_in_both for one in found):
        raise DeployError(
            f"{old} and {new} have no measured cell in common in which the robot stopped: measure the same faults and speeds"
        )
    results = [one.result for one in found]
    if not any(one.is_different for one in found):
        answer(results, f"all {len(found)} limits are the same", as_json=as_json)
        return 0
    worse = sum(one.is_worse for one in found)
    table = Table(
        "fault", SPEED, LOAD, "limit", OLD, NEW, "", title=f"{worse} of {len(found)} limits became worse"
    )
    for one in found:
        if one.is_different:
            cell, quantity = one.cell, f"{one.quantity} [{one.unit}]"
            condition = (cell.speed, f"{cell.load_percent} %")
            table.add_row(
                cell.name,
                *condition,
                quantity,
                _shown(one.old, failed=one.old_failed),
                _shown(one.new, failed=one.new_failed),
                "worse" if one.is_worse else "",
            )
    show(results, table, as_json=as_json)
    return WORSE if worse else 0


def _shown(value: float | None, *, failed: bool) -> str:
    if failed:
        return "did not stop"
    return "not measured" if value is None else f"{value:.3f}"


def _named(who: Signer) -> str:
    return f"{who.name} ({who.common_name})"


def _sign(passport: Passport, keys: Path) -> tuple[Envelope, Signer]:
    try:
        bundle = choose_bundle(keys, time.time(), part=Role.SUPERVISOR)
        if bundle.role is not Role.SUPERVISOR:
            raise DeployError(
                f"{keys} is of the role {bundle.role}: the computer of a robot signs its passport, with the role supervisor"
            )
        envelope = signed(statement_of(passport), bundle.certificate.read_bytes(), bundle.key.read_bytes())
        return envelope, verify(envelope, bundle.authority.read_bytes())
    except (BundleError, SignatureError) as error:
        raise DeployError(str(error) if isinstance(error, BundleError) else f"{keys} {error}") from error
    except OSError as error:
        raise DeployError(f"cannot read {error.filename}: {error.strerror}") from error


def _read(file: Path) -> tuple[Passport, Envelope | None]:
    return _parsed(file, _text(file, MAX_FILE_BYTES))


def _text(file: Path, most_bytes: int | None) -> str:
    try:
        return read_text(file, most_bytes)
    except OSError as error:
        raise DeployError(f"cannot read {file}: {error.strerror}") from error
    except ForeignError as error:
        raise DeployError(f"{file}: {error}") from error


def _parsed(file: Path, text: str) -> tuple[Passport, Envelope | None]:
    """Return the record of a page, an envelope or a record, with its envelope if it has one."""
    inside = inside_of(text)
    text = text if inside is None else inside
    envelope = envelope_of(text)
    try:
        return (from_json(text) if envelope is None else record_in(payload_of(envelope))), envelope
    except (ForeignError, SignatureError) as error:
        raise DeployError(f"{file}: {error}") from error
