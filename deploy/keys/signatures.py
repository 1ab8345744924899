"""Signed statements: DSSE envelopes, signed with the key of a bundle and verified with the certificate of its authority.

The signature covers type and payload (https://github.com/secure-systems-lab/dsse). Nobody attests the time of a signature: an ended
or revoked certificate still verifies what its key has signed.
"""

import base64
import binascii
from typing import NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID
from pydantic import BaseModel, ConfigDict, Field, ValidationError

PAYLOAD_TYPE = "application/vnd.in-toto+json"
MAX_TEXT = 64 << 20
"""Characters of a payload."""
MAX_FIELD = 20_000
"""Characters of any other field."""


class SignatureError(Exception):
    """The signature does not hold; the message is the end of a sentence that begins with the file."""


class Signer(NamedTuple):
    """Who signed, by the certificate."""

    name: str
    common_name: str
    """Role and robot (wire/roles.py)."""


class Signature(BaseModel):
    """One signature, with the certificate of its key."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    sig: str = Field(max_length=MAX_FIELD)
    cert: str = Field(max_length=MAX_FIELD)


class Envelope(BaseModel):
    """A DSSE envelope."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    payload: str = Field(max_length=MAX_TEXT)
    payloadType: str = Field(max_length=MAX_FIELD)  # noqa: N815 - the name in the format
    signatures: tuple[Signature, ...] = Field(max_length=1)


def signed(payload: bytes, certificate: bytes, key: bytes) -> Envelope:
    """Return the envelope of a payload.

    Args:
        payload: what is signed.
        certificate: that of the signer, in PEM.
        key: its private key in PEM, on P-256.

    Raises:
        SignatureError: the key cannot be used.
    """
    try:
        private = load_pem_private_key(key, None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:  # damaged, or encrypted
        raise SignatureError("has a private key that is damaged") from error
    if not isinstance(private, ec.EllipticCurvePrivateKey):
        raise SignatureError("has a private key of another kind than ECDSA")
    sig = private.sign(_encoded(payload), ec.ECDSA(hashes.SHA256()))
    one = Signature(sig=base64.b64encode(sig).decode(), cert=certificate.decode("ascii", "replace"))
    return Envelope(payload=base64.b64encode(payload).decode(), payloadType=PAYLOAD_TYPE, signatures=(one,))


def envelope_of(text: str) -> Envelope | None:
    """Return the envelope of a JSON text; None if it is none."""
    try:
        return Envelope.model_validate_json(text)
    except ValidationError:
        return None


def payload_of(envelope: Envelope) -> bytes:
    """Return the payload without a check of its signature.

    Raises:
        SignatureError: it is not encoded as base64.
    """
    try:
        return base64.b64decode(envelope.payload, validate=True)
    except binascii.Error as error:
        raise SignatureError("has a damaged envelope") from error


def verify(envelope: Envelope, authority: bytes) -> Signer:
    """Return who signed the payload.

    Args:
        envelope: the envelope.
        authority: the certificate of the authority that is trusted, in PEM.

    Raises:
        SignatureError: there is no signature, it does not belong to the payload, or the signer is of another authority.
    """
    if envelope.payloadType != PAYLOAD_TYPE or not envelope.signatures:
        raise SignatureError("is not signed")
    one, payload = envelope.signatures[0], payload_of(envelope)
    try:
        issuer = x509.load_pem_x509_certificate(authority)
        certificate = x509.load_pem_x509_certificate(one.cert.encode())
        public = certificate.public_key()
        sig = base64.b64decode(one.sig, validate=True)
    except (ValueError, UnsupportedAlgorithm) as error:  # also of base64, and a curve that does not exist
        raise SignatureError("has a damaged certificate or signature") from error
    if not isinstance(public, ec.EllipticCurvePublicKey):
        raise SignatureError("is signed with another kind of key than ECDSA")
    try:
        certificate.verify_directly_issued_by(issuer)
    except (InvalidSignature, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise SignatureError("is signed with a key of another authority") from error
    try:
        public.verify(sig, _encoded(payload), ec.ECDSA(hashes.SHA256()))
    except InvalidSignature as error:
        raise SignatureError("was changed after it was signed") from error
    return Signer(
        _field(certificate, NameOID.ORGANIZATIONAL_UNIT_NAME), _field(certificate, NameOID.COMMON_NAME)
    )


def _field(certificate: x509.Certificate, oid: x509.ObjectIdentifier) -> str:
    found = certificate.subject.get_attributes_for_oid(oid)
    return str(found[0].value) if found else "without a name"


def _encoded(payload: bytes) -> bytes:
    """Return what is signed: the pre-authentication encoding of DSSE."""
    kind = PAYLOAD_TYPE.encode()
    return b"DSSEv1 %d %s %d %s" % (len(kind), kind, len(payload), payload)
