"""What other users can change is refused, with the command that repairs it."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from wire.ownership import ENTER, make_directory, open_own, refusal

OTHER = 65_534
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to another user")


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    made = tmp_path / "state"
    made.mkdir(mode=0o700)
    return made


def give(path: Path) -> None:
    os.chown(path, OTHER, OTHER, follow_symlinks=False)


@pytest.mark.parametrize("mode", [0o700, 0o750, 0o755, 0o500])
def test_a_directory_that_only_its_user_can_change_is_used(mode: int, directory: Path) -> None:
    directory.chmod(mode)
    (directory / "estop-robot.ready").touch()
    assert refusal(directory) is None


@pytest.mark.parametrize(
    ("mode", "repaired"), [(0o777, 0o755), (0o770, 0o750), (0o702, 0o700), (0o1777, 0o1755), (0o2775, 0o2755)]
)
def test_a_directory_that_others_can_change_is_refused_with_the_command_that_repairs_it(
    mode: int, repaired: int, directory: Path
) -> None:
    directory.chmod(mode)
    assert refusal(directory) == (
        f"{directory} has mode {mode:04o}, so that other users can change it: run `chmod {repaired:o} {directory}`"
    )
    directory.chmod(repaired)
    assert refusal(directory) is None


def test_a_directory_of_sockets_may_not_even_be_entered(directory: Path) -> None:
    directory.chmod(0o711)
    assert refusal(directory) is None
    assert "chmod 700" in (refusal(directory, ENTER) or "")


def test_a_path_with_a_space_is_quoted_in_the_command(tmp_path: Path) -> None:
    path = tmp_path / "a b"
    path.mkdir()
    path.chmod(0o777)
    assert (refusal(path) or "").endswith(f"run `chmod 755 '{path}'`")


@pytest.mark.parametrize("depth", [1, 2])
def test_a_directory_that_others_can_exchange_is_refused(depth: int, directory: Path) -> None:
    below = directory / "/".join("ab"[:depth])
    below.mkdir(parents=True)
    directory.chmod(0o777)
    assert refusal(below) == f"other users can exchange {directory / 'a'}: run `chmod +t {directory}`"
    directory.chmod(0o1777)
    assert refusal(below) is None


def test_a_link_of_this_user_leads_to_the_directory_that_counts(tmp_path: Path, directory: Path) -> None:
    (tmp_path / "link").symlink_to(directory)
    assert refusal(tmp_path / "link") is None
    directory.chmod(0o777)
    assert f"`chmod 755 {directory}`" in (refusal(tmp_path / "link") or "")


def test_a_link_that_others_can_exchange_is_refused(tmp_path: Path, directory: Path) -> None:
    (tmp_path / "open").mkdir()
    link = tmp_path / "open" / "link"
    link.symlink_to(directory)
    (tmp_path / "open").chmod(0o777)
    assert "other users can exchange" in (refusal(link) or "")


@pytest.mark.parametrize("below", [".", "state"])
def test_each_link_on_the_way_is_refused_if_others_can_exchange_it(
    below: str, tmp_path: Path, directory: Path
) -> None:
    """A link of this user leads to one in an open directory, which leads to a directory of this user."""
    shared = tmp_path / "open"
    shared.mkdir()
    (shared / "now").symlink_to(directory if below == "." else "../")
    (tmp_path / "link").symlink_to("open/now")
    assert refusal(tmp_path / "link" / below) is None
    shared.chmod(0o777)
    assert refusal(tmp_path / "link" / below) == (
        f"other users can exchange {shared / 'now'}: run `chmod +t {shared}`"
    )
    shared.chmod(0o1777)
    assert refusal(tmp_path / "link" / below) is None


def a_link(path: Path) -> None:
    path.symlink_to("/etc/passwd")


def a_file(path: Path) -> None:
    path.touch()


@needs_root
@pytest.mark.parametrize(("put", "command"), [(a_link, "rm"), (a_file, "chown root")])
def test_what_another_user_left_in_a_directory_is_refused(
    put: Callable[[Path], None], command: str, directory: Path
) -> None:
    left = directory / "estop-robot.ready"
    put(left)
    give(left)
    assert refusal(directory) == f"{left} belongs to the user nobody: run `{command} {left}`"


@needs_root
def test_a_directory_that_another_user_made_where_everyone_can_write_is_refused(directory: Path) -> None:
    directory.chmod(0o1777)
    below = directory / "theirs" / "state"
    below.mkdir(parents=True)
    give(below.parent)
    assert f"run `chown root {below.parent}`" in (refusal(below) or "")
    (directory / "link").symlink_to("theirs/state")
    give(directory / "link")
    below.parent.chmod(0o755)
    os.chown(below.parent, 0, 0)
    assert f"run `rm {directory / 'link'}`" in (refusal(directory / "link") or "")


@needs_root
def test_a_user_other_than_root_uses_no_directory_of_a_third(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    give(directory)
    assert refusal(directory) is None, "root may"
    monkeypatch.setattr(os, "geteuid", lambda: 12_345)
    assert refusal(directory) == f"{directory} belongs to the user nobody: run `sudo chown 12345 {directory}`"


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_a_directory_that_is_made_is_used_under_any_umask(umask: int, tmp_path: Path) -> None:
    before = os.umask(umask)
    try:
        missing = make_directory(tmp_path / "a" / "b" / "state")
    finally:
        os.umask(before)
    assert missing == [tmp_path / one for one in ("a/b/state", "a/b", "a")]
    assert make_directory(tmp_path / "a" / "b" / "state") == []
    assert refusal(tmp_path / "a" / "b" / "state", ENTER) is None


def test_a_missing_directory_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        refusal(tmp_path / "none")


def test_a_link_to_itself_is_an_error_of_the_system(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("link")
    with pytest.raises(OSError, match="Too many levels of symbolic links"):
        refusal(tmp_path / "link")


def test_a_link_is_not_opened(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("kept")
    (tmp_path / "link").symlink_to("target")
    with pytest.raises(OSError, match="Too many levels of symbolic links"):
        open_own(tmp_path / "link", os.O_WRONLY | os.O_TRUNC)
    assert (tmp_path / "target").read_text() == "kept"
