"""Pages that are signed, verified, changed and compared, with real keys."""

import base64
import json
import time
from pathlib import Path

import pytest

from deploy.keys.certificates import Subject, make_authority, sign
from deploy.keys.signatures import (
    Envelope,
    Signature,
    SignatureError,
    envelope_of,
    payload_of,
    signed,
    verify,
)
from deploy.stack.errors import DeployError
from passport.page import inside_of
from passport.reading import check, compare, report
from passport.record import MAX_BYTES
from passport.statement import digest
from tests.unit.passport.records import cell, record, run
from wire.bundle import AUTHORITY
from wire.roles import Role

PASSPORT = record(cell("e-stop", run(0.3), run(0.2)))
ROBOT = "robot7 (supervisor@robot)"
P_256 = bytes.fromhex("06082a8648ce3d030107")
"""The name of the curve in a certificate."""


def bundle(directory: Path, role: Role = Role.SUPERVISOR, name: str = "robot7") -> Path:
    """Write a bundle of a new authority."""
    authority = make_authority(time.time())
    issued = sign(authority.certificate, authority.key, Subject(name, role, "robot"), time.time(), 3600.0)
    directory.mkdir(mode=0o700)
    for file, content in {
        AUTHORITY: authority.certificate,
        f"{name}.pem": issued.certificate,
        f"{name}.key": issued.key,
    }.items():
        (directory / file).write_bytes(content)
        (directory / file).chmod(0o600)
    return directory


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bundle(tmp_path_factory.mktemp("keys") / "robot7")


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    path = tmp_path / "passport.json"
    path.write_text(PASSPORT.to_json())
    return path


def page_of(measured: Path, keys: Path | None) -> Path:
    out = measured.with_suffix(".html")
    report(measured, out, keys)
    return out


def test_a_signed_page_is_verified_with_its_signer_and_its_digest(measured: Path, keys: Path) -> None:
    out = page_of(measured, keys)
    found = check(out, keys)
    assert (found.signer, found.sha256) == (ROBOT, digest(PASSPORT))
    assert found.shows.startswith("After the one fault tested")
    assert check(out, keys / AUTHORITY) == found


def test_the_report_names_its_signer(measured: Path, keys: Path, tmp_path: Path) -> None:
    assert report(measured, tmp_path / "a.html", keys).signer == ROBOT
    assert report(measured, tmp_path / "b.html", None).signer is None


def test_a_page_is_made_again_from_a_page(measured: Path, keys: Path, tmp_path: Path) -> None:
    first, again = page_of(measured, keys), tmp_path / "again.html"
    report(first, again, None)
    assert inside_of(again.read_text()) == PASSPORT.to_json().strip()


def test_the_envelope_alone_is_verified(measured: Path, keys: Path, tmp_path: Path) -> None:
    inside = inside_of(page_of(measured, keys).read_text())
    assert inside is not None
    (tmp_path / "envelope.json").write_text(inside)
    assert check(tmp_path / "envelope.json", keys).signer == ROBOT


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("within 0.31 m", "within 0.11 m", "has text that was not signed"),
        ("<dd>concrete</dd>", "<dd>ice</dd>", "has text that was not signed"),
    ],
)
def test_a_page_whose_text_was_changed_is_rejected(
    measured: Path, keys: Path, old: str, new: str, why: str
) -> None:
    out = page_of(measured, keys)
    text = out.read_text()
    assert old in text
    out.write_text(text.replace(old, new))
    assert why in rejected(out, keys)


def rejected(file: Path, keys: Path, envelope: Envelope | None = None) -> str:
    """Return why a file is rejected, which contains the envelope instead if there is one."""
    if envelope is not None:
        file.write_text(envelope.model_dump_json())
    with pytest.raises(SignatureError) as caught:
        check(file, keys)
    return str(caught.value)


def envelope_in(out: Path) -> Envelope:
    inside = inside_of(out.read_text())
    assert inside is not None
    envelope = envelope_of(inside)
    assert envelope is not None
    return envelope


def test_a_record_that_was_changed_after_it_was_signed_is_rejected(measured: Path, keys: Path) -> None:
    envelope = envelope_in(page_of(measured, keys))
    payload = json.loads(payload_of(envelope))
    other = PASSPORT.model_copy(update={"robot": "other"})
    payload["predicate"] = json.loads(other.to_json())
    payload["subject"] = [{"name": "other", "digest": {"sha256": digest(other)}}]
    changed = envelope.model_copy(update={"payload": base64.b64encode(json.dumps(payload).encode()).decode()})
    assert "was changed after it was signed" in rejected(measured, keys, changed)


def test_a_signature_of_another_authority_is_rejected(measured: Path, keys: Path, tmp_path: Path) -> None:
    out = page_of(measured, bundle(tmp_path / "robot7"))
    assert "is signed with a key of another authority" in rejected(out, keys)


def test_a_file_that_is_not_signed_is_rejected(measured: Path, keys: Path) -> None:
    assert "is not signed" in rejected(measured, keys)
    assert "is not signed" in rejected(page_of(measured, None), keys)
    envelope = envelope_in(page_of(measured, keys))
    assert "is not signed" in rejected(measured, keys, envelope.model_copy(update={"signatures": ()}))
    other = envelope.model_copy(update={"payloadType": "text/plain"})
    assert "is not signed" in rejected(measured, keys, other)


