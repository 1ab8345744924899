"""Keys and certificates: an authority, and the certificates of participants that it signs.

All keys are ECDSA on P-256, which every TLS library accepts. The authority signs participants only (path length 0). A
certificate that names hosts is valid for servers and clients, all others for clients only. Participants accept only a
supervisor or a router as a hub: a station that serves a page to browsers cannot act as one (wire/tls.py). The import of
cryptography takes 0.1 s: only this file and signatures.py need it.
"""

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from deploy.keys.register import WITH_HOSTS
from wire.roles import Role, common_name

AUTHORITY_LIFETIME = timedelta(days=3650)
BACKDATED = timedelta(hours=1)
"""A certificate is valid from this long before it was made: the clocks of two computers may differ."""


@dataclass(frozen=True, slots=True)
class Subject:
    """Whom a certificate names."""

    name: str
    """The name of the person or the computer; the organizational unit of the subject."""
    role: Role
    robot: str
    """The namespace of a robot, or `wire.roles.ANY`."""
    hosts: tuple[str, ...] = ()
    """Host names and addresses at which it listens; empty for what only connects."""


@dataclass(frozen=True, slots=True)
class Signed:
    """A certificate and its key, in PEM."""

    certificate: bytes
    key: bytes
    serial: int
    ends_s: float
    """End of the validity, in seconds since the epoch."""


class UnusableAuthorityError(Exception):
    """The authority's certificate or key cannot be read, or they do not belong together."""


def make_authority(now_s: float) -> Signed:
    """Return a new authority, whose name differs from that of every other."""
    key, serial = ec.generate_private_key(ec.SECP256R1()), x509.random_serial_number()
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"Lifeline authority {serial:040x}"[:40])])
    builder = _valid(serial, now_s, AUTHORITY_LIFETIME)
    certificate = (
        builder.subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_others=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    return _signed(certificate, key)


def sign(authority: bytes, authority_key: bytes, subject: Subject, now_s: float, lifetime_s: float) -> Signed:
    """Return a new certificate with a new key; it ends with the authority at the latest.

    Args:
        authority: the authority's certificate in PEM.
        authority_key: the authority's private key in PEM.
        subject: whom it names.
        now_s: the time, in seconds since the epoch.
        lifetime_s: how long it is valid from now on.

    Raises:
        UnusableAuthorityError: the authority's files are damaged, or it has expired.
    """
    issuer, issuer_key = _authority(authority, authority_key)
    left = issuer.not_valid_after_utc - _time(now_s)
    if left <= timedelta(0):
        raise UnusableAuthorityError(f"it expired on {issuer.not_valid_after_utc:%Y-%m-%d}")
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, common_name(subject.role, subject.robot)),
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, subject.name),
        ]
    )
    lifetime = min(timedelta(seconds=lifetime_s), left)
    purposes = [ExtendedKeyUsageOID.CLIENT_AUTH]
    builder = _valid(x509.random_serial_number(), now_s, lifetime)
    if subject.hosts and subject.role in WITH_HOSTS:
        purposes.append(ExtendedKeyUsageOID.SERVER_AUTH)
        hosts = x509.SubjectAlternativeName(_general_names(subject.hosts))
        builder = builder.add_extension(hosts, critical=False)
    certificate = (
        builder.subject_name(name)
        .issuer_name(issuer.subject)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs_others=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key()), critical=False
        )
        .sign(issuer_key, hashes.SHA256())
    )
    return _signed(certificate, key)


def _authority(certificate: bytes, key: bytes) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    try:
        issuer, issuer_key = x509.load_pem_x509_certificate(certificate), load_pem_private_key(key, None)
    except (ValueError, TypeError) as error:  # damaged, or encrypted
        raise UnusableAuthorityError("its files are damaged") from error
    if (
        not isinstance(issuer_key, ec.EllipticCurvePrivateKey)
        or issuer_key.public_key() != issuer.public_key()
    ):
        raise UnusableAuthorityError("its key does not belong to its certificate")
    return issuer, issuer_key


def _valid(serial: int, now_s: float, lifetime: timedelta) -> x509.CertificateBuilder:
    now, builder = _time(now_s), x509.CertificateBuilder()
    return builder.serial_number(serial).not_valid_before(now - BACKDATED).not_valid_after(now + lifetime)


def _time(now_s: float) -> datetime:
    return datetime.fromtimestamp(now_s, UTC)


def _usage(*, signs_others: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_others,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_others,
        crl_sign=signs_others,
        encipher_only=False,
        decipher_only=False,
    )


def _general_names(hosts: Sequence[str]) -> list[x509.GeneralName]:
    names: list[x509.GeneralName] = []
    for host in hosts:
        try:
            names.append(x509.IPAddress(ipaddress.ip_address(host)))
        except ValueError:
            names.append(x509.DNSName(host))
    return names


def _signed(certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> Signed:
    return Signed(
        certificate.public_bytes(Encoding.PEM),
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()),
        certificate.serial_number,
        certificate.not_valid_after_utc.timestamp(),
    )
