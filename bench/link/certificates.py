"""Makes an authority and the certificates of both sides, for one run."""

import ipaddress
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

LIFETIME = timedelta(days=2)


def make(folder: Path, sides: Iterable[str], addresses: Iterable[str]) -> None:
    """Write `SIDE/authority.pem`, `SIDE/certificate.pem` and `SIDE/key.pem` for each side.

    Args:
        folder: exists.
        sides: the names of the folders, and the common names.
        addresses: IP addresses for which the certificates are valid.
    """
    names = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(one)) for one in addresses])
    authority_key = ec.generate_private_key(ec.SECP256R1())
    issuer = _name("authority")
    authority = (
        _begun(issuer, issuer, authority_key.public_key())
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(authority_key, hashes.SHA256())
    )
    for side in sides:
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = (
            _begun(_name(side), issuer, key.public_key())
            .add_extension(names, critical=False)
            .sign(authority_key, hashes.SHA256())
        )
        (folder / side).mkdir(mode=0o700)
        (folder / side / "authority.pem").write_bytes(authority.public_bytes(serialization.Encoding.PEM))
        (folder / side / "certificate.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        (folder / side / "key.pem").write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
        )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _begun(subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + LIFETIME)
    )