def test_only_the_computer_of_a_robot_signs_a_passport(measured: Path, tmp_path: Path) -> None:
    viewer = bundle(tmp_path / "eve", Role.VIEWER, "eve")
    with pytest.raises(DeployError, match="role viewer"):
        report(measured, tmp_path / "out.html", viewer)
    forged = signed(
        payload_of(envelope_in(page_of(measured, bundle(tmp_path / "own")))),
        (viewer / "eve.pem").read_bytes(),
        (viewer / "eve.key").read_bytes(),
    )
    assert "is signed by eve (viewer@robot): only the computer" in rejected(measured, viewer, forged)


@pytest.mark.parametrize("field", ["sig", "cert"])
def test_a_damaged_signature_is_rejected(measured: Path, keys: Path, field: str) -> None:
    envelope = envelope_in(page_of(measured, keys))
    damaged = envelope.signatures[0].model_copy(update={field: "é"})
    assert "damaged" in rejected(measured, keys, envelope.model_copy(update={"signatures": (damaged,)}))


def test_a_certificate_with_a_curve_that_does_not_exist_is_rejected(measured: Path, keys: Path) -> None:
    envelope = envelope_in(page_of(measured, keys))
    lines = envelope.signatures[0].cert.strip().splitlines()
    content = base64.b64decode("".join(lines[1:-1]))
    assert P_256 in content
    content = content.replace(P_256, P_256[:-1] + b"\x63")
    cert = "\n".join((lines[0], base64.encodebytes(content).decode().strip(), lines[-1]))
    damaged = envelope.signatures[0].model_copy(update={"cert": cert})
    assert "damaged" in rejected(measured, keys, envelope.model_copy(update={"signatures": (damaged,)}))


def test_a_key_that_cannot_sign_is_named(keys: Path) -> None:
    with pytest.raises(SignatureError, match="damaged"):
        signed(b"", b"", b"nothing")
    one = Signature(sig="", cert=(keys / "robot7.pem").read_text())
    with pytest.raises(SignatureError, match="changed"):
        verify(
            Envelope(payload="", payloadType="application/vnd.in-toto+json", signatures=(one,)),
            (keys / AUTHORITY).read_bytes(),
        )


@pytest.mark.parametrize(
    "text", ["", "{}", "null", '{"payload": "!", "payloadType": "", "signatures": []}', "<!doctype html>"]
)
def test_a_file_that_is_no_passport_is_refused_in_one_sentence(measured: Path, keys: Path, text: str) -> None:
    measured.write_text(text)
    for use in (lambda: check(measured, keys), lambda: report(measured, measured, None)):
        with pytest.raises(DeployError) as caught:
            use()
        assert str(caught.value).count("\n") == 0


def test_a_missing_or_too_large_file_is_refused(measured: Path, keys: Path, tmp_path: Path) -> None:
    with pytest.raises(DeployError, match="No such file"):
        check(tmp_path / "none", keys)
    with measured.open("wb") as file:
        file.truncate(3 * MAX_BYTES + 1)
    with pytest.raises(DeployError, match="larger"):
        check(measured, keys)
    with pytest.raises(DeployError, match="No such file"):
        report(measured.with_name("none"), measured, None)
    with pytest.raises(DeployError, match="cannot write"):
        report(page_of(_written(tmp_path / "good.json"), None), tmp_path / "no" / "such.html", None)
    with pytest.raises(DeployError, match="no bundle of keys"):
        report(_written(tmp_path / "good.json"), tmp_path / "out.html", tmp_path / "nowhere")


def _written(path: Path) -> Path:
    path.write_text(PASSPORT.to_json())
    return path


def test_a_worse_limit_is_shown_and_fails(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    worse = tmp_path / "worse.json"
    worse.write_text(record(cell("e-stop", run(0.4), run(0.2))).to_json())
    assert compare(measured, worse, as_json=False) == 1
    shown = capsys.readouterr().out
    assert "1 of 3 limits became worse" in shown
    assert "0.310" in shown
    assert "0.410" in shown
    assert compare(worse, measured, as_json=False) == 0
    capsys.readouterr()
    assert compare(measured, measured, as_json=False) == 0
    assert "all 3 limits are the same" in capsys.readouterr().out
    assert compare(measured, measured, as_json=True) == 0
    assert '"worse": false' in capsys.readouterr().out


def test_passports_without_a_common_cell_are_not_compared(measured: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text(record(cell("plain zero", run())).to_json())
    with pytest.raises(DeployError, match="no measured cell in common"):
        compare(measured, other, as_json=False)


def test_a_limit_that_is_not_known_any_more_is_shown_in_words(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lost = tmp_path / "lost.json"
    lost.write_text(record(cell("e-stop", run(0.3, stop_s=None))).to_json())
    assert compare(measured, lost, as_json=False) == 1
    assert "not measured" in capsys.readouterr().out


def test_a_robot_that_does_not_stop_any_more_is_worse(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    failed = tmp_path / "failed.json"
    for cells in (
        [cell("e-stop", run(stopped=False))],
        [*PASSPORT.cells, cell("operator's program killed", run(stopped=False))],
    ):
        failed.write_text(record(*cells).to_json())
        assert compare(measured, failed, as_json=False) == 1
        assert "did not stop" in capsys.readouterr().out
        assert compare(measured, failed, as_json=True) == 1
        assert '"new_did_not_stop": true' in capsys.readouterr().out


def test_a_refusal_quotes_little_of_the_file(measured: Path) -> None:
    measured.write_text(json.dumps(json.loads(PASSPORT.to_json()) | {"x" * 100_000: 1}))
    with pytest.raises(DeployError) as caught:
        report(measured, measured, None)
    assert len(str(caught.value)) < len(str(measured)) + 300
