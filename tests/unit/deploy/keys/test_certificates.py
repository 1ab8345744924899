"""Certificates: what they permit, how long, and which keys they accept."""

from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from deploy.keys.certificates import (
    AUTHORITY_LIFETIME,
    Signed,
    Subject,
    UnusableAuthorityError,
    make_authority,
    sign,
)
from deploy.keys.register import WITH_HOSTS
from wire.roles import Role

NOW_S = 1_800_000_000.0
DAY_S = 86400.0
AUTHORITY = make_authority(NOW_S)
HUB = Subject("robot7", Role.SUPERVISOR, "r7", ("robot7", "192.168.1.7", "::1"))
ALICE = Subject("alice", Role.OPERATOR, "r7")


def signed(subject: Subject, now_s: float = NOW_S, lifetime_s: float = DAY_S) -> Signed:
    return sign(AUTHORITY.certificate, AUTHORITY.key, subject, now_s, lifetime_s)


def certificate(pem: bytes) -> x509.Certificate:
    return x509.load_pem_x509_certificate(pem)


def test_the_authority_signs_participants_and_no_further_authority() -> None:
    of = certificate(AUTHORITY.certificate)
    constraints = of.extensions.get_extension_for_class(x509.BasicConstraints)
    assert constraints.critical
    assert constraints.value == x509.BasicConstraints(ca=True, path_length=0)
    usage = of.extensions.get_extension_for_class(x509.KeyUsage).value
    assert (usage.key_cert_sign, usage.crl_sign, usage.digital_signature) == (True, True, False)


def test_two_authorities_differ_in_name_and_key() -> None:
    other = make_authority(NOW_S)
    assert certificate(other.certificate).subject != certificate(AUTHORITY.certificate).subject
    assert other.key != AUTHORITY.key


def test_a_certificate_names_role_robot_and_person() -> None:
    subject = certificate(signed(ALICE).certificate).subject
    assert [one.value for one in subject.get_attributes_for_oid(NameOID.COMMON_NAME)] == ["operator@r7"]
    assert [one.value for one in subject.get_attributes_for_oid(NameOID.ORGANIZATIONAL_UNIT_NAME)] == [
        "alice"
    ]


@pytest.mark.parametrize("role", Role)
def test_only_a_supervisor_a_router_a_station_or_an_operator_may_be_a_server_and_only_for_its_hosts(
    role: Role,
) -> None:
    for hosts in ((), ("robot7",)):
        of = certificate(signed(Subject("x", role, "r7", hosts)).certificate)
        purposes = set(of.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
        assert ExtendedKeyUsageOID.CLIENT_AUTH in purposes
        assert (ExtendedKeyUsageOID.SERVER_AUTH in purposes) is (role in WITH_HOSTS and hosts != ())
    assert not of.extensions.get_extension_for_class(x509.BasicConstraints).value.ca


def test_a_supervisors_certificate_has_its_names_and_addresses() -> None:
    names = certificate(signed(HUB).certificate).extensions.get_extension_for_class(
        x509.SubjectAlternativeName
    )
    assert names.value.get_values_for_type(x509.DNSName) == ["robot7"]
    assert [str(ip) for ip in names.value.get_values_for_type(x509.IPAddress)] == ["192.168.1.7", "::1"]


def test_the_key_belongs_to_the_certificate_and_is_new_each_time() -> None:
    first, second = signed(ALICE), signed(ALICE)
    key = load_pem_private_key(first.key, None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    assert key.public_key() == certificate(first.certificate).public_key()
    assert first.key != second.key
    assert first.serial != second.serial


def test_a_certificate_begins_an_hour_ago_and_ends_after_its_lifetime() -> None:
    of, now = certificate(signed(ALICE).certificate), datetime.fromtimestamp(NOW_S, UTC)
    assert of.not_valid_before_utc == now - timedelta(hours=1)
    assert of.not_valid_after_utc == now + timedelta(days=1)
    assert signed(ALICE).ends_s == NOW_S + DAY_S


def test_a_certificate_ends_with_its_authority_at_the_latest() -> None:
    late_s = NOW_S + AUTHORITY_LIFETIME.total_seconds() - DAY_S / 2
    assert signed(ALICE, late_s).ends_s == late_s + DAY_S / 2
    with pytest.raises(UnusableAuthorityError, match="it expired on 20"):
        signed(ALICE, late_s + DAY_S / 2)


@pytest.mark.parametrize(
    ("pem", "key", "reason"),
    [
        (b"", AUTHORITY.key, "damaged"),
        (AUTHORITY.certificate, b"nonsense", "damaged"),
        (AUTHORITY.certificate, make_authority(NOW_S).key, "does not belong"),
    ],
)
def test_a_damaged_authority_is_refused(pem: bytes, key: bytes, reason: str) -> None:
    with pytest.raises(UnusableAuthorityError, match=reason):
        sign(pem, key, ALICE, NOW_S, DAY_S)
