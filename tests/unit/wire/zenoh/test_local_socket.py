"""The hub's socket for the programs of its user: where it is, and when the hub refuses to offer it."""

import fcntl
import os
import pwd
import socket
from pathlib import Path

import pytest

from wire.zenoh import local_socket
from wire.zenoh.local_socket import (
    SocketError,
    answers,
    participants,
    pid_in,
    prepare,
    run_directory,
    session_id,
    socket_of,
)


def test_the_directory_is_in_the_users_home_unless_a_variable_names_another(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv(local_socket.ENVIRONMENT, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))  # sudo and service managers may set another than the user's
    assert run_directory() == Path(pwd.getpwuid(os.getuid()).pw_dir) / ".local/state/lifeline/run"
    monkeypatch.setenv(local_socket.ENVIRONMENT, "sockets")
    assert run_directory() == Path.cwd() / "sockets"


def test_a_user_without_an_entry_has_the_home_of_the_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def unknown(_: int) -> pwd.struct_passwd:
        raise KeyError

    monkeypatch.delenv(local_socket.ENVIRONMENT, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run_directory() == tmp_path / ".local/state/lifeline/run"


def test_the_port_decides_which_socket_and_endpoints_with_certificates_have_none() -> None:
    here = socket_of("tcp/127.0.0.1:7447")
    assert here is not None
    assert here.name.endswith("-7447.sock")
    assert here == socket_of("tcp/0.0.0.0:7447") == socket_of("tcp/[::1]:7447")
    assert here != socket_of("tcp/127.0.0.1:7448")
    assert socket_of("quic/127.0.0.1:7447") is None


def test_the_directory_is_made_for_its_user_only(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "7447.sock"
    for _ in range(2):
        prepare(path)
        assert path.parent.stat().st_mode & 0o777 == 0o700
    assert list(path.parent.iterdir()) == []


def test_foreign_programs_name_the_socket_of_their_network_namespace(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(local_socket.ENVIRONMENT, str(tmp_path))
    network = Path("/proc/self/ns/net").stat().st_ino
    assert participants("tcp/127.0.0.1:7447") == f"unixsock-stream/{tmp_path}/{network}-7447.sock"
    assert participants("tls/127.0.0.1:7447") is None


def test_a_start_removes_what_ended_hubs_left_and_nothing_else(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    gone = ("1-7448.sock", "1-7448.sock.lock", "2-7447.sock.lock", "7449.sock.lock")
    stays = ("1-7447.sock", "1-7447.sock.lock", "3-7447.sock", "3-7447.sock.lock", "mine.sock.lock", "notes")
    for name in (*gone, *stays):
        (tmp_path / name).touch()
    (tmp_path / "mine").symlink_to("3-7447.sock")
    with (tmp_path / "3-7447.sock.lock").open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        prepare(tmp_path / "1-7447.sock")
    assert {path.name for path in tmp_path.iterdir()} == {*stays, "mine"}


def test_a_lock_that_is_a_pipe_keeps_no_hub_from_starting(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    os.mkfifo(tmp_path / "1-7448.sock.lock")
    (tmp_path / "1-7449.sock.lock").mkdir()
    prepare(tmp_path / "1-7447.sock")
    assert [path.name for path in tmp_path.iterdir()] == ["1-7449.sock.lock"]


def test_a_directory_that_others_may_enter_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o711)
    with pytest.raises(
        SocketError,
        match=rf"mode 0711, so that other users can read it: run `chmod 700 .*{local_socket.ENVIRONMENT}",
    ):
        prepare(tmp_path / "7447.sock")


def test_a_directory_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SocketError, match=rf"cannot make .*{local_socket.ENVIRONMENT}"):
        prepare(tmp_path / "file" / "7447.sock")


def test_a_path_that_the_kernel_does_not_accept_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SocketError, match="longer than 107 bytes"):
        prepare(tmp_path / ("x" * 107) / "7447.sock")


@pytest.mark.parametrize("name", ["run#x", "run?x", "run\udcff"])
def test_a_path_that_zenoh_would_cut_is_refused_since_others_may_enter_what_is_left(
    name: str, tmp_path: Path
) -> None:
    with pytest.raises(SocketError, match=rf"has \? or #, or is not UTF-8: .*{local_socket.ENVIRONMENT}"):
        prepare(tmp_path / name / "7447.sock")


def test_a_socket_answers_while_a_program_listens(tmp_path: Path) -> None:
    path = tmp_path / "s"
    assert not answers(path)
    with socket.socket(socket.AF_UNIX) as hub:
        hub.bind(str(path))
        hub.listen()
        assert answers(path)
    assert path.exists()
    assert not answers(path)


@pytest.mark.parametrize("pid", [1, 4_194_304])
def test_the_id_of_a_session_ends_with_its_pid_and_has_no_leading_zero(pid: int) -> None:
    ids = {session_id(pid) for _ in range(20)}
    assert len(ids) == 20
    assert {len(one) for one in ids} == {32}
    assert {pid_in(one) for one in ids} == {pid}
    assert not any(one.startswith("0") for one in ids)
