"""A bundle is checked before it is used, and each fault is one sentence."""

import shutil
import time
from pathlib import Path

import pytest

from deploy.keys.certificates import Subject, make_authority, sign
from wire.bundle import BundleError, choose_bundle, read_bundle
from wire.roles import ANY, SERVERS, Role

NOW_S = float(round(time.time()))
"""The certificates are made for the real time: OpenSSL compares some times itself."""
DAY_S = 86400.0
AUTHORITY, OTHER = make_authority(NOW_S), make_authority(NOW_S)


def write(directory: Path, subject: Subject, authority: object = None) -> Path:
    issuer = AUTHORITY if authority is None else OTHER
    signed = sign(issuer.certificate, issuer.key, subject, NOW_S, DAY_S)
    directory.mkdir(mode=0o700)
    (directory / "authority.pem").write_bytes(issuer.certificate)
    (directory / f"{subject.name}.pem").write_bytes(signed.certificate)
    key = directory / f"{subject.name}.key"
    key.touch(mode=0o600)
    key.write_bytes(signed.key)
    return directory


@pytest.fixture
def alice(tmp_path: Path) -> Path:
    return write(tmp_path / "alice", Subject("alice", Role.OPERATOR, "r7"))


def refusal(directory: Path, now_s: float = NOW_S) -> str:
    with pytest.raises(BundleError) as caught:
        read_bundle(directory, now_s)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("role", Role)
def test_a_bundle_of_each_role_is_read(tmp_path: Path, role: Role) -> None:
    hosts = ("robot7", "127.0.0.1", "::1") if role in SERVERS else ()
    bundle = read_bundle(write(tmp_path / "x", Subject("x", role, "r7", hosts)), NOW_S)
    assert (bundle.name, bundle.role, bundle.namespace) == ("x", role, "r7")
    assert bundle.ends_s == NOW_S + DAY_S
    assert bundle.hosts == (("robot7", "127.0.0.1", "0:0:0:0:0:0:0:1") if hosts else ())
    assert (bundle.authority, bundle.certificate, bundle.key) == tuple(
        tmp_path / "x" / name for name in ("authority.pem", "x.pem", "x.key")
    )


def test_a_bundle_is_for_one_robot_or_for_any(tmp_path: Path, alice: Path) -> None:
    bundle = read_bundle(alice, NOW_S)
    assert bundle.is_for("r7")
    assert not bundle.is_for("r8")
    assert read_bundle(write(tmp_path / "x", Subject("x", Role.VIEWER, ANY)), NOW_S).is_for("r8")


def test_it_ends_to_the_second(alice: Path) -> None:
    read_bundle(alice, NOW_S + DAY_S - 0.001)
    assert "alice" in (sentence := refusal(alice, NOW_S + DAY_S))
    assert "expired on" in sentence
    assert "`lifeline keys issue alice`" in sentence


def test_it_is_not_valid_before_it_begins(alice: Path) -> None:
    assert "is not valid before" in (sentence := refusal(alice, NOW_S - 3601.0))
    assert "check the clock" in sentence


def test_a_key_that_others_can_read_is_refused(alice: Path) -> None:
    (alice / "alice.key").chmod(0o640)
    assert "mode 0640" in (sentence := refusal(alice))
    assert f"`chmod 600 {alice / 'alice.key'}`" in sentence


def test_a_bundle_that_others_can_change_is_refused(alice: Path) -> None:
    for path, mode in ((alice, 0o755), (alice / "authority.pem", 0o644), (alice / "alice.pem", 0o644)):
        path.chmod(mode | 0o022)
        assert f"so that other users can change it: run `chmod {mode:o} {path}`" in refusal(alice)
        path.chmod(mode)
    read_bundle(alice, NOW_S)


def test_a_key_that_leads_nowhere_is_one_sentence(alice: Path) -> None:
    (alice / "alice.key").unlink()
    (alice / "alice.key").symlink_to("nowhere")
    assert "cannot read" in refusal(alice)


@pytest.mark.parametrize("name", ["authority.pem", "alice.pem", "alice.key"])
def test_a_missing_file_is_named(alice: Path, name: str) -> None:
    (alice / name).unlink()
    assert ("has no private key" if name.endswith(".key") else f"{name} is missing") in refusal(alice)


@pytest.mark.parametrize("name", ["authority.pem", "alice.pem", "alice.key"])
@pytest.mark.parametrize(
    "content", [b"", b"nonsense", b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"]
)
def test_a_damaged_file_is_one_sentence(alice: Path, name: str, content: bytes) -> None:
    (alice / name).write_bytes(content)
    assert "copy the whole bundle again" in refusal(alice)


def test_files_of_different_bundles_do_not_fit_together(tmp_path: Path, alice: Path) -> None:
    foreign = write(tmp_path / "foreign", Subject("alice", Role.OPERATOR, "r7"), OTHER)
    shutil.copy(alice / "authority.pem", foreign)
    assert "from another authority" in refusal(foreign)
    again = write(tmp_path / "again", Subject("alice", Role.OPERATOR, "r7"))
    shutil.copy(again / "alice.pem", alice)
    assert "does not belong to the certificate" in refusal(alice)


def test_a_directory_that_is_missing_or_a_file_is_refused(tmp_path: Path, alice: Path) -> None:
    assert "there is no bundle of keys at" in refusal(tmp_path / "none")
    assert "there is no bundle of keys at" in refusal(alice / "alice.key")


def test_each_process_finds_its_bundle_in_a_directory_of_two(tmp_path: Path) -> None:
    write(tmp_path / "robot7", Subject("robot7", Role.SUPERVISOR, "r7"))
    with pytest.raises(
        BundleError, match=r"must have one bundle of another role.*robot7 \(supervisor\).*--keys"
    ):
        choose_bundle(tmp_path, NOW_S, part=None)
    write(tmp_path / "wheels", Subject("wheels", Role.BASE, "r7"))
    assert choose_bundle(tmp_path, NOW_S, part=Role.SUPERVISOR).name == "robot7"
    assert choose_bundle(tmp_path, NOW_S, part=None).name == "wheels"
    assert choose_bundle(tmp_path / "wheels", NOW_S, part=None).name == "wheels"
    with pytest.raises(BundleError, match=r"must have one bundle of the role operator .*--role operator"):
        choose_bundle(tmp_path, NOW_S, part=Role.OPERATOR)
    write(tmp_path / "vera", Subject("vera", Role.VIEWER, "r7"))
    with pytest.raises(BundleError, match=r"vera \(viewer\), wheels \(base\)"):
        choose_bundle(tmp_path, NOW_S, part=None)
    assert choose_bundle(tmp_path, NOW_S, part=Role.BASE).name == "wheels"
    write(tmp_path / "olga", Subject("olga", Role.OPERATOR, "r7"))
    for part in (Role.OPERATOR, None):
        assert choose_bundle(tmp_path, NOW_S, part=part).name == "olga"
    with pytest.raises(BundleError, match="there is no bundle of keys"):
        choose_bundle(tmp_path / "none", NOW_S, part=Role.SUPERVISOR)
