"""The bundle of a participant: the authority's certificate, its own certificate and its private key.

`lifeline keys issue` writes it. Before a session uses it, it is checked as the other side will check it: by a TLS
handshake in memory with the standard library. The library gives the fields of a certificate only to the other side of a
handshake, and the handshake also proves that the key belongs to the certificate and the certificate to the authority.
Zenoh itself reports none of this: an expired certificate looks like a supervisor that does not run.
"""

import ssl
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from wire.foreign import ForeignError, read_text
from wire.ownership import CHANGE, ENTER, refusal
from wire.roles import ANY, SERVERS, Role, role_of

AUTHORITY = "authority.pem"
CERTIFICATE_SUFFIX = ".pem"
KEY_SUFFIX = ".key"
HOW_TO_ISSUE = "issue one with `lifeline keys issue`"
NO_CHECK_TIME = 0x200000
"""X509_V_FLAG_NO_CHECK_TIME of OpenSSL: the times are compared here, so that the sentence names them."""
WRONG_AUTHORITY = {7, 18, 19, 20, 21}
"""OpenSSL's codes for a certificate that no certificate in `AUTHORITY` signed."""


class BundleError(Exception):
    """The bundle cannot be used; the message gives the cause and the remedy in one sentence."""


@dataclass(frozen=True, slots=True)
class Bundle:
    """A bundle that was checked."""

    name: str
    role: Role
    namespace: str
    """The namespace of a robot, or `wire.roles.ANY`."""
    hosts: tuple[str, ...]
    """Host names and addresses of a server's certificate."""
    ends_s: float
    """End of the certificate, in seconds since the epoch."""
    authority: Path
    certificate: Path
    key: Path

    def is_for(self, namespace: str) -> bool:
        return self.namespace in (namespace, ANY)


def read_bundle(directory: Path, now_s: float) -> Bundle:
    """Read a bundle and check it.

    Args:
        directory: as `lifeline keys issue` wrote it.
        now_s: the time, in seconds since the epoch.

    Raises:
        BundleError: a file is missing, damaged, or readable or writable for others, the files do not belong together, or
            the certificate has expired or is not valid yet.
    """
    key = _key_in(directory)
    authority, certificate = directory / AUTHORITY, key.with_suffix(CERTIFICATE_SUFFIX)
    for path in (authority, certificate):
        if not path.is_file():
            raise BundleError(f"{path} is missing: copy the whole bundle again, or {HOW_TO_ISSUE}")
        _refuse_shared(path)
    try:
        for path in (authority, certificate, key):
            read_text(path)  # OpenSSL would wait for a pipe
        fields = _fields(authority, certificate, key)
    except OSError as error:  # among them the errors of ssl
        raise BundleError(_unreadable(directory, authority, error)) from error
    except ForeignError as error:
        raise BundleError(
            f"a file in {directory} is damaged ({error}): copy the whole bundle again"
        ) from error
    subject = {name: value for part in fields["subject"] for name, value in part}
    known = role_of(subject.get("commonName", ""))
    if known is None:
        raise BundleError(
            f"the certificate in {directory} names no role but {subject.get('commonName', '')!r}: {HOW_TO_ISSUE}"
        )
    begins_s, ends_s = (ssl.cert_time_to_seconds(fields[key]) for key in ("notBefore", "notAfter"))
    who = f"the certificate of {key.stem} ({directory})"
    if now_s < begins_s:
        raise BundleError(
            f"{who} is not valid before {fields['notBefore']}: check the clock of this computer and of the one that "
            "issued it"
        )
    if now_s >= ends_s:
        raise BundleError(
            f"{who} expired on {fields['notAfter']}: issue a new one with `lifeline keys issue {key.stem}`, or check the "
            "clock of this computer"
        )
    hosts = tuple(str(value) for _, value in fields.get("subjectAltName", ()))
    return Bundle(key.stem, *known, hosts, float(ends_s), authority, certificate, key)


