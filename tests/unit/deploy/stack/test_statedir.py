"""The state directory: its place, and its lock."""

import fcntl
import resource
from pathlib import Path

import pytest

from deploy.stack import statedir
from deploy.stack.errors import DeployError
from deploy.stack.statedir import SOCKET_PATH_LIMIT, LockedError, StateDir, locked
from deploy.stack.takedown import down
from wire.host.installation import ENVIRONMENT, state_directory


def test_without_an_option_it_is_where_the_supervisor_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    assert StateDir.choose(None).path == state_directory()


def test_an_option_goes_before_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, str(tmp_path / "named"))
    assert StateDir.choose(None).path == tmp_path / "named"
    assert StateDir.choose(tmp_path / "given").path == tmp_path / "given"


@pytest.mark.parametrize("is_option", [True, False])
def test_the_home_of_nobody_is_refused_in_one_sentence(
    *, is_option: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = "~no-such-user/state"
    monkeypatch.setenv(ENVIRONMENT, named)
    with pytest.raises(
        DeployError, match=r"^~no-such-user/state: there is no user ~no-such-user; .*--state-dir"
    ):
        StateDir.choose(Path(named) if is_option else None)


def test_a_link_that_others_can_exchange_is_refused_although_it_leads_to_a_directory_of_this_user(
    tmp_path: Path,
) -> None:
    for name in ("own", "open"):
        (tmp_path / name).mkdir(mode=0o700)
    link = tmp_path / "open" / "link"
    link.symlink_to(tmp_path / "own")
    state = StateDir.choose(link)
    state.create()
    assert state == StateDir.choose(tmp_path / "own")
    (tmp_path / "open").chmod(0o777)
    with pytest.raises(DeployError, match=f"^other users can exchange {link}: run `chmod"):
        StateDir.choose(link).create()


def test_a_link_to_itself_stops_no_command_but_is_no_state_directory(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to("link")
    state = StateDir.choose(link)
    assert statedir.read_json(state.record) == {}
    with pytest.raises(DeployError, match=r"cannot create the state directory .*--state-dir"):
        state.create()


def test_a_directory_that_cannot_be_written_is_refused_with_a_way_out(tmp_path: Path) -> None:
    state = StateDir(tmp_path / "is-not-there")
    with (
        pytest.raises(DeployError, match=r"cannot write .*is-not-there \(No such file.*--state-dir"),
        locked(state, "up"),
    ):
        pass
    state.record.mkdir(parents=True)
    with pytest.raises(DeployError, match="cannot write in the state directory"):
        state.forget()


def test_on_a_full_disk_a_lock_is_a_lock_all_the_same(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    state.lock.touch()
    full = resource.getrlimit(resource.RLIMIT_FSIZE)
    with state.lock.open("ab") as other:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, full[1]))
        try:
            with locked(state, "down"), pytest.raises(BlockingIOError):
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, full)
    assert state.lock.read_bytes() == b""


def test_a_lock_that_is_a_link_is_not_opened(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("kept")
    state = StateDir(tmp_path)
    state.lock.symlink_to("kept")
    with pytest.raises(DeployError, match=r"cannot write .*symbolic links"), locked(state, "up"):
        pass
    assert (tmp_path / "kept").read_text() == "kept"


def test_a_directory_that_others_can_change_is_refused_with_the_command_that_repairs_it(
    tmp_path: Path,
) -> None:
    state = StateDir(tmp_path / "state")
    state.create()
    state.path.chmod(0o777)
    with pytest.raises(DeployError, match=f"other users can change it: run `chmod 755 {state.path}`"):
        state.create()


def test_where_nothing_can_be_locked_down_looks_for_what_runs_all_the_same(tmp_path: Path) -> None:
    state, said = StateDir(tmp_path), list[str]()
    state.lock.mkdir()
    down(state, said.append)
    assert said == ["nothing is running"]


def test_it_is_for_this_user_only(tmp_path: Path) -> None:
    state = StateDir(tmp_path / "new")
    state.create()
    assert state.path.stat().st_mode & 0o777 == 0o700


def _of_socket_length(length: int) -> StateDir:
    """Return a state directory whose socket's path has this length, without creating it."""
    rest = length - len("//supervisord.sock")
    return StateDir(Path("/" + "d" * rest))


def test_a_socket_path_just_too_long_is_refused_with_a_way_out() -> None:
    state = _of_socket_length(SOCKET_PATH_LIMIT + 1)
    with pytest.raises(DeployError, match=r"too long for a socket .* choose a shorter one with --state-dir"):
        state.create()


def test_a_socket_path_just_short_enough_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Path] = []

    def mkdir(path: Path, **_: object) -> None:
        made.append(path)

    def usable(_: Path) -> None:
        return None

    monkeypatch.setattr(Path, "mkdir", mkdir)
    monkeypatch.setattr(statedir, "refusal", usable)
    state = _of_socket_length(SOCKET_PATH_LIMIT)
    state.create()
    assert made == [state.path]


def test_a_second_command_is_refused_and_told_who_is_at_work(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    sentence = r"`lifeline up` \(pid \d+\) is using .*`lifeline down`"
    with locked(state, "up"), pytest.raises(LockedError, match=sentence), locked(state, "up"):
        pass
    with locked(state, "down"):
        pass


def test_a_lock_without_a_readable_holder_is_a_lock_all_the_same(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    with locked(state, "up"):
        state.lock.write_text("[]")
        with pytest.raises(LockedError, match="another `lifeline` is using"), locked(state, "up"):
            pass


def test_the_last_lines_of_a_log_are_reported_and_a_missing_log_is_empty(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    state.log("sim").write_text("".join(f"line {i}\n" for i in range(20)))
    assert state.last_lines("sim") == "\n".join(f"    line {n}" for n in range(12, 20))
    assert state.last_lines("supervisor") == ""


@pytest.mark.parametrize("pid", ["0", "-1", "true", "1.5", "null", str(2**63), "[" * 100_000])
def test_a_lock_that_names_no_single_process_names_none(tmp_path: Path, pid: str) -> None:
    """Zero and negative numbers would send a signal to several processes."""
    state = StateDir(tmp_path)
    state.lock.write_text(f'{{"pid": {pid}, "command": "up"}}')
    assert LockedError(state).pid is None
