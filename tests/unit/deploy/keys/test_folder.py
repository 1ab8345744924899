"""The folder of keys: modes from the creation on, nothing half-written, and each refusal in one sentence."""

import json
import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from deploy.keys import commands, folder
from deploy.keys.commands import init, issue, issued_sentences, revoke, revoked_sentence, show, table
from deploy.keys.folder import default_folder, locked
from deploy.keys.register import Request
from deploy.stack.errors import DeployError
from wire.bundle import BundleError, read_bundle
from wire.roles import Role

DAY_S = 86400.0


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def ask(name: str, role: Role | None = Role.OPERATOR) -> Request:
    return Request(name, role, None, None)


@contextmanager
def umask(mask: int) -> Generator[None]:
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    path = tmp_path / "keys"
    init(path, replace=False)
    return path


@pytest.mark.parametrize("mask", [0o000, 0o022, 0o077])
def test_keys_are_private_under_any_umask(tmp_path: Path, mask: int) -> None:
    path = tmp_path / "keys"
    with umask(mask):
        init(path, replace=False)
        bundle = Path(issue(path, ask("alice"), DAY_S)["bundle"])
    for directory in (path, path / "authority", path / "bundles", bundle):
        assert mode(directory) == 0o700, directory
    for private in (path / "authority" / "authority.key", bundle / "alice.key", path / "register.json"):
        assert mode(private) == 0o600, private