def choose_bundle(directory: Path, now_s: float, *, part: Role | None) -> Bundle:
    """Read a bundle, or the one of several in a directory that a process needs.

    The computer of a robot has several: the hub takes that of the role supervisor, the base that of the role base, and
    teleop that of the role operator. A router takes that of the role router.

    Args:
        directory: a bundle, or a directory of bundles.
        now_s: the time, in seconds since the epoch.
        part: the role of the process; None: any but those of servers, of several that of the operator.

    Raises:
        BundleError: as `read_bundle`, or there is not exactly one that fits.
    """
    within = sorted({key.parent for key in directory.glob(f"*/*{KEY_SUFFIX}")})
    if not within or any(directory.glob(f"*{KEY_SUFFIX}")):
        return read_bundle(directory, now_s)
    bundles = [read_bundle(one, now_s) for one in within]
    if part is None:
        others = [bundle for bundle in bundles if bundle.role not in SERVERS]
        fitting = [bundle for bundle in others if bundle.role is Role.OPERATOR] or others
    else:
        fitting = [bundle for bundle in bundles if bundle.role is part]
    if len(fitting) == 1:
        return fitting[0]
    named = ", ".join(f"{bundle.name} ({bundle.role})" for bundle in bundles)
    what = f"of another role than {' and '.join(SERVERS)}" if part is None else f"of the role {part}"
    raise BundleError(
        f"{directory} must have one bundle {what} for this process, but has {named}: name one with --keys, or issue it with "
        f"`lifeline keys issue NAME --role {part or Role.VIEWER}`"
    )


def _key_in(directory: Path) -> Path:
    if not directory.is_dir():
        raise BundleError(f"there is no bundle of keys at {directory}: {HOW_TO_ISSUE} and copy it there")
    keys = sorted(directory.glob(f"*{KEY_SUFFIX}"))
    if not keys:
        raise BundleError(
            f"{directory} has no private key (NAME{KEY_SUFFIX}): {HOW_TO_ISSUE} and copy the whole bundle"
        )
    if len(keys) > 1:
        names = ", ".join(key.name for key in keys)
        raise BundleError(
            f"{directory} has several private keys ({names}): keep each bundle in a directory of its own"
        )
    _refuse_shared(directory)
    _refuse_shared(keys[0], ENTER)
    return keys[0]


def _refuse_shared(path: Path, forbidden: int = CHANGE) -> None:
    try:
        refused = refusal(path, forbidden)
    except OSError as error:
        raise BundleError(f"cannot read {path}: {error.strerror}") from error
    if refused is not None:
        raise BundleError(refused)


def _fields(authority: Path, certificate: Path, key: Path) -> dict[str, Any]:
    """Return the fields of the certificate after a handshake in memory, in which it is the client's.

    Raises:
        OSError: a file cannot be read, or the files do not belong together.
    """
    client, server = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT), ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    client.check_hostname, client.verify_mode = False, ssl.CERT_NONE  # only the server's check counts
    server.verify_mode = ssl.CERT_REQUIRED
    server.verify_flags |= ssl.VerifyFlags(NO_CHECK_TIME)
    server.load_verify_locations(authority)
    for context in (client, server):
        context.load_cert_chain(certificate, key, password="")
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = (
        client.wrap_bio(to_client, to_server),
        server.wrap_bio(to_server, to_client, server_side=True),
    )
    waiting: list[Callable[[], None]] = [end.do_handshake for end in ends]
    while waiting:
        waiting = [shake for shake in waiting if not _has_ended(shake)]
    return cast("dict[str, Any]", ends[1].getpeercert())


def _has_ended(shake: Callable[[], None]) -> bool:
    try:
        shake()
    except ssl.SSLWantReadError:
        return False
    return True


def _unreadable(directory: Path, authority: Path, error: OSError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        if error.verify_code in WRONG_AUTHORITY:
            return f"the certificate in {directory} is from another authority than its {AUTHORITY}: copy the whole bundle again"
        return f"the certificate in {directory} cannot be used ({error.verify_message}): {HOW_TO_ISSUE}"
    if isinstance(error, ssl.SSLError):
        if error.reason == "KEY_VALUES_MISMATCH":
            return f"the key in {directory} does not belong to the certificate: copy the whole bundle again"
        return f"a file in {directory} is damaged ({error.reason or error}): copy the whole bundle again"
    return f"cannot read the bundle in {directory}: {error.filename or authority}: {error.strerror or error}"