def test_a_key_is_private_from_its_creation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A change of the mode afterwards would leave a moment in which others can open the file."""
    created: dict[str, int] = {}
    opening = os.open

    def watched(path: str | Path, flags: int, mode: int = 0o777) -> int:
        if flags & os.O_CREAT:
            created[Path(path).name] = mode
        return opening(path, flags, mode)

    def refused(_path: str, _mode: int) -> None:
        pytest.fail("the mode is changed afterwards")

    monkeypatch.setattr(folder.os, "open", watched)
    monkeypatch.setattr(folder.os, "chmod", refused)
    init(tmp_path / "keys", replace=False)
    issue(tmp_path / "keys", ask("alice"), DAY_S)
    assert created["authority.key"] == created["alice.key"] == 0o600


def test_a_bundle_has_what_the_other_computer_needs_and_no_more(keys: Path) -> None:
    bundle = Path(issue(keys, ask("alice"), DAY_S)["bundle"])
    assert {path.name for path in bundle.iterdir()} == {"authority.pem", "alice.pem", "alice.key"}
    assert (bundle / "authority.pem").read_bytes() == (keys / "authority" / "authority.pem").read_bytes()


def test_a_second_authority_needs_replace_and_ends_the_bundles_of_the_first(keys: Path) -> None:
    issue(keys, ask("alice"), DAY_S)
    issue(keys, ask("bob"), DAY_S)
    revoke(keys, "bob")
    before = (keys / "authority" / "authority.pem").read_bytes()
    with pytest.raises(DeployError, match=r"there is an authority.*--replace"):
        init(keys, replace=False)
    init(keys, replace=True)
    assert (keys / "authority" / "authority.pem").read_bytes() != before
    assert not (keys / "bundles").exists()
    assert table(keys) == []
    with pytest.raises(DeployError, match="bob was revoked"):
        issue(keys, ask("bob"), DAY_S)
    issue(keys, ask("alice"), DAY_S)


def test_a_revoked_name_still_connects_until_a_time_that_the_sentence_gives(keys: Path) -> None:
    ends = issue(keys, ask("alice"), DAY_S)["ends"]
    sentence = revoked_sentence(revoke(keys, "alice"))
    assert f"connects until {ends}" in sentence
    assert "keys init --replace" in sentence
    assert not (keys / "bundles" / "alice").exists()
    assert table(keys)[0].revoked
    issue(keys, ask("bob"), -1.0)
    assert revoked_sentence(revoke(keys, "bob")).endswith("no longer connects")


def test_a_crash_while_a_bundle_is_written_leaves_the_old_one(
    keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = Path(issue(keys, ask("alice"), DAY_S)["bundle"])
    before = {path.name: path.read_bytes() for path in bundle.iterdir()}
    with monkeypatch.context() as patch:
        patch.setattr(folder.shutil, "rmtree", _not_removed)  # a killed process cleans nothing up
        patch.setattr(folder.os, "fsync", _killed_at_a_private_key())
        with pytest.raises(KeyboardInterrupt):
            issue(keys, ask("alice"), DAY_S)
    assert {path.name: path.read_bytes() for path in bundle.iterdir()} == before
    issue(keys, ask("alice"), DAY_S)
    assert sorted(path.name for path in (keys / "bundles").iterdir()) == ["alice"]
    assert len(json.loads((keys / "register.json").read_text())["issued"]) == 3


def _not_removed(_path: Path, *, ignore_errors: bool = False) -> None:
    """As shutil.rmtree."""


def _killed_at_a_private_key() -> object:
    flush = os.fsync

    def killed(descriptor: int) -> None:
        if Path(f"/proc/self/fd/{descriptor}").readlink().name == "alice.key":
            raise KeyboardInterrupt
        flush(descriptor)

    return killed


def test_without_an_authority_nothing_is_issued(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match=r"there is no folder of keys at .*keys init"):
        issue(tmp_path / "none", ask("alice"), DAY_S)
    (tmp_path / "empty").mkdir(mode=0o700)
    with pytest.raises(DeployError, match=r"there is no authority in .*keys init"):
        issue(tmp_path / "empty", ask("alice"), DAY_S)


def test_a_folder_that_others_can_read_is_refused(keys: Path) -> None:
    keys.chmod(0o750)
    with pytest.raises(DeployError, match=r"has mode 0750.*chmod 700"):
        table(keys)


def test_a_damaged_register_or_authority_is_one_sentence(keys: Path) -> None:
    issue(keys, ask("alice"), DAY_S)
    (keys / "register.json").write_text("{")
    with pytest.raises(DeployError, match=r"register.json is damaged.*--replace"):
        table(keys)
    init(keys, replace=True)
    (keys / "authority" / "authority.key").write_text("nonsense")
    with pytest.raises(DeployError, match=r"cannot sign, because its files are damaged.*--replace"):
        issue(keys, ask("alice"), DAY_S)
    (keys / "authority" / "authority.key").unlink()
    with pytest.raises(DeployError, match=r"cannot read the authority: .*authority.key: No such file"):
        issue(keys, ask("alice"), DAY_S)


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DeployError, match=r"cannot use the folder of keys: .*Not a directory"):
        init(tmp_path / "file" / "keys", replace=False)
    with pytest.raises(DeployError, match=r"there is no user ~nobody-here.* --keys"):
        table(Path("~nobody-here/keys"))


def test_the_default_folder_is_the_users(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    assert default_folder() == tmp_path / ".config" / "lifeline" / "keys"
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")
    assert default_folder() == tmp_path / ".config" / "lifeline" / "keys"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "c"))
    assert default_folder() == tmp_path / "c" / "lifeline" / "keys"
    init(None, replace=False)
    with locked(None) as found:
        assert found.path == tmp_path / "c" / "lifeline" / "keys"


def test_the_sentences_after_an_issue_name_the_next_step(keys: Path) -> None:
    hub = issue(keys, Request("robot7", Role.SUPERVISOR, None, ("robot7",)), DAY_S)
    sentences = issued_sentences(hub)
    assert "supervisor@robot" in sentences[0]
    assert "robot7, localhost, 127.0.0.1, ::1" in sentences[0]
    assert f"scp -r {hub['bundle']} HOST:" in sentences[1]
    assert "--endpoint quic/0.0.0.0:7447 --keys robot7" in sentences[2]
    assert "--endpoint quic/ROBOT:7447 --keys alice" in issued_sentences(issue(keys, ask("alice"), DAY_S))[2]


@pytest.mark.parametrize(("role", "drive"), [(Role.ESTOP, ""), (Role.OPERATOR, " --drive")])
def test_the_sentences_after_an_issue_for_a_page_name_the_command_that_serves_it(
    keys: Path, role: Role, drive: str
) -> None:
    page = issue(keys, Request("page", role, None, ("robot7",)), DAY_S)
    sentences = issued_sentences(page)
    assert f"`lifeline station --open{drive} --keys {page['bundle']}`" in sentences[1]
    assert sentences[2].endswith(f"scp -r {page['bundle']} HOST:")
    assert "install authority.pem" in sentences[3]


def test_the_table_warns_of_what_ends_soon(keys: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show(table(keys))
    assert "no certificate was issued yet" in capsys.readouterr().out
    issue(keys, ask("alice"), 2 * DAY_S)
    issue(keys, ask("bob", Role.VIEWER), 20 * DAY_S)
    show(table(keys))
    shown = capsys.readouterr().out
    assert [line.split()[:4] for line in shown.splitlines()[1:3]] == [
        ["alice", "operator", "robot", "2.0"],
        ["bob", "viewer", "robot", "20.0"],
    ]
    assert shown.count("warning:") == 1
    assert "warning: alice ends on" in shown
    assert [row["name"] for row in commands.to_json(table(keys))] == ["alice", "bob"]


def test_a_second_bundle_in_one_directory_is_refused(keys: Path) -> None:
    bundle = Path(issue(keys, ask("alice"), DAY_S)["bundle"])
    (bundle / "bob.key").write_text("")
    with pytest.raises(BundleError, match=r"several private keys \(alice.key, bob.key\)"):
        read_bundle(bundle, 0.0)
